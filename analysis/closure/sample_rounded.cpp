#include "analysis/closure/sample_rounded.hpp"

#include <algorithm>
#include <boost/random/mersenne_twister.hpp>
#include <boost/random/normal_distribution.hpp>
#include <cmath>
#include <utility>

#include "analysis/closure/sample_unrounding.hpp"

namespace ringlock::closure {

namespace {

double variance_of_steps(double step_arcsec) { return step_arcsec * step_arcsec / 12.0; }

}  // namespace

void RoundedSamples::restore() {
    series_.increment = measured_;
    step_ = 0.0;
    draws_ = 0;
}

bool RoundedSamples::show(const SampleFit& fit, double step_arcsec) {
    if (!(step_arcsec > 0.0) || fit.model().noise.from_hz > 0.0) return false;
    const double sd = fit.sd(fit.series().size() / 2);
    return rounding_shows(step_arcsec, std::sqrt(std::max(0.0, sd * sd - variance_of_steps(step_arcsec))));
}

std::shared_ptr<SampleFit> RoundedSamples::begin(const SampleFit& fit, double step_arcsec) {
    constexpr int rounds = 4;
    constexpr int draws = 3;
    constexpr double least = 0.02;
    step_ = step_arcsec;
    SampleModel model = fit.model();
    double& angle = model.noise.angle_arcsec;
    angle = std::sqrt(std::max(angle * angle - variance_of_steps(step_), least * least * step_ * step_));
    auto now = std::make_shared<SampleFit>(series_, std::move(model), fit.rows(), SampleFit::Noise::held);
    for (int round = 0; round < rounds; ++round) now = draw(with_likeliest_readings(*now), draws);
    if (foretells_as_said(*now)) return now;
    restore();
    return nullptr;
}

std::shared_ptr<SampleFit> RoundedSamples::draw(std::shared_ptr<SampleFit> fit, int rounds) {
    for (int round = 0; round < rounds; ++round) {
        series_.increment = unround(*fit, measured_, step_, ++draws_);
        fit = std::make_shared<SampleFit>(series_, fit->model(), fit->rows(), SampleFit::Noise::near);
    }
    return fit;
}

/// Log-likelihood of the rounded increments by the model, with one of its noises that many times less and more.
RoundedSamples::Parabola RoundedSamples::along(const SampleFit& fit, double SampleNoise::*noise) const {
    const auto likelihood = [&](double times) {
        SampleModel model = fit.model();
        model.noise.*noise *= times;
        const SampleFit of(series_, std::move(model), fit.rows(), SampleFit::Noise::held);
        return score_of(of, of.rows()).log_likelihood;
    };
    const double less = likelihood(1.0 / times_along);
    const double here = likelihood(1.0);
    const double more = likelihood(times_along);
    return {0.5 * (more - less), 2.0 * here - less - more};
}

/// Draws hardly move a noise of the readings that is small beside their steps: it is put where it makes the rounded
/// increments most probable.
std::shared_ptr<SampleFit> RoundedSamples::with_likeliest_readings(const SampleFit& fit) const {
    constexpr double most = 2.0;
    const Parabola of = along(fit, &SampleNoise::angle_arcsec);
    const double powers = of.bend > 0.0 ? of.slope / of.bend : std::copysign(most, of.slope);
    SampleModel model = fit.model();
    model.noise.angle_arcsec *= std::pow(times_along, std::clamp(powers, -most, most));
    return std::make_shared<SampleFit>(series_, std::move(model), fit.rows(), SampleFit::Noise::held);
}

/// Whether the rounded increments are off what is foretold of them by as much as that says. Beside steps that are very
/// large too few of the filters hit the moments at which the angle crosses them.
bool RoundedSamples::foretells_as_said(const SampleFit& fit) const {
    constexpr double about = 0.08;
    const SampleScore score = score_of(fit, fit.rows());
    return std::abs(score.error / score.floor - 1.0) < about;
}

SampleScore RoundedSamples::score_of(const SampleFit& fit, const Rows& reported) const {
    const Foretold foretold = foretell_rounded(fit, measured_, step_);
    SampleScore score;
    double count = 0.0;
    for (std::size_t i = 0; i < reported.size(); ++i) {
        if (fit.rows()[i]) score.log_likelihood += foretold.log_probability[i];
        if (!reported[i]) continue;
        score.error += std::pow(measured_[i] - foretold.mean[i], 2);
        score.floor += foretold.variance[i];
        score.log_score += foretold.log_probability[i] - std::log(step_);
        count += 1.0;
    }
    score.error = std::sqrt(score.error / std::max(count, 1.0));
    score.floor = std::sqrt(score.floor / std::max(count, 1.0));
    return score;
}

SampleFigures RoundedSamples::figures_of(const SampleFit& fit,
                                         const std::function<SampleFigures(const SampleFit&)>& figures) {
    constexpr int several = 8;
    boost::random::mt19937_64 generator(1);
    boost::random::normal_distribution<double> normal;
    const auto moved = [&](double value, double sd) {
        // What is hardly known at all would be anywhere.
        return value * std::exp(std::min(sd / value, 0.5) * normal(generator));
    };
    std::vector<SampleFigures> all;
    SampleFit whole = fit;
    for (int k = 0; k < several; ++k) {
        SampleModel model = whole.model();
        const SampleNoise errors = whole.noise_errors().noise;
        model.noise.angle_arcsec = moved(model.noise.angle_arcsec, errors.angle_arcsec);
        model.noise.rate_arcsec_rt_s = moved(model.noise.rate_arcsec_rt_s, errors.rate_arcsec_rt_s);
        const SampleFit by(series_, std::move(model), fit.rows(), SampleFit::Noise::held);
        series_.increment = unround(by, measured_, step_, ++draws_);
        whole = SampleFit(series_, whole.model(), fit.rows(), SampleFit::Noise::near);
        all.push_back(figures(whole));
    }
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
    // Draws that follow one another are alike: the white noises are as uncertain as the likelihood of what was rounded
    // says.
    for (Estimate& estimate : mean.base) {
        const bool angle = estimate.name == "white_angle_arcsec";
        if (!angle && estimate.name != "white_rate_deg_rt_h") continue;
        const double bend = along(fit, angle ? &SampleNoise::angle_arcsec : &SampleNoise::rate_arcsec_rt_s).bend;
        if (bend > 0.0) estimate.sd = std::max(estimate.sd, estimate.value * std::log(times_along) / std::sqrt(bend));
    }
    return mean;
}

}  // namespace ringlock::closure
