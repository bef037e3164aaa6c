#pragma once
#include "engine/reader/fir.hpp"
#include "engine/reader/reference.hpp"

namespace ringlock::reader {

/// A measured dither angle is subtracted, and a low-pass filter attenuates the residual dither. The filter can be
/// shorter than without the subtraction.
class ReferenceFir final : public Stripper {
   public:
    ReferenceFir(const Reference& reference, const Fir& fir) : reference_(reference), fir_(fir) {}

    void take(const Latched& latched) override {
        reference_.take(latched);
        fir_.take_angle(reference_.angle_arcsec());
    }
    double angle_arcsec() const override { return fir_.angle_arcsec(); }
    double delay_s() const override { return fir_.delay_s(); }
    double residue_relative() const override { return reference_.residue_relative() * fir_.residue_relative(); }
    double warm_up_s() const override { return reference_.warm_up_s() + fir_.warm_up_s(); }

   private:
    Reference reference_;
    Fir fir_;
};

}  // namespace ringlock::reader
