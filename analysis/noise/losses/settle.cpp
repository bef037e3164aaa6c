#include "analysis/noise/losses/settle.hpp"

#include <Eigen/Dense>
#include <cmath>
#include <deque>

#include "engine/core/dense.hpp"

namespace ringlock::noise {
namespace {

constexpr int most_rounds = 60;

Eigen::VectorXd logarithms(const std::vector<double>& values) {
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size())).array().log();
}

/// Next place of an iteration x -> g(x): where the least squares of the last differences put its rest g(x) - x to 0.
class Acceleration {
   public:
    Eigen::VectorXd next(const Eigen::VectorXd& x, const Eigen::VectorXd& image) {
        constexpr std::size_t most = 3;
        const Eigen::VectorXd rest = image - x;
        if (!rests_.empty() && rest.squaredNorm() > 4.0 * rests_.back().squaredNorm()) clear();
        rests_.push_back(rest);
        images_.push_back(image);
        if (rests_.size() > most + 1) {
            rests_.pop_front();
            images_.pop_front();
        }
        const auto columns = static_cast<Eigen::Index>(rests_.size()) - 1;
        if (columns == 0) return image;
        Eigen::MatrixXd differences(rest.size(), columns);
        for (Eigen::Index k = 0; k < columns; ++k) differences.col(k) = rests_[at(k + 1)] - rests_[at(k)];
        const Eigen::VectorXd share = dense::least_squares(differences, rest);
        if (!share.allFinite() || share.norm() > 30.0) {
            clear();
            return image;
        }
        Eigen::VectorXd out = image;
        for (Eigen::Index k = 0; k < columns; ++k) out -= share[k] * (images_[at(k + 1)] - images_[at(k)]);
        return out;
    }

   private:
    static std::size_t at(Eigen::Index k) { return static_cast<std::size_t>(k); }
    void clear() {
        rests_.clear();
        images_.clear();
    }
    std::deque<Eigen::VectorXd> rests_, images_;
};

/// Squares of what the means moved by over the variances.
double moved(const RecordModel& from, const RecordModel& to) {
    double sum = 0.0;
    for (std::size_t j = 0; j < from.means.size(); ++j) {
        const double d = to.means[j] - from.means[j];
        sum += d * d / to.variance[j];
    }
    return sum;
}

}  // namespace

RecordModel record_model(const Spectrum& spectrum, const Maximum& fit, std::span<const Line> lines) {
    RecordModel out{coefficient_variances(spectrum, fit), fit.theta[quantisation], {}};
    for (std::size_t j = 1; j < spectrum.samples; ++j) out.means.push_back(fit.ramp * spectrum.ramp(j));
    if (!lines.empty()) {
        const LineFinder finder(spectrum.samples);
        for (const Line& line : lines) finder.add(line, 1.0, out.means);
    }
    return out;
}

Filled settle(Filling& filling, RecordModel& begin, const std::function<RecordModel(const Filled&)>& fit) {
    // Of half the squares of the variances' logarithms, a deviance of a completed record: a step of a hundredth of a
    // standard error.
    constexpr double enough = 1e-4;
    Acceleration acceleration;
    for (int round = 0;; ++round) {
        Filled filled = filling.fill(begin.noise(), begin.means);
        if (filling.too_hard()) throw GivenUp();
        RecordModel image = fit(filled);
        const Eigen::VectorXd x = logarithms(begin.variance);
        const Eigen::VectorXd g = logarithms(image.variance);
        const double distance = 0.5 * (g - x).squaredNorm() + moved(begin, image);
        if (distance < enough || round == most_rounds) return filled;
        const Eigen::VectorXd next = acceleration.next(x, g);
        for (std::size_t j = 0; j < image.variance.size(); ++j) {
            image.variance[j] = std::exp(next[static_cast<Eigen::Index>(j)]);
        }
        begin = std::move(image);
    }
}

}  // namespace ringlock::noise
