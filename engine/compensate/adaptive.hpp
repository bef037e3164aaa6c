#pragma once
#include <array>
#include <cstdint>

#include "engine/compensate/exact.hpp"
#include "engine/readout/fraction_recovery.hpp"

namespace ringlock::compensate {

/// The exact compensator with a coupling that it learns online: neither lock-in threshold nor coupling phase need be
/// told, the calibration's threshold is where it starts from.
///
/// The lock-in does not only kick the phase at a turn, it bends the path there: pulses come early on one side and late
/// on the other, by an amount that shows b sin(psi + e) and b cos(psi + e) at every single turn, whatever the dither
/// and the input do. FractionRecovery keeps the normal equations of that over the last minute or so, and this
/// compensator inverts the turn map with their solution of every 128 turns. A mean over a minute is late; the mean of
/// such means is late twice, and twice the one less the other is not (Brown, "Smoothing, Forecasting and Prediction of
/// Discrete Time Series", 1963, double smoothing), so that a steady drift is followed without delay.
///
/// Its state beyond Exact's are five sums and the pulse tables for the coupling as known, which are made anew when the
/// estimate has moved by a hundredth.
/// Readings are to be as sampled, with pulses: it recovers the phase from them by itself.
class Adaptive final : public LaneCompensator {
   public:
    /// \param electronics    what the readout's noise is
    /// \param tolerance_rad  of the turn map's tables, for one turn
    Adaptive(const Calibration& calibration, const readout::Electronics& electronics, double tolerance_rad);

    void observe(const readout::LaneReadings& readings, LaneErrors& errors) override;
    bool wants_samples() const override { return true; }

    /// As estimated by now.
    readout::FractionRecovery::Coupling coupling(std::size_t lane) const { return coupling_[lane]; }

    static constexpr double memory_turns = 65536.0;

   private:
    void take_coupling();

    std::size_t lanes_;
    readout::FractionRecovery recovery_;
    Exact exact_;
    std::array<readout::FractionRecovery::Coupling, simd::lanes> coupling_{};
    simd::Lanes late_cosine_, late_sine_;  ///< mean of means: b cos e, b sin e
    std::int64_t turns_ = 0;
    // Rows between two estimates, and what comes of them.
    readout::LaneReadings part_;
    LaneErrors part_errors_;
};

}  // namespace ringlock::compensate
