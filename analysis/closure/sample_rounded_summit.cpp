#include "analysis/closure/sample_rounded_summit.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace ringlock::closure {

namespace {

/// Differences of the log-likelihoods that the filters estimate are off by about as much.
constexpr double off_by = 1.0;

class Climb {
   public:
    Climb(const SampleFit& fit, const RoundedIncrements& rounded, std::size_t until)
        : fit_(fit), rounded_(rounded), until_(until), model_(fit.model()) {
        here_ = at(model_);
        log_length_ = Eigen::VectorXd::Constant(static_cast<Eigen::Index>(noises()), first_log);
    }
    const SampleModel& model() const { return model_; }
    double log_likelihood() const { return here_; }

    /// All noises by one parabola; how far, in standard errors.
    double climb_noises();
    const std::vector<double>& noise_log_sd() const { return noise_log_sd_; }
    /// Columns, by one parabola for each direction that would be independent of the others, were the increments known;
    /// how far, in standard errors.
    double climb_columns();
    const std::vector<double>& column_times() const { return column_times_; }

   private:
    static constexpr double first_log = 0.33;

    double at(const SampleModel& model) const {
        const SampleFit of(fit_.series(), model, fit_.rows(), SampleFit::Noise::all_held);
        return log_likelihood_of_rounded(of, rounded_, until_);
    }
    std::vector<double> at(const std::vector<SampleModel>& models) const {
        std::vector<double> values(models.size());
        oneapi::tbb::parallel_for(std::size_t{0}, models.size(), [&](std::size_t k) { values[k] = at(models[k]); });
        return values;
    }
    std::size_t noises() const { return model_.walk || model_.flicker ? 3 : 2; }
    /// Their logarithms moved by so many lengths.
    SampleModel with_noises(const Eigen::VectorXd& lengths) const;
    SampleModel with_columns(const Eigen::VectorXd& moved) const;

    const SampleFit& fit_;
    const RoundedIncrements rounded_;
    const std::size_t until_;
    SampleModel model_;
    double here_ = 0.0;
    Eigen::VectorXd log_length_;
    std::vector<double> noise_log_sd_, column_times_;
};

SampleModel Climb::with_noises(const Eigen::VectorXd& lengths) const {
    const Eigen::VectorXd times = lengths.cwiseProduct(log_length_).array().exp();
    SampleModel model = model_;
    model.noise.angle_arcsec *= times(0);
    model.noise.rate_arcsec_rt_s *= times(1);
    if (times.size() < 3) return model;
    model.noise.walk_arcsec2_s3 *= times(2) * times(2);
    model.flicker_deg_h *= times(2);
    for (auto& term : model.noise.terms) term.variance_arcsec2_s2 *= times(2) * times(2);
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
    constexpr double most = 2.0;         // lengths
    constexpr double wanted_bend = 8.0;  // of a length
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
    for (Eigen::Index i = 0; i < m; ++i) {
        for (Eigen::Index j = 0; j < i; ++j) beside.push_back(with_noises(axis(i) + axis(j)));
    }
    const auto values = at(beside);
    for (Eigen::Index i = 0; i < m; ++i) {
        more(i) = values[2 * static_cast<std::size_t>(i)];
        const double less = values[2 * static_cast<std::size_t>(i) + 1];
        slope(i) = 0.5 * (more(i) - less);
        bend(i, i) = 2.0 * here_ - less - more(i);
        if (std::abs(slope(i)) < off_by && std::abs(bend(i, i)) < 2.0 * off_by) slope(i) = bend(i, i) = 0.0;
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
    Eigen::VectorXd lengths = Eigen::VectorXd::Zero(m);
    Eigen::VectorXd sd = Eigen::VectorXd::Constant(m, std::numeric_limits<double>::infinity());  // lengths
    const Eigen::LLT<Eigen::MatrixXd> peak(bend);
    if (peak.info() == Eigen::Success && bend.diagonal().minCoeff() > 0.0) {
        lengths = peak.solve(slope);
        sd = peak.solve(Eigen::MatrixXd::Identity(m, m)).diagonal().cwiseSqrt();
    } else {
        for (Eigen::Index i = 0; i < m; ++i) {
            if (slope(i) == 0.0) continue;
            lengths(i) = bend(i, i) > 0.0 ? slope(i) / bend(i, i) : std::copysign(most, slope(i));
            if (bend(i, i) > 0.0) sd(i) = 1.0 / std::sqrt(bend(i, i));
        }
    }
    noise_log_sd_.assign(static_cast<std::size_t>(m), 0.0);
    Eigen::VectorXd::Map(noise_log_sd_.data(), m) = sd.cwiseProduct(log_length_);
    lengths = lengths.cwiseMax(-most).cwiseMin(most);
    // No parabola far from the top: half of the way, if that is no worse.
    for (int k = 0; k < 2; ++k, lengths *= 0.5) {
        SampleModel next = with_noises(lengths);
        const double there = at(next);
        if (there < here_ - off_by) continue;
        model_ = std::move(next);
        here_ = there;
        break;
    }
    double furthest = 0.0;
    for (Eigen::Index i = 0; i < m; ++i) {
        furthest = std::max(furthest, std::abs(lengths(i)) / std::min(sd(i), 0.5));
        if (bend(i, i) > 0.0)
            log_length_(i) = std::min(log_length_(i) * std::sqrt(wanted_bend / bend(i, i)), first_log);
    }
    return furthest;
}

double Climb::climb_columns() {
    constexpr double first_length = 3.0;  // standard errors, were the increments known
    constexpr int doublings = 3;
    constexpr double enough = 5.0;
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

RoundedSummit towards_summit(const SampleFit& fit, const RoundedIncrements& rounded, std::size_t until,
                             int most_rounds) {
    constexpr double little = 0.5;
    Climb climb(fit, rounded, until);
    for (int round = 0; round < most_rounds; ++round) {
        if (climb.climb_noises() < little) break;
    }
    return {climb.model(), climb.log_likelihood(), climb.noise_log_sd(), {}};
}

RoundedSummit find_summit(const SampleFit& fit, const RoundedIncrements& rounded, int most_rounds) {
    constexpr double little = 0.5;
    Climb climb(fit, rounded, rounded.arcsec.size());
    for (int round = 0; round < most_rounds; ++round) {
        const double columns = climb.climb_columns();
        const double noises = climb.climb_noises();
        if (std::max(columns, noises) < little) break;
    }
    return {climb.model(), climb.log_likelihood(), climb.noise_log_sd(), climb.column_times()};
}

}  // namespace ringlock::closure
