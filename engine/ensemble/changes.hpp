#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "engine/effects/effect.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/scenario.hpp"

/// The deterministic part of the effects on a block of gyros, under the scenario's temperature and input rate.
namespace ringlock::ensemble {

/// Rotation [arcsec] that something adds to a gyro of a block from `start_s` after the start of the run on, over
/// `duration_s`: a pure function of these.
using AngleOver = std::function<double(std::size_t lane, double start_s, double duration_s)>;

/// Rotation that an effect adds. The effect must outlive the function.
AngleOver angle_of(const scenario::ActiveEffect& active, const scenario::Scenario& scenario,
                   const std::vector<gyro::Setup>& setups);

/// The input's profile less the mean that the gyros have for a rate.
AngleOver angle_of_profile(const scenario::InputRate& input, const std::vector<gyro::Setup>& setups);

/// The same over the half cycles of a block of `lanes` gyros.
std::unique_ptr<effects::LaneRateProcess> angles_of(AngleOver added, std::size_t lanes);

/// Changes of the coupling by all active effects, half cycle by half cycle. Effects whose bounds exclude a change over
/// the run are left out.
class CouplingChanges {
   public:
    /// The effects must outlive it.
    CouplingChanges(const scenario::Scenario& scenario, const std::vector<gyro::Setup>& setups);

    bool phases_vary() const { return phases_vary_; }

    /// Evaluates the half cycles that begin at `turns` turns, from turn `first_turn` of the run on.
    void evaluate(std::int64_t first_turn, std::size_t turns);
    /// Factors of the threshold, [turn][gyro]; empty where it does not change.
    std::span<const simd::Lanes> threshold_factors() const { return factors_; }
    /// Changes of the coupling's phase, [turn][gyro]; empty where it does not change.
    std::span<const simd::Lanes> phases_rad() const { return phases_rad_; }

   private:
    scenario::Scenario scenario_;
    std::vector<gyro::Setup> setups_;
    std::vector<double> period_s_;
    std::vector<effects::ChangeOver> changes_;
    bool thresholds_vary_ = false;
    bool phases_vary_ = false;
    std::vector<simd::Lanes> factors_;
    std::vector<simd::Lanes> phases_rad_;
};

}  // namespace ringlock::ensemble
