#include "analysis/closure/turns/residual/residual_tests.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <unsupported/Eigen/FFT>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/normality.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/stats/whiteness.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "analysis/closure/turns/residual/jumps.hpp"
#include "analysis/closure/turns/residual/size_over_phase.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using Columns = std::vector<Regressor>;

/// Integral of a rate [1/s]: the phase for a rate in proportion to it.
std::vector<double> integral(const TurnFit& fit, const std::vector<double>& rate) {
    const auto& time = fit.model().series().time_s;
    std::vector<double> sum(rate.size(), 0.0);
    for (std::size_t i = 1; i < rate.size(); ++i) {
        sum[i] = sum[i - 1] + 0.5 * (rate[i] + rate[i - 1]) * (time[i] - time[i - 1]);
    }
    return sum;
}

double largest_of(const std::vector<double>& values) {
    double most = 0.0;
    for (const double value : values) most = std::max(most, std::abs(value));
    return most;
}

constexpr std::size_t of_harmonic = 4;  // cosine and sine, with equal or opposite signs at maxima

/// One column of harmonic k of the phase at the turns, as kicks or as errors of the reading, times the factor
/// `times(turn)`.
template <typename Times>
Regressor harmonic_column(const TurnFit& fit, int k, bool kicks, std::size_t column, Times&& times) {
    const auto& model = fit.model();
    const std::size_t n = model.series().size();
    const NoiseShape* shape = fit.parameters().shape.get();
    const std::vector<double> zeros(n);
    Regressor of(zeros, zeros, zeros, shape != nullptr ? zeros : std::vector<double>());
    const double share = kicks ? 0.5 : 1.0;  // half of a kick comes before the turn
    double sum = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        const double angle = k * model.phase_rad()[i];
        const double d = column < 2 ? 1.0 : model.series().direction[i];
        const double by = times(i);
        const double cosine = by * std::cos(angle);
        const double sine = by * std::sin(angle);
        const bool is_sine = column % 2 == 1;
        const double value = d * (is_sine ? sine : cosine);
        const double slope = is_sine ? k * (d * cosine) : -k * (d * sine);
        of.series[i] = (kicks ? sum : 0.0) + share * value;
        of.slope[i] = share * slope;
        of.kick[i] = kicks ? slope : 0.0;
        sum += value;
        if (shape == nullptr) continue;
        const std::complex<double> left = share * by * shape->at(i)[static_cast<std::size_t>(k - 1)];
        of.left[i] = d * (is_sine ? left.imag() : left.real());
    }
    return of;
}

Regressor harmonic_column(const TurnFit& fit, int k, bool kicks, std::size_t column) {
    return harmonic_column(fit, k, kicks, column, [](std::size_t) { return 1.0; });
}

Columns harmonic(const TurnFit& fit, int k, bool kicks) {
    Columns columns;
    for (std::size_t c = 0; c < of_harmonic; ++c) columns.push_back(harmonic_column(fit, k, kicks, c));
    return columns;
}

constexpr std::size_t of_changing_kicks = 2 * of_harmonic;

/// One column of kicks whose size and phase oscillate with this number of periods over the record.
Regressor column_of_changing_kicks(const TurnFit& fit, double periods, std::size_t column) {
    const auto n = static_cast<double>(fit.model().series().size());
    const bool sine = column >= of_harmonic;
    return harmonic_column(fit, 1, true, column % of_harmonic, [=](std::size_t i) {
        const double angle = units::two_pi * periods * static_cast<double>(i) / n;
        return sine ? std::sin(angle) : std::cos(angle);
    });
}

Columns kicks_that_change(const TurnFit& fit, double periods) {
    Columns columns;
    for (std::size_t c = 0; c < of_changing_kicks; ++c) columns.push_back(column_of_changing_kicks(fit, periods, c));
    return columns;
}

/// Adds the error of the model's ellipse to a score. The radii determine the ellipse as well as the phases would, so
/// the amplitudes of the first two harmonics, to which it shifts the reading, also have that error.
void doubt_ellipse(const TurnFit& fit, TurnFit::Score& score) {
    if (fit.parameters().find(effect_roles().ellipse.effect) == nullptr || score.rank != 4) return;
    const auto counted = static_cast<double>(std::count(fit.rows().begin(), fit.rows().end(), 1));
    const double sd = fit.model().series().radius_sd_rad;
    Eigen::MatrixXd covariance = score.covariance;
    covariance.diagonal().head(2).array() += 2.0 * sd * sd / counted;
    score.chi2 = score.value.dot(dense::solve_symmetric(covariance, score.value));
}

void test_phase(const TurnFit& fit, std::vector<TurnResidualTest>& tests) {
    // The innovation is a part of the phase that was read. Their correlation without a missing effect is known for
    // normal innovations (Stein, Annals of Statistics 9, 1981, 1135) and for those of a known density.
    const bool known = fit.parameters().shape || !is_of_even_density(fit.innovations(), fit.rows());
    for (const bool kicks : {true, false}) {
        if (!kicks && !known) continue;
        double least = 1.0;
        double most = 0.0;
        double cost = 0.0;
        int at = 0;
        for (int k = 1; k <= harmonics_of_phase; ++k) {
            auto score =
                fit.score(of_harmonic, [&](std::size_t column) { return harmonic_column(fit, k, kicks, column); });
            if (!kicks && k <= 2) doubt_ellipse(fit, score);
            const double p = chi2_tail(score.chi2, score.rank);
            if (at > 0 && p >= least) continue;
            least = p;
            at = k;
            cost = score.rank + std::log(static_cast<double>(harmonics_of_phase));
            most = 0.5 * score.chi2 - cost;
        }
        tests.push_back(
            {{Where::phase,
              kicks ? "kicks at harmonics of the turn's phase" : "phase read at harmonics of the turn's phase",
              of_several(least, harmonics_of_phase), fmt::format("harmonic {}", at), most},
             cost,
             [&fit, at, kicks] { return harmonic(fit, at, kicks); },
             options.turns.residual.largest_kick_rad / at});
    }
}

/// A lock-in that is not constant: kicks at the phase, times slow oscillations.
void test_kicks_over_time(const TurnFit& fit, std::vector<TurnResidualTest>& tests) {
    constexpr std::size_t positions = options.turns.residual.kick_periods;
    const auto periods_of = [](std::size_t place) { return 0.5 * static_cast<double>(place + 1); };
    std::vector<TurnFit::Score> scores(positions);
    // One after the other, with the columns of each in parallel.
    for (std::size_t place = 0; place < positions; ++place) {
        scores[place] = fit.score(of_changing_kicks, [&](std::size_t column) {
            return column_of_changing_kicks(fit, periods_of(place), column);
        });
    }
    const auto most =
        std::max_element(scores.begin(), scores.end(), [](const auto& a, const auto& b) { return a.chi2 < b.chi2; });
    const TurnFit::Score& score = *most;
    const double periods = periods_of(static_cast<std::size_t>(most - scores.begin()));
    if (score.rank == 0) return;
    const double cost = score.rank + std::log(static_cast<double>(positions));
    tests.push_back(
        {{Where::time, "kicks that change in time", of_several(chi2_tail(score.chi2, score.rank), positions),
          fmt::format("{:g} periods over the record", periods), 0.5 * score.chi2 - cost},
         cost,
         [&fit, periods] { return kicks_that_change(fit, periods); },
         options.turns.residual.largest_kick_rad});
}

/// Amplitude of the dither at the turns over its mean: second differences of the phases, in which a constant rate
/// cancels, with the kicks of the lock-in subtracted. The first and the last value repeat those next to them.
std::vector<double> amplitude_at_turns(const TurnFit& fit) {
    const auto& series = fit.model().series();
    const auto& predicted = fit.prediction().phase_rad;
    const auto& phase = fit.model().phase_rad();
    const std::size_t n = series.size();
    std::vector<double> amplitude(n, 1.0);
    for (std::size_t i = 1; i + 1 < n; ++i) {
        double second = 0.0;
        for (const std::size_t k : {i - 1, i, i, i + 1}) second += (k == i ? 1.0 : -1.0) * (phase[k] - predicted[k]);
        amplitude[i] = -0.25 * series.direction[i] * second / series.amplitude_rad;
    }
    amplitude[0] = amplitude[1];
    amplitude[n - 1] = amplitude[n - 2];
    return amplitude;
}

/// Gain of the Kalman filter of a random walk that is read with noise (Harvey 1989, section 4.1). The variances follow
/// from the growth of differences with their lag.
double gain_of_walk(const std::vector<double>& series) {
    const TurnOptions::Residual& of = options.turns.residual;
    const std::size_t lag = of.amplitude_lag;
    const auto turns_apart = static_cast<double>(lag);
    const std::size_t n = series.size();
    double squares[3] = {};
    const auto of_lag = [&](std::size_t k, std::size_t i) { return std::pow(series[i + k] - series[i], 2); };
    for (std::size_t i = 0; i + 2 * lag < n; ++i) {
        const double grown = of_lag(2 * lag, i) - of_lag(lag, i);
        squares[0] += of_lag(lag, i) / static_cast<double>(n);
        squares[1] += grown / static_cast<double>(n);
        squares[2] += grown * grown / static_cast<double>(n);
    }
    // Each difference over twice the lag shares values with that number of others.
    const double error = std::sqrt(squares[2] * 2.0 * turns_apart / static_cast<double>(n));
    const double walk = std::max(squares[1] - of.no_growth_sd * error, 0.0) / turns_apart;
    const double read = std::max(0.5 * (squares[0] - turns_apart * walk), 0.0);
    return std::clamp(2.0 * walk / (walk + std::sqrt(walk * walk + 4.0 * walk * read) + 1e-300), of.least_gain,
                      of.most_gain);
}

void test_rates(const TurnFit& fit, std::vector<TurnResidualTest>& tests) {
    const auto& series = fit.model().series();
    const std::size_t n = series.size();
    const auto against = [&](Where where, std::string subject, Columns columns) {
        const auto score = fit.score(columns);
        if (score.rank == 0) return;
        const double cost = score.rank;
        tests.push_back({{where, std::move(subject), chi2_tail(score.chi2, score.rank), "", 0.5 * score.chi2 - cost},
                         cost,
                         [columns = std::make_shared<const Columns>(std::move(columns))] { return *columns; }});
    };
    if (!series.temperature_change_k.empty() && largest_of(series.temperature_change_k) > 0.0) {
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
    // The amplitude of the cycles before the turn, which the residual itself has not changed.
    const auto at_turn = std::make_shared<const std::vector<double>>(amplitude_at_turns(fit));
    const double memory = gain_of_walk(*at_turn);
    const auto stretch = static_cast<std::ptrdiff_t>(std::min<std::size_t>(n - 1, std::lround(2.0 / memory)));
    const auto mean_of = [&](auto first) {
        return std::accumulate(first, first + stretch, 0.0) / static_cast<double>(stretch);
    };
    std::vector<double> amplitude(n);
    double mean = mean_of(at_turn->begin());
    for (std::size_t i = 0; i < n; ++i) {
        amplitude[i] = mean - 1.0;
        if (i > 1) mean += memory * ((*at_turn)[i - 2] - mean);
    }
    const auto angles = [&fit](std::vector<double> change) {
        const double scale = std::max(largest_of(change), 1e-12);
        std::vector<double> square(change.size());
        for (std::size_t i = 0; i < change.size(); ++i) {
            change[i] /= scale;
            square[i] = change[i] * change[i];
        }
        return Columns{integral(fit, change), integral(fit, square)};
    };
    against(Where::amplitude, "rates that follow the dither's amplitude and its square", angles(amplitude));
    if (!tests.empty() && tests.back().result.where == Where::amplitude) {
        // The columns for the evidence, after the test has failed, also use the cycles after the turn.
        tests.back().columns = [at_turn, amplitude, angles, memory, n, last = mean_of(at_turn->rbegin())] {
            std::vector<double> change = amplitude;
            double after = last;
            for (std::size_t i = n; i-- > 0;) {
                if (i + 1 < n) after += memory * ((*at_turn)[i] - after);
                change[i] = 0.5 * (change[i] + after - 1.0);
            }
            return angles(change);
        };
    }
    constexpr int degrees = options.turns.residual.degree_of_rates;
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

void test_steps(const TurnFit& fit, std::vector<TurnResidualTest>& tests) {
    constexpr int positions = options.turns.residual.steps;
    const auto& time = fit.model().series().time_s;
    std::vector<double> roots(positions - 1);
    const auto ramp_of = [&time](std::size_t k) {
        const double start = time.back() * static_cast<double>(k + 1) / positions;
        std::vector<double> ramp(time.size());
        for (std::size_t i = 0; i < time.size(); ++i) ramp[i] = std::max(0.0, time[i] - start);
        return ramp;
    };
    side_by_side(roots.size(), [&](std::size_t k) {
        const auto score = fit.score({ramp_of(k)});
        if (score.rank > 0 && score.covariance(0, 0) > 0.0) {
            roots[k] = score.value(0) / std::sqrt(score.covariance(0, 0));
        }
    });
    const auto most =
        std::max_element(roots.begin(), roots.end(), [](double a, double b) { return std::abs(a) < std::abs(b); });
    const double chi2 = *most * *most;
    const auto at = static_cast<std::size_t>(most - roots.begin());
    const double cost = 2.0 + std::log(davies_look_elsewhere(chi2, roots));
    tests.push_back(
        {{Where::time, "steps of the rate", davies_bound(chi2, roots),
          fmt::format("at {:.6g} s", time.back() * static_cast<double>(at + 1) / positions), 0.5 * chi2 - cost},
         cost,
         [ramp_of, at] { return Columns{ramp_of(at)}; }});
}

/// A rate that jumps between two levels, by the rates of stretches of the record.
void test_levels(const TurnFit& fit, std::vector<TurnResidualTest>& tests) {
    const TwoLevels found = levels_of_stretches(fit);
    TurnResidualTest& test = tests.emplace_back();
    test.result = {Where::time, "a rate that jumps between two levels", found.p_value,
                   fmt::format("{} jumps", found.changes), found.evidence};
    test.cost = found.cost + options.turns.jumps.cost_of_place * found.changes;
    test.columns = [&fit, found] { return Columns{placed_jumps(fit, found)}; };
    test.jumps = found.changes > 1;
    if (test.jumps) {
        test.refitted = [&fit, found](double competing) { return evidence_of_jumps(fit, found, competing); };
    }
}

void test_whiteness(const TurnFit& fit, std::vector<TurnResidualTest>& tests) {
    const Correlations found = correlations_of(fit.innovations(), fit.rows());
    double rising = 0.0;       // sum of correlations: slow changes
    double alternating = 0.0;  // the same with alternating signs: changes of the dither's amplitude
    for (std::size_t k = 1; k < found.root.size(); ++k) {
        rising += found.root[k];
        alternating += k % 2 == 0 ? found.root[k] : -found.root[k];
    }
    const Where where = std::abs(alternating) > std::abs(rising) ? Where::amplitude : Where::time;
    tests.push_back({found.test(where, fmt::format("correlation with the {} turns before", options.stats.lags))});
}

/// Lines, including those that drift.
void test_lines(const TurnFit& fit, std::vector<TurnResidualTest>& tests) {
    constexpr int drifts = options.turns.residual.drifts;
    constexpr double apart = options.turns.residual.drifts_apart;
    const auto& e = fit.innovations();
    const auto& rows = fit.rows();
    const std::size_t n = e.size();
    std::size_t padded = 1;
    while (padded < 2 * n) padded *= 2;
    double power = 0.0;
    for (std::size_t i = 0; i < n; ++i) power += rows[i] ? e[i] * e[i] : 0.0;
    struct Line {
        double power = 0.0;
        std::size_t bin = 0;
    };
    std::vector<Line> lines(drifts);
    const auto drift_of = [](std::size_t k) { return apart * (static_cast<double>(k) - drifts / 2); };
    side_by_side(lines.size(), [&](std::size_t k) {
        const double drift = drift_of(k);
        std::vector<std::complex<double>> in(padded);
        for (std::size_t i = 0; i < n; ++i) {
            if (!rows[i]) continue;
            const double x = static_cast<double>(i) / static_cast<double>(n) - 0.5;
            in[i] = std::polar(e[i], -units::pi * drift * x * x);
        }
        std::vector<std::complex<double>> out;
        Eigen::FFT<double> fft;
        fft.fwd(out, in);
        for (std::size_t bin = options.turns.residual.lowest_bin; bin < padded / 2; ++bin) {
            if (std::norm(out[bin]) > lines[k].power) lines[k] = {std::norm(out[bin]), bin};
        }
    });
    const double positions = options.turns.residual.trials_per_bin * static_cast<double>(n);
    const double bin_hz = 1.0 / (static_cast<double>(padded) * fit.model().series().interval_s);
    const auto report = [&](const char* subject, const Line& line, double look_elsewhere, double drift) {
        const double chi2 = 2.0 * line.power / power;
        const double duration_s = static_cast<double>(n) * fit.model().series().interval_s;
        const double periods = static_cast<double>(line.bin) * bin_hz * duration_s;
        const double cost = 2.0 + std::log(look_elsewhere);
        tests.push_back({{Where::frequency, subject, of_several(chi2_tail(chi2, 2), look_elsewhere),
                          fmt::format("at {:.6g} Hz{}", static_cast<double>(line.bin) * bin_hz,
                                      drift != 0.0 ? fmt::format(", drifting by {:.2g} Hz", drift / duration_s) : ""),
                          0.5 * chi2 - cost},
                         cost,
                         [n, periods, drift] {
                             Columns columns(2, std::vector<double>(n));
                             for (std::size_t i = 0; i < n; ++i) {
                                 const double x = static_cast<double>(i) / static_cast<double>(n) - 0.5;
                                 const double angle = units::two_pi * periods * x + units::pi * drift * x * x;
                                 columns[0].series[i] = std::cos(angle);
                                 columns[1].series[i] = std::sin(angle);
                             }
                             return columns;
                         }});
        tests.back().hz = static_cast<double>(line.bin) * bin_hz;
    };
    report("lines", lines[drifts / 2], positions, 0.0);
    // A line of constant frequency does not count as one that drifts slightly.
    lines[drifts / 2] = {};
    const auto best =
        std::max_element(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.power < b.power; });
    report("lines that drift", *best, drifts * positions, drift_of(static_cast<std::size_t>(best - lines.begin())));
}

/// Innovations are normal with a true random rate, but not necessarily with one that substitutes for another cause.
void test_normality(const TurnFit& fit, std::vector<TurnResidualTest>& tests) {
    const std::size_t bounded = options.turns.residual.bounded_sums;
    if (const auto test = fourth_moments(fit.innovations(), fit.rows(), 1, bounded)) tests.push_back({*test});
    const TurnNoise noise = fit.model().noise(fit.parameters());
    if (noise.rates.empty() && noise.walk_rad2_per_s3 == 0.0) return;
    const auto& time = fit.model().series().time_s;
    std::vector<double> ramp(time.size());
    for (std::size_t i = 0; i < time.size(); ++i) ramp[i] = std::max(0.0, time[i] - time[time.size() / 2]);
    if (const auto jump = largest_jump(fit.innovations(), fit.rows(), fit.whitened_alone(ramp))) {
        tests.emplace_back().result = test_of(*jump);
    }
}

void test_size(const TurnFit& fit, std::vector<TurnResidualTest>& tests) {
    const TurnOptions::Residual& of = options.turns.residual;
    tests.push_back({size_over_time(fit.innovations(), fit.rows(), of.stretches_of_size, of.fewest_rows_of_size)});
    if (is_of_even_density(fit.innovations(), fit.rows())) return;
    tests.push_back({size_over_phase(fit)});
}

}  // namespace

double refitted_evidence(const TurnFit& fit, const TurnResidualTest& test, double competing) {
    if (test.refitted) return test.refitted(competing);
    const TurnFit::Regression regression = fit.regress(test.columns());
    if (regression.value.cwiseAbs().maxCoeff() > test.largest) return -std::numeric_limits<double>::infinity();
    // The cost of the test contains one for each of the amplitudes.
    const auto amplitudes = static_cast<int>(regression.value.size());
    return regression.gain - (test.cost - amplitudes) - cost_of_amplitudes(regression.gain, amplitudes);
}

std::vector<TurnResidualTest> test_residual(const TurnFit& fit) {
    std::vector<TurnResidualTest> tests;
    test_phase(fit, tests);
    test_kicks_over_time(fit, tests);
    test_rates(fit, tests);
    test_steps(fit, tests);
    test_levels(fit, tests);
    test_whiteness(fit, tests);
    test_lines(fit, tests);
    test_size(fit, tests);
    test_normality(fit, tests);
    return tests;
}

}  // namespace ringlock::closure
