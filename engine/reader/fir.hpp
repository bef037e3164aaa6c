#pragma once
#include <vector>

#include "engine/reader/stripper.hpp"

namespace ringlock::reader {

/// A low-pass filter of linear phase: the ideal one cut off by Hamming's window, of gain one for a steady rotation. It
/// delays by half its order of ticks.
class Fir final : public Stripper {
   public:
    /// `cutoff_hz`: where the ideal filter ends and the response is about one half.
    Fir(std::size_t order, double cutoff_hz, double latch_hz, double dither_hz);

    void take(const Latched& latched) override { take_angle(latched.angle_arcsec); }
    void take_angle(double angle_arcsec);
    double angle_arcsec() const override;
    double delay_s() const override { return 0.5 * static_cast<double>(order_) / latch_hz_; }
    double residue_relative() const override;
    double warm_up_s() const override { return static_cast<double>(order_ + 1) / latch_hz_; }

   private:
    std::vector<double> make_taps() const;

    std::size_t order_;
    double cutoff_hz_;
    double latch_hz_;
    double dither_hz_;
    std::vector<double> taps_;    ///< made with the first angle: many filters are only needed for their delay
    std::vector<double> angles_;  ///< the last ones, oldest at next_
    std::size_t next_ = 0;
};

}  // namespace ringlock::reader
