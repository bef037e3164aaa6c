#pragma once
#include "engine/reader/stripper.hpp"

namespace ringlock::reader {

/// The latched angle as it is, dither included.
class NoStripping final : public Stripper {
   public:
    void take(const Latched& latched) override { angle_arcsec_ = latched.angle_arcsec; }
    double angle_arcsec() const override { return angle_arcsec_; }
    double delay_s() const override { return 0.0; }
    double residue_relative() const override { return 1.0; }
    double warm_up_s() const override { return 0.0; }

   private:
    double angle_arcsec_ = 0.0;
};

}  // namespace ringlock::reader
