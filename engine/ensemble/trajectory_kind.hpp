#pragma once
#include "engine/scenario/arm.hpp"

namespace ringlock::ensemble {

/// What happens to a gyro physically; arms that differ in their compensator only share it.
enum class TrajectoryKind { ideal, plain, noise_injected };

inline TrajectoryKind kind_of(const scenario::Arm& arm) {
    return arm.ideal            ? TrajectoryKind::ideal
           : arm.noise_injected ? TrajectoryKind::noise_injected
                                : TrajectoryKind::plain;
}

}  // namespace ringlock::ensemble
