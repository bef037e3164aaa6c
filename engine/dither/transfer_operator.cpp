#include "engine/dither/transfer_operator.hpp"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::dither {

namespace {

using Sparse = Eigen::SparseMatrix<double, Eigen::RowMajor>;

constexpr Eigen::Index interpolated_points = 6;

Eigen::Index rows_of(const PhaseChain& chain) {
    constexpr double widest_step_rad = 0.35;
    return std::max<Eigen::Index>(
        12, 1 + static_cast<Eigen::Index>(std::ceil(2.0 * chain.largest_rad() / widest_step_rad)));
}

}  // namespace

TransferOperator::TransferOperator(const PhaseChain& chain, int harmonics)
    : harmonics_(harmonics),
      half_cycle_rad_(chain.half_cycle_rad),
      hold_(chain.hold_half_cycles),
      rows_(rows_of(chain)),
      first_rad_(-chain.largest_rad()),
      step_rad_(2.0 * chain.largest_rad() / static_cast<double>(rows_ - 1)),
      levels_(drive_levels(chain)) {
    make_maps(chain);
    make_kicks(chain);
}

double TransferOperator::work(const PhaseChain& chain, int harmonics) {
    const auto rows = static_cast<double>(rows_of(chain));
    const double columns = 2.0 * (harmonics + 1.0);
    const double levels = drive_level_count(chain);
    // Levels of single half cycles are summed up in one map, as wide as they reach.
    if (chain.hold_half_cycles == 1) {
        return 2.0 * rows * columns * (std::min(rows, levels * static_cast<double>(interpolated_points)) + columns);
    }
    return 2.0 * static_cast<double>(chain.hold_half_cycles) * levels * rows * columns *
           (static_cast<double>(interpolated_points) + columns);
}

TransferOperator::Functions TransferOperator::expectation(const Functions& f) const {
    return period({f, {}}, false, 0.0).value;
}

TransferOperator::Functions TransferOperator::kicks() const { return period({zero(), {}}, true, 0.0).value; }

TransferOperator::Functions TransferOperator::squares(const Functions& potential, double mean_kick_rad) const {
    return period({potential, zero()}, true, mean_kick_rad).squares;
}

void TransferOperator::make_maps(const PhaseChain& chain) {
    for (const DriveLevel& level : levels_) {
        maps_.push_back(Sparse(rows_, rows_));
        std::vector<Eigen::Triplet<double>> entries;
        for (Eigen::Index i = 0; i < rows_; ++i) {
            interpolate(chain.decay * amplitude_rad(i) + (1.0 - chain.decay) * chain.level_rad * level.value, i,
                        entries);
        }
        maps_.back().setFromTriplets(entries.begin(), entries.end());
    }
    if (hold_ != 1) return;
    Sparse mean(rows_, rows_);
    for (std::size_t i = 0; i < levels_.size(); ++i) mean += levels_[i].weight * maps_[i];
    mean.prune(1e-14);
    maps_.assign(1, mean);
    levels_.assign(1, {0.0, 1.0});
}

/// Adds a row of the Lagrange interpolation of six points.
void TransferOperator::interpolate(double at_rad, Eigen::Index row,
                                   std::vector<Eigen::Triplet<double>>& entries) const {
    constexpr Eigen::Index points = interpolated_points;
    const double x = std::clamp((at_rad - first_rad_) / step_rad_, 0.0, static_cast<double>(rows_ - 1));
    const Eigen::Index first =
        std::clamp<Eigen::Index>(static_cast<Eigen::Index>(x) - points / 2 + 1, 0, rows_ - points);
    for (Eigen::Index i = 0; i < points; ++i) {
        double weight = 1.0;
        for (Eigen::Index j = 0; j < points; ++j) {
            if (j != i) weight *= (x - static_cast<double>(first + j)) / static_cast<double>(i - j);
        }
        entries.emplace_back(row, first + i, weight);
    }
}

/// A turn takes v = exp(i (psi - arg z)) to (v + r)/(1 + r v), a power series in v: modes m >= 0 stay among
/// themselves. It adds -2 arg(1 + r v) to the phase.
void TransferOperator::make_kicks(const PhaseChain& chain) {
    const Eigen::Index n = harmonics_ + 1;
    Eigen::VectorXd base = Eigen::VectorXd::Zero(n);
    base(0) = chain.r;
    for (Eigen::Index k = 1; k < n; ++k) {
        base(k) = (1.0 - chain.r * chain.r) * std::pow(-chain.r, static_cast<double>(k - 1));
    }
    turn_ = Functions::Zero(n, n);
    turn_(0, 0) = 1.0;
    for (Eigen::Index m = 1; m < n; ++m) {
        for (Eigen::Index i = 0; i < n; ++i) {
            for (Eigen::Index j = 0; i + j < n; ++j) turn_(m, i + j) += turn_(m - 1, i) * base(j);
        }
    }
    for (const std::size_t side : {0U, 1U}) {
        const double sign = side == 0 ? -1.0 : 1.0;  // the first turn of a period is a minimum of the phase
        cosine_[side] = sine_[side] = Functions::Zero(rows_, n);
        kick_[side] = zero();
        for (Eigen::Index i = 0; i < rows_; ++i) {
            for (Eigen::Index m = 0; m < n; ++m) {
                const double angle =
                    static_cast<double>(m) * sign * (chain.amplitude_rad + amplitude_rad(i) - 0.25 * units::pi);
                cosine_[side](i, m) = std::cos(angle);
                sine_[side](i, m) = std::sin(angle);
                if (m == 0) continue;
                const double size =
                    (m % 2 == 1 ? 2.0 : -2.0) * std::pow(chain.r, static_cast<double>(m)) / static_cast<double>(m);
                kick_[side](i, m) = -size * sine_[side](i, m);
                kick_[side](i, n + m) = size * cosine_[side](i, m);
            }
        }
    }
}

/// To the turn before, less its kick, with a level of the drive.
TransferOperator::Functions TransferOperator::over_half_cycle(const Functions& f, std::size_t level) const {
    Functions g = maps_[level] * f;
    const Eigen::Index n = harmonics_ + 1;
    for (Eigen::Index m = 1; m < n; ++m) {
        const double c = std::cos(static_cast<double>(m) * half_cycle_rad_);
        const double s = std::sin(static_cast<double>(m) * half_cycle_rad_);
        for (Eigen::Index i = 0; i < rows_; ++i) {
            const double re = g(i, m);
            g(i, m) = re * c - g(i, n + m) * s;
            g(i, n + m) = re * s + g(i, n + m) * c;
        }
    }
    return g;
}

/// To the state before the kick of a turn.
TransferOperator::Functions TransferOperator::over_turn(const Functions& f, std::size_t side) const {
    const Eigen::Index n = harmonics_ + 1;
    const auto& c = cosine_[side].array();
    const auto& s = sine_[side].array();
    Functions re = f.leftCols(n).array() * c + f.rightCols(n).array() * s;
    Functions im = f.rightCols(n).array() * c - f.leftCols(n).array() * s;
    re = (re * turn_).eval();
    im = (im * turn_).eval();
    Functions g(rows_, 2 * n);
    g.leftCols(n) = re.array() * c - im.array() * s;
    g.rightCols(n) = re.array() * s + im.array() * c;
    g.col(n).setZero();
    return g;
}

/// (k - c)(2 g - (k - c)) = (k - c + g')^2 - g'^2 with the potential g' after the turn.
TransferOperator::Functions TransferOperator::square(const Functions& potential, std::size_t side,
                                                     double mean_kick_rad) const {
    const Eigen::Index n = harmonics_ + 1;
    const Eigen::Index points = 4 * n;
    Functions wave(2 * n, points);
    for (Eigen::Index m = 0; m < n; ++m) {
        for (Eigen::Index j = 0; j < points; ++j) {
            const double angle = units::two_pi * static_cast<double>(m * j % points) / static_cast<double>(points);
            wave(m, j) = std::cos(angle);
            wave(n + m, j) = -std::sin(angle);
        }
    }
    const Eigen::ArrayXXd kick = (kick_[side] * wave).array() - mean_kick_rad;
    const Functions product = kick * (2.0 * (potential * wave).array() - kick);
    Functions result = product * wave.transpose() * (2.0 / static_cast<double>(points));
    result.col(0) *= 0.5;
    result.col(n).setZero();
    return result;
}

void TransferOperator::finish_turn(Pair& f, std::size_t side, bool with_kicks, double mean_kick_rad) const {
    f.value = over_turn(f.value, side);
    if (with_kicks) {
        f.value += kick_[side];
        f.value.col(0).array() -= mean_kick_rad;
    }
    if (f.squares.size() == 0) return;
    f.squares = over_turn(f.squares, side) + square(f.value, side, mean_kick_rad);
}

/// To the beginning of a hold whose first turn is on that side.
TransferOperator::Pair TransferOperator::hold(const Pair& end, std::size_t first_side, bool with_kicks,
                                              double mean_kick_rad) const {
    Pair sum{zero(), end.squares.size() > 0 ? zero() : Functions{}};
    std::vector<Pair> parts(levels_.size());
    tbb::parallel_for(std::size_t{0}, levels_.size(), [&](std::size_t level) {
        Pair f = end;
        for (std::int64_t turn = hold_; turn-- > 0;) {
            f.value = over_half_cycle(f.value, level);
            if (f.squares.size() > 0) f.squares = over_half_cycle(f.squares, level);
            if (turn == 0) break;  // the level is not known there yet
            finish_turn(f, (first_side + static_cast<std::size_t>(turn)) % 2, with_kicks, mean_kick_rad);
        }
        parts[level] = std::move(f);
    });
    for (std::size_t level = 0; level < levels_.size(); ++level) {
        sum.value += levels_[level].weight * parts[level].value;
        if (sum.squares.size() > 0) sum.squares += levels_[level].weight * parts[level].squares;
    }
    finish_turn(sum, first_side, with_kicks, mean_kick_rad);
    return sum;
}

TransferOperator::Pair TransferOperator::period(Pair f, bool with_kicks, double mean_kick_rad) const {
    for (std::int64_t turn = turns_per_period(); turn > 0;) {
        turn -= hold_;
        f = hold(f, static_cast<std::size_t>(turn % 2), with_kicks, mean_kick_rad);
    }
    return f;
}

}  // namespace ringlock::dither
