#pragma once
#include "engine/reader/stripper.hpp"

namespace ringlock::reader {

/// Cancels the frequency of the dither's drive: amplitude and phase of a sinusoid are learnt from the output itself and
/// subtracted (Widrow et al., "Adaptive noise cancelling", Proc. IEEE 63, 1975), which for a steady dither is the
/// filter (Glover, IEEE Trans. ASSP 25, 1977)
///
///     H(z) = (1 - m) (1 - 2 c/z + 1/z^2)/(1 - 2 (1 - m) c/z + (1 - 2 m)/z^2),    c = cos(2 pi f_D/f_latch),
///
/// with m = pi bandwidth/f_latch. The factor 1 - m makes the gain one for a steady rotation. It works on increments, so
/// that a rotation does not grow in the sinusoid's place.
class Notch final : public Stripper {
   public:
    Notch(double bandwidth_hz, double latch_hz, double dither_hz);

    void take(const Latched& latched) override;
    double angle_arcsec() const override { return angle_arcsec_; }
    double delay_s() const override;
    double residue_relative() const override { return 0.0; }
    double warm_up_s() const override;

   private:
    double bandwidth_hz_;
    double latch_hz_;
    double dither_hz_;
    double step_;
    double cosine_weight_ = 0.0, sine_weight_ = 0.0;
    bool begun_ = false;
    double last_arcsec_ = 0.0;
    double angle_arcsec_ = 0.0;
};

}  // namespace ringlock::reader
