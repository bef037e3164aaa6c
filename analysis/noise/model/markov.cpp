#include "analysis/noise/model/markov.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/core/dense.hpp"

namespace ringlock::noise {
namespace {

struct Score {
    double log_time = 0.0;
    double z = 0.0;         ///< standard normal without correlated noise
    double variance = 0.0;  ///< that a step of scoring leads to
};

/// Scores of a little correlated noise of many correlation times, orthogonal to the terms of the model.
std::vector<Score> scores(const Likelihood& likelihood, const Maximum& five, double& path_length) {
    const std::vector<Bin>& bins = likelihood.bins();
    const auto rows = static_cast<Eigen::Index>(bins.size());
    Eigen::VectorXd weight(rows);
    Eigen::VectorXd excess(rows);
    Eigen::MatrixXd terms(rows, static_cast<Eigen::Index>(correlated));
    for (Eigen::Index k = 0; k < rows; ++k) {
        const Bin& b = bins[static_cast<std::size_t>(k)];
        double v = 0.0;
        for (std::size_t i = 0; i < correlated; ++i) v += five.theta[i] * b.shape[i];
        weight[k] = std::sqrt(0.5 * b.count) / v;
        const double power = b.power + five.ramp * (five.ramp * b.ramp2 - 2.0 * b.ramp_data);
        excess[k] = weight[k] * (power / b.count - v);
        for (std::size_t i = 0; i < correlated; ++i) {
            terms(k, static_cast<Eigen::Index>(i)) = five.theta[i] > 0.0 ? weight[k] * b.shape[i] : 0.0;
        }
    }
    for (Eigen::Index i = 0; i < terms.cols(); ++i) {
        const double size = terms.col(i).norm();
        if (size > 0.0) terms.col(i) /= size;
    }
    const Eigen::MatrixXd base = dense::orthonormal_basis_of_rank(terms);

    std::vector<Score> out;
    const LogTimes range = log_times(likelihood.samples());
    constexpr double step = 0.5 * std::numbers::ln2;
    const int steps = std::max(1, static_cast<int>(std::ceil((range.hi - range.lo) / step)));
    Eigen::VectorXd last;
    path_length = 0.0;
    for (int k = 0; k <= steps; ++k) {
        Score score;
        score.log_time = range.lo + (range.hi - range.lo) * k / steps;
        const CorrelatedShape shape(score.log_time, likelihood.samples());
        Eigen::VectorXd direction(rows);
        for (Eigen::Index r = 0; r < rows; ++r) {
            direction[r] = weight[r] * shape(bins[static_cast<std::size_t>(r)].sin2).shape;
        }
        direction -= base * (base.transpose() * direction);
        const double size = direction.norm();
        direction /= size;
        score.z = direction.dot(excess);
        score.variance = score.z / size;
        if (k > 0) path_length += std::acos(std::clamp(direction.dot(last), -1.0, 1.0));
        last = direction;
        out.push_back(score);
    }
    return out;
}

}  // namespace

double Markov::price(double significance) const {
    const auto exceeds = [&](double c) {
        return 0.5 * std::erfc(c / std::numbers::sqrt2) + 0.5 * path_length / std::numbers::pi * std::exp(-0.5 * c * c);
    };
    double lo = 0.0;
    double hi = 40.0;
    for (int i = 0; i < 60; ++i) {
        const double middle = 0.5 * (lo + hi);
        (exceeds(middle) > significance ? lo : hi) = middle;
    }
    return hi * hi;
}

Markov find_markov(const Likelihood& likelihood, const Maximum& five) {
    // Where no score comes near what this share of records reach, the deviance will not either.
    constexpr double worth_a_look = 0.3;
    Markov out;
    out.best = five;
    const LogTimes range = log_times(likelihood.samples());
    if (!(range.hi > range.lo) || !std::isfinite(five.deviance)) return out;
    const std::vector<Score> along = scores(likelihood, five, out.path_length);
    const double least = std::sqrt(out.price(worth_a_look));
    for (std::size_t k = 0; k < along.size(); ++k) {
        const double z = along[k].z;
        const bool peak = (k == 0 || along[k - 1].z < z) && (k + 1 == along.size() || along[k + 1].z <= z);
        if (!peak || !(z > least)) continue;
        Parameters start = five.theta;
        start[correlated] = along[k].variance;
        start[log_time] = along[k].log_time;
        const Maximum there = likelihood.maximise(model_of(five_terms | correlated_bit), &start);
        if (there.deviance < out.best.deviance) out.best = there;
    }
    const double time = out.best.theta[log_time];
    if (time > range.lo + 1e-3 && time < range.hi - 1e-3) out.evidence = five.deviance - out.best.deviance;
    return out;
}

}  // namespace ringlock::noise
