#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/lines.hpp"
#include "analysis/closure/samples/fit/repeats_and_witness.hpp"
#include "analysis/closure/samples/fit/steps.hpp"
#include "analysis/closure/samples/residual/templates.hpp"
#include "analysis/closure/samples/residual/tests.hpp"
#include "analysis/closure/stats/normality.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/stats/two_levels.hpp"
#include "analysis/closure/stats/two_states.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Rates that are polynomials of time, of as few terms as the record requires (Schwarz, Annals of Statistics 6, 1978,
/// 461).
void test_powers_of_time(const SampleFit& fit, SampleResidualTests& tests) {
    const std::size_t degrees = options.samples.residual.polynomial_degrees;
    const std::size_t n = fit.series().size();
    Columns powers;
    Columns taken;
    SampleFit::Score score;
    std::size_t degree = 0;
    double most = 0.0;
    for (std::size_t k = 1; k <= degrees; ++k) {
        std::vector<double> rate(n);
        for (std::size_t i = 0; i < n; ++i) {
            const double x = 2.0 * static_cast<double>(i) / static_cast<double>(n - 1) - 1.0;
            rate[i] = std::cos(static_cast<double>(k) * std::acos(std::clamp(x, -1.0, 1.0)));
        }
        taken.push_back(fit.as_taken(rate));
        powers.push_back(std::move(rate));
        score = fit.score(taken);
        const double evidence = 0.5 * (score.chi2 - score.rank * std::log(static_cast<double>(n)));
        if (degree > 0 && evidence <= most) continue;
        most = evidence;
        degree = k;
    }
    if (score.rank == 0) return;
    powers.resize(degree);
    tests.push_back({{Where::time, "rates that are polynomials of time", chi2_tail(score.chi2, score.rank),
                      fmt::format("degree {}", degree), 0.5 * score.chi2 - score.rank},
                     static_cast<double>(degree) + std::log(static_cast<double>(degrees)),
                     [powers = std::make_shared<const Columns>(std::move(powers))] { return *powers; }});
}

/// A rate with an oscillation that is too slow for a line.
void test_slow_swings(const SampleFit& fit, SampleResidualTests& tests) {
    const std::size_t n = fit.series().size();
    const auto periods = [](std::size_t place) { return 0.25 * static_cast<double>(place + 1); };
    const auto swing = [n, periods](std::size_t place) {
        Columns columns(2, std::vector<double>(n));
        for (std::size_t i = 0; i < n; ++i) {
            const double angle = units::two_pi * periods(place) * static_cast<double>(i) / static_cast<double>(n);
            columns[0][i] = std::cos(angle);
            columns[1][i] = std::sin(angle);
        }
        return columns;
    };
    const auto said = [periods](std::size_t place) {
        return fmt::format("{:g} periods over the record", periods(place));
    };
    test_templates(fit, Where::time, "a rate that swings slowly", {options.samples.residual.slow_swings, swing, said},
                   tests);
}

/// A rate that settles exponentially after the start.
void test_settling(const SampleFit& fit, SampleResidualTests& tests) {
    const auto& time_s = fit.series().time_s;
    const double duration_s = time_s.back() - time_s.front();
    // A constant between two of these loses little with either.
    const auto constant_s = [duration_s](std::size_t place) {
        return duration_s * std::pow(options.samples.residual.settling_factor, -static_cast<double>(place));
    };
    const auto settles = [&time_s, constant_s](std::size_t place) {
        Columns columns(1, std::vector<double>(time_s.size()));
        for (std::size_t i = 0; i < time_s.size(); ++i) {
            columns[0][i] = std::exp(-(time_s[i] - time_s.front()) / constant_s(place));
        }
        return columns;
    };
    const auto said = [constant_s](std::size_t place) {
        return fmt::format("with a time constant of {:.2g} s", constant_s(place));
    };
    test_templates(fit, Where::time, "a rate that settles",
                   {options.samples.residual.settling_constants, settles, said}, tests);
}

void test_steps(const SampleFit& fit, SampleResidualTests& tests) {
    const SampleSeries& series = fit.series();
    const std::size_t n = series.size();
    std::vector<double> roots;
    double best = 0.0;
    std::size_t at = 0;
    const std::size_t positions = options.samples.residual.step_positions;
    const auto step_at = [n](std::size_t row) {
        std::vector<double> step(n, 0.0);
        std::fill(step.begin() + static_cast<std::ptrdiff_t>(row), step.end(), 1.0);
        return step;
    };
    for (std::size_t k = 1; k < positions; ++k) {
        const auto score = fit.score({fit.as_taken(step_at(n * k / positions))});
        const double root = score.rank > 0 ? std::copysign(std::sqrt(score.chi2), score.value[0]) : 0.0;
        roots.push_back(root);
        if (std::abs(root) > best) {
            best = std::abs(root);
            at = n * k / positions;
        }
    }
    const double cost = 2.0 + std::log(davies_look_elsewhere(best * best, roots));
    tests.push_back({{Where::time, "steps of the rate", davies_bound(best * best, roots),
                      fmt::format("at {:.6g} s", series.time_s[at]), 0.5 * best * best - cost},
                     cost,
                     [step_at, at] { return Columns{step_at(at)}; }});
}

/// A rate of one in some stretches and of zero in the others, with the jumps moved to where they explain most.
std::vector<double> two_level_rate(const SampleFit& fit, const Eigen::VectorXd& shape) {
    const std::size_t n = fit.series().size();
    const auto stretches = static_cast<std::size_t>(shape.size());
    std::vector<std::size_t> jumps;
    for (Eigen::Index k = 1; k < shape.size(); ++k) {
        if (shape(k) != shape(k - 1)) jumps.push_back(n * static_cast<std::size_t>(k) / stretches);
    }
    const auto rate = [&] {
        std::vector<double> out(n);
        std::size_t next = 0;
        double on = shape(0);
        for (std::size_t i = 0; i < n; ++i) {
            for (; next < jumps.size() && jumps[next] <= i; ++next) on = 1.0 - on;
            out[i] = on;
        }
        return out;
    };
    double best = fit.score({fit.as_taken(rate())}).chi2;
    const std::size_t length = std::max<std::size_t>(1, n / stretches);
    for (std::size_t step = length / 2; step > length / options.samples.residual.jump_positions; step /= 2) {
        for (std::size_t& jump : jumps) {
            for (const bool later : {false, true}) {
                const std::size_t from = jump;
                jump = later ? std::min(n, jump + step) : jump - std::min(jump, step);
                const double chi2 =
                    std::is_sorted(jumps.begin(), jumps.end()) ? fit.score({fit.as_taken(rate())}).chi2 : 0.0;
                if (chi2 > best) {
                    best = chi2;
                } else {
                    jump = from;
                }
            }
        }
    }
    return rate();
}

/// Normal equations of a regression on the rates of stretches of the record, and the part of them that the columns of
/// the model explain.
struct Stretches {
    Eigen::MatrixXd normal, of_columns;
    Eigen::VectorXd right;
};

Stretches regress_on_stretches(const SampleFit& fit, std::size_t stretches) {
    const std::size_t n = fit.series().size();
    // The filter's response decays: only its part that is not negligible is kept for each stretch.
    struct Response {
        std::size_t from = 0;
        std::vector<float> values;
    };
    std::vector<Response> responses(stretches);
    const auto& own = fit.whitened();
    const auto m = static_cast<Eigen::Index>(own.size());
    const auto k = static_cast<Eigen::Index>(stretches);
    Eigen::MatrixXd cross(m, k);
    Eigen::VectorXd right(k);
    for (std::size_t s = 0; s < stretches; ++s) {
        std::vector<double> column(n, 0.0);
        std::fill(column.begin() + static_cast<std::ptrdiff_t>(n * s / stretches),
                  column.begin() + static_cast<std::ptrdiff_t>(n * (s + 1) / stretches), fit.series().interval_s);
        column = fit.filter().apply(fit.as_taken(column));
        double most = 0.0;
        for (const double x : column) most = std::max(most, std::abs(x));
        std::size_t last = n;
        while (last > 0 && std::abs(column[last - 1]) < 1e-5 * most) --last;
        // In a resampled record the response begins with the source's interval before the stretch.
        responses[s].from = n * s / stretches - std::min<std::size_t>(n * s / stretches, 4);
        double sum = 0.0;
        for (std::size_t i = responses[s].from; i < last; ++i) {
            if (!fit.informative()[i]) column[i] = 0.0;
            responses[s].values.push_back(static_cast<float>(column[i]));
            sum += column[i] * fit.innovations()[i];
        }
        right(static_cast<Eigen::Index>(s)) = sum;
        for (Eigen::Index c = 0; c < m; ++c) {
            double product = 0.0;
            const auto& w = own[static_cast<std::size_t>(c)];
            for (std::size_t i = responses[s].from; i < last; ++i) product += column[i] * w[i];
            cross(c, static_cast<Eigen::Index>(s)) = product;
        }
    }
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(k, k);
    for (std::size_t a = 0; a < stretches; ++a) {
        for (std::size_t b = a; b < stretches; ++b) {
            const Response& x = responses[a];
            const Response& y = responses[b];
            const std::size_t last = std::min(x.from + x.values.size(), y.from + y.values.size());
            double sum = 0.0;
            for (std::size_t i = y.from; i < last; ++i)
                sum += static_cast<double>(x.values[i - x.from]) * static_cast<double>(y.values[i - y.from]);
            normal(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b)) = sum;
            normal(static_cast<Eigen::Index>(b), static_cast<Eigen::Index>(a)) = sum;
        }
    }
    return {std::move(normal), cross.transpose() * fit.covariance() * cross, std::move(right)};
}

/// Gain of the log-likelihood by a rate of two states, less the cost of its parameters; the noise is fitted again with
/// it.
double evidence_of_states(const SampleFit& fit, const TwoStates& first) {
    const std::size_t n = fit.series().size();
    const auto stretches = static_cast<std::size_t>(first.expected.size());
    std::vector<double> rate(n);
    for (std::size_t i = 0; i < n; ++i) {
        rate[i] = fit.series().interval_s * first.expected(static_cast<Eigen::Index>(i * stretches / n));
    }
    SampleModel with = fit.model();
    with.columns.push_back({nullptr, "view", std::make_shared<const std::vector<double>>(std::move(rate))});
    SampleModel without = fit.model();
    without.noise = SampleFit(fit.series(), std::move(with), fit.rows(), SampleFit::Noise::near).model().noise;
    const SampleFit without_rate(fit.series(), std::move(without), fit.rows(), SampleFit::Noise::held);
    // Jumps may be within a stretch: stretches are divided while each is correlated with the adjacent ones only.
    constexpr double little = 1e-3;
    std::size_t finer = 4;
    Stretches all = regress_on_stretches(without_rate, finer * stretches);
    while (finer > 1 && all.normal.diagonal(2).cwiseAbs().maxCoeff() > little * all.normal.diagonal().maxCoeff()) {
        finer /= 2;
        all = regress_on_stretches(without_rate, finer * stretches);
    }
    Eigen::VectorXd shape(all.right.size());
    for (Eigen::Index k = 0; k < shape.size(); ++k) {
        shape(k) = (first.expected(k / static_cast<Eigen::Index>(finer)) - first.rate) / first.step;
    }
    return without_rate.gain_over(fit) + two_states(all.normal, all.right, shape).gain -
           options.samples.residual.price_of_states;
}

/// Rates of stretches of the record, for a rate that jumps between two levels.
void test_levels(const SampleFit& fit, SampleResidualTests& tests) {
    const std::size_t stretches = options.samples.residual.level_stretches;
    const Stretches all = regress_on_stretches(fit, stretches);
    const TwoLevels found = two_levels(all.normal - all.of_columns, all.right);
    // Jumps may be within a stretch.
    const double cost = found.cost + options.samples.residual.price_of_jump * found.changes;
    SampleResidualTest test{
        {Where::time, std::string(jumping_rate), found.p_value, fmt::format("{} jumps", found.changes), found.evidence},
        cost,
        [&fit, found] { return Columns{two_level_rate(fit, found.shape)}; }};
    test.jumps = found.changes > 1;  // a single jump is the step of the library
    // With a random rate in the model, stretches are not independent.
    if (test.jumps && !fit.model().walk && !fit.model().flicker) {
        const TwoStates states = two_states(all.normal, all.right, found.shape);
        if (states.step != 0.0) test.refitted = [&fit, states](double) { return evidence_of_states(fit, states); };
    }
    tests.push_back(std::move(test));
}

void test_jumps(const SampleFit& fit, SampleResidualTests& tests) {
    if (const auto jump = jump_with_random_rate(fit)) {
        tests.emplace_back().result = test_of(*jump);
    }
}

}  // namespace

void test_rate_patterns(const SampleFit& fit, SampleResidualTests& tests) {
    test_steps(fit, tests);
    test_powers_of_time(fit, tests);
    test_slow_swings(fit, tests);
    test_settling(fit, tests);
    test_levels(fit, tests);
    test_jumps(fit, tests);
}

}  // namespace ringlock::closure
