#include "analysis/closure/independence.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>

#include "analysis/closure/chance.hpp"
#include "analysis/closure/decision.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using Columns = std::vector<std::vector<double>>;

/// Running sum of a rate [1/s], as an angle: what a rate in proportion to it adds to the phase.
std::vector<double> integral(const TurnFit& fit, const std::vector<double>& rate) {
    const auto& time = fit.model().series().time_s;
    std::vector<double> sum(rate.size(), 0.0);
    for (std::size_t i = 1; i < rate.size(); ++i) {
        sum[i] = sum[i - 1] + 0.5 * (rate[i] + rate[i - 1]) * (time[i] - time[i - 1]);
    }
    return sum;
}

double largest(const std::vector<double>& values) {
    double most = 0.0;
    for (const double value : values) most = std::max(most, std::abs(value));
    return most;
}

void test_phase(const TurnFit& fit, std::vector<ResidualTest>& tests) {
    constexpr int harmonics = 6;
    const auto& model = fit.model();
    const std::size_t n = model.series().size();
    for (const bool kicks : {true, false}) {
        double least = 1.0;
        double most = 0.0;
        int at = 0;
        for (int k = 1; k <= harmonics; ++k) {
            Columns columns(4, std::vector<double>(n));
            double sums[4] = {};
            for (std::size_t i = 0; i < n; ++i) {
                const double angle = k * model.phase_rad()[i];
                const double d = model.series().direction[i];
                const double values[4] = {std::cos(angle), std::sin(angle), d * std::cos(angle), d * std::sin(angle)};
                for (int c = 0; c < 4; ++c) {
                    columns[static_cast<std::size_t>(c)][i] = kicks ? sums[c] + 0.5 * values[c] : values[c];
                    sums[c] += values[c];
                }
            }
            const auto score = fit.score(columns);
            const double p = chi2_tail(score.chi2, score.rank);
            most = std::max(most, 0.5 * score.chi2 - score.rank - std::log(static_cast<double>(harmonics)));
            if (at > 0 && p >= least) continue;
            least = p;
            at = k;
        }
        tests.push_back(
            {Where::phase,
             kicks ? "kicks at harmonics of the turn's phase" : "phase read at harmonics of the turn's phase",
             of_several(least, harmonics), fmt::format("harmonic {}", at), most});
    }
}

void test_rates(const TurnFit& fit, std::vector<ResidualTest>& tests) {
    const auto& series = fit.model().series();
    const std::size_t n = series.size();
    const auto against = [&](Where where, std::string view, const Columns& columns) {
        const auto score = fit.score(columns);
        if (score.rank == 0) return;
        tests.push_back({where, std::move(view), chi2_tail(score.chi2, score.rank), "", 0.5 * score.chi2 - score.rank});
    };
    if (!series.temperature_change_k.empty() && largest(series.temperature_change_k) > 0.0) {
        const auto& t = series.temperature_change_k;
        std::vector<double> square(n);
        for (std::size_t i = 0; i < n; ++i) square[i] = t[i] * t[i];
        against(Where::temperature, "rates that follow temperature, its square and its slope",
                {integral(fit, t), integral(fit, square), t});
    }
    const auto [low, high] = std::minmax_element(series.input_rate_deg_h.begin(), series.input_rate_deg_h.end());
    if (*high > *low) {
        std::vector<double> square(n);
        std::vector<double> cube(n);
        for (std::size_t i = 0; i < n; ++i) {
            const double x = series.input_rate_deg_h[i] / std::max(std::abs(*high), std::abs(*low));
            square[i] = x * x;
            cube[i] = x * x * x;
        }
        against(Where::rate, "rates that follow the input rate, its square and its cube",
                {integral(fit, series.input_rate_deg_h), integral(fit, square), integral(fit, cube)});
    }
    // The amplitude of the cycles before: what the residual itself has done to it stays out.
    constexpr double memory = 1.0 / 200.0;
    std::vector<double> amplitude(n);
    std::vector<double> square(n);
    double mean = 1.0;
    for (std::size_t i = 0; i < n; ++i) {
        amplitude[i] = mean - 1.0;
        if (i > 0) mean += memory * (series.swing[i - 1] - mean);
    }
    const double scale = std::max(largest(amplitude), 1e-12);
    for (std::size_t i = 0; i < n; ++i) {
        amplitude[i] /= scale;
        square[i] = amplitude[i] * amplitude[i];
    }
    against(Where::amplitude, "rates that follow the dither's amplitude and its square",
            {integral(fit, amplitude), integral(fit, square)});
    constexpr int degrees = 6;
    Columns powers;
    for (int k = 1; k <= degrees; ++k) {
        std::vector<double> rate(n);
        for (std::size_t i = 0; i < n; ++i) {
            const double x = 2.0 * static_cast<double>(i) / static_cast<double>(n - 1) - 1.0;
            rate[i] = std::cos(k * std::acos(std::clamp(x, -1.0, 1.0)));
        }
        powers.push_back(integral(fit, rate));
    }
    against(Where::time, "rates that are polynomials of time", powers);
}

void test_steps(const TurnFit& fit, std::vector<ResidualTest>& tests) {
    constexpr int places = 80;
    const auto& time = fit.model().series().time_s;
    std::vector<double> roots(places - 1);
    const auto time_of = [&](std::size_t k) { return time.back() * static_cast<double>(k + 1) / places; };
    oneapi::tbb::parallel_for(std::size_t{0}, roots.size(), [&](std::size_t k) {
        std::vector<double> ramp(time.size());
        for (std::size_t i = 0; i < time.size(); ++i) ramp[i] = std::max(0.0, time[i] - time_of(k));
        const auto score = fit.score({ramp});
        if (score.rank > 0 && score.covariance(0, 0) > 0.0) {
            roots[k] = score.value(0) / std::sqrt(score.covariance(0, 0));
        }
    });
    const auto most = std::max_element(roots.begin(), roots.end(),
                                       [](double a, double b) { return std::abs(a) < std::abs(b); });
    const double best = std::abs(*most);
    const double at = time_of(static_cast<std::size_t>(most - roots.begin()));
    tests.push_back(
        {Where::time, "steps of the rate", davies_bound(best * best, roots), fmt::format("at {:.6g} s", at)});
}

void test_whiteness(const TurnFit& fit, std::vector<ResidualTest>& tests) {
    const auto& e = fit.innovations();
    const auto& rows = fit.rows();
    const std::size_t n = e.size();
    constexpr std::size_t lags = 24;
    double chi2 = 0.0;
    double rising = 0.0;       // sum of correlations: slow changes
    double alternating = 0.0;  // with alternating signs: changes of the dither's amplitude
    std::vector<double> root(lags + 1);
    for (std::size_t k = 1; k <= lags; ++k) {
        double sum = 0.0;
        double weight = 0.0;
        for (std::size_t i = k; i < n; ++i) {
            if (!rows[i] || !rows[i - k]) continue;
            const double product = e[i] * e[i - k];
            sum += product;
            weight += product * product;
        }
        if (weight == 0.0) continue;
        root[k] = sum / std::sqrt(weight);
        chi2 += root[k] * root[k];
        rising += root[k];
        alternating += k % 2 == 0 ? root[k] : -root[k];
    }
    tests.push_back(
        {std::abs(alternating) > std::abs(rising) ? Where::amplitude : Where::time,
         "correlation with the 24 turns before", chi2_tail(chi2, lags),
         fmt::format("first correlations {:.2f}, {:.2f}, {:.2f} standard errors", root[1], root[2], root[3])});

    std::size_t padded = 1;
    while (padded < 4 * n) padded *= 2;
    std::vector<double> in(padded, 0.0);
    double power = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        in[i] = rows[i] ? e[i] : 0.0;
        power += in[i] * in[i];
    }
    std::vector<std::complex<double>> out;
    Eigen::FFT<double> fft;
    fft.SetFlag(Eigen::FFT<double>::HalfSpectrum);
    fft.fwd(out, in);
    std::size_t peak = 4;
    for (std::size_t k = 4; k < padded / 2; ++k) {
        if (std::norm(out[k]) > std::norm(out[peak])) peak = k;
    }
    const double chi2_line = 2.0 * std::norm(out[peak]) / power;
    const double hz = static_cast<double>(peak) / (static_cast<double>(padded) * fit.model().series().interval_s);
    // Between the Fourier frequencies there is more to find than at them.
    tests.push_back({Where::frequency, "lines", of_several(chi2_tail(chi2_line, 2), 1.5 * static_cast<double>(n)),
                     fmt::format("at {:.6g} Hz", hz)});
}

void test_size(const TurnFit& fit, std::vector<ResidualTest>& tests) {
    const auto& e = fit.innovations();
    const auto& rows = fit.rows();
    const std::size_t n = e.size();
    double mean = 0.0;
    double fourth = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        if (!rows[i]) continue;
        mean += e[i] * e[i];
        fourth += e[i] * e[i] * e[i] * e[i];
        count += 1.0;
    }
    mean /= count;
    const double variance = std::max(fourth / count - mean * mean, 1e-12);
    tests.push_back(size_over_time(e, rows, 20, 8.0));
    constexpr int columns = 8;
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(columns, columns);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(columns);
    Eigen::VectorXd row(columns);
    for (std::size_t i = 0; i < n; ++i) {
        if (!rows[i]) continue;
        const double psi = fit.model().phase_rad()[i];
        const double d = fit.model().series().direction[i];
        row << std::cos(psi), std::sin(psi), std::cos(2 * psi), std::sin(2 * psi), d * std::cos(psi), d * std::sin(psi),
            d * std::cos(2 * psi), d * std::sin(2 * psi);
        normal += row * row.transpose();
        right += row * (e[i] * e[i] - mean);
    }
    Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd> decomposition(normal);
    decomposition.setThreshold(1e-6);
    const double folded = right.dot(decomposition.solve(right)) / variance;
    tests.push_back({Where::phase, "size of the residual over the turn's phase",
                     chi2_tail(folded, static_cast<int>(decomposition.rank())), ""});
}

}  // namespace

std::string_view name_of(Where where) {
    switch (where) {
        case Where::phase:
            return "phase";
        case Where::time:
            return "time";
        case Where::frequency:
            return "frequency";
        case Where::temperature:
            return "temperature";
        case Where::rate:
            return "rate";
        case Where::amplitude:
            break;
    }
    return "amplitude";
}

std::string ResidualTest::description() const {
    return fmt::format("{}{}{}, by chance p {:.2g}", view, detail.empty() ? "" : ", ", detail, p_value);
}

std::vector<ResidualTest> test_residual(const TurnFit& fit) {
    std::vector<ResidualTest> tests;
    if (fit.model().series().all_phases_come) test_phase(fit, tests);
    test_rates(fit, tests);
    test_steps(fit, tests);
    test_whiteness(fit, tests);
    test_size(fit, tests);
    return tests;
}

}  // namespace ringlock::closure
