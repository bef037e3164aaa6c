#include "analysis/closure/sample_rounded_summit.hpp"

#include <oneapi/tbb/parallel_for.h>

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
    double log_likelihood() const { return here_; }

    /// All noises by one parabola, no further than `most_powers`; how far.
    double climb_noises();
    const std::vector<double>& noise_log_sd() const { return noise_log_sd_; }
    /// Columns, by one parabola for each direction that would be independent of the others, were the increments known;
    /// how far, in standard errors.
    double climb_columns();
    const std::vector<double>& column_times() const { return column_times_; }

   private:
    static constexpr double times = 1.4;

    double at(const SampleModel& model) const {
        const SampleFit of(fit_.series(), model, fit_.rows(), SampleFit::Noise::all_held);
        return log_likelihood_of_rounded(of, rounded_, step_, until_);
    }
    std::vector<double> at(const std::vector<SampleModel>& models) const {
        std::vector<double> values(models.size());
        oneapi::tbb::parallel_for(std::size_t{0}, models.size(), [&](std::size_t k) { values[k] = at(models[k]); });
        return values;
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
    std::vector<SampleModel> beside;
    for (Eigen::Index i = 0; i < m; ++i) {
        beside.push_back(with_noises(axis(i)));
        beside.push_back(with_noises(-axis(i)));
    }
    const auto values = at(beside);
    for (Eigen::Index i = 0; i < m; ++i) {
        more(i) = values[2 * static_cast<std::size_t>(i)];
        const double less = values[2 * static_cast<std::size_t>(i) + 1];
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

double Climb::climb_columns() {
    constexpr double first_length = 5.0;  // standard errors, were the increments known
    constexpr int doublings = 3;
    constexpr double enough = 20.0;
    constexpr double reach = 3.0;
    const Eigen::MatrixXd& known = fit_.covariance();
    const Eigen::Index m = known.rows();
    Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> of;
    const Eigen::VectorXd scale = known.diagonal().cwiseMax(1e-300).cwiseSqrt();
    of.compute(scale.cwiseInverse().asDiagonal() * known * scale.cwiseInverse().asDiagonal());
    struct Along {
        Eigen::VectorXd direction;
        double length;
        double slope = 0.0, bend = 0.0;
    };
    Eigen::MatrixXd rounded = Eigen::MatrixXd::Zero(m, m);
    Eigen::VectorXd moved = Eigen::VectorXd::Zero(m);
    double furthest = 0.0;
    std::vector<Along> all;
    for (Eigen::Index j = 0; j < m; ++j) {
        const double variance = of.eigenvalues()(j);
        if (!(variance > 1e-12)) continue;
        all.push_back({std::sqrt(variance) * scale.asDiagonal() * of.eigenvectors().col(j), first_length});
    }
    // Further where the increments say little
    for (int k = 0; k <= doublings; ++k) {
        std::vector<Along*> open;
        std::vector<SampleModel> beside;
        for (Along& along : all) {
            if (along.bend * along.length * along.length > enough) continue;
            if (k > 0) along.length *= 2.0;
            open.push_back(&along);
            beside.push_back(with_columns(along.length * along.direction));
            beside.push_back(with_columns(-along.length * along.direction));
        }
        const auto values = at(beside);
        for (std::size_t i = 0; i < open.size(); ++i) {
            const double more = values[2 * i];
            const double less = values[2 * i + 1];
            open[i]->slope = 0.5 * (more - less) / open[i]->length;
            open[i]->bend = (2.0 * here_ - more - less) / (open[i]->length * open[i]->length);
        }
    }
    for (const Along& along : all) {
        // Rounding hides, it does not tell; and what bends less than the likelihood is off by is not seen to bend.
        const double bend = std::clamp(along.bend, 2.0 * off_by / (along.length * along.length), 1.0);
        moved += std::clamp(along.slope / bend, -reach * along.length, reach * along.length) * along.direction;
        furthest = std::max(furthest, std::abs(along.slope) / std::sqrt(bend));
        rounded += along.direction * along.direction.transpose() / bend;
    }
    for (int k = 0; k < 2; ++k, moved *= 0.5) {
        SampleModel next = with_columns(moved);
        const double there = at(next);
        if (there < here_ - off_by) continue;
        model_ = std::move(next);
        here_ = there;
        break;
    }
    column_times_.clear();
    for (Eigen::Index a = 0; a < m; ++a) {
        column_times_.push_back(std::max(1.0, std::sqrt(rounded(a, a) / std::max(known(a, a), 1e-300))));
    }
    return furthest;
}

}  // namespace

RoundedSummit towards_summit(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec,
                             std::size_t until, int most_rounds) {
    constexpr double little = 0.3;
    Climb climb(fit, rounded, step_arcsec, until);
    for (int round = 0; round < most_rounds; ++round) {
        if (climb.climb_noises() < little) break;
    }
    return {climb.model(), climb.log_likelihood(), climb.noise_log_sd(), {}};
}

RoundedSummit find_summit(const SampleFit& fit, const std::vector<double>& rounded, double step_arcsec,
                          int most_rounds) {
    constexpr double little = 0.7;
    Climb climb(fit, rounded, step_arcsec, rounded.size());
    for (int round = 0; round < most_rounds; ++round) {
        const double columns = climb.climb_columns();
        const double noises = climb.climb_noises();
        if (std::max(columns, noises) < little) break;
    }
    return {climb.model(), climb.log_likelihood(), climb.noise_log_sd(), climb.column_times()};
}

}  // namespace ringlock::closure
