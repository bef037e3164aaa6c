#include "engine/reader/whole_cycle.hpp"

namespace ringlock::reader {

void WholeCycle::take(const Latched& latched) {
    const double at_s = latched.time_s - cycle_s_;
    while (crossings_.size() > 2 && crossings_[1].time_s <= at_s) crossings_.pop_front();
    if (crossings_.size() < 2) return;
    // Where a noisy dither crosses late the second angle is not there yet, and the line before it goes on.
    const Crossing& before = crossings_[0];
    const Crossing& after = crossings_[1];
    const double share = (at_s - before.time_s) / (after.time_s - before.time_s);
    angle_arcsec_ = before.angle_arcsec + share * (after.angle_arcsec - before.angle_arcsec);
}

}  // namespace ringlock::reader
