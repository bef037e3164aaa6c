#include "analysis/closure/sample_tests.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "analysis/closure/chance.hpp"
#include "analysis/closure/decision.hpp"
#include "analysis/closure/normality.hpp"
#include "analysis/closure/sample_search.hpp"

namespace ringlock::closure {

namespace {

using Tests = std::vector<ResidualTest>;

void test_correlation(const SampleFit& fit, Tests& tests) {
    tests.push_back(
        correlations_of(fit.innovations(), fit.rows()).test(Where::time, "correlation with the 24 samples before"));
}

void test_spectrum(const SampleFit& fit, Tests& tests) {
    const std::size_t n = fit.innovations().size();
    std::vector<double> e(n, 0.0);
    double count = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        if (!fit.rows()[i]) continue;
        e[i] = fit.innovations()[i];
        count += 1.0;
    }
    std::size_t padded = 1;
    while (padded < n) padded *= 2;
    padded *= 2;
    const auto power = periodogram(e, padded);
    double square = 0.0;
    for (const double x : e) square += x * x;
    // Frequencies that the rows that count can tell apart, a bin
    const double independent = count / static_cast<double>(padded);
    double chi2 = 0.0;
    double worst = 0.0;
    double worst_ratio = 1.0;
    double worst_hz = 0.0;
    int bands = 0;
    // Doubling from below, then 32 of equal width.
    double from = 1.0 / independent;
    const double widest = static_cast<double>(power.size()) / 32.0;
    while (from < static_cast<double>(power.size()) - 1.0) {
        const double to = std::min(static_cast<double>(power.size()), std::min(2.0 * from, from + widest));
        const auto a = static_cast<std::size_t>(from);
        const auto b = static_cast<std::size_t>(to);
        from = to;
        if (b <= a + 1) continue;
        const double ratio = std::accumulate(power.begin() + static_cast<std::ptrdiff_t>(a),
                                             power.begin() + static_cast<std::ptrdiff_t>(b), 0.0) /
                             (static_cast<double>(b - a) * square);
        const double freedom = 2.0 * static_cast<double>(b - a) * independent;
        // Wilson and Hilferty: the cube root of chi-squared is nearly normal.
        const double z = (std::cbrt(ratio) - 1.0 + 2.0 / (9.0 * freedom)) / std::sqrt(2.0 / (9.0 * freedom));
        chi2 += z * z;
        ++bands;
        if (std::abs(z) > worst) {
            worst = std::abs(z);
            worst_ratio = ratio;
            worst_hz = 0.5 * static_cast<double>(a + b) * fit.series().rate_hz / static_cast<double>(padded);
        }
    }
    tests.push_back({Where::frequency, "spectrum in bands", chi2_tail(chi2, bands),
                     fmt::format("most at {:.4g} Hz, {:.3g} times the mean", worst_hz, worst_ratio)});
    const FoundLine line = find_line(e, fit.series().rate_hz, true);
    tests.push_back(
        {Where::frequency, "lines, still and drifting", line.p_value, fmt::format("at {:.6g} Hz", line.frequency_hz)});
}

void test_size(const SampleFit& fit, Tests& tests) {
    const auto& e = fit.innovations();
    const Rows& rows = fit.rows();
    const std::size_t n = e.size();
    const auto [mean, variance] = squares_of(e, rows);
    tests.push_back(size_over_time(e, rows, 40, 20.0));
    // Patterns of the place in the record: mean and size for each remainder.
    double least = 1.0;
    std::size_t at = 0;
    for (std::size_t m = 2; m <= 16; ++m) {
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
            means += sum[j] * sum[j] / (k[j] * mean);
            sizes += squares[j] * squares[j] / (k[j] * variance);
        }
        const double p = std::min(chi2_tail(means, static_cast<int>(m)), chi2_tail(sizes, static_cast<int>(m) - 1));
        if (p < least) {
            least = p;
            at = m;
        }
    }
    tests.push_back(
        {Where::time, "place in the record modulo 2 to 16", of_several(least, 30.0), fmt::format("modulo {}", at)});
    const FoundCycle cycle = find_cycle(e, rows, fit.series().rate_hz);
    tests.push_back({Where::time, "variance and covariance that repeat", cycle.p_value,
                     fmt::format("{:.6g} times a second", cycle.frequency_hz)});
}

void test_rates(const SampleFit& fit, Tests& tests) {
    const SampleSeries& series = fit.series();
    const std::size_t n = series.size();
    const auto against = [&](Where where, std::string view, const std::vector<std::vector<double>>& columns) {
        const auto score = fit.score(columns);
        if (score.rank > 0) tests.push_back({where, std::move(view), chi2_tail(score.chi2, score.rank), ""});
    };
    if (!series.temperature_change_k.empty()) {
        const auto& t = series.temperature_change_k;
        std::vector<double> square(n);
        std::vector<double> slope(n, 0.0);
        const std::size_t apart = std::max<std::size_t>(1, n / 200);
        for (std::size_t i = 0; i < n; ++i) {
            square[i] = t[i] * t[i];
            const std::size_t a = i > apart ? i - apart : 0;
            const std::size_t b = std::min(n - 1, i + apart);
            slope[i] = (t[b] - t[a]) / static_cast<double>(b - a);
        }
        against(Where::temperature, "rates that follow temperature, its square and its slope", {t, square, slope});
    }
    if (!series.input_rate_deg_h.empty()) {
        const auto& x = series.input_rate_deg_h;
        const auto [low, high] = std::minmax_element(x.begin(), x.end());
        if (*high > *low) {
            const double most = std::max(std::abs(*high), std::abs(*low));
            std::vector<double> one(n), square(n), cube(n);
            for (std::size_t i = 0; i < n; ++i) {
                one[i] = x[i] / most;
                square[i] = one[i] * one[i];
                cube[i] = one[i] * square[i];
            }
            against(Where::rate, "rates that follow the input rate, its square and its cube", {one, square, cube});
        }
    }
    std::vector<std::vector<double>> powers;
    for (int k = 1; k <= 6; ++k) {
        std::vector<double> rate(n);
        for (std::size_t i = 0; i < n; ++i) {
            rate[i] = std::cos(
                k * std::acos(std::clamp(2.0 * static_cast<double>(i) / static_cast<double>(n - 1) - 1.0, -1.0, 1.0)));
        }
        powers.push_back(std::move(rate));
    }
    against(Where::time, "rates that are polynomials of time", powers);
    std::vector<double> roots;
    double best = 0.0;
    double at = 0.0;
    constexpr std::size_t places = 40;
    for (std::size_t k = 1; k < places; ++k) {
        std::vector<double> step(n, 0.0);
        std::fill(step.begin() + static_cast<std::ptrdiff_t>(n * k / places), step.end(), 1.0);
        const auto score = fit.score({step});
        const double root = score.rank > 0 ? std::copysign(std::sqrt(score.chi2), score.value[0]) : 0.0;
        roots.push_back(root);
        if (std::abs(root) > best) {
            best = std::abs(root);
            at = series.time_s[n * k / places];
        }
    }
    tests.push_back(
        {Where::time, "steps of the rate", davies_bound(best * best, roots), fmt::format("at {:.6g} s", at)});
}

/// A line that is not what it was: its amplitudes in stretches.
void test_lines(const SampleFit& fit, Tests& tests) {
    constexpr std::size_t stretches = 20;
    const std::size_t n = fit.innovations().size();
    double least = 1.0;
    double lines = 0.0;
    const auto& columns = fit.model().columns;
    for (std::size_t c = 0; c + 1 < columns.size(); ++c) {
        if (columns[c].name != "cosine" || columns[c + 1].name != "sine") continue;
        lines += 1.0;
        const auto x = fit.filter().apply(*columns[c].series);
        const auto y = fit.filter().apply(*columns[c + 1].series);
        double chi2 = 0.0;
        int freedom = -2;
        for (std::size_t s = 0; s < stretches; ++s) {
            double xx = 0.0, xy = 0.0, yy = 0.0, xe = 0.0, ye = 0.0;
            for (std::size_t i = n * s / stretches; i < n * (s + 1) / stretches; ++i) {
                if (!fit.rows()[i]) continue;
                const double e = fit.innovations()[i];
                xx += x[i] * x[i];
                xy += x[i] * y[i];
                yy += y[i] * y[i];
                xe += x[i] * e;
                ye += y[i] * e;
            }
            const double det = xx * yy - xy * xy;
            if (!(det > 1e-6 * xx * yy)) continue;
            chi2 += (yy * xe * xe - 2.0 * xy * xe * ye + xx * ye * ye) / det;
            freedom += 2;
        }
        if (freedom > 0) least = std::min(least, chi2_tail(chi2, freedom));
    }
    if (lines > 0.0) {
        tests.push_back({Where::amplitude, "amplitude and phase of the lines over time", of_several(least, lines), ""});
    }
}

void test_jumps(const SampleFit& fit, Tests& tests) {
    if (!fit.model().walk && !fit.model().flicker) return;
    const std::size_t n = fit.innovations().size();
    std::vector<double> step(n, 0.0);
    std::fill(step.begin() + static_cast<std::ptrdiff_t>(n / 2), step.end(), fit.series().interval_s);
    if (const auto test = jumps_of_rate(fit.innovations(), fit.rows(), fit.filter().apply(step))) {
        tests.push_back(*test);
    }
}

void test_distribution(const SampleFit& fit, double lattice_arcsec, Tests& tests) {
    const auto& e = fit.innovations();
    const std::size_t n = e.size();
    // Steps that are not small are no normal noise; sums of them are.
    const bool steps = lattice_arcsec > 0.2 * fit.sd(n / 2);
    if (const auto test = fourth_moments(e, fit.rows(), steps ? 16 : 1)) tests.push_back(*test);
    if (lattice_arcsec == 0.0) {
        // No two values of so many digits are the same by chance, the largest least of all.
        const auto& x = fit.series().increment;
        const double high = *std::max_element(x.begin(), x.end());
        const double low = *std::min_element(x.begin(), x.end());
        const double tolerance = 1e-9 * (high - low);
        const auto ties =
            std::count_if(x.begin(), x.end(), [&](double v) { return v > high - tolerance || v < low + tolerance; });
        if (ties > 4) {
            tests.push_back(
                {Where::amplitude, "values at the end of their range", 0.0, fmt::format("{} of them", ties)});
        }
    }
}

}  // namespace

Disturbed find_disturbed(const SampleFit& fit) {
    const auto& e = fit.innovations();
    const std::size_t n = e.size();
    const std::size_t length = std::max<std::size_t>(50, n / 500);
    const std::size_t windows = n / length;
    std::vector<double> power(windows, 0.0);
    for (std::size_t w = 0; w < windows; ++w) {
        for (std::size_t i = w * length; i < (w + 1) * length; ++i)
            power[w] += e[i] * e[i] / static_cast<double>(length);
    }
    auto sorted = power;
    const auto middle = sorted.begin() + static_cast<std::ptrdiff_t>(windows / 2);
    std::nth_element(sorted.begin(), middle, sorted.end());
    const double usual = std::max(*middle, 1e-300);
    Disturbed disturbed;
    disturbed.rows.assign(n, 0);
    disturbed.length_s = static_cast<double>(length) * fit.series().interval_s;
    double count = 0.0;
    for (std::size_t w = 0; w < windows; ++w) {
        const double ratio = power[w] / usual;
        const double p = of_several(chi2_tail(ratio * static_cast<double>(length), static_cast<int>(length)),
                                    static_cast<double>(windows));
        if (ratio > disturbed.worst) {
            disturbed.worst = ratio;
            disturbed.at_s = fit.series().time_s[w * length];
            disturbed.p_value = p;
        }
        if (ratio < 2.0 || p > 1e-6) continue;
        // What comes up and goes down reaches into its neighbours.
        const std::size_t a = w > 0 ? (w - 1) * length : 0;
        const std::size_t b = w + 2 < windows ? (w + 2) * length : n;
        for (std::size_t i = a; i < b; ++i) disturbed.rows[i] = 1;
    }
    for (const auto row : disturbed.rows) count += row;
    disturbed.share = count / static_cast<double>(n);
    return disturbed;
}

std::vector<ResidualTest> test_samples(const SampleFit& fit, double lattice_arcsec) {
    Tests tests;
    test_correlation(fit, tests);
    test_spectrum(fit, tests);
    test_size(fit, tests);
    test_rates(fit, tests);
    test_lines(fit, tests);
    test_jumps(fit, tests);
    test_distribution(fit, lattice_arcsec, tests);
    if (!fit.series().witnesses.empty()) {
        const FoundWitness witness = find_witness(fit.innovations(), fit.rows(), fit.series());
        if (witness.lags > 0 && !witness.name.empty()) {
            tests.push_back(
                {Where::frequency, "witnesses at lags up to a quarter of a second", witness.p_value, witness.name});
        }
    }
    return tests;
}

}  // namespace ringlock::closure
