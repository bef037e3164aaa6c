#include "engine/dither/noise_effectiveness.hpp"

#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <Eigen/Sparse>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <iterator>
#include <numbers>
#include <numeric>
#include <unsupported/Eigen/IterativeSolvers>

#include "engine/core/units.hpp"
#include "engine/dither/drive_noise.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/theory.hpp"

namespace ringlock::dither {
namespace {
class Deflated;
}  // namespace
}  // namespace ringlock::dither

namespace Eigen::internal {
/// To Eigen's solvers a matrix that can only be applied is a sparse one.
template <>
struct traits<ringlock::dither::Deflated> : traits<Eigen::SparseMatrix<double>> {};
}  // namespace Eigen::internal

namespace ringlock::dither {

namespace {

/// Functions of (slow phase, amplitude): a row for each amplitude of the grid; f = Re sum c_m exp(i m theta), the real
/// parts of c_0...c_M first and then the imaginary ones.
using Functions = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Sparse = Eigen::SparseMatrix<double, Eigen::RowMajor>;

/// A level of the drive and its probability.
struct Level {
    double value = 0.0;
    double weight = 0.0;
};

/// Gauss quadrature with the recursion coefficients of its orthonormal polynomials (Golub and Welsch 1969).
template <class Recursion>
std::vector<Level> gauss(int count, const Recursion& recursion) {
    Eigen::MatrixXd jacobi = Eigen::MatrixXd::Zero(count, count);
    for (int i = 1; i < count; ++i) jacobi(i, i - 1) = jacobi(i - 1, i) = recursion(static_cast<double>(i));
    const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(jacobi);
    std::vector<Level> levels;
    for (int i = 0; i < count; ++i) {
        levels.push_back({solver.eigenvalues()(i), solver.eigenvectors()(0, i) * solver.eigenvectors()(0, i)});
    }
    return levels;
}

constexpr double gaussian_end = 5.5;  ///< standard deviations beyond which there is no amplitude and no level

/// Levels of variance 1 that stand for the distribution: as many as resolve waves of four a radian where a level of one
/// standard deviation moves the amplitude by `reach_rad`.
std::vector<Level> levels_of(gyro::NoiseDistribution distribution, double reach_rad) {
    if (distribution == gyro::NoiseDistribution::binary) return {{-1.0, 0.5}, {1.0, 0.5}};
    if (distribution == gyro::NoiseDistribution::uniform) {
        std::vector<Level> levels =
            gauss(8 + static_cast<int>(4.0 * reach_rad), [](double i) { return i / std::sqrt(4.0 * i * i - 1.0); });
        for (Level& level : levels) level.value *= std::numbers::sqrt3;
        return levels;
    }
    // Equidistant sums of a Gaussian converge faster than any power.
    const int half = 6 + static_cast<int>(3.5 * reach_rad);
    std::vector<Level> levels;
    double sum = 0.0;
    for (int i = -half; i <= half; ++i) {
        const double value = gaussian_end * i / half;
        levels.push_back({value, std::exp(-0.5 * value * value)});
        sum += levels.back().weight;
    }
    for (Level& level : levels) level.weight /= sum;
    return levels;
}

/// The chain: constants of one gyro and its noise.
struct Chain {
    double r = 0.0;               ///< |z| of a turn's Moebius map
    double amplitude_rad = 0.0;   ///< M less what lock-in and the finite swing delay
    double half_cycle_rad = 0.0;  ///< rotation of the input
    double rms_rad = 0.0;         ///< of the amplitude at the turns
    double decay = 0.0;           ///< what is left of a deviation after a half cycle
    double level_rad = 0.0;       ///< rms of the amplitude that a level would come to
    std::int64_t hold_half_cycles = 1;
    gyro::NoiseDistribution distribution = gyro::NoiseDistribution::gaussian;

    double reach_rad() const { return (1.0 - std::pow(decay, static_cast<double>(hold_half_cycles))) * level_rad; }
    double largest_rad() const {
        const double gaussian = gaussian_end * rms_rad;
        if (distribution == gyro::NoiseDistribution::gaussian) return gaussian;
        const double level = distribution == gyro::NoiseDistribution::binary ? 1.0 : std::numbers::sqrt3;
        return std::min(gaussian, level * level_rad);
    }
};

Eigen::Index rows_of(const Chain& chain) {
    constexpr double widest_step_rad = 0.35;
    return std::max<Eigen::Index>(
        12, 1 + static_cast<Eigen::Index>(std::ceil(2.0 * chain.largest_rad() / widest_step_rad)));
}

/// Whether a turn tells nothing of the next: Gaussian levels of one half cycle move the amplitude so far that phases
/// are correlated by exp(-reach^2/2) < 1e-13.
bool is_independent(const Chain& chain) {
    return chain.hold_half_cycles == 1 && chain.distribution == gyro::NoiseDistribution::gaussian &&
           chain.reach_rad() > 8.0;
}

/// Whether the operator is too large to be worth its while: some 15 s of two cores.
bool is_too_large(const Chain& chain) {
    constexpr double most = 2.0e6;
    const auto levels = static_cast<double>(levels_of(chain.distribution, chain.reach_rad()).size());
    return levels * static_cast<double>(rows_of(chain)) * static_cast<double>(chain.hold_half_cycles) > most;
}

/// A function and, where wanted, what is carried along with it.
struct Pair {
    Functions value;
    Functions carried;
};

/// Takes functions of the state at a turn back to earlier turns: the expectation of what they will be there.
class TransferOperator {
   public:
    TransferOperator(const Chain& chain, int harmonics)
        : harmonics_(harmonics), turn_rad_(chain.half_cycle_rad), hold_(chain.hold_half_cycles) {
        const double end = chain.largest_rad();
        rows_ = rows_of(chain);
        first_rad_ = -end;
        step_rad_ = 2.0 * end / static_cast<double>(rows_ - 1);
        levels_ = levels_of(chain.distribution, chain.reach_rad());
        for (const Level& level : levels_) {
            maps_.push_back(Sparse(rows_, rows_));
            std::vector<Eigen::Triplet<double>> entries;
            for (Eigen::Index i = 0; i < rows_; ++i) {
                interpolate(chain.decay * amplitude_rad(i) + (1.0 - chain.decay) * chain.level_rad * level.value, i,
                            entries);
            }
            maps_.back().setFromTriplets(entries.begin(), entries.end());
        }
        if (hold_ == 1) {
            // One map for all levels together.
            Sparse mean(rows_, rows_);
            for (std::size_t i = 0; i < levels_.size(); ++i) mean += levels_[i].weight * maps_[i];
            mean.prune(1e-14);
            maps_.assign(1, mean);
            levels_.assign(1, {0.0, 1.0});
        }
        make_kicks(chain);
    }

    Eigen::Index rows() const { return rows_; }
    Eigen::Index columns() const { return 2 * (harmonics_ + 1); }
    /// Turns of a period: whole holds and whole cycles.
    std::int64_t turns() const { return hold_ % 2 == 0 ? hold_ : 2 * hold_; }
    Functions zero() const { return Functions::Zero(rows(), columns()); }

    /// From the minimum at the end of a period back to that at its beginning.
    Functions expectation(const Functions& f) const { return period({f, {}}, false, 0.0).value; }
    /// The same with the kicks that were added on the way.
    Functions kicks() const { return period({zero(), {}}, true, 0.0).value; }
    /// `potential`: sum of all later kicks less their mean. Sum over a period of the martingale's squares.
    Functions squares(const Functions& potential, double mean_kick_rad) const {
        return period({potential, zero()}, true, mean_kick_rad).carried;
    }

   private:
    double amplitude_rad(Eigen::Index i) const { return first_rad_ + step_rad_ * static_cast<double>(i); }

    /// Adds a row of the Lagrange interpolation of six points.
    void interpolate(double at_rad, Eigen::Index row, std::vector<Eigen::Triplet<double>>& entries) const {
        constexpr Eigen::Index points = 6;
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
    void make_kicks(const Chain& chain) {
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

    /// Over a half cycle, with a level.
    Functions over_half_cycle(const Functions& f, std::size_t level) const {
        Functions g = maps_[level] * f;
        const Eigen::Index n = harmonics_ + 1;
        for (Eigen::Index m = 1; m < n; ++m) {
            const double c = std::cos(static_cast<double>(m) * turn_rad_);
            const double s = std::sin(static_cast<double>(m) * turn_rad_);
            for (Eigen::Index i = 0; i < rows_; ++i) {
                const double re = g(i, m);
                g(i, m) = re * c - g(i, n + m) * s;
                g(i, n + m) = re * s + g(i, n + m) * c;
            }
        }
        return g;
    }

    /// Over the kick of a turn.
    Functions over_turn(const Functions& f, std::size_t side) const {
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

    /// (k - c)(2 g - (k - c)), k the kick of the turn, c its mean: E[(k - c + g')^2 - g'^2], g' the potential after it.
    Functions square(const Functions& potential, std::size_t side, double mean_kick_rad) const {
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

    void finish_turn(Pair& f, std::size_t side, bool with_kicks, double mean_kick_rad) const {
        f.value = over_turn(f.value, side);
        if (with_kicks) {
            f.value += kick_[side];
            f.value.col(0).array() -= mean_kick_rad;
        }
        if (f.carried.size() == 0) return;
        f.carried = over_turn(f.carried, side) + square(f.value, side, mean_kick_rad);
    }

    /// Over one hold, whose first turn is on that side.
    Pair hold(const Pair& end, std::size_t first_side, bool with_kicks, double mean_kick_rad) const {
        Pair sum{zero(), end.carried.size() > 0 ? zero() : Functions{}};
        std::vector<Pair> parts(levels_.size());
        tbb::parallel_for(std::size_t{0}, levels_.size(), [&](std::size_t level) {
            Pair f = end;
            for (std::int64_t turn = hold_; turn-- > 0;) {
                f.value = over_half_cycle(f.value, level);
                if (f.carried.size() > 0) f.carried = over_half_cycle(f.carried, level);
                if (turn == 0) break;  // the level is not known there yet
                finish_turn(f, (first_side + static_cast<std::size_t>(turn)) % 2, with_kicks, mean_kick_rad);
            }
            parts[level] = std::move(f);
        });
        for (std::size_t level = 0; level < levels_.size(); ++level) {
            sum.value += levels_[level].weight * parts[level].value;
            if (sum.carried.size() > 0) sum.carried += levels_[level].weight * parts[level].carried;
        }
        finish_turn(sum, first_side, with_kicks, mean_kick_rad);
        return sum;
    }

    Pair period(Pair f, bool with_kicks, double mean_kick_rad) const {
        for (std::int64_t turn = turns(); turn > 0;) {
            turn -= hold_;
            f = hold(f, static_cast<std::size_t>(turn % 2), with_kicks, mean_kick_rad);
        }
        return f;
    }

    Eigen::Index harmonics_;
    double turn_rad_;
    std::int64_t hold_;
    Eigen::Index rows_ = 0;
    double first_rad_ = 0.0;
    double step_rad_ = 0.0;
    std::vector<Level> levels_;
    std::vector<Sparse> maps_;  ///< of each level: functions of the amplitude a half cycle earlier
    Functions turn_;            ///< powers of (v + r)/(1 + r v) by powers of v
    std::array<Functions, 2> cosine_, sine_, kick_;
};

/// 1 - T + (mean over the grid): regular, where 1 - T is not. x - T x + mean(x) = f has the solution whose mean is that
/// of f over the stationary state, less which it is the sum of all later f (Poisson's equation).
class Deflated : public Eigen::EigenBase<Deflated> {
   public:
    using Scalar = double;
    using RealScalar = double;
    using StorageIndex = int;
    enum { ColsAtCompileTime = Eigen::Dynamic, MaxColsAtCompileTime = Eigen::Dynamic, IsRowMajor = false };

    explicit Deflated(const TransferOperator& chain) : chain_(chain) {}
    Eigen::Index rows() const { return chain_.rows() * chain_.columns(); }
    Eigen::Index cols() const { return rows(); }
    template <class Vector>
    Eigen::Product<Deflated, Vector, Eigen::AliasFreeProduct> operator*(const Eigen::MatrixBase<Vector>& x) const {
        return {*this, x.derived()};
    }
    Eigen::VectorXd apply(const Eigen::VectorXd& x) const {
        const Functions f = Eigen::Map<const Functions>(x.data(), chain_.rows(), chain_.columns());
        Functions result = f - chain_.expectation(f);
        result.col(0).array() += f.col(0).mean();
        return Eigen::Map<const Eigen::VectorXd>(result.data(), result.size());
    }

   private:
    const TransferOperator& chain_;
};

}  // namespace

}  // namespace ringlock::dither

namespace Eigen::internal {

template <class Vector>
struct generic_product_impl<ringlock::dither::Deflated, Vector, SparseShape, DenseShape, GemvProduct>
    : generic_product_impl_base<ringlock::dither::Deflated, Vector,
                                generic_product_impl<ringlock::dither::Deflated, Vector>> {
    template <class To>
    static void scaleAndAddTo(To& to, const ringlock::dither::Deflated& a, const Vector& x, double factor) {
        to.noalias() += factor * a.apply(x);
    }
};

}  // namespace Eigen::internal

namespace ringlock::dither {

namespace {

/// Solution of Poisson's equation for `f`; nothing where the phase hardly comes round.
std::optional<Functions> potential(const TransferOperator& chain, const Functions& f) {
    const Deflated matrix(chain);
    Eigen::GMRES<Deflated, Eigen::IdentityPreconditioner> solver;
    solver.set_restart(150);
    solver.setMaxIterations(1500);
    solver.setTolerance(1e-7);
    solver.compute(matrix);
    const Eigen::VectorXd x = solver.solve(Eigen::Map<const Eigen::VectorXd>(f.data(), f.size()));
    if (solver.info() != Eigen::Success) return std::nullopt;
    return Functions(Eigen::Map<const Functions>(x.data(), chain.rows(), chain.columns()));
}

/// Of one turn.
struct Drift {
    double mean_kick_rad = 0.0;
    double variance_rad2 = 0.0;
};

std::optional<Drift> drift(const Chain& chain, int harmonics) {
    const TransferOperator transfer(chain, harmonics);
    const auto turns = static_cast<double>(transfer.turns());
    const std::optional<Functions> later = potential(transfer, transfer.kicks());
    if (!later) return std::nullopt;
    const double mean = later->col(0).mean() / turns;
    const std::optional<Functions> squares = potential(transfer, transfer.squares(*later, mean));
    if (!squares) return std::nullopt;
    return Drift{mean, squares->col(0).mean() / turns};
}

/// With as many harmonics of the phase as the result takes to stand.
std::optional<Drift> converged_drift(const Chain& chain) {
    constexpr double relative = 0.005;
    const double full = 2.0 * chain.r * chain.r;  // variance of a kick, to first order
    std::optional<Drift> last = drift(chain, 4);
    for (int harmonics = 8; last && harmonics <= 128; harmonics *= 2) {
        const std::optional<Drift> next = drift(chain, harmonics);
        if (!next) return std::nullopt;
        const bool stands =
            std::abs(next->variance_rad2 - last->variance_rad2) <= 2.0 * relative * next->variance_rad2 &&
            std::abs(next->mean_kick_rad - last->mean_kick_rad) <= 1e-3 * std::sqrt(full);
        last = next;
        if (stands) return last;
    }
    return std::nullopt;
}

/// Gyros that are taken along the chain itself, with the exact motion of their resonators.
class Followed {
   public:
    Followed(const Chain& chain, const gyro::Setup& setup, const gyro::DriveNoise& noise, std::uint64_t first_gyro)
        : chain_(chain), noise_(noise, devices(setup), chain.rms_rad, identities(first_gyro)) {
        // Phases that fill the circle evenly however many gyros there are: multiples of the golden ratio.
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const double share = (static_cast<double>(first_gyro + lane) + 0.5) * 0.6180339887498949;
            first_rad_[lane] = units::two_pi * (share - std::floor(share));
        }
    }

    void advance(std::int64_t turns) {
        constexpr std::int64_t piece = 256;
        for (; turns > 0; turns -= piece) {
            const auto some = static_cast<std::size_t>(std::min(turns, piece));
            noise_.next(some, deviation_rad_, late_s_);
            for (std::size_t i = 0; i < some; ++i, ++turn_) step(deviation_rad_[i]);
        }
    }
    /// What lock-in has added to the phase of each gyro.
    const simd::Lanes& lockin_rad() const { return lockin_rad_; }

   private:
    static std::vector<gyro::Device> devices(const gyro::Setup& setup) {
        return std::vector<gyro::Device>(simd::lanes, gyro::Device(setup));
    }
    static random::LaneIdentities identities(std::uint64_t first_gyro) {
        random::LaneIdentities who;
        who.seed = 1;  // of predictions: the same one always
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = first_gyro + lane;
        return who;
    }
    void step(const simd::Lanes& deviation_rad) {
        const double sign = turn_ % 2 == 0 ? -1.0 : 1.0;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const double phase = first_rad_[lane] + lockin_rad_[lane] +
                                 static_cast<double>(turn_) * chain_.half_cycle_rad +
                                 sign * (chain_.amplitude_rad + deviation_rad[lane] - 0.25 * units::pi);
            lockin_rad_[lane] -= 2.0 * std::atan2(chain_.r * std::sin(phase), 1.0 + chain_.r * std::cos(phase));
        }
    }

    Chain chain_;
    DriveNoiseLanes noise_;
    std::int64_t turn_ = 0;
    simd::Lanes first_rad_{}, lockin_rad_{};
    std::vector<simd::Lanes> deviation_rad_, late_s_;
};

constexpr double seen_after_s = 32.0;  ///< where a random walk is read from an Allan deviation

/// Whether the slow phase takes all values within the time after which the random walk is read: by the input's rotation
/// or by the kicks. Otherwise the walk that is seen is a mean over gyros that differ, and not that of infinite time.
bool comes_round(const Chain& chain, const gyro::Setup& setup) {
    constexpr double rotations = 2.0;
    const double turns = seen_after_s * 2.0 * setup.dither_frequency_hz;
    const double by_input = chain.half_cycle_rad * turns;
    const double by_kicks = std::sqrt(0.5 * gyro::randomised_kick_variance_rad2(setup) * turns);
    return std::abs(by_input) > rotations * units::two_pi || by_kicks > 0.5 * units::two_pi;
}

/// Mean kick and long-term variance from many gyros along the chain.
Drift followed_drift(const Chain& chain, const gyro::Setup& setup, const gyro::DriveNoise& noise) {
    constexpr std::size_t blocks = 32;
    constexpr std::size_t stretches = 8;
    const double memory = 1.0 / (1.0 - gyro::Resonator(noise).decay());
    const std::int64_t settling = std::max<std::int64_t>(4000, static_cast<std::int64_t>(20.0 * memory));
    const std::int64_t turns =
        comes_round(chain, setup) ? settling : std::llround(seen_after_s * 2.0 * setup.dither_frequency_hz);
    std::vector<double> sum(blocks, 0.0);
    std::vector<double> squares(blocks, 0.0);
    tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
        Followed gyros(chain, setup, noise, block * simd::lanes);
        gyros.advance(settling);  // the phases' beginning is forgotten
        for (std::size_t i = 0; i < stretches; ++i) {
            const simd::Lanes before = gyros.lockin_rad();
            gyros.advance(turns);
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                const double moved = gyros.lockin_rad()[lane] - before[lane];
                sum[block] += moved;
                squares[block] += moved * moved;
            }
        }
    });
    constexpr auto count = static_cast<double>(blocks * stretches * simd::lanes);
    const double mean = std::accumulate(sum.begin(), sum.end(), 0.0) / count;
    const double square = std::accumulate(squares.begin(), squares.end(), 0.0) / count;
    const auto length = static_cast<double>(turns);
    return {mean / length, (square - mean * mean) * count / (count - 1.0) / length};
}

/// Deterministic motion under a sinusoidal modulation: mean and spread over gyros of all phases.
void follow_sinusoid(const Chain& chain, const gyro::Setup& setup, const gyro::DriveNoise& noise,
                     NoiseEffectiveness& found) {
    constexpr std::size_t times = std::size(spread_times_s);
    constexpr std::size_t blocks = 16;
    std::array<std::array<simd::Lanes, blocks>, times> angle_rad;
    tbb::parallel_for(std::size_t{0}, blocks, [&](std::size_t block) {
        Followed gyros(chain, setup, noise, block * simd::lanes);
        std::int64_t turn = 0;
        for (std::size_t i = 0; i < times; ++i) {
            const std::int64_t end = std::llround(spread_times_s[i] * 2.0 * setup.dither_frequency_hz);
            gyros.advance(end - turn);
            turn = end;
            angle_rad[i][block] = gyros.lockin_rad();
        }
    });
    constexpr auto count = static_cast<double>(blocks * simd::lanes);
    const double arcsec_per_rad = setup.scale_factor_arcsec / units::two_pi;
    for (std::size_t i = 0; i < times; ++i) {
        double sum = 0.0;
        double squares = 0.0;
        for (const simd::Lanes& angles : angle_rad[i]) {
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                sum += angles[lane];
                squares += angles[lane] * angles[lane];
            }
        }
        const double variance = std::max(0.0, (squares - sum * sum / count) / (count - 1.0));
        found.angle_spread.push_back({spread_times_s[i], arcsec_per_rad * std::sqrt(variance)});
        found.bias_deg_h = arcsec_per_rad * sum / count / spread_times_s[i];  // that of the longest time stays
    }
    found.reason = "a sinusoidal modulation is deterministic and makes no random walk";
}

}  // namespace

NoiseEffectiveness predict_noise_effectiveness(const gyro::Setup& setup, const InjectedTurns& noise) {
    using gyro::NoiseForm;
    NoiseEffectiveness found;
    found.input_rate_deg_h = setup.input_rate_deg_h;
    const double kick = gyro::turn_kick_rad(setup);
    const double depth = gyro::modulation_depth_rad(setup);
    Chain chain;
    chain.r = std::sqrt(-std::expm1(-0.25 * kick * kick));
    chain.amplitude_rad = depth - 0.125 / depth - gyro::half_turn_delay_rad(setup);
    chain.half_cycle_rad = units::pi * setup.input_rate_deg_h /
                           (setup.scale_factor_arcsec * setup.dither_frequency_hz);  // [deg/h] is [arcsec/s]
    chain.rms_rad = noise.rms_rad;
    chain.level_rad = noise.rms_rad;
    found.change_per_cycle_rad = std::numbers::sqrt2 * noise.rms_rad;
    if (noise.drive) {
        const gyro::Resonator resonator(*noise.drive);
        found.change_per_cycle_rad = noise.rms_rad * resonator.change_per_cycle();
        chain.decay = resonator.step()(0, 0);
        if (noise.drive->form == NoiseForm::held) {
            chain.distribution = noise.drive->distribution;
            chain.hold_half_cycles = noise.drive->hold_half_cycles;
            chain.level_rad = noise.rms_rad / resonator.rms();
        } else {
            // The sum of 32 levels a half cycle is Gaussian whatever they are.
            chain.level_rad = noise.rms_rad * std::sqrt((1.0 + chain.decay) / (1.0 - chain.decay));
        }
    }
    if (kick == 0.0) {
        found.bias_deg_h = 0.0;
        found.reason = "without lock-in there is no random walk";
        return found;
    }
    if (noise.rms_rad == 0.0) {
        found.reason = "no noise is injected";
        return found;
    }
    if (noise.drive && noise.drive->form == NoiseForm::sinusoidal) {
        follow_sinusoid(chain, setup, *noise.drive, found);
        return found;
    }
    std::optional<Drift> drift;
    if (is_independent(chain)) {
        drift = Drift{0.0, gyro::randomised_kick_variance_rad2(setup)};
    } else if (!noise.drive || (noise.drive->amplitude_loop_hz == 0.0 && comes_round(chain, setup))) {
        if (!is_too_large(chain)) drift = converged_drift(chain);
    }
    if (!drift && noise.drive) drift = followed_drift(chain, setup, *noise.drive);
    if (!drift) {
        found.reason = "the noise is so weak that the phases hardly come round";
        return found;
    }
    found.arw_over_theory = std::sqrt(drift->variance_rad2 / gyro::randomised_kick_variance_rad2(setup));
    found.bias_deg_h =
        drift->mean_kick_rad / units::two_pi * setup.scale_factor_arcsec * 2.0 * setup.dither_frequency_hz;
    return found;
}

}  // namespace ringlock::dither
