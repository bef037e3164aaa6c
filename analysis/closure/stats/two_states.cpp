#include "analysis/closure/stats/two_states.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "analysis/closure/options.hpp"
#include "engine/core/dense.hpp"

namespace ringlock::closure {

namespace {

constexpr double least_chance = options.stats.two_levels.least_chance;
constexpr double most_chance = options.stats.two_levels.most_chance;

using Pair = std::array<double, 2>;

double log_sum(double a, double b) {
    const double high = std::max(a, b);
    return high + std::log1p(std::exp(std::min(a, b) - high));
}

class Chain {
   public:
    Chain(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right)
        : own_(normal.diagonal()), next_(normal.diagonal(1)), right_(right) {}

    void start(const Eigen::VectorXd& shape, TwoStates& states) {
        both_.assign(static_cast<std::size_t>(next_.size()), 0.0);
        double changes = 0.0;
        for (Eigen::Index k = 0; k + 1 < shape.size(); ++k) {
            both_[static_cast<std::size_t>(k)] = shape(k) * shape(k + 1);
            changes += std::abs(shape(k + 1) - shape(k));
        }
        upper_ = shape;
        set_levels(states);
        states.up = states.down = std::clamp(changes / static_cast<double>(shape.size()), least_chance, most_chance);
    }

    /// Expectations of the state of each stretch, and of it and its neighbour, with these parameters.
    void expect(TwoStates& states) {
        const auto n = static_cast<std::size_t>(right_.size());
        const Pair level{states.rate, states.rate + states.step};
        const std::array<Pair, 2> chance{Pair{std::log1p(-states.up), std::log(states.up)},
                                         Pair{std::log(states.down), std::log1p(-states.down)}};
        const auto seen = [&](std::size_t k, int s) {
            const auto at = static_cast<Eigen::Index>(k);
            const double x = level[static_cast<std::size_t>(s)];
            return right_(at) * x - 0.5 * own_(at) * x * x;
        };
        const auto step = [&](std::size_t k, int s, int t) {
            const auto from = static_cast<std::size_t>(s);
            const auto to = static_cast<std::size_t>(t);
            return chance[from][to] - next_(static_cast<Eigen::Index>(k)) * level[from] * level[to];
        };
        std::vector<Pair> forward(n);
        std::vector<Pair> backward(n, {0.0, 0.0});
        forward[0] = {seen(0, 0) + std::log(0.5), seen(0, 1) + std::log(0.5)};
        for (std::size_t k = 1; k < n; ++k) {
            for (int t = 0; t < 2; ++t) {
                forward[k][static_cast<std::size_t>(t)] =
                    seen(k, t) + log_sum(forward[k - 1][0] + step(k - 1, 0, t), forward[k - 1][1] + step(k - 1, 1, t));
            }
        }
        for (std::size_t k = n - 1; k-- > 0;) {
            for (int s = 0; s < 2; ++s) {
                backward[k][static_cast<std::size_t>(s)] = log_sum(step(k, s, 0) + seen(k + 1, 0) + backward[k + 1][0],
                                                                   step(k, s, 1) + seen(k + 1, 1) + backward[k + 1][1]);
            }
        }
        states.gain = log_sum(forward[n - 1][0], forward[n - 1][1]);
        std::array<Pair, 2> moves{};
        for (std::size_t k = 0; k < n; ++k) {
            upper_(static_cast<Eigen::Index>(k)) = std::exp(forward[k][1] + backward[k][1] - states.gain);
            if (k + 1 == n) break;
            for (int s = 0; s < 2; ++s) {
                for (int t = 0; t < 2; ++t) {
                    const double p = std::exp(forward[k][static_cast<std::size_t>(s)] + step(k, s, t) + seen(k + 1, t) +
                                              backward[k + 1][static_cast<std::size_t>(t)] - states.gain);
                    moves[static_cast<std::size_t>(s)][static_cast<std::size_t>(t)] += p;
                    if (s == 1 && t == 1) both_[k] = p;
                }
            }
        }
        const auto share = [](double moved, double stayed) {
            const double all = moved + stayed;
            return all > 0.0 ? std::clamp(moved / all, least_chance, most_chance) : least_chance;
        };
        up_ = share(moves[0][1], moves[0][0]);
        down_ = share(moves[1][0], moves[1][1]);
        states.expected = (states.rate + states.step * upper_.array()).matrix();
    }

    /// The most likely parameters with these expectations.
    void mend(TwoStates& states) {
        set_levels(states);
        states.up = up_;
        states.down = down_;
    }

   private:
    void set_levels(TwoStates& states) const {
        Eigen::Matrix2d h = Eigen::Matrix2d::Zero();
        Eigen::Vector2d b(right_.sum(), right_.dot(upper_));
        h(0, 0) = own_.sum() + 2.0 * next_.sum();
        h(0, 1) = own_.dot(upper_);
        h(1, 1) = own_.dot(upper_);
        for (Eigen::Index k = 0; k < next_.size(); ++k) {
            h(0, 1) += next_(k) * (upper_(k) + upper_(k + 1));
            h(1, 1) += 2.0 * next_(k) * both_[static_cast<std::size_t>(k)];
        }
        h(1, 0) = h(0, 1);
        const Eigen::Vector2d levels = dense::MinimumNorm(h).solve(Eigen::VectorXd(b));
        states.rate = levels(0);
        states.step = levels(1);
    }

    Eigen::VectorXd own_, next_, right_;
    Eigen::VectorXd upper_;     ///< probability of the upper state of each stretch
    std::vector<double> both_;  ///< that each stretch and the next are both in it
    double up_ = least_chance;
    double down_ = least_chance;
};

}  // namespace

TwoStates two_states(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right, const Eigen::VectorXd& shape) {
    constexpr double little = 1e-3;
    TwoStates states;
    if (right.size() < 2) return states;
    Chain chain(normal, right);
    chain.start(shape, states);
    for (int pass = 0; pass < options.stats.two_levels.most_passes; ++pass) {
        const double before = states.gain;
        chain.expect(states);
        if (pass > 0 && states.gain < before + little) break;
        chain.mend(states);
    }
    return states;
}

}  // namespace ringlock::closure
