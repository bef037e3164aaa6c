#include "analysis/closure/sample_rounded_summit.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "analysis/closure/sample_unrounding.hpp"

namespace ringlock::closure {

namespace {

/// Log-likelihoods that the filters estimate are off by about as much.
constexpr double off_by = 3.0;

class Climb {
   public:
    Climb(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec, std::size_t until)
        : fit_(fit), rounded_(rounded), step_(step_arcsec), until_(until), model_(fit.model()) {
        here_ = at(model_);
    }
    const SampleModel& model() const { return model_; }

    /// All noises by one parabola, no further than `most_powers`; how far.
    double climb_noises();
    const std::vector<double>& noise_log_sd() const { return noise_log_sd_; }
    /// Columns, each direction that is independent of the others were the increments known.
    void climb_columns();
    const std::vector<double>& column_times() const { return column_times_; }

   private:
    static constexpr double times = 1.4;

    double at(const SampleModel& model) const {
        const SampleFit of(fit_.series(), model, fit_.rows(), SampleFit::Noise::all_held);
        return log_likelihood_of_rounded(of, rounded_, step_, until_);
    }
    std::size_t noises() const { return model_.walk || model_.flicker ? 3 : 2; }
    SampleModel with_noises(const Eigen::VectorXd& powers) const;
    SampleModel with_columns(const Eigen::VectorXd& moved) const;

    const SampleFit& fit_;
    const std::vector<double>& rounded_;
    const double step_;
    const std::size_t until_;
    SampleModel model_;
    double here_ = 0.0;
    std::vector<double> noise_log_sd_, column_times_;
};

SampleModel Climb::with_noises(const Eigen::VectorXd& powers) const {
    SampleModel model = model_;
    model.noise.angle_arcsec *= std::pow(times, powers(0));
    model.noise.rate_arcsec_rt_s *= std::pow(times, powers(1));
    if (powers.size() < 3) return model;
    const double random = std::pow(times, powers(2));
    model.noise.walk_arcsec2_s3 *= random * random;
    model.flicker_deg_h *= random;
    for (auto& term : model.noise.terms) term.variance_arcsec2_s2 *= random * random;
    return model;
}

SampleModel Climb::with_columns(const Eigen::VectorXd& moved) const {
    SampleModel model = model_;
    for (std::size_t k = 0; k < model.columns.size(); ++k) {
        model.columns[k].value += moved(static_cast<Eigen::Index>(k));
    }
    return model;
}

double Climb::climb_noises() {
    constexpr double most_powers = 2.0;
    const auto m = static_cast<Eigen::Index>(noises());
    const auto axis = [m](Eigen::Index i) { return Eigen::VectorXd::Unit(m, i); };
    Eigen::VectorXd slope(m);
    Eigen::VectorXd more(m);
    Eigen::MatrixXd bend = Eigen::MatrixXd::Zero(m, m);
    for (Eigen::Index i = 0; i < m; ++i) {
        more(i) = at(with_noises(axis(i)));
        const double less = at(with_noises(-axis(i)));
        slope(i) = 0.5 * (more(i) - less);
        bend(i, i) = 2.0 * here_ - less - more(i);
        if (std::abs(slope(i)) < off_by && std::abs(bend(i, i)) < 2.0 * off_by) slope(i) = bend(i, i) = 0.0;
    }
    for (Eigen::Index i = 0; i < m; ++i) {
        for (Eigen::Index j = 0; j < i; ++j) {
            if (bend(i, i) <= 0.0 || bend(j, j) <= 0.0) continue;
            const double both = at(with_noises(axis(i) + axis(j)));
            const double cross = more(i) + more(j) - here_ - both;
            const double most = 0.95 * std::sqrt(bend(i, i) * bend(j, j));
            bend(i, j) = bend(j, i) = std::clamp(cross, -most, most);
        }
    }
    Eigen::VectorXd powers = Eigen::VectorXd::Zero(m);
    const Eigen::LLT<Eigen::MatrixXd> peak(bend);
    noise_log_sd_.assign(static_cast<std::size_t>(m), std::numeric_limits<double>::infinity());
    if (peak.info() == Eigen::Success && bend.diagonal().minCoeff() > 0.0) {
        powers = peak.solve(slope);
        const Eigen::MatrixXd covariance = peak.solve(Eigen::MatrixXd::Identity(m, m));
        for (Eigen::Index i = 0; i < m; ++i) {
            noise_log_sd_[static_cast<std::size_t>(i)] = std::log(times) * std::sqrt(covariance(i, i));
        }
    } else {
        for (Eigen::Index i = 0; i < m; ++i) {
            if (slope(i) == 0.0) continue;
            powers(i) = bend(i, i) > 0.0 ? slope(i) / bend(i, i) : std::copysign(most_powers, slope(i));
            if (bend(i, i) > 0.0) {
                noise_log_sd_[static_cast<std::size_t>(i)] = std::log(times) / std::sqrt(bend(i, i));
            }
        }
    }
    powers = powers.cwiseMax(-most_powers).cwiseMin(most_powers);
    SampleModel next = with_noises(powers);
    const double there = at(next);
    // No parabola far from the top: half of the way, if that is no worse.
    if (there < here_ - off_by) {
        powers *= 0.5;
        next = with_noises(powers);
        const double half = at(next);
        if (half < here_ - off_by) return 0.0;
        here_ = half;
    } else {
        here_ = there;
    }
    model_ = std::move(next);
    return powers.cwiseAbs().maxCoeff();
}

void Climb::climb_columns() {
    constexpr double first_length = 5.0;  // standard errors, were the increments known
    constexpr int doublings = 3;
    constexpr double enough = 20.0;
    const Eigen::MatrixXd& known = fit_.covariance();
    const Eigen::Index m = known.rows();
    Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of;
    const Eigen::VectorXd scale = known.diagonal().cwiseMax(1e-300).cwiseSqrt();
    of.compute(scale.cwiseInverse().asDiagonal() * known * scale.cwiseInverse().asDiagonal());
    Eigen::MatrixXd rounded = Eigen::MatrixXd::Zero(m, m);
    Eigen::VectorXd moved = Eigen::VectorXd::Zero(m);
    for (Eigen::Index j = 0; j < m; ++j) {
        const double variance = of.eigenvalues()(j);
        if (!(variance > 1e-12)) continue;
        const Eigen::VectorXd direction = std::sqrt(variance) * scale.asDiagonal() * of.eigenvectors().col(j);
        double length = first_length;
        double slope = 0.0;
        double bend = 0.0;
        for (int k = 0; k <= doublings; ++k, length *= 2.0) {
            const double more = at(with_columns(length * direction));
            const double less = at(with_columns(-length * direction));
            slope = 0.5 * (more - less) / length;
            bend = (2.0 * here_ - more - less) / (length * length);
            if (bend * length * length > enough) break;
        }
        // Rounding hides, it does not tell.
        bend = std::min(bend, 1.0);
        if (!(bend > 0.0)) continue;
        moved += std::clamp(slope / bend, -length, length) * direction;
        rounded += direction * direction.transpose() / bend;
    }
    model_ = with_columns(moved);
    here_ = at(model_);
    column_times_.clear();
    for (Eigen::Index a = 0; a < m; ++a) {
        column_times_.push_back(std::max(1.0, std::sqrt(rounded(a, a) / std::max(known(a, a), 1e-300))));
    }
}

}  // namespace

SampleModel towards_summit(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec,
                           std::size_t until, int most_rounds) {
    constexpr double little = 0.3;
    Climb climb(fit, rounded, step_arcsec, until);
    for (int round = 0; round < most_rounds; ++round) {
        if (climb.climb_noises() < little) break;
    }
    return climb.model();
}

RoundedSummit find_summit(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec) {
    Climb climb(fit, rounded, step_arcsec, rounded.size());
    climb.climb_columns();
    climb.climb_noises();
    return {climb.model(), climb.noise_log_sd(), climb.column_times()};
}

}  // namespace ringlock::closure
