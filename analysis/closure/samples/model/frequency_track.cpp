#include "analysis/closure/samples/model/frequency_track.hpp"

#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::closure {

std::vector<double> line_phase(std::size_t size, double rate_hz, const FrequencyTrack& track) {
    std::vector<double> phase(size);
    for (std::size_t i = 0; i < size; ++i) {
        const double t = (static_cast<double>(i) - 0.5 * static_cast<double>(size - 1)) / rate_hz;
        const double turns = track.turns(t);
        phase[i] = units::two_pi * (turns - std::floor(turns));
    }
    return phase;
}

}  // namespace ringlock::closure
