#pragma once
#include <cstdint>
#include <vector>

#include "engine/compensate/coupling_filter.hpp"
#include "engine/compensate/exact.hpp"
#include "engine/readout/fraction_recovery.hpp"

namespace ringlock::compensate {

/// The exact compensator with a coupling that it learns online: neither lock-in threshold nor coupling phase need be
/// known; it starts from the calibration's threshold.
///
/// The lock-in does not only kick the phase at a turn, it also distorts the path there: pulses come early on one side
/// and late on the other, by an amount that shows b sin(psi + e) and b cos(psi + e) at every single turn, independently
/// of dither and input. FractionRecovery adds up the normal equations of that, CouplingFilter estimates the coupling
/// from those of 128 turns each, and this compensator inverts the turn map with it.
///
/// Its state beyond Exact's are five sums, the filter's 15 numbers, and the pulse tables for the coupling as known,
/// which are made anew when the estimate has moved by a hundredth. Readings are to be as sampled, with pulses: it
/// recovers the phase from them by itself.
class Adaptive final : public LaneCompensator {
   public:
    /// \param electronics    they determine the noise of the readout
    /// \param tolerance_rad  of the turn map's tables, for one turn
    Adaptive(const Calibration& calibration, const readout::Electronics& electronics, double tolerance_rad);

    void observe(const readout::LaneReadings& readings, LaneErrors& errors) override;
    bool wants_samples() const override { return true; }
    std::int64_t tables_made() const override { return exact_.tables_made(); }

    /// As estimated by now.
    readout::FractionRecovery::Coupling coupling(std::size_t lane) const { return filters_[lane].coupling(); }
    /// Times that the memory of the coupling phase was contradicted and begun anew.
    int restarts(std::size_t lane) const { return filters_[lane].restarts(); }

   private:
    void take_coupling();

    std::size_t lanes_;
    readout::FractionRecovery recovery_;
    Exact exact_;
    std::vector<CouplingFilter> filters_;
    std::vector<double> between_estimates_s_;
    std::int64_t turns_ = 0;
    readout::LaneReadings recovered_;
};

}  // namespace ringlock::compensate
