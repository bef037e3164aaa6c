#pragma once
#include <vector>

#include "engine/dither/lane_dither.hpp"
#include "engine/random/normal_lanes.hpp"
#include "tests/physics/support.hpp"
#include "tests/support/drive.hpp"

/// A block of gyros, no two alike, and its noisy drive.
namespace ringlock::test {

/// Gyros of unequal couplings, rates and phases. `add(setup, x)` gives gyro x what else is to tell it apart.
template <class Add>
std::vector<gyro::Device> unequal_devices(std::size_t gyros, Add add) {
    std::vector<gyro::Device> devices;
    for (std::size_t i = 0; i < gyros; ++i) {
        gyro::Setup setup = paper_device();
        const auto x = static_cast<double>(i);
        setup.lockin_threshold_deg_h *= 1.0 + 0.1 * x;
        setup.input_rate_deg_h = 20.0 * x - 10.0;
        setup.coupling_phase_rad = 0.4 * x;
        setup.initial_phase_rad = 0.7 * x;
        add(setup, x);
        devices.emplace_back(setup);
    }
    return devices;
}

/// Injected noise of a block [rad], rms: that of the default scenario.
inline constexpr double block_noise_rad = 3.0;

inline dither::LaneDither noisy_dither(const std::vector<gyro::Device>& devices) {
    random::LaneIdentities who;
    who.seed = 35;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = lane;
    return {devices, block_noise_rad, who};
}

/// Half cycles that the noisy drive may ask of the device.
inline propagate::HalfCycleRanges noisy_ranges(const gyro::Device& device) {
    return ranges(device, Drive::amplitude_margin_rad(block_noise_rad));
}

}  // namespace ringlock::test
