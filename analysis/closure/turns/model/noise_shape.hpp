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

/// Correction of the likelihood for injected noise that is flatter than normal, as noise between bounds is.
///
/// A turn's innovation v, of variance s^2, is a part of the phase psi, and the phase that the lock-in adds before the
/// turn is a function of psi: v is correlated with it even if no effect is missing. The factor |1 - before'| of the
/// likelihood compensates for this in the mean if v is normal (Stein, Annals of Statistics 9, 1135, 1981). Otherwise
/// the residual score of a term exp(i k psi) in `before` is
///
///     E[(v / s^2 - i k / (1 - before'(psi))) exp(i k psi)],     psi = predicted + v + before(psi),
///
/// over the density that the innovations show. It is tabulated over the predicted phase, which is kept for each turn.
class NoiseShape {
   public:
    using Left = TurnKicks::Weights;  ///< for harmonics 1, 2, ...

    /// \param counted_rad  innovations that determine the density
    /// \param predicted_rad  predicted phases without the phase that the lock-in adds before the turn
    /// \return null if the innovations are not flatter than normal ones beyond doubt
    static std::shared_ptr<const NoiseShape> of(std::span<const double> counted_rad, const TurnKicks& kicks,
                                                std::span<const int> direction, std::span<const double> predicted_rad);

    Left at(std::size_t turn) const;

   private:
    using Lefts = Eigen::Array<std::complex<double>, TurnKicks::harmonics, 1>;
    using Table = PhaseTable<Lefts>;
    static Table by_phase(const TurnKicks& kicks, int direction, std::span<const double> sizes_rad);

    std::unique_ptr<const Table> at_minima_, at_maxima_;
    std::vector<std::uint8_t> is_minimum_;
    std::vector<double> predicted_rad_;
};

}  // namespace ringlock::closure
