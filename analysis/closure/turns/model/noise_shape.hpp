#pragma once
#include <Eigen/Dense>
#include <complex>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "analysis/closure/turns/model/kicks.hpp"
#include "analysis/closure/turns/model/phase_table.hpp"

namespace ringlock::closure {

/// What injected noise that is flatter than a normal one, as between bounds, changes in the likelihood.
///
/// A turn's innovation v, of variance s^2, is a part of the phase psi that comes of it, and what the lock-in adds
/// before the turn follows that phase: v goes with it where nothing is missing. The likelihood's |1 - before'| makes up
/// for that in the mean where v is normal (Stein, Annals of Statistics 9, 1135, 1981). Else it leaves, of exp(i k psi)
/// in what is added,
///
///     E[(v / s^2 - i k / (1 - before'(psi))) exp(i k psi)],     psi = foretold + v + before(psi),
///
/// over the density that the innovations show. Kept over the phase, and the phase foretold for each turn.
class NoiseShape {
   public:
    using Left = TurnKicks::Weights;  ///< of harmonics 1, 2, ..

    /// `counted_rad`: innovations that show the density. Foretold phases are those but for the lock-in's share before
    /// the turn. None where the innovations are not flatter than normal ones beyond doubt.
    static std::shared_ptr<const NoiseShape> of(std::span<const double> counted_rad, const TurnKicks& kicks,
                                                std::span<const int> direction, std::span<const double> foretold_rad);

    Left at(std::size_t turn) const;

   private:
    using Lefts = Eigen::Array<std::complex<double>, TurnKicks::harmonics, 1>;
    using Table = PhaseTable<Lefts>;
    static Table by_phase(const TurnKicks& kicks, int direction, std::span<const double> sizes_rad);

    std::unique_ptr<const Table> at_minima_, at_maxima_;
    std::vector<std::uint8_t> is_minimum_;
    std::vector<double> foretold_rad_;
};

}  // namespace ringlock::closure
