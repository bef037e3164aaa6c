#pragma once
#include <cstdint>
#include <memory>

#include "engine/reader/settings.hpp"

namespace ringlock::reader {

/// Data of a reader at a tick of its clock.
struct Latched {
    double time_s = 0.0;        ///< since tick 0
    double angle_arcsec = 0.0;  ///< latched angle, dither included
    /// Measured angle of the dither and the same a quarter of a cycle later: for a dither A sin x they are A sin x and
    /// A cos x.
    double dither_arcsec = 0.0;
    double dither_ahead_arcsec = 0.0;
};

/// Takes the dither out of latched angles, tick after tick. One file for each method; docs/reader.md compares them.
class Stripper {
   public:
    virtual ~Stripper() = default;
    /// The next tick; ticks are consecutive.
    virtual void take(const Latched& latched) = 0;
    /// Whether angles are to be latched at the upward zero crossings of the measured dither, too.
    virtual bool wants_crossings() const { return false; }
    /// An angle latched at a crossing; called in the order of time with take().
    virtual void take_crossing(double /*time_s*/, double /*angle_arcsec*/) {}
    /// Output at the tick that was taken last [arcsec].
    virtual double angle_arcsec() const = 0;

    /// Time by which the output lags behind a steady rotation [s].
    virtual double delay_s() const = 0;
    /// Amplitude of a steady dither that is left in the output over that of the dither, once learnt.
    virtual double residue_relative() const = 0;
    /// Ticks before this time [s] are not fit for use: filters are not full, and gains are not learnt yet.
    virtual double warm_up_s() const = 0;
};

/// The stripper that the settings select. `latch_hz`: rate of the ticks; `dither_hz`: frequency of the dither's drive.
std::unique_ptr<Stripper> make_stripper(const Settings& settings, double latch_hz, double dither_hz);

/// Outputs at that rate, from tick 0 on, that are not fit for use; 1e15 where there are more.
std::int64_t warm_up_outputs(const Stripper& stripper, double output_hz);

}  // namespace ringlock::reader
