#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/declared/turn_pattern.hpp"
#include "analysis/closure/samples/fit/line_search.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/fit/swing.hpp"
#include "analysis/closure/samples/residual/templates.hpp"
#include "analysis/closure/samples/residual/tests.hpp"
#include "analysis/closure/stats/normality.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/stats/whiteness.hpp"

namespace ringlock::closure {

namespace {

void test_size(const SampleFit& fit, SampleResidualTests& tests) {
    const auto& e = fit.innovations();
    const Rows& rows = fit.informative();
    const std::size_t n = e.size();
    const auto [mean, variance] = squares_of(e, rows);
    tests.push_back({size_over_time(e, rows, 40, 20.0)});
    // Patterns of the place in the record: mean and mean square for each remainder.
    double least = 1.0;
    std::size_t at = 0;
    const std::size_t most_modulo = options.samples.residual.most_modulo;
    for (std::size_t m = 2; m <= most_modulo; ++m) {
        double means = 0.0;
        double sizes = 0.0;
        std::vector<double> sum(m, 0.0);
        std::vector<double> squares(m, 0.0);
        std::vector<double> k(m, 0.0);
        for (std::size_t i = 0; i < n; ++i) {
            if (!rows[i]) continue;
            sum[i % m] += e[i];
            squares[i % m] += e[i] * e[i] - mean;
            k[i % m] += 1.0;
        }
        for (std::size_t j = 0; j < m; ++j) {
            if (k[j] < options.samples.residual.fewest_in_pattern) continue;
            means += sum[j] * sum[j] / (k[j] * mean);
            sizes += squares[j] * squares[j] / (k[j] * variance);
        }
        const double p = std::min(chi2_tail(means, static_cast<int>(m)), chi2_tail(sizes, static_cast<int>(m) - 1));
        if (p < least) {
            least = p;
            at = m;
        }
    }
    tests.push_back({{Where::time, fmt::format("place in the record modulo 2 to {}", most_modulo),
                      of_several(least, 2.0 * static_cast<double>(most_modulo - 1)), fmt::format("modulo {}", at)}});
    const FoundCycle cycle = find_cycle(e, rows, fit.series().rate_hz);
    const double cost = 2.0 + std::log(cycle.look_elsewhere);
    const Swing swing = swing_of_variance(fit, cycle.frequency_hz);
    SampleResidualTest test{{Where::time, std::string(repeating_variance), cycle.p_value,
                             fmt::format("{:.6g} times a second", cycle.frequency_hz), swing.gain - cost}};
    test.refitted = [&fit, hz = cycle.frequency_hz, swing, cost](double) {
        return with_swinging_errors(fit, hz, swing).gain_over(fit) - cost;
    };
    tests.push_back(std::move(test));
}

void test_distribution(const SampleFit& fit, double lattice_arcsec, SampleResidualTests& tests) {
    const auto& e = fit.innovations();
    // Large steps are not normal noise; sums of them are nearly normal.
    const bool steps = lattice_arcsec > options.samples.residual.coarse_lattice * fit.typical_sd();
    // Between two readings of a whole cycle there are two kicks, whose distribution is flatter than a normal one; sums
    // of many are nearly normal.
    const std::size_t bounded = fit.series().whole_cycles ? 16 : 1;
    if (const auto test = fourth_moments(e, fit.informative(), steps ? 16 : 1, bounded,
                                         [&](std::size_t length) { return expected_excess(fit, length); })) {
        tests.push_back({*test});
    }
    if (lattice_arcsec == 0.0 && !fit.series().cycle_counts) {
        // Values with so many digits are not equal by chance, least of all the largest.
        const auto& x = fit.series().increment;
        const double high = *std::max_element(x.begin(), x.end());
        const double low = *std::min_element(x.begin(), x.end());
        const double tolerance = 1e-9 * (high - low);
        // Values on one straight line between two readings of a source are equal.
        const bool on_lines = fit.model().noise.from_hz > 0.0;
        int ties = 0;
        for (std::size_t i = 0; i < x.size(); ++i) {
            if (on_lines && i > 0 && std::abs(x[i] - x[i - 1]) <= tolerance) continue;
            ties += x[i] > high - tolerance || x[i] < low + tolerance ? 1 : 0;
        }
        if (ties > options.samples.residual.most_ties) {
            tests.push_back(
                {{Where::amplitude, "values at the end of their range", 0.0, fmt::format("{} of them", ties)}});
        }
    }
}

}  // namespace

void test_sizes(const SampleFit& fit, double lattice_arcsec, SampleResidualTests& tests) {
    test_size(fit, tests);
    test_distribution(fit, lattice_arcsec, tests);
}

Disturbed find_disturbed(const SampleFit& fit, const Rows& rows) {
    const auto& e = fit.innovations();
    const std::size_t n = e.size();
    // Length by the informative rows, which are few in a record with many samples to every reading of its source.
    std::size_t informative = 0;
    for (std::size_t i = 0; i < n; ++i) informative += rows[i] && !fit.deterministic(i) ? 1 : 0;
    const SampleResidualOptions& by = options.samples.residual;
    const std::size_t length =
        std::min(n, std::max(by.disturbed_rows * n / std::max<std::size_t>(informative, 1), n / by.disturbed_parts));
    const std::size_t windows = n / length;
    std::vector<double> power(windows, 0.0);
    std::vector<double> freedom(windows, 0.0);
    for (std::size_t w = 0; w < windows; ++w) {
        // Variance about the mean of the window: a different rate in a window is no disturbance.
        double sum = 0.0;
        double squares = 0.0;
        double count = 0.0;
        for (std::size_t i = w * length; i < (w + 1) * length; ++i) {
            if (!rows[i] || fit.deterministic(i)) continue;
            sum += e[i];
            squares += e[i] * e[i];
            count += 1.0;
        }
        if (count < 2.0) continue;
        freedom[w] = count - 1.0;
        power[w] = (squares - sum * sum / count) / freedom[w];
    }
    // Usual variance of the windows with rows that count.
    std::vector<double> sorted;
    for (std::size_t w = 0; w < windows; ++w) {
        if (freedom[w] > 0.0) sorted.push_back(power[w]);
    }
    if (sorted.empty()) sorted.push_back(0.0);
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(sorted.size() / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    const double usual = std::max(*middle, 1e-300);
    Disturbed disturbed;
    disturbed.rows.assign(n, 0);
    disturbed.length_s = static_cast<double>(length) * fit.series().interval_s;
    double count = 0.0;
    for (std::size_t w = 0; w < windows; ++w) {
        if (freedom[w] == 0.0) continue;
        const double ratio = power[w] / usual;
        const double p =
            of_several(chi2_tail(ratio * freedom[w], static_cast<int>(freedom[w])), static_cast<double>(windows));
        if (ratio > disturbed.worst) {
            disturbed.worst = ratio;
            disturbed.at_s = fit.series().time_s[w * length];
            disturbed.p_value = p;
        }
        if (ratio < by.disturbed_variance || p > by.disturbed_p) continue;
        // A disturbance may begin and end in the adjacent windows.
        const std::size_t a = w > 0 ? (w - 1) * length : 0;
        const std::size_t b = w + 2 < windows ? (w + 2) * length : n;
        for (std::size_t i = a; i < b; ++i) disturbed.rows[i] = 1;
    }
    for (const auto row : disturbed.rows) count += row;
    disturbed.share = count / static_cast<double>(n);
    return disturbed;
}

}  // namespace ringlock::closure
