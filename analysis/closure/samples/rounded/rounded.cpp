#include "analysis/closure/samples/rounded/rounded.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

double variance_of_steps(double step_arcsec) { return step_arcsec * step_arcsec / 12.0; }

}  // namespace

void RoundedSamples::restore() {
    series_.increment = measured_;
    step_ = 0.0;
    draws_ = 0;
    maximum_.reset();
    wandering_.reset();
}

bool RoundedSamples::show(const SampleFit& fit, double step_arcsec) {
    if (!(step_arcsec > 0.0) || fit.model().noise.from_hz > 0.0) return false;
    const double sd = fit.typical_sd();
    return rounding_shows(step_arcsec, std::sqrt(std::max(0.0, sd * sd - variance_of_steps(step_arcsec))));
}

std::shared_ptr<SampleFit> RoundedSamples::begin(const SampleFit& fit, double step_arcsec) {
    const SampleRoundedOptions& of = options.samples.rounded;
    const double least = of.least_angle_noise;
    step_ = step_arcsec;
    SampleModel model = fit.model();
    double& angle = model.noise.angle_arcsec;
    angle = std::sqrt(std::max(angle * angle - variance_of_steps(step_), least * least * step_ * step_));
    SampleFit now(series_, std::move(model), fit.rows(), SampleFit::Noise::held);
    // The noise of the rate may contain the error of rounding between two steps of the values.
    filters_ = filters_for(step_, now.sd(measured_.size() / 2));
    maximum_ = towards_maximum(now, rounded(), of.first_look, of.steps_at_start);
    wandering_.reset();
    const SampleFit there(series_, maximum_->model, fit.rows(), SampleFit::Noise::all_held);
    filters_ = filters_for(step_, there.sd(measured_.size() / 2));
    auto drawn = draw_by(maximum_->model, maximum_->model, fit.rows());
    for (int round = 0; round < of.rounds_at_start; ++round) drawn = draw(std::move(drawn), of.draws_a_round);
    return drawn;
}

std::shared_ptr<SampleFit> RoundedSamples::draw_by(const SampleModel& drawing, const SampleModel& model,
                                                   const Rows& rows) {
    const SampleFit by(series_, drawing, rows, SampleFit::Noise::all_held);
    series_.increment = impute(by, rounded(), ++draws_);
    return std::make_shared<SampleFit>(series_, model, rows, SampleFit::Noise::near);
}

std::shared_ptr<SampleFit> RoundedSamples::draw(std::shared_ptr<SampleFit> fit, int rounds) {
    for (int round = 0; round < rounds; ++round) fit = draw_by(fit->model(), fit->model(), fit->rows());
    const SampleModel drawing = likeliest(*fit);
    const bool with_walk = drawing.walk && !fit->model().walk;
    return draw_by(drawing, with_walk ? fit->model() : drawing, fit->rows());
}

/// Growth of the variance of a random walk of the rate, from the differences between means of successive stretches;
/// zero where white noise alone may cause them.
double RoundedSamples::wander(const SampleFit& fit) const {
    constexpr std::size_t stretches = options.samples.rounded.stretches;
    const std::vector<double> known = fit.determined();
    const std::size_t length = measured_.size() / stretches;
    const double length_s = series_.interval_s * static_cast<double>(length);
    double before = 0.0;
    double squares = 0.0;
    for (std::size_t k = 0; k < stretches; ++k) {
        double sum = 0.0;
        for (std::size_t i = k * length; i < (k + 1) * length; ++i) sum += measured_[i] - known[i];
        if (k > 0) squares += std::pow((sum - before) / length_s, 2) / static_cast<double>(stretches - 1);
        before = sum;
    }
    const SampleNoise& noise = fit.model().noise;
    const double of_readings = noise.angle_arcsec * noise.angle_arcsec + variance_of_steps(step_);
    const double white =
        2.0 * noise.rate_arcsec_rt_s * noise.rate_arcsec_rt_s / length_s + 6.0 * of_readings / (length_s * length_s);
    return squares > options.samples.rounded.wanders * white ? 1.5 * squares / length_s : 0.0;
}

/// Imputations follow the noise of the model. Where the model lacks a slow rate, and a random walk, which follows that
/// rate, makes the increments likelier by far, they are imputed with the walk.
SampleModel RoundedSamples::likeliest(const SampleFit& fit) {
    maximum_ = find_maximum(fit, rounded(), options.samples.rounded.most_steps, near(fit.model()));
    const double walk = fit.model().walk || fit.model().flicker ? 0.0 : wander(fit);
    if (walk == 0.0) return maximum_->model;
    SampleModel walking = maximum_->model;
    walking.walk = true;
    walking.noise.walk_arcsec2_s3 = walk;
    const SampleFit start(series_, std::move(walking), fit.rows(), SampleFit::Noise::all_held);
    wandering_ = towards_maximum(start, rounded(), measured_.size(), options.samples.rounded.steps_with_walk,
                                 wandering_ ? &*wandering_ : nullptr);
    return wandering_->log_likelihood > maximum_->log_likelihood + options.samples.rounded.drawn_with_walk
               ? wandering_->model
               : maximum_->model;
}

const RoundedMaximum* RoundedSamples::near(const SampleModel& model) const {
    if (model.walk && wandering_ && !(maximum_ && maximum_->model.walk)) return &*wandering_;
    return maximum_ ? &*maximum_ : nullptr;
}

ResidualTest RoundedSamples::test(const SampleFit& fit) const {
    const Prediction predicted = predict_rounded(fit, rounded());
    double off = 0.0;
    double said = 0.0;
    double of_squares = 0.0;
    for (std::size_t i = 0; i < measured_.size(); ++i) {
        if (!fit.rows()[i]) continue;
        const double variance = predicted.variance[i];
        off += std::pow(measured_[i] - predicted.mean[i], 2);
        said += variance;
        of_squares += predicted.fourth_moment[i] - variance * variance;
    }
    const double z =
        (std::abs(off - said) - options.samples.rounded.filters_off * said) / std::sqrt(std::max(of_squares, 1e-300));
    return {Where::amplitude, "rounded increments against their prediction", z > 0.0 ? chi2_tail(z * z, 1) : 1.0,
            fmt::format("{:.3g} times the predicted rms", std::sqrt(off / std::max(said, 1e-300)))};
}

SampleScore RoundedSamples::score_of(const SampleFit& fit, const Rows& reported) const {
    const Prediction predicted = predict_rounded(fit, rounded());
    SampleScore score;
    double count = 0.0;
    for (std::size_t i = 0; i < reported.size(); ++i) {
        if (fit.rows()[i]) score.log_likelihood += predicted.log_probability[i];
        if (!reported[i]) continue;
        score.error += std::pow(measured_[i] - predicted.mean[i], 2);
        score.floor += predicted.variance[i];
        score.log_score += predicted.log_probability[i] - std::log(step_);
        count += 1.0;
    }
    score.error = std::sqrt(score.error / std::max(count, 1.0));
    score.floor = std::sqrt(score.floor / std::max(count, 1.0));
    return score;
}

SampleFigures RoundedSamples::figures_of(const SampleFit& fit,
                                         const std::function<SampleFigures(const SampleFit&)>& figures) {
    constexpr int several = options.samples.rounded.draws_of_figures;
    maximum_ = find_maximum(fit, rounded(), options.samples.rounded.steps_of_figures, near(fit.model()));
    const RoundedMaximum& maximum = *maximum_;
    std::vector<SampleFigures> all;
    for (int k = 0; k < several; ++k) all.push_back(figures(*draw_by(maximum.model, maximum.model, fit.rows())));
    SampleFigures mean = all.front();
    const auto combine = [&](const auto& of) {
        double sum = 0.0;
        double squares = 0.0;
        double within = 0.0;
        for (SampleFigures& one : all) {
            sum += of(one).value / several;
            within += of(one).sd * of(one).sd / several;
        }
        for (SampleFigures& one : all) squares += std::pow(of(one).value - sum, 2) / (several - 1);
        of(mean).value = sum;
        of(mean).sd = std::sqrt(within + (1.0 + 1.0 / several) * squares);
    };
    for (std::size_t k = 0; k < mean.base.size(); ++k) {
        combine([k](SampleFigures& of) -> Estimate& { return of.base[k]; });
    }
    for (std::size_t s = 0; s < mean.steps.size(); ++s) {
        for (std::size_t k = 0; k < mean.steps[s].size(); ++k) {
            combine([s, k](SampleFigures& of) -> Estimate& { return of.steps[s][k]; });
        }
    }
    // Imputations by one model differ less than models that are nearly as likely.
    const SampleNoise& noise = maximum.model.noise;
    const auto known_to = [&](Estimate& estimate, double value, std::size_t of) {
        if (!std::isfinite(maximum.noise_log_sd[of])) return;
        estimate.value = value;
        estimate.sd = std::max(estimate.sd, value * maximum.noise_log_sd[of]);
    };
    for (Estimate& estimate : mean.base) {
        if (estimate.name == "mean_rate_deg_h") estimate.sd *= maximum.column_times.front();
        if (estimate.name == "white_angle_arcsec") known_to(estimate, noise.angle_arcsec, 0);
        if (estimate.name == "white_rate_deg_rt_h") {
            known_to(estimate, noise.rate_arcsec_rt_s * units::deg_rt_h_per_arcsec_rt_s, 1);
        }
    }
    for (std::size_t s = 0; s < mean.steps.size(); ++s) {
        for (Estimate& estimate : mean.steps[s]) {
            double times = 1.0;
            for (std::size_t k = 0; k < maximum.column_times.size(); ++k) {
                const effects::Effect* effect = maximum.model.columns[k].effect;
                const bool same = effect != nullptr && effect->name() == estimate.effect;
                if (same) times = std::max(times, maximum.column_times[k]);
            }
            estimate.sd *= times;
            const effects::Effect* effect = effects::find(estimate.effect);
            if (effect == nullptr) continue;
            if (on_samples(*effect) == OnSamples::flicker) known_to(estimate, maximum.model.flicker_deg_h, 2);
            if (on_samples(*effect) == OnSamples::walk) known_to(estimate, deviation_of_walk(*effect, noise), 2);
        }
    }
    return mean;
}

}  // namespace ringlock::closure
