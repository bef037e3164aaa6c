#include "analysis/closure/samples/model/gaps.hpp"

#include <algorithm>
#include <cmath>
#include <functional>

#include "analysis/closure/options.hpp"

namespace ringlock::closure {
namespace {

/// Calls `fill` with the first row of each gap and the row behind its last one.
std::size_t for_each_gap(const std::vector<double>& values, const std::function<void(std::size_t, std::size_t)>& fill) {
    std::size_t missing = 0;
    for (std::size_t from = 0; from < values.size(); ++from) {
        if (!std::isnan(values[from])) continue;
        std::size_t to = from;
        while (to < values.size() && std::isnan(values[to])) ++to;
        missing += to - from;
        fill(from, to);
        from = to;
    }
    return missing;
}

Rows with_rows_behind(const Rows& missing, std::size_t behind) {
    Rows out = missing;
    std::size_t left = 0;
    for (std::size_t i = 0; i < missing.size(); ++i) {
        if (missing[i])
            left = behind;
        else if (left > 0) {
            out[i] = 1;
            --left;
        }
    }
    return out;
}

}  // namespace

std::size_t bridge_gaps(std::vector<double>& values) {
    if (std::all_of(values.begin(), values.end(), [](double v) { return std::isnan(v); })) return values.size();
    const std::vector<double> given = values;
    return for_each_gap(given, [&](std::size_t from, std::size_t to) {
        const double before = from > 0 ? given[from - 1] : given[to];
        const double after = to < given.size() ? given[to] : before;
        const auto steps = static_cast<double>(to - from + 1);
        for (std::size_t i = from; i < to; ++i) {
            values[i] = before + (after - before) * static_cast<double>(i - from + 1) / steps;
        }
    });
}

std::size_t fill_gaps(std::vector<double>& increments) {
    const std::vector<double> given = increments;
    const std::size_t reach = options.samples.record.rows_around_gap;
    return for_each_gap(given, [&](std::size_t from, std::size_t to) {
        double sum = 0.0;
        double count = 0.0;
        const auto add = [&](std::size_t i) {
            if (std::isnan(given[i])) return;
            sum += given[i];
            count += 1.0;
        };
        for (std::size_t i = from - std::min(from, reach); i < from; ++i) add(i);
        for (std::size_t i = to; i < std::min(given.size(), to + reach); ++i) add(i);
        const double mean = count > 0.0 ? sum / count : 0.0;
        std::fill(increments.begin() + static_cast<std::ptrdiff_t>(from),
                  increments.begin() + static_cast<std::ptrdiff_t>(to), mean);
    });
}

Rows rows_about_gaps(const Rows& missing) {
    std::size_t behind = options.samples.record.rows_behind_gap;
    for (;; behind /= 2) {
        Rows rows = with_rows_behind(missing, behind);
        const auto count = static_cast<std::size_t>(std::count(rows.begin(), rows.end(), 1));
        if (2 * count <= rows.size() || behind == 0) return rows;
    }
}

}  // namespace ringlock::closure
