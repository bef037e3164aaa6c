#pragma once
#include "analysis/closure/closure.hpp"
#include "engine/scenario/scenario.hpp"

namespace ringlock::closure {

/// The closed model as a scenario for `ringlock run` and `ringlock record`: the device as fitted, with the effects that
/// were added. Times count from the start of the record.
///
/// Of a record of samples lock-in is no part of the model: what it leaves is in the white noises that were fitted. The
/// dither then turns at the samples, and the white noise of the angle is that of the detectors, with a scale factor
/// that makes it small beside a fringe.
scenario::Scenario closed_scenario(const record::Record& record, const Closure& closure);

/// When the record begins [s], on its own clock.
double start_of(const record::Record& record);

}  // namespace ringlock::closure
