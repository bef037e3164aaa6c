// The random part of the fit, by the likelihood of the increments less the deterministic part.
#include <oneapi/tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/fit/motion.hpp"
#include "analysis/closure/samples/fit/simplex.hpp"
#include "analysis/closure/samples/model/lanes.hpp"
#include "analysis/closure/stats/column_regression.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

struct Free {
    double* value;
    bool logarithmic;
    double scale = 1.0;      ///< unit of its steps
    bool of_source = false;  ///< of a resampled record's source
    bool of_clock = false;   ///< of the times at which that source takes its readings
};

constexpr std::size_t whites = 2;    // they are the first of the free parameters
constexpr double negligible = 1e-4;  // ratio to the other white noise below which one has no effect on the fit

std::vector<Free> free_parameters(SampleModel& model) {
    std::vector<Free> all{{&model.noise.angle_arcsec, true}, {&model.noise.rate_arcsec_rt_s, true}};
    if (model.walk) all.push_back({&model.noise.walk_arcsec2_s3, true});
    if (model.flicker) all.push_back({&model.flicker_deg_h, true});
    for (std::size_t k = 0; k < model.resonances.size(); ++k) {
        auto& resonance = model.noise.resonances[k];
        all.push_back({&resonance.arcsec, true});
        // A phase-incoherent line is narrow: its frequency is determined to within its width.
        all.push_back({&resonance.hz, true, std::min(1.0, resonance.width_hz / resonance.hz)});
        all.push_back({&resonance.width_hz, true});
    }
    if (model.noise.sidebands.width_hz > 0.0) {
        SampleNoise::Resonance& sidebands = model.noise.sidebands;
        all.push_back({&sidebands.arcsec, true});
        if (sidebands.hz > 0.0) {
            all.push_back({&sidebands.hz, true, std::min(1.0, sidebands.width_hz / sidebands.hz)});
        }
        all.push_back({&sidebands.width_hz, true});
    }
    if (model.noise.count_error.harmonics > 0) all.push_back({&model.noise.count_error.width_hz, true});
    if (model.noise.swing_hz > 0.0) {
        all.push_back({&model.noise.swing_cos, false});
        all.push_back({&model.noise.swing_sin, false});
    }
    if (model.noise.from_hz > 0.0) {
        all.push_back({&model.noise.from_phase, false, 1.0, true, true});
        if (!model.held_from_hz_sd) all.push_back({&model.from_shift, false, 1.0, true, true});
        all.push_back({&model.noise.blur_arcsec, true, 1.0, true});
    }
    return all;
}

std::vector<double> coordinates_of(SampleModel model) {
    std::vector<double> coordinates;
    for (const Free& parameter : free_parameters(model))
        coordinates.push_back(parameter.logarithmic ? std::log(std::max(*parameter.value, 1e-300)) / parameter.scale
                                                    : *parameter.value);
    return coordinates;
}

/// Parameters without any information must not spoil the errors of the others.
Eigen::MatrixXd inverse_of_information(const Eigen::MatrixXd& information) {
    const Eigen::VectorXd over = information.diagonal().cwiseMax(1e-12).cwiseSqrt().cwiseInverse();
    Eigen::MatrixXd scaled = over.asDiagonal() * information * over.asDiagonal();
    scaled.diagonal().array() += 1e-9;
    const Eigen::MatrixXd inverse = dense::inverse_of_symmetric(scaled);
    return over.asDiagonal() * inverse * over.asDiagonal();
}

}  // namespace

std::vector<SampleNoise::Term> flicker_terms(double deg_h, double shortest_s, double longest_s) {
    // B^2/(2 pi f) by Markov rates. Each has the variance (B^2/pi) ln(ratio), the integral of the density over its
    // band, doubled for both signs. The slowest is nearly constant over the record.
    constexpr int most = 8;
    const double last_s = std::sqrt(10.0) * longest_s;
    const double ratio = std::max(std::sqrt(10.0), std::pow(last_s / shortest_s, 1.0 / (most - 1)));
    std::vector<SampleNoise::Term> terms;
    for (double t = shortest_s; t < 1.001 * last_s && terms.size() < most; t *= ratio) {
        terms.push_back({t, deg_h * deg_h / units::pi * std::log(ratio)});
    }
    return terms;
}

void move_source(SampleModel& model, const SampleSeries& series, double shift_hz) {
    const double duration_s = series.interval_s * static_cast<double>(series.size());
    model.noise.from_hz += shift_hz;
    model.noise.from_phase -= 0.5 * shift_hz * duration_s;
    model.noise.from_phase -= std::floor(model.noise.from_phase);
}

/// White noises from the variance of the residual and the covariance of adjacent rows, as if there were no other noise.
void SampleFit::take_whites(SampleNoise& noise) const {
    const Rows& rows = *rows_;
    double sum = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < rest_.size(); ++i) {
        if (!rows[i]) continue;
        sum += rest_[i];
        count += 1.0;
    }
    const double mean = sum / std::max(count, 1.0);
    double white = 0.0;
    double next = 0.0;
    double pairs = 0.0;
    for (std::size_t i = 1; i < rest_.size(); ++i) {
        if (!rows[i - 1] || !rows[i]) continue;
        white += (rest_[i] - mean) * (rest_[i] - mean);
        next += (rest_[i - 1] - mean) * (rest_[i] - mean);
        pairs += 1.0;
    }
    white /= std::max(pairs, 1.0);
    const double angle = std::clamp(-next / std::max(pairs, 1.0), 1e-3 * white, 0.499 * white);
    noise.angle_arcsec = std::sqrt(angle);
    noise.rate_arcsec_rt_s = std::sqrt((white - 2.0 * angle) * series_->rate_hz);
}

std::vector<double> SampleFit::evaluate(const std::vector<SampleModel>& models, std::span<const double> rest,
                                        const Rows& rows) const {
    check_interrupt();
    std::vector<SampleNoise> noises;
    for (const SampleModel& model : models) noises.push_back(model.noise);
    auto values = SampleFilter::minus_log_likelihoods(noises, series_->interval_s, rest, rows);
    for (double& value : values) value = std::isfinite(value) ? value : 1e300;
    return values;
}

/// The model with its free parameters at x.
SampleModel SampleFit::at(const std::vector<double>& x) const {
    const double duration_s = series_->interval_s * static_cast<double>(series_->size());
    SampleModel model = model_;
    auto free = free_parameters(model);
    for (std::size_t i = 0; i < free.size(); ++i)
        *free[i].value = free[i].logarithmic ? std::exp(x[i] * free[i].scale) : x[i];
    for (std::size_t k = 0; k < model.resonances.size(); ++k) {
        auto& resonance = model.noise.resonances[k];
        const double rate_hz = model.noise.from_hz > 0.0 ? model.noise.from_hz : series_->rate_hz;
        if (resonance.hz > 0.5 * rate_hz || resonance.width_hz > options.samples.fit.widest_resonance * rate_hz) {
            resonance.arcsec = 0.0;
        }
        const bool slow = std::hypot(resonance.hz, 0.5 * resonance.width_hz) < model.motion_from_hz;
        if (slow && is_motion(model.resonances[k].effect)) resonance.arcsec = 0.0;
    }
    if (model.noise.from_hz > 0.0) {
        move_source(model, *series_, 0.1 * model.from_shift / duration_s);
        model.from_shift = 0.0;
    }
    if (model.flicker) model.noise.terms = flicker_terms(model.flicker_deg_h, 4.0 * series_->interval_s, duration_s);
    return model;
}

/// The values of columns are fitted again for each clock of the source, and the derivatives by the clock are projected
/// off the columns (Golub and Pereyra, SIAM Journal on Numerical Analysis 10, 413, 1973; Kaufman, BIT 15, 49, 1975).
SampleFit::ByClock SampleFit::by_clock(const std::vector<double>& x, const Rows& rows,
                                       const std::vector<bool>& held) const {
    constexpr double step = 1e-4;
    ByClock by;
    by.moved.resize(x.size());
    SampleModel own = model_;
    const auto all = free_parameters(own);
    std::vector<std::size_t> free;
    for (std::size_t j = 0; j < all.size(); ++j) {
        if (all[j].of_clock && (held.empty() || !held[j])) free.push_back(j);
    }
    if (free.empty()) {
        by.rest = rest_;
        return by;
    }
    SampleModel model = at(x);
    const SampleFilter filter(model.noise, rest_.size(), series_->interval_s);
    const std::vector<Shared> taken = taken_by(model);
    std::vector<std::vector<double>> whitened;
    for (const Shared& column : taken) whitened.push_back(filter.apply(*column));
    const ColumnRegression regression(whitened, rows);
    by.rest = rest_of(model);
    const Eigen::VectorXd correction = regression.of(filter.apply(by.rest));
    for (std::size_t k = 0; k < taken.size(); ++k) {
        const double more = correction(static_cast<Eigen::Index>(k));
        model.columns[k].value += more;
        for (std::size_t i = 0; i < by.rest.size(); ++i) by.rest[i] -= more * (*taken[k])[i];
    }
    for (const std::size_t j : free) {
        auto shifted = x;
        shifted[j] += step;
        const SampleNoise there = at(shifted).noise;
        SampleModel moved = model;
        moved.noise.from_hz = there.from_hz;
        moved.noise.from_phase = there.from_phase;
        std::vector<double> change = rest_of(moved);
        for (std::size_t i = 0; i < change.size(); ++i) change[i] = (change[i] - by.rest[i]) / step;
        by.moved[j] = regression.freed(filter.apply(change));
    }
    return by;
}

/// Minus the log-likelihood. The columns are fitted again where the record was resampled.
double SampleFit::value_at(const std::vector<double>& x, const Rows& rows) const {
    return evaluate({at(x)}, by_clock(x, rows, {}).rest, rows).front();
}

/// Gradient of the likelihood, with Fisher's information: sum over the rows of (dS/S)(dS/S)'/2 + (dr)(dr)'/S, r the
/// innovations and S their variances (Harvey, "Forecasting, Structural Time Series Models and the Kalman Filter", 1989,
/// section 3.4.5).
SampleFit::Slope SampleFit::slope(const std::vector<double>& x, const Rows& rows, const std::vector<bool>& held) const {
    constexpr double step = 1e-4;
    const std::size_t n = rest_.size();
    const auto m = static_cast<Eigen::Index>(x.size());
    Slope slope;
    slope.gradient = Eigen::VectorXd::Zero(m);
    slope.information = Eigen::MatrixXd::Zero(m, m);
    const ByClock by = by_clock(x, rows, held);
    const SampleStates here(at(x).noise, series_->interval_s);
    std::vector<std::size_t> moves;
    std::vector<SampleStates> moved_there;
    for (std::size_t j = 0; j < x.size(); ++j) {
        if (!held.empty() && held[j]) continue;
        auto shifted = x;
        shifted[j] += step;
        SampleStates there(at(shifted).noise, series_->interval_s);
        if (!there.is_like(here)) continue;  // beyond the end of its range
        moves.push_back(j);
        moved_there.push_back(there);
    }
    // d log(sd) and d(innovation) by each free parameter
    std::vector<std::vector<float>> log_sd(x.size(), std::vector<float>(n, 0.0F));
    std::vector<std::vector<float>> moved(x.size(), std::vector<float>(n, 0.0F));
    const auto parts = std::max<std::size_t>(1, (moves.size() + most_lanes - 2) / (most_lanes - 1));
    oneapi::tbb::parallel_for(std::size_t{0}, parts, [&](std::size_t part) {
        check_interrupt();
        const std::size_t first = part * (most_lanes - 1);
        const std::size_t some = std::min(most_lanes - 1, moves.size() - first);
        std::vector<SampleStates> lanes{here};
        for (std::size_t k = 0; k < some; ++k) lanes.push_back(moved_there[first + k]);
        std::array<double, most_lanes> gradient{};
        double value = 0.0;
        filter_lanes(lanes, by.rest, [&](std::size_t i, const double* e, const double* variances) {
            if (!rows[i]) return;
            const double sd = std::sqrt(variances[0]);
            const double white = e[0] / sd;
            value += 0.5 * white * white + std::log(sd);
            for (std::size_t k = 0; k < some; ++k) {
                const double sd_there = std::sqrt(variances[k + 1]);
                const double of_log = std::log1p((sd_there - sd) / sd) / step;
                const auto& moves_rest = by.moved[moves[first + k]];
                const double of_rest = moves_rest.empty() ? 0.0 : moves_rest[i];
                const double of_e = (e[k + 1] / sd_there - white) / step + of_rest;
                gradient[k] += white * of_e + of_log;
                log_sd[moves[first + k]][i] = static_cast<float>(of_log);
                moved[moves[first + k]][i] = static_cast<float>(of_e + white * of_log);
            }
        });
        if (part == 0) slope.value = value;
        for (std::size_t k = 0; k < some; ++k) {
            slope.gradient(static_cast<Eigen::Index>(moves[first + k])) = gradient[k];
        }
    });
    for (Eigen::Index a = 0; a < m; ++a) {
        for (Eigen::Index b = 0; b <= a; ++b) {
            const auto& la = log_sd[static_cast<std::size_t>(a)];
            const auto& lb = log_sd[static_cast<std::size_t>(b)];
            const auto& ma = moved[static_cast<std::size_t>(a)];
            const auto& mb = moved[static_cast<std::size_t>(b)];
            double sum = 0.0;
            for (std::size_t i = 0; i < n; ++i) {
                sum += 2.0 * static_cast<double>(la[i]) * static_cast<double>(lb[i]) +
                       static_cast<double>(ma[i]) * static_cast<double>(mb[i]);
            }
            slope.information(a, b) = slope.information(b, a) = sum;
        }
    }
    return slope;
}

/// Fisher's scoring, damped (Levenberg and Marquardt): steps by the information while the likelihood increases.
void SampleFit::score_noise(std::vector<double>& x, const Rows& rows, const std::vector<bool>& held) const {
    constexpr double longest = 1.5;
    constexpr double enough = 2e-3;  // of the log-likelihood
    double damping = 1e-3;
    Slope now = slope(x, rows, held);
    for (int round = 0; round < options.samples.fit.most_scorings && damping < 1e7; ++round) {
        bool better = false;
        double gained = 0.0;
        while (!better && damping < 1e7) {
            Eigen::MatrixXd damped = now.information;
            damped.diagonal() *= 1.0 + damping;
            damped.diagonal().array() += 1e-6;
            Eigen::VectorXd step = dense::solve_symmetric(damped, -now.gradient);
            if (!step.allFinite()) break;
            const double most = step.cwiseAbs().maxCoeff();
            if (most > longest) step *= longest / most;
            if (-now.gradient.dot(step) < enough) return;
            auto next = x;
            for (std::size_t i = 0; i < x.size(); ++i) next[i] += step(static_cast<Eigen::Index>(i));
            // Most steps are accepted, so the slope is computed together with the value.
            Slope there = slope(next, rows, held);
            if (there.value < now.value) {
                better = true;
                gained = now.value - there.value;
                x = std::move(next);
                now = std::move(there);
                damping = std::max(1e-6, 0.1 * damping);
            } else {
                damping *= 10.0;
            }
        }
        if (!better || gained < enough) return;
    }
}

/// White noises from the differences of adjacent rows; the errors of readings have that share of their variance.
void SampleFit::share_whites(SampleNoise& noise, double share) const {
    double squares = 0.0;
    double count = 0.0;
    for (std::size_t i = 1; i < rest_.size(); ++i) {
        if (!(*rows_)[i - 1] || !(*rows_)[i]) continue;
        squares += std::pow(rest_[i] - rest_[i - 1], 2);
        count += 1.0;
    }
    squares /= std::max(count, 1.0);
    noise.angle_arcsec = std::sqrt(share * squares / 6.0);
    noise.rate_arcsec_rt_s = std::sqrt((1.0 - share) * squares / (2.0 * series_->interval_s));
}

/// Whether one of the white noises is negligible against the other.
bool SampleFit::gone(const SampleNoise& noise) const {
    const double root_s = std::sqrt(series_->interval_s);
    const double scale = std::hypot(noise.angle_arcsec, noise.rate_arcsec_rt_s * root_s);
    return std::min(noise.angle_arcsec, noise.rate_arcsec_rt_s * root_s) < negligible * scale;
}

/// Raises white noises at zero to a small value: a fit in logarithms cannot leave zero, and has no information there.
void SampleFit::raise_whites(SampleNoise& noise) const {
    constexpr double small = 1e-2;
    const double root_s = std::sqrt(series_->interval_s);
    const double scale = std::hypot(noise.angle_arcsec, noise.rate_arcsec_rt_s * root_s);
    if (noise.angle_arcsec < negligible * scale) noise.angle_arcsec = small * scale;
    if (noise.rate_arcsec_rt_s * root_s < negligible * scale) noise.rate_arcsec_rt_s = small * scale / root_s;
}

/// Free parameters for frequency and width of the resonances that one point has and the other has not.
std::vector<bool> SampleFit::which_are_lost(const std::vector<double>& before, const std::vector<double>& after) const {
    SampleModel own = model_;
    const auto all = free_parameters(own);
    const SampleModel had = at(before);
    const SampleModel has = at(after);
    std::vector<bool> lost(all.size(), false);
    for (std::size_t k = 0; k < own.noise.resonances.size(); ++k) {
        if (!(had.noise.resonances[k].arcsec > 0.0) || has.noise.resonances[k].arcsec > 0.0) continue;
        for (std::size_t i = 0; i < all.size(); ++i) {
            const auto& resonance = own.noise.resonances[k];
            lost[i] = lost[i] || all[i].value == &resonance.hz || all[i].value == &resonance.width_hz;
        }
    }
    return lost;
}

void SampleFit::fit_noise() {
    const bool had_both = !gone(model_.noise);
    raise_whites(model_.noise);
    // The second resonance of a motion starts again as well: a line that was not yet in the model may have left it
    // unused.
    auto& resonances = model_.noise.resonances;
    for (std::size_t k = 1; k < resonances.size(); ++k) {
        const bool of_one_motion = is_motion(model_.resonances[k].effect) && is_motion(model_.resonances[k - 1].effect);
        if (of_one_motion && resonances[k].arcsec < 1e-2 * resonances[k - 1].arcsec) {
            resonances[k] = resonances[k - 1];
            resonances[k].arcsec *= 0.3;
            resonances[k].width_hz *= 3.0;
        }
    }
    std::vector<double> start = coordinates_of(model_);
    const std::size_t n = rest_.size();
    const bool resampled = model_.noise.from_hz > 0.0;
    const bool narrow = !model_.resonances.empty();
    if (!resampled) {
        // An effect that was added last may have been most of the noise; far from the maximum the likelihood is flat.
        SampleModel anew = model_;
        take_whites(anew.noise);
        double least = evaluate({at(start)}, rest_, *rows_).front();
        const auto try_from = [&](const SampleModel& model) {
            auto other = coordinates_of(model);
            const double value = evaluate({at(other)}, rest_, *rows_).front();
            if (!(value < least)) return;
            least = value;
            start = std::move(other);
        };
        try_from(anew);
        // With a random rate in the model, adjacent rows are correlated and hide the white noises; differences show
        // them.
        for (const double share : {0.05, 0.5, 0.95}) {
            if (!model_.walk && !model_.flicker) break;
            share_whites(anew.noise, share);
            try_from(anew);
        }
    }
    std::vector<double> as_it_was = start;
    if (!searched_ && (resampled || narrow)) {
        // The likelihood may have several maxima. A simplex searches a part of the record first, and starts again from
        // its result until that gains nothing, since it may have degenerated. With a source, only its clock, its blur
        // and the white noises are searched; the other parameters keep their values.
        const std::size_t part = std::min<std::size_t>(n, resampled ? 15000 : 20000);
        std::vector<std::size_t> turned;
        const std::vector<Free> own = free_parameters(model_);
        for (std::size_t i = 0; i < own.size(); ++i) {
            if (!resampled || own[i].of_source || i < whites) turned.push_back(i);
        }
        const auto with = [&](const Point& some) {
            Point all = start;
            for (std::size_t k = 0; k < turned.size(); ++k) all[turned[k]] = some[k];
            return all;
        };
        const auto on_part = [&](const std::vector<Point>& points) {
            std::vector<SampleModel> models;
            for (const Point& some : points) models.push_back(at(with(some)));
            return evaluate(models, std::span<const double>(rest_.data(), part), *rows_);
        };
        Point some;
        for (const std::size_t i : turned) some.push_back(start[i]);
        const int steps = 18 * static_cast<int>(some.size());
        double value = on_part({some}).front();
        for (int i = 0; i < options.samples.fit.most_searches; ++i) {
            some = smallest(on_part, some, 0.3, steps);
            const double now = on_part({some}).front();
            if (value - now < options.samples.fit.searched_again) break;
            value = now;
        }
        start = with(some);
    }
    score_noise(start, *rows_, {});
    if (!resampled && had_both && gone(at(start).noise)) {
        // Where one of the white noises goes to zero, there may be another maximum with both.
        SampleModel both = at(start);
        share_whites(both.noise, 0.5);
        auto other = coordinates_of(both);
        score_noise(other, *rows_, {});
        const auto values = evaluate({at(start), at(other)}, rest_, *rows_);
        if (values[1] < values[0]) start = std::move(other);
    }
    // A resonance that leaves its range does not return.
    const std::vector<bool> lost = which_are_lost(as_it_was, start);
    if (std::find(lost.begin(), lost.end(), true) != lost.end()) {
        score_noise(as_it_was, *rows_, lost);
        if (value_at(as_it_was, *rows_) < value_at(start, *rows_)) start = std::move(as_it_was);
    }
    if (resampled) {
        // Deterministic rows determine the source's times so precisely that rounding of numbers there outweighs the
        // information of all other rows on the noise. The noise is therefore fitted once more to the informative rows.
        model_ = at(start);
        filter_by(model_.noise);
        fit_columns();
        start = coordinates_of(model_);
        std::vector<bool> held;
        for (const Free& parameter : free_parameters(model_)) held.push_back(parameter.of_source);
        auto scored = start;
        score_noise(scored, informative_, held);
        const auto values = evaluate({at(scored), at(start)}, rest_, *rows_);
        if (values[0] < values[1]) start = std::move(scored);
    }
    model_ = at(start);
    filter_by(model_.noise);
}

SampleModel SampleFit::noise_errors() const {
    SampleModel errors = model_;
    SampleModel values = model_;
    raise_whites(values.noise);
    const std::vector<double> x = coordinates_of(values);
    const auto own = free_parameters(values);
    Eigen::MatrixXd information = slope(x, informative_, {}).information;
    if (model_.noise.from_hz > 0.0) {
        // The source's times and the deviation of its readings from straight lines are determined by the deterministic
        // rows as well. That deviation is correlated with the white angle.
        const Eigen::MatrixXd by_all = slope(x, *rows_, {}).information;
        for (std::size_t a = 0; a < x.size(); ++a) {
            for (std::size_t b = 0; b < x.size(); ++b) {
                const auto i = static_cast<Eigen::Index>(a);
                const auto j = static_cast<Eigen::Index>(b);
                if (own[a].of_clock != own[b].of_clock) information(i, j) = 0.0;
                if (own[a].of_source && own[b].of_source) information(i, j) = by_all(i, j);
            }
        }
    }
    Eigen::MatrixXd covariance = inverse_of_information(information);
    for (std::size_t a = 0; a < x.size(); ++a) {
        // A parameter at zero, its lower bound, is not correlated with the others.
        const auto i = static_cast<Eigen::Index>(a);
        if (own[a].of_clock || !own[a].of_source || !(std::sqrt(covariance(i, i)) > options.samples.fit.log_sd_at_zero))
            continue;
        const double own_information = information(i, i);
        information.row(i).setZero();
        information.col(i).setZero();
        information(i, i) = own_information;
        covariance = inverse_of_information(information);
    }
    const auto slots = free_parameters(errors);
    for (std::size_t i = 0; i < slots.size(); ++i) {
        const auto k = static_cast<Eigen::Index>(i);
        double sd = std::sqrt(std::max(0.0, covariance(k, k)));
        if (own[i].logarithmic) {
            sd *= own[i].scale * *own[i].value;
            // Near zero the record determines the square of the value, with the error 2 value sd.
            if (sd > *own[i].value) sd = std::sqrt(2.0 * *own[i].value * sd);
        }
        *slots[i].value = sd;
    }
    const double duration_s = series_->interval_s * static_cast<double>(series_->size());
    if (model_.noise.from_hz > 0.0) {
        errors.noise.from_hz = model_.held_from_hz_sd.value_or(0.1 * errors.from_shift / duration_s);
    }
    return errors;
}

}  // namespace ringlock::closure
