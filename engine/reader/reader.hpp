#pragma once
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "engine/gyro/setup.hpp"
#include "engine/random/stream.hpp"
#include "engine/reader/latch.hpp"
#include "engine/reader/settings.hpp"
#include "engine/reader/stripper.hpp"
#include "engine/readout/electronics.hpp"

namespace ringlock::reader {

/// The gyro and the electronics to which a reader is attached.
struct Source {
    double scale_factor_arcsec = 0.5;
    double dither_hz = 0.0;
    gyro::Ellipse ellipse;             ///< of the detectors
    readout::Electronics electronics;  ///< of these, noise and converter
    random::Identity who;
};

/// Reads one gyro: latches its angle, takes the dither out, and puts out every so many ticks.
class Reader {
   public:
    /// `output_hz`: the latching rate is a whole multiple of it.
    Reader(const Settings& settings, double output_hz, const Source& source);

    /// The instants of a piece. `correction_fringes`: for the half cycle that ends at each turn of the piece, the
    /// lock-in error that a compensator takes away there; none where it is empty. `count_errors`: counts of the up/down
    /// counter less the true ones at these turns, in quarter fringes; none where it is empty.
    void read(std::span<const Instant> instants, std::span<const double> correction_fringes,
              std::span<const double> count_errors);

    /// Stripped angles of the piece at the ticks of the output, in order [arcsec], and the first one's number: tick
    /// number n of the output is tick n latch_hz/output_hz.
    const std::vector<double>& angles_arcsec() const { return angles_arcsec_; }
    std::int64_t first_output() const { return first_output_; }

    const Stripper& stripper() const { return *stripper_; }
    /// Outputs before this one are not fit for use.
    std::int64_t warm_up_outputs() const;

   private:
    double latched_fringes(const Instant& instant, double count_error) const;
    Latched latched(const Instant& instant, double angle_arcsec) const;
    Instant moved_crossing(Instant instant) const;

    Settings settings_;
    Source source_;
    double output_hz_;
    std::int64_t decimation_;
    std::unique_ptr<Stripper> stripper_;
    double last_count_error_ = 0.0;  ///< at the last turn of the piece before
    std::vector<double> angles_arcsec_;
    std::int64_t first_output_ = 0;
    std::int64_t next_output_ = 0;
};

}  // namespace ringlock::reader
