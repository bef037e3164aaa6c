#include "analysis/record/mapped_columns.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

#include "analysis/record/readers.hpp"
#include "analysis/record/series/series.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {

namespace {

constexpr const char* rate_name = "rate";

std::optional<SampleKind> kind_of(const std::string& quantity) {
    if (quantity == rate_name) return SampleKind::angle_increment_arcsec;
    for (const SampleKind kind : sample_kinds) {
        if (quantity == name_of(kind)) return kind;
    }
    return std::nullopt;
}

void check_quantities(const MappedLog& log) {
    std::set<std::string> seen;
    std::vector<std::string> samples;
    const std::vector<std::string> known = quantities_to_map();
    for (const MappedColumn& mapped : log.columns) {
        if (std::find(known.begin(), known.end(), mapped.quantity) == known.end()) {
            throw InputError(fmt::format("--column {}={}: a column can become {}", text::shown(mapped.column),
                                         text::shown(mapped.quantity), listed(known)));
        }
        if (!seen.insert(mapped.quantity).second) {
            throw InputError(fmt::format("--column {}={}: another column becomes {} as well; leave one out",
                                         text::shown(mapped.column), mapped.quantity, mapped.quantity));
        }
        if (kind_of(mapped.quantity)) samples.push_back(mapped.quantity);
    }
    if (samples.size() == 1) return;
    throw InputError(fmt::format(
        "--column: {}; a record has one column of samples: angle_increment_arcsec, angle_arcsec, quarter_count or rate",
        samples.empty() ? "no column becomes samples of the gyro" : listed(samples) + " are all samples of the gyro"));
}

/// `again`: the file has been read before, and its notes given.
Series read_column(const MappedLog& log, const MappedColumn& mapped, bool again) {
    SeriesRequest request{.path = log.path, .column = mapped.column, .time = log.time, .rate_hz = log.rate_hz};
    request.time_unit = log.time_unit;
    request.follow_links = log.follow_links;
    request.text = log.text;
    request.text.quiet = again;
    Series series = read_series(request);
    if (series.rate_hz && std::abs(*series.rate_hz - log.rate_hz) > 1e-9 * log.rate_hz) {
        throw InputError(fmt::format("{}: says rate_hz = {}, which contradicts --rate {}", printable(log.path),
                                     *series.rate_hz, log.rate_hz));
    }
    if (series.missing == 0 || mapped.quantity != name_of(SampleKind::quarter_count)) return series;
    const auto at = std::find_if(series.values.begin(), series.values.end(), [](double v) { return std::isnan(v); });
    throw InputError(fmt::format(
        "{}: column {}: {} of {} values are missing, the first is sample {}; counts are whole numbers, "
        "which cannot mark a missing sample. Cut the record there, or import the angle as angle_arcsec",
        printable(log.path), printable(series.column), series.missing, series.n, at - series.values.begin() + 1));
}

std::int64_t whole(const MappedLog& log, const MappedColumn& mapped, double value) {
    constexpr double largest = 9007199254740992.0;  // 2^53: whole numbers of a double
    if (value != std::nearbyint(value) || std::abs(value) > largest) {
        throw InputError(fmt::format("{}: column {}: holds {}; a count must be a whole number", printable(log.path),
                                     text::shown(mapped.column), value));
    }
    return static_cast<std::int64_t>(value);
}

}  // namespace

std::vector<std::string> quantities_to_map() {
    std::vector<std::string> names;
    for (const SampleKind kind : sample_kinds) names.emplace_back(name_of(kind));
    names.emplace_back(rate_name);
    names.insert(names.end(), witness_names.begin(), witness_names.end());
    return names;
}

bool is_rate(const std::string& quantity) { return quantity == rate_name; }

bool has_unit(const std::string& quantity) {
    const auto kind = kind_of(quantity);
    return kind && *kind != SampleKind::quarter_count;
}

Record read_mapped(const MappedLog& log) {
    check_quantities(log);
    Record record;
    Samples& samples = record.samples.emplace();
    samples.rate_hz = log.rate_hz;
    std::optional<std::size_t> rows;
    for (const MappedColumn& mapped : log.columns) {
        Series series = read_column(log, mapped, rows.has_value());
        if (rows && *rows != series.n) {
            throw InputError(fmt::format("{}: column {} has {} values, another has {}; columns of a record are as long",
                                         printable(log.path), printable(series.column), series.n, *rows));
        }
        rows = series.n;
        const auto kind = kind_of(mapped.quantity);
        if (!kind) {
            samples.witnesses[mapped.quantity] = std::move(series.values);
            continue;
        }
        samples.kind = *kind;
        if (*kind == SampleKind::quarter_count) {
            samples.counts = std::move(series.counts);
            if (!samples.counts.empty()) continue;
            for (const double value : series.values) samples.counts.push_back(whole(log, mapped, value));
            continue;
        }
        const double unit = log.to_arcsec / (is_rate(mapped.quantity) ? log.rate_hz : 1.0);
        for (double& value : series.values) value *= unit;
        samples.values = std::move(series.values);
    }
    return record;
}

void declare(Record& record, const std::string& name, double value) {
    std::vector<std::string> names;
    for (const DeclaredName& declared : declared_names) {
        names.emplace_back(declared.name);
        if (name != declared.name) continue;
        record.declared.*declared.field = value;
        return;
    }
    throw InputError(fmt::format("--declare {}: a record can declare {}", text::shown(name), listed(names)));
}

}  // namespace ringlock::record
