#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "engine/readout/lane_readings.hpp"
#include "engine/simd/lanes.hpp"

/// Lock-in compensators: they see readings and a calibration, never the truth.
namespace ringlock::compensate {

/// Calibration of each gyro of a block, which an operator has measured beforehand.
struct Calibration {
    std::size_t lanes = simd::lanes;                         ///< gyros of the block
    std::array<double, simd::lanes> b_rad_s{};               ///< (2 pi / K) Omega_L
    std::array<double, simd::lanes> dither_amplitude_rad{};  ///< half the swing in optical phase
    std::array<double, simd::lanes> positive_duration_s{};   ///< of half cycles of positive dither rate
    std::array<double, simd::lanes> negative_duration_s{};
    double amplitude_margin_rad = 0.0;  ///< half cycles' amplitudes stay within it of the mean
    double amplitude_rms_rad = 0.0;     ///< their spread about it
    /// Amplitudes change over half cycles, evenly, by at most that much; 0: half cycles are cosines.
    double amplitude_change_rad = 0.0;
    double amplitude_change_rms_rad = 0.0;  ///< rms of that change
};

/// Lock-in errors at the turns of a piece, to be taken away from the phases read there.
struct LaneErrors {
    std::vector<simd::Lanes> fringes;  ///< [turns], less ...
    simd::Lanes whole;                 ///< ... these whole fringes
    /// [turns] up to the middle of the half cycle that ends at the turn, less `whole`: the correction of the angle
    /// between the turns, since the lock-in acts next to the turns alone. Filled where `middles` asks for it.
    std::vector<simd::Lanes> middle_fringes;
    bool middles = false;

    void resize(std::size_t turns) {
        fringes.resize(turns);
        middle_fringes.resize(middles ? turns : 0);
    }
};

/// Computes the lock-in error of a block of gyros from the readings at the zero-rate points, online.
class LaneCompensator {
   public:
    virtual ~LaneCompensator() = default;
    /// Whether readings are to be as sampled, with pulses, before the phase is recovered from them.
    virtual bool wants_samples() const { return false; }
    /// Takes the next readings, consecutive and without gaps, and gives the error accumulated up to each. An error
    /// never depends on later readings, but that the first piece of a run may be taken as one.
    virtual void observe(const readout::LaneReadings& readings, LaneErrors& errors) = 0;
    /// Times that turn maps of any gyro were tabulated.
    virtual std::int64_t tables_made() const { return 0; }
};

}  // namespace ringlock::compensate
