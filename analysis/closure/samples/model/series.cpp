#include "analysis/closure/samples/model/series.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/model/gaps.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::closure {

namespace {

/// Whether two of the values that are not missing differ.
bool changes(const std::vector<double>& values) {
    const auto first = std::find_if(values.begin(), values.end(), [](double v) { return !std::isnan(v); });
    return std::any_of(first, values.end(), [&](double v) { return !std::isnan(v) && v != *first; });
}

/// Greatest common divisor of two numbers that are known to `tolerance`.
double common_divisor(double a, double b, double tolerance) {
    while (b > tolerance) {
        const double rest = std::abs(a - std::round(a / b) * b);
        a = b;
        b = rest;
    }
    return a;
}

/// The known input in the middle of each interval. A sample belongs to the end of its interval by convention; where the
/// start or the middle leaves a residual that is smaller by far (options.samples.record.other_clock), the time stamps
/// are interpreted in that way.
void take_input(const record::Record& record, SampleSeries& series) {
    const std::size_t n = series.size();
    double least = 0.0;
    for (const double late : {-0.5, 0.0, 0.5}) {
        std::vector<double> input;
        for (const double t : series.time_s) input.push_back(record.input_rate_deg_h.at(t + late * series.interval_s));
        double sum = 0.0;
        double squares = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
            const double left = series.increment[i] - input[i] * series.interval_s;
            sum += left;
            squares += left * left;
        }
        squares -= sum * sum / static_cast<double>(n);
        const bool first = series.input_rate_deg_h.empty();
        if (!first && !(squares < least * (1.0 - options.samples.record.other_clock / static_cast<double>(n))))
            continue;
        least = squares;
        series.input_rate_deg_h = std::move(input);
        series.input_late_s = (late + 0.5) * series.interval_s;
    }
}

struct Smoothed {
    std::vector<double> values;
    double start_sd = 0.0;
};

/// Removes the noise of a thermometer, which is faster than any temperature, by straight lines through a 500th of the
/// record about each row; near the ends, by the first and the last of these lines.
Smoothed smooth(const std::vector<double>& values) {
    const std::size_t n = values.size();
    const std::size_t half = std::min(std::max<std::size_t>(1, n / options.samples.record.smoothed_parts), (n - 1) / 2);
    std::vector<double> sums(n + 1, 0.0);
    for (std::size_t i = 0; i < n; ++i) sums[i + 1] = sums[i] + values[i];
    const auto mean_about = [&](std::size_t middle) {
        return (sums[middle + half + 1] - sums[middle - half]) / static_cast<double>(2 * half + 1);
    };
    const auto slope_about = [&](std::size_t middle) {
        double by = 0.0;
        double squares = 0.0;
        for (std::size_t k = 1; k <= half; ++k) {
            by += static_cast<double>(k) * (values[middle + k] - values[middle - k]);
            squares += 2.0 * static_cast<double>(k * k);
        }
        return by / squares;
    };
    const std::size_t last = n - 1 - half;
    const double first_slope = slope_about(half);
    const double last_slope = slope_about(last);
    Smoothed smoothed;
    for (std::size_t i = 0; i < n; ++i) {
        const std::size_t middle = std::clamp(i, half, last);
        const double off = static_cast<double>(i) - static_cast<double>(middle);
        smoothed.values.push_back(mean_about(middle) + off * (i < middle ? first_slope : last_slope));
    }
    double squares = 0.0;
    for (std::size_t i = 0; i <= 2 * half; ++i) {
        const double off = static_cast<double>(i) - static_cast<double>(half);
        squares += std::pow(values[i] - mean_about(half) - off * first_slope, 2);
    }
    // At its end, a line through m values has the standard error 2/sqrt(m) of one value, for large m.
    smoothed.start_sd =
        2.0 * std::sqrt(squares / static_cast<double>(2 * half - 1) / static_cast<double>(2 * half + 1));
    return smoothed;
}

/// Slopes of a smoothed series [1/row], over some rows on either side.
std::vector<double> slopes(const std::vector<double>& values) {
    const std::size_t last = values.size() - 1;
    const std::size_t apart = std::max<std::size_t>(1, values.size() / options.samples.record.slope_parts);
    std::vector<double> all(values.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
        const std::size_t before = i > apart ? i - apart : 0;
        const std::size_t behind = std::min(last, i + apart);
        all[i] = (values[behind] - values[before]) / static_cast<double>(behind - before);
    }
    return all;
}

/// Increments of the samples; NaN where one of the samples of an increment is missing.
void take_increments(const record::Record& record, SampleSeries& series) {
    const record::Samples& samples = *record.samples;
    if (samples.kind == record::SampleKind::angle_increment_arcsec) {
        series.increment = samples.values;
        return;
    }
    series.counted = samples.kind == record::SampleKind::quarter_count;
    const scenario::Scenario standard;
    series.scale_factor_assumed = series.counted && !record.declared.scale_factor_arcsec;
    series.scale_factor_arcsec = record.declared.scale_factor_arcsec.value_or(standard.gyro.scale_factor_arcsec);
    for (std::size_t k = 1; k < samples.size(); ++k) {
        series.increment.push_back(series.counted ? 0.25 * series.scale_factor_arcsec *
                                                        static_cast<double>(samples.counts[k] - samples.counts[k - 1])
                                                  : samples.values[k] - samples.values[k - 1]);
    }
}

/// Fills the gaps and marks their rows. Angles keep the rotation during a gap; increments lose it.
void take_gaps(const record::Samples& samples, SampleSeries& series) {
    Rows missing(series.size(), 0);
    std::size_t count = 0;
    for (std::size_t i = 0; i < missing.size(); ++i) {
        missing[i] = std::isnan(series.increment[i]) ? 1 : 0;
        count += missing[i];
    }
    for (auto& [name, values] : series.witnesses) {
        for (std::size_t i = 0; i < missing.size(); ++i) {
            if (std::isnan(values[i])) missing[i] = 1;
        }
        bridge_gaps(values);
    }
    bridge_gaps(series.temperature_change_k);
    if (static_cast<double>(count) > options.samples.record.most_missing * static_cast<double>(missing.size())) {
        throw InputError(
            fmt::format("/samples: {} of {} increments are missing; the closed loop needs half of them. Cut the record "
                        "to a part with fewer gaps",
                        count, missing.size()));
    }
    if (count > 0 && samples.kind == record::SampleKind::angle_arcsec) {
        std::vector<double> angle = samples.values;
        bridge_gaps(angle);
        for (std::size_t i = 0; i < series.size(); ++i) series.increment[i] = angle[i + 1] - angle[i];
    } else if (count > 0) {
        fill_gaps(series.increment);
    }
    if (std::find(missing.begin(), missing.end(), 1) != missing.end()) series.missing = std::move(missing);
}

}  // namespace

SampleSeries prepare_samples(const record::Record& record) {
    if (!record.samples) throw InputError("the record has neither /turns nor /samples");
    const record::Samples& samples = *record.samples;
    SampleSeries series;
    series.rate_hz = samples.rate_hz;
    series.interval_s = 1.0 / samples.rate_hz;
    take_increments(record, series);
    const std::size_t first = samples.size() - series.increment.size();
    const std::size_t n = series.increment.size();
    if (samples.size() < record::fewest_samples_to_close) {
        throw InputError(fmt::format("/samples: {} of them are too few for the closed loop; at least {} are needed",
                                     samples.size(), record::fewest_samples_to_close));
    }
    for (std::size_t i = 0; i < n; ++i) {
        series.time_s.push_back(samples.t0_s + static_cast<double>(i + first) * series.interval_s);
    }
    for (const auto& [name, values] : samples.witnesses) {
        if (!changes(values)) continue;
        std::vector<double> cut(values.begin() + static_cast<std::ptrdiff_t>(first), values.end());
        if (name == "temperature_c") {
            series.temperature_change_k = std::move(cut);
        } else {
            series.witnesses.emplace_back(name, std::move(cut));
        }
    }
    take_gaps(samples, series);
    if (!changes(series.increment)) throw InputError("/samples: they never change; there is nothing to fit");
    if (series.temperature_change_k.empty() && !record.temperature_c.empty() && changes(record.temperature_c.value)) {
        for (const double t : series.time_s) series.temperature_change_k.push_back(record.temperature_c.at(t));
    }
    if (!series.temperature_change_k.empty()) {
        const Smoothed smoothed = smooth(series.temperature_change_k);
        series.temperature_start_sd_k = smoothed.start_sd;
        series.temperature_change_k = smoothed.values;
        for (double& value : series.temperature_change_k) value -= smoothed.values.front();
        series.temperature_slope_k_per_s = slopes(series.temperature_change_k);
        for (double& value : series.temperature_slope_k_per_s) value *= series.rate_hz;
    }
    if (!record.input_rate_deg_h.empty()) take_input(record, series);
    return series;
}

Lattice find_lattice(const std::vector<double>& increments, double sd_arcsec) {
    Lattice lattice;
    std::vector<double> sorted = increments;
    std::sort(sorted.begin(), sorted.end());
    const std::size_t n = sorted.size();
    const double range = sorted.back() - sorted.front();
    double total = 0.0;
    for (const double x : increments) total += std::abs(x);
    const double tolerance = 1e-9 * range + 1e-13 * total;
    std::vector<double> levels{sorted.front()};
    for (const double x : sorted) {
        if (x - levels.back() > tolerance) levels.push_back(x);
    }
    // Without quantisation no two values with so many digits are equal.
    if (levels.size() > n / options.samples.record.values_per_level || levels.size() < 2) return lattice;
    double step = std::max(std::abs(levels.front()), range);
    for (const double x : levels) {
        if (std::abs(x) > tolerance)
            step = common_divisor(std::max(step, std::abs(x)), std::min(step, std::abs(x)),
                                  20.0 * tolerance + 1e-6 * range);
    }
    // Least-squares step over the levels, each of which is a whole multiple of it.
    double xy = 0.0;
    double yy = 0.0;
    for (const double x : levels) {
        const double m = std::round(x / step);
        xy += x * m;
        yy += m * m;
    }
    step = xy / yy;
    for (const double x : levels) {
        if (std::abs(x / step - std::round(x / step)) > options.samples.record.off_lattice) return lattice;
    }
    lattice.printed_arcsec = lattice.step_arcsec = step;
    lattice.strength = 1.0;
    lattice.p_value = 0.0;
    lattice.step_sd_arcsec = 1e-9 * step;  // by the digits of the values
    // A larger step that the digits of the record blur: its characteristic function has a maximum between that of the
    // distribution, near zero, and that of the digits, at 1/printed.
    std::vector<std::pair<double, double>> weights;  // level and number of values; without level zero
    double count = 0.0;
    double second = 0.0;
    const auto most = static_cast<std::int64_t>(std::llround(std::max(-sorted.front(), sorted.back()) / step));
    if (most > options.samples.record.most_levels) return lattice;
    std::vector<double> often(static_cast<std::size_t>(2 * most + 1), 0.0);
    for (const double x : sorted) often[static_cast<std::size_t>(std::llround(x / step) + most)] += 1.0;
    for (std::int64_t m = -most; m <= most; ++m) {
        const double w = often[static_cast<std::size_t>(m + most)];
        if (m == 0 || w == 0.0) continue;
        weights.emplace_back(static_cast<double>(m) * step, w);
        count += w;
    }
    const double quartile = 0.5 * (sorted[n * 7 / 8] - sorted[n / 8]);  // 1.15 sigma
    for (const auto& [x, w] : weights) second += std::min(x * x, 9.0 * quartile * quartile + 1e-300) * w / count;
    const double sigma = std::min(std::sqrt(second), sd_arcsec);
    const auto characteristic = [&](double u) {
        std::complex<double> sum = 0.0;
        for (const auto& [x, w] : weights) sum += w * std::polar(1.0, units::two_pi * u * x);
        return std::abs(sum) / count;
    };
    const double lowest = 1.5 / sigma;
    const double highest = 0.5 / step;
    if (!(lowest < highest)) return lattice;
    const double du = 0.02 / sigma;
    const auto positions = static_cast<std::size_t>((highest - lowest) / du) + 1;
    double best = 0.0;
    double at = 0.0;
    for (std::size_t k = 0; k < positions; ++k) {
        const double u = lowest + static_cast<double>(k) * du;
        const double c = characteristic(u);
        if (c > best) {
            best = c;
            at = u;
        }
    }
    for (double d = du; d > 1e-7 * at; d *= 0.5) {
        for (const double u : {at - d, at + d}) {
            const double c = characteristic(u);
            if (c > best) {
                best = c;
                at = u;
            }
        }
    }
    const double p = of_several(std::exp(-count * best * best), static_cast<double>(positions));
    const auto& record = options.samples.record;
    if (best > record.coarser_lattice_strength && p < record.coarser_lattice_p && at < highest) {
        lattice.step_arcsec = 1.0 / at;
        lattice.strength = best;
        lattice.p_value = p;
        // Standard error of a frequency u = 1/step from phases 2 pi u x with noise. If exp(i noise) has the mean c,
        // cos(2 noise) has the mean c^4 for normal noise, and u the variance (1 - c^4)/(2 c^2 N (2 pi sigma)^2).
        const double c2 = best * best;
        const double u_sd = std::sqrt((1.0 - c2 * c2) / (2.0 * c2 * count)) / (units::two_pi * sigma);
        lattice.step_sd_arcsec = u_sd / (at * at);
    }
    return lattice;
}

}  // namespace ringlock::closure
