#pragma once
#include <deque>

#include "engine/reader/stripper.hpp"

namespace ringlock::reader {

/// Counts over whole cycles of the dither, as in Gao & Deng 2007: the angle is latched where the measured dither angle
/// crosses zero upwards, where the dither itself adds nothing, for any amplitude, and the output at a tick is linear
/// between these angles one cycle earlier, when both of them are known.
///
/// Sampling once a cycle and the straight line between make a response of sinc^2(frequency/dither frequency) to slow
/// rotations; faster ones are aliased.
class WholeCycle final : public Stripper {
   public:
    explicit WholeCycle(double dither_hz) : cycle_s_(1.0 / dither_hz) {}

    void take(const Latched& latched) override;
    bool wants_crossings() const override { return true; }
    void take_crossing(double time_s, double angle_arcsec) override { crossings_.push_back({time_s, angle_arcsec}); }
    double angle_arcsec() const override { return angle_arcsec_; }
    double delay_s() const override { return cycle_s_; }
    double residue_relative() const override { return 0.0; }
    double warm_up_s() const override { return 4.0 * cycle_s_; }

   private:
    struct Crossing {
        double time_s, angle_arcsec;
    };

    double cycle_s_;
    std::deque<Crossing> crossings_;  ///< from the last one before the instant that is put out on
    double angle_arcsec_ = 0.0;
};

}  // namespace ringlock::reader
