#pragma once
#include "engine/scenario/arm.hpp"

namespace ringlock::ensemble {

/// Physical history of a gyro; arms that differ only in their compensator share it.
enum class TrajectoryKind { ideal, plain, noise_injected };

inline TrajectoryKind kind_of(const scenario::Arm& arm) {
    return arm.ideal            ? TrajectoryKind::ideal
           : arm.noise_injected ? TrajectoryKind::noise_injected
                                : TrajectoryKind::plain;
}

}  // namespace ringlock::ensemble
