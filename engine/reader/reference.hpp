#pragma once
#include <complex>

#include "engine/reader/stripper.hpp"

namespace ringlock::reader {

/// Subtracts the measured dither angle, of which gain and delay may be learnt.
///
/// The angle and its quadrature are weighted with two numbers, the real and the imaginary part of a complex gain, which
/// hold an error of the gain and a delay. They follow the least squares of the output's increments by stochastic
/// gradient (the LMS algorithm, Widrow et al., "Adaptive noise cancelling", Proc. IEEE 63, 1975), normalised by the
/// power of the dither's increments. The time constant is `reference_learning_s`; in the steady state, white noise of
/// variance s^2 on the latched angle leaves a dither of rms s sqrt(step/2), step = 2/(time constant x latching rate).
class Reference final : public Stripper {
   public:
    Reference(const Settings& settings, double latch_hz, double dither_hz);

    void take(const Latched& latched) override;
    double angle_arcsec() const override { return angle_arcsec_; }
    double delay_s() const override { return 0.0; }
    double residue_relative() const override;
    double warm_up_s() const override;

   private:
    Settings settings_;
    double dither_hz_;
    double latch_hz_;
    double step_ = 0.0;
    std::complex<double> gain_{1.0, 0.0};
    Latched last_;
    bool begun_ = false;
    double power_ = 0.0;     ///< of the increments of dither and quadrature, averaged as long as the gain is
    double averaged_ = 0.0;  ///< share of the average that has come in
    double angle_arcsec_ = 0.0;
};

}  // namespace ringlock::reader
