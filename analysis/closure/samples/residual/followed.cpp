#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <numeric>
#include <string>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/residual/templates.hpp"
#include "analysis/closure/samples/residual/tests.hpp"
#include "analysis/closure/stats/p_values.hpp"

namespace ringlock::closure {

namespace {

/// Values behind a lag of first order: y' = (x - y)/lag. Before the start, values are taken as the mean over the first
/// lag, since a single one may be mostly noise.
std::vector<double> lagged(std::vector<double> values, double interval_s, double lag_s) {
    if (!(lag_s > 0.0)) return values;
    const double kept = std::exp(-interval_s / lag_s);
    const auto first = std::clamp<std::size_t>(static_cast<std::size_t>(lag_s / interval_s), 1, values.size());
    double y = std::accumulate(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(first), 0.0) /
               static_cast<double>(first);
    for (double& x : values) x = y = kept * y + (1.0 - kept) * x;
    return values;
}

/// Cubics through the values within `half` of each, fewer at the ends (Savitzky and Golay, Anal. Chem. 36, 1964, 1627);
/// the slope is that of a straight line.
struct LocalCubic {
    std::vector<double> value, slope;
};

LocalCubic local_cubic(const std::vector<double>& x, std::size_t half) {
    LocalCubic out{x, std::vector<double>(x.size(), 0.0)};
    for (std::size_t i = 1; i + 1 < x.size(); ++i) {
        const std::size_t reach = std::min({half, i, x.size() - 1 - i});
        const auto m = static_cast<double>(reach);
        const double most = 3.0 * (3.0 * m * m + 3.0 * m - 1.0);
        double value = most * x[i];
        double slope = 0.0;
        for (std::size_t j = 1; j <= reach; ++j) {
            const auto k = static_cast<double>(j);
            value += (most - 15.0 * k * k) * (x[i + j] + x[i - j]);
            slope += k * (x[i + j] - x[i - j]);
        }
        out.value[i] = value / ((2.0 * m - 1.0) * (2.0 * m + 1.0) * (2.0 * m + 3.0));
        out.slope[i] = 3.0 * slope / (m * (m + 1.0) * (2.0 * m + 1.0));
    }
    out.slope.front() = out.slope[1];
    out.slope.back() = out.slope[x.size() - 2];
    return out;
}

double duration_s(const SampleSeries& series) { return static_cast<double>(series.size()) * series.interval_s; }

void test_columns(const SampleFit& fit, Where where, const char* subject, Columns columns, SampleResidualTests& tests) {
    const auto score = fit.score(taken_by(fit, columns));
    if (score.rank == 0) return;
    const double cost = score.rank;
    tests.push_back({{where, subject, chi2_tail(score.chi2, score.rank), "", 0.5 * score.chi2 - cost},
                     cost,
                     [columns = std::make_shared<const Columns>(std::move(columns))] { return *columns; }});
}

void test_temperature(const SampleFit& fit, SampleResidualTests& tests) {
    const SampleSeries& series = fit.series();
    const auto& t = series.temperature_change_k;
    if (t.empty()) return;
    const std::size_t n = series.size();
    std::vector<double> square(n);
    for (std::size_t i = 0; i < n; ++i) square[i] = t[i] * t[i];
    test_columns(fit, Where::temperature, "rates that follow temperature, its square and its slope",
                 {t, square, series.temperature_slope_k_per_s}, tests);
    // A mass between thermometer and gyro, which may be warmer or colder at the start. Short lags equal the slope.
    const auto lag_s = [&series](std::size_t place) {
        return 0.5 * duration_s(series) * std::pow(1.6, -static_cast<double>(place));
    };
    const auto columns = [&series, lag_s](std::size_t place) -> Columns {
        const auto& now = series.temperature_change_k;
        std::vector<double> start(now.size());
        for (std::size_t i = 0; i < start.size(); ++i) {
            start[i] = std::exp(-static_cast<double>(i) * series.interval_s / lag_s(place));
        }
        return {now, lagged(now, series.interval_s, lag_s(place)), std::move(start)};
    };
    const auto said = [lag_s](std::size_t place) { return fmt::format("by {:.2g} s", lag_s(place)); };
    test_templates(fit, Where::temperature, "rates that follow the temperature late",
                   {options.samples.residual.temperature_lags, columns, said, 1}, tests);
}

void test_input(const SampleFit& fit, SampleResidualTests& tests) {
    const SampleSeries& series = fit.series();
    const auto& x = series.input_rate_deg_h;
    if (x.empty()) return;
    const auto [low, high] = std::minmax_element(x.begin(), x.end());
    if (!(*high > *low)) return;
    const std::size_t n = series.size();
    const double most = std::max(std::abs(*high), std::abs(*low));
    std::vector<double> one(n), square(n), cube(n);
    for (std::size_t i = 0; i < n; ++i) {
        one[i] = x[i] / most;
        square[i] = one[i] * one[i];
        cube[i] = one[i] * square[i];
    }
    test_columns(fit, Where::rate, "rates that follow the input rate, its square and its cube", {one, square, cube},
                 tests);
    // The instrument that measures the input may be early or late by a little, and has noise of its own, which is
    // faster than the input.
    const auto half = [n](std::size_t place) {
        return std::max<std::size_t>(
            2, static_cast<std::size_t>(0.02 * static_cast<double>(n) * std::pow(3.0, -static_cast<double>(place))));
    };
    const auto columns = [one, half](std::size_t place) -> Columns {
        LocalCubic cubic = local_cubic(one, half(place));
        for (std::size_t i = 0; i < one.size(); ++i) cubic.value[i] = one[i] - cubic.value[i];
        return {one, std::move(cubic.value), std::move(cubic.slope)};
    };
    const auto said = [&series, half](std::size_t place) {
        return fmt::format("within {:.2g} s", static_cast<double>(half(place)) * series.interval_s);
    };
    test_templates(fit, Where::rate, "rates that follow the input rate's slope and its noise",
                   {options.samples.residual.input_reaches, columns, said}, tests);
}

/// A bias that is proportional to the acceleration. A lag smooths the witness as well, whose noise is fast.
void test_accelerations(const SampleFit& fit, SampleResidualTests& tests) {
    const SampleSeries& series = fit.series();
    if (series.witnesses.empty()) return;
    const auto lag_s = [&series](std::size_t place) {
        return place == 0 ? 0.0 : duration_s(series) / 30.0 * std::pow(3.0, 1.0 - static_cast<double>(place));
    };
    const auto columns = [&series, lag_s](std::size_t place) {
        Columns late;
        for (const auto& [name, values] : series.witnesses) {
            late.push_back(lagged(values, series.interval_s, lag_s(place)));
            const double start = late.back().front();
            for (double& value : late.back()) value -= start;
        }
        return late;
    };
    const auto said = [lag_s](std::size_t place) {
        return place == 0 ? std::string() : fmt::format("{:.2g} s late", lag_s(place));
    };
    test_templates(fit, Where::frequency, std::string(followed_witnesses),
                   {options.samples.residual.acceleration_lags, columns, said}, tests);
}

}  // namespace

void test_followed(const SampleFit& fit, SampleResidualTests& tests) {
    test_temperature(fit, tests);
    test_input(fit, tests);
    test_accelerations(fit, tests);
}

}  // namespace ringlock::closure
