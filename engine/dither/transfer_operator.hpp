#pragma once
#include <Eigen/Core>
#include <Eigen/Sparse>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/dither/phase_chain.hpp"

namespace ringlock::dither {

/// The transfer operator of a PhaseChain: it takes a function of the state at the end of a period to its expectation as
/// a function of the state at the beginning. A period is made of whole holds and of whole cycles and begins at a
/// minimum of the phase.
///
/// Functions are Fourier series in the slow phase and are interpolated in the amplitude.
class TransferOperator {
   public:
    /// A row for each amplitude of the grid; f = Re sum c_m exp(i theta m), the real parts of c_0...c_M first, then the
    /// imaginary ones.
    using Functions = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

    TransferOperator(const PhaseChain& chain, int harmonics);

    Eigen::Index rows() const { return rows_; }
    Eigen::Index columns() const { return 2 * (harmonics_ + 1); }
    std::int64_t turns_per_period() const { return hold_ % 2 == 0 ? hold_ : 2 * hold_; }

    Functions expectation(const Functions& f) const;
    /// Expectation of the sum of the kicks over a period.
    Functions kicks() const;
    /// Expectation over a period of the squares whose mean is the long-term variance of the sum of the kicks: of (k -
    /// c)(2 g - (k - c)) at each turn, k the kick, c = `mean_kick_rad`, g = `potential` there, which solves Poisson's
    /// equation for k - c.
    Functions squares(const Functions& potential, double mean_kick_rad) const;

    /// Multiplications that one application takes, about.
    static double work(const PhaseChain& chain, int harmonics);

   private:
    /// A function and, where it is not empty, the sum of the squares that is propagated backwards along with it.
    struct Pair {
        Functions value;
        Functions squares;
    };

    Functions zero() const { return Functions::Zero(rows(), columns()); }
    double amplitude_rad(Eigen::Index i) const { return first_rad_ + step_rad_ * static_cast<double>(i); }
    void interpolate(double at_rad, Eigen::Index row, std::vector<Eigen::Triplet<double>>& entries) const;
    void make_maps(const PhaseChain& chain);
    void make_kicks(const PhaseChain& chain);
    Functions over_half_cycle(const Functions& f, std::size_t level) const;
    Functions over_turn(const Functions& f, std::size_t side) const;
    Functions square(const Functions& potential, std::size_t side, double mean_kick_rad) const;
    void finish_turn(Pair& f, std::size_t side, bool with_kicks, double mean_kick_rad) const;
    Pair hold(const Pair& end, std::size_t first_side, bool with_kicks, double mean_kick_rad) const;
    Pair period(Pair f, bool with_kicks, double mean_kick_rad) const;

    Eigen::Index harmonics_;
    double half_cycle_rad_;
    std::int64_t hold_;
    Eigen::Index rows_;
    double first_rad_;
    double step_rad_;
    std::vector<DriveLevel> levels_;
    /// For each level, the map from a function of the amplitude to that function a half cycle earlier.
    std::vector<Eigen::SparseMatrix<double, Eigen::RowMajor>> maps_;
    Functions turn_;  ///< powers of (v + r)/(1 + r v), as power series of v
    std::array<Functions, 2> cosine_, sine_, kick_;
};

}  // namespace ringlock::dither
