#include "analysis/closure/samples/rounded/maximum.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "engine/core/dense.hpp"

namespace ringlock::closure {

namespace {

/// A step of at most so many standard errors is the last.
constexpr double little = 0.5;

class Maximisation {
   public:
    Maximisation(const SampleFit& fit, const RoundedIncrements& rounded, std::size_t until, const RoundedMaximum* near)
        : fit_(fit), rounded_(rounded), until_(until), model_(fit.model()) {
        here_ = at(model_);
        log_length_ = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(noises()), first_log);
        measure_roughness();
        if (near != nullptr) begin_near(*near);
    }
    const SampleModel& model() const { return model_; }
    double log_likelihood() const { return here_; }

    /// Moves all noises by one parabola; returns the distance in standard errors.
    double maximise_over_noises();
    const std::vector<double>& noise_log_sd() const { return noise_log_sd_; }
    /// Moves the columns, by one parabola for each direction that would be independent of the others if the increments
    /// were known; returns the distance in standard errors.
    double maximise_over_columns();
    const std::vector<double>& column_times() const { return column_times_; }

   private:
    static constexpr double first_log = 0.33;
    static constexpr double least_off = 0.7;

    double at(const SampleModel& model) const {
        const SampleFit of(fit_.series(), model, fit_.rows(), SampleFit::Noise::all_held);
        return log_likelihood_of_rounded(of, rounded_, until_);
    }
    std::vector<double> at(const std::vector<SampleModel>& models) const {
        std::vector<double> values(models.size());
        oneapi::tbb::parallel_for(std::size_t{0}, models.size(), [&](std::size_t k) { values[k] = at(models[k]); });
        return values;
    }
    void measure_roughness();
    void begin_near(const RoundedMaximum& maximum);
    bool random() const { return model_.walk || model_.flicker; }
    std::size_t noises() const {
        return (random() ? 3U : 2U) + model_.noise.resonances.size() + (model_.motion.empty() ? 0U : 1U);
    }
    /// The noises with their logarithms moved by `lengths` in units of log_length_.
    SampleModel with_noises(const Eigen::VectorXd& lengths) const;
    SampleModel with_columns(const Eigen::VectorXd& moved) const;
    void maximise_to(SampleModel&& model, double log_likelihood) {
        model_ = std::move(model);
        here_ = log_likelihood;
    }

    const SampleFit& fit_;
    const RoundedIncrements rounded_;
    const std::size_t until_;
    SampleModel model_;
    double here_ = 0.0;
    double off_by_ = least_off;  ///< typical error of a difference of log-likelihoods
    double wanted_bend_ = 0.0;   ///< curvature over a length
    Eigen::VectorXd log_length_;
    std::vector<double> noise_log_sd_, column_times_;
};

/// The log-likelihood of the filters is rough: it varies between nearly equal models, most of all with strong random
/// rates.
void Maximisation::measure_roughness() {
    constexpr double nothing = 0.005;  // lengths
    constexpr double most_off = 4.0;
    constexpr double bends = 8.0;
    const auto all = Eigen::VectorXd::Constant(log_length_.size(), nothing);
    const auto values = at({with_noises(all), with_noises(-all)});
    const double rms = std::sqrt(0.5 * (std::pow(values[0] - here_, 2) + std::pow(values[1] - here_, 2)));
    off_by_ = std::clamp(1.5 * rms, least_off, most_off);
    wanted_bend_ = bends * off_by_;
}

void Maximisation::begin_near(const RoundedMaximum& maximum) {
    constexpr double least_log = 0.02;
    for (Eigen::Index i = 0; i < log_length_.size(); ++i) {
        if (static_cast<std::size_t>(i) >= maximum.noise_log_sd.size()) break;
        const double sd = maximum.noise_log_sd[static_cast<std::size_t>(i)];
        log_length_(i) = std::clamp(std::sqrt(wanted_bend_) * sd, least_log, first_log);
    }
    const SampleModel& other = maximum.model;
    if (other.walk != model_.walk || other.flicker != model_.flicker) return;
    if (other.noise.terms.size() != model_.noise.terms.size()) return;
    const bool same_resonances =
        std::ranges::equal(other.resonances, model_.resonances, {}, &ResonanceOwner::effect, &ResonanceOwner::effect);
    if (!same_resonances || other.motion.size() != model_.motion.size()) return;
    SampleModel model = model_;
    model.noise.angle_arcsec = other.noise.angle_arcsec;
    model.noise.rate_arcsec_rt_s = other.noise.rate_arcsec_rt_s;
    model.noise.walk_arcsec2_s3 = other.noise.walk_arcsec2_s3;
    model.noise.terms = other.noise.terms;
    model.noise.resonances = other.noise.resonances;
    model.motion = other.motion;
    model.flicker_deg_h = other.flicker_deg_h;
    const double there = at(model);
    if (there > here_) maximise_to(std::move(model), there);
}

SampleModel Maximisation::with_noises(const Eigen::VectorXd& lengths) const {
    const Eigen::VectorXd times = lengths.cwiseProduct(log_length_).array().exp();
    SampleModel model = model_;
    model.noise.angle_arcsec *= times(0);
    model.noise.rate_arcsec_rt_s *= times(1);
    Eigen::Index next = random() ? 3 : 2;
    for (auto& resonance : model.noise.resonances) resonance.arcsec *= times(next++);
    if (!model.motion.empty())
        Eigen::Map<Eigen::VectorXd>(model.motion.data(), static_cast<Eigen::Index>(model.motion.size())) *= times(next);
    if (!random()) return model;
    model.noise.walk_arcsec2_s3 *= times(2) * times(2);
    model.flicker_deg_h *= times(2);
    for (auto& term : model.noise.terms) term.variance_arcsec2_s2 *= times(2) * times(2);
    return model;
}

SampleModel Maximisation::with_columns(const Eigen::VectorXd& moved) const {
    SampleModel model = model_;
    for (std::size_t k = 0; k < model.columns.size(); ++k) {
        model.columns[k].value += moved(static_cast<Eigen::Index>(k));
    }
    return model;
}

double Maximisation::maximise_over_noises() {
    constexpr double most = 2.0;  // lengths
    constexpr double softest = 0.25;
    constexpr double part = 0.01;
    constexpr int halvings = 2;
    const auto m = static_cast<Eigen::Index>(noises());
    const auto axis = [m](Eigen::Index i) { return Eigen::VectorXd::Unit(m, i); };
    Eigen::VectorXd slope(m);
    Eigen::VectorXd more(m);
    Eigen::MatrixXd bend = Eigen::MatrixXd::Zero(m, m);
    std::vector<SampleModel> shifted;
    for (Eigen::Index i = 0; i < m; ++i) {
        shifted.push_back(with_noises(axis(i)));
        shifted.push_back(with_noises(-axis(i)));
    }
    for (Eigen::Index i = 0; i < m; ++i) {
        for (Eigen::Index j = 0; j < i; ++j) shifted.push_back(with_noises(axis(i) + axis(j)));
    }
    const auto values = at(shifted);
    for (Eigen::Index i = 0; i < m; ++i) {
        more(i) = values[2 * static_cast<std::size_t>(i)];
        const double less = values[2 * static_cast<std::size_t>(i) + 1];
        slope(i) = 0.5 * (more(i) - less);
        bend(i, i) = 2.0 * here_ - less - more(i);
        if (std::abs(slope(i)) < off_by_ && std::abs(bend(i, i)) < 2.0 * off_by_) slope(i) = bend(i, i) = 0.0;
    }
    auto both = values.begin() + 2 * m;
    for (Eigen::Index i = 0; i < m; ++i) {
        for (Eigen::Index j = 0; j < i; ++j, ++both) {
            if (bend(i, i) <= 0.0 || bend(j, j) <= 0.0) continue;
            const double cross = more(i) + more(j) - here_ - *both;
            const double most_cross = 0.95 * std::sqrt(bend(i, i) * bend(j, j));
            bend(i, j) = bend(j, i) = std::clamp(cross, -most_cross, most_cross);
        }
    }
    const dense::SymmetricEigen axes = dense::symmetric_eigen(bend);
    Eigen::VectorXd lengths = Eigen::VectorXd::Zero(m);
    Eigen::VectorXd variance = Eigen::VectorXd::Zero(m);  // lengths^2
    for (Eigen::Index j = 0; j < m; ++j) {
        const auto along = axes.vectors.col(j);
        const double bends = axes.values(j);
        // Where the curvature is not that of a maximum, the step is still uphill.
        const double stiff = std::max(std::abs(bends), softest);
        lengths += std::clamp(slope.dot(along) / stiff, -most, most) * along;
        for (Eigen::Index i = 0; i < m; ++i) {
            const double share = along(i) * along(i);
            if (bends > softest) variance(i) += share / bends;
            if (bends <= softest && share > part) variance(i) = std::numeric_limits<double>::infinity();
        }
    }
    noise_log_sd_.assign(static_cast<std::size_t>(m), 0.0);
    Eigen::VectorXd::Map(noise_log_sd_.data(), m) = variance.cwiseSqrt().cwiseProduct(log_length_);
    double furthest = 0.0;
    for (int k = 0; k <= halvings; ++k, lengths *= 0.5) {
        SampleModel next = with_noises(lengths);
        const double there = at(next);
        if (there < here_ - off_by_) continue;
        maximise_to(std::move(next), there);
        furthest = lengths.cwiseAbs().cwiseQuotient(variance.cwiseSqrt().cwiseMin(0.5)).maxCoeff();
        break;
    }
    for (Eigen::Index i = 0; i < m; ++i) {
        if (bend(i, i) <= 0.0) continue;
        const double length = std::min(log_length_(i) * std::sqrt(wanted_bend_ / bend(i, i)), first_log);
        // The parabola extended over too many standard errors: repeat with a shorter one.
        if (length < 0.4 * log_length_(i)) furthest = std::max(furthest, 1.0);
        log_length_(i) = length;
    }
    return furthest;
}

double Maximisation::maximise_over_columns() {
    constexpr double first_length = 3.0;  // standard errors with known increments
    constexpr int doublings = 3;
    const double enough = 5.0 * off_by_;
    constexpr double reach = 3.0;
    const Eigen::MatrixXd& known = fit_.covariance();
    const Eigen::Index m = known.rows();
    const Eigen::VectorXd scale = known.diagonal().cwiseMax(1e-300).cwiseSqrt();
    const Eigen::MatrixXd correlation = scale.cwiseInverse().asDiagonal() * known * scale.cwiseInverse().asDiagonal();
    // Independent directions nearest to the columns: steps hide the amplitude of a line, and not the mean rate.
    const dense::SymmetricEigen axes = dense::symmetric_eigen(correlation);
    const Eigen::MatrixXd root =
        axes.vectors * axes.values.cwiseMax(0.0).cwiseSqrt().asDiagonal() * axes.vectors.transpose();
    struct Along {
        Eigen::VectorXd direction;
        double length;
        double slope = 0.0, bend = 0.0;
    };
    Eigen::MatrixXd rounded = Eigen::MatrixXd::Zero(m, m);
    Eigen::VectorXd moved = Eigen::VectorXd::Zero(m);
    double furthest = 0.0;
    std::vector<Along> all;
    for (Eigen::Index j = 0; j < m; ++j) all.push_back({scale.asDiagonal() * root.col(j), first_length});
    // Longer where the increments carry little information
    for (int k = 0; k <= doublings; ++k) {
        std::vector<Along*> open;
        std::vector<SampleModel> shifted;
        for (Along& along : all) {
            if (along.bend * along.length * along.length > enough) continue;
            if (k > 0) along.length *= 2.0;
            open.push_back(&along);
            shifted.push_back(with_columns(along.length * along.direction));
            shifted.push_back(with_columns(-along.length * along.direction));
        }
        const auto values = at(shifted);
        for (std::size_t i = 0; i < open.size(); ++i) {
            const double more = values[2 * i];
            const double less = values[2 * i + 1];
            open[i]->slope = 0.5 * (more - less) / open[i]->length;
            open[i]->bend = (2.0 * here_ - more - less) / (open[i]->length * open[i]->length);
        }
    }
    for (const Along& along : all) {
        // A curvature below the error of the likelihood is not measured.
        const double bend = std::max(along.bend, 2.0 * off_by_ / (along.length * along.length));
        moved += std::clamp(along.slope / bend, -reach * along.length, reach * along.length) * along.direction;
        furthest = std::max(furthest, std::abs(along.slope) / std::sqrt(bend));
        // Rounding loses information and does not add any.
        rounded += along.direction * along.direction.transpose() / std::min(bend, 1.0);
    }
    bool higher = false;
    for (int k = 0; k < 3 && !higher; ++k, moved *= 0.5) {
        SampleModel next = with_columns(moved);
        const double there = at(next);
        higher = there > here_ - off_by_;
        if (higher) maximise_to(std::move(next), there);
    }
    if (!higher) furthest = 0.0;
    column_times_.clear();
    for (Eigen::Index a = 0; a < m; ++a) {
        column_times_.push_back(std::max(1.0, std::sqrt(rounded(a, a) / std::max(known(a, a), 1e-300))));
    }
    return furthest;
}

}  // namespace

RoundedMaximum towards_maximum(const SampleFit& fit, const RoundedIncrements& rounded, std::size_t until,
                               int most_rounds, const RoundedMaximum* near) {
    Maximisation maximise(fit, rounded, until, near);
    for (int round = 0; round < most_rounds; ++round) {
        if (maximise.maximise_over_noises() < little) break;
    }
    return {maximise.model(), maximise.log_likelihood(), maximise.noise_log_sd(), {}};
}

RoundedMaximum find_maximum(const SampleFit& fit, const RoundedIncrements& rounded, int most_rounds,
                            const RoundedMaximum* near) {
    Maximisation maximise(fit, rounded, rounded.arcsec.size(), near);
    for (int round = 0; round < most_rounds; ++round) {
        const double columns = maximise.maximise_over_columns();
        const double noises = maximise.maximise_over_noises();
        if (std::max(columns, noises) < little) break;
    }
    return {maximise.model(), maximise.log_likelihood(), maximise.noise_log_sd(), maximise.column_times()};
}

}  // namespace ringlock::closure
