#pragma once
#include <span>
#include <string>
#include <string_view>

#include "analysis/noise/fit.hpp"
#include "analysis/quantity/unit.hpp"

namespace ringlock::allan_run {

/// Name of one noise coefficient of an instrument, and the factor from the value of a NoiseFit to its unit.
struct CoefficientName {
    std::string_view key;   ///< in JSON
    std::string_view name;  ///< in the table
    std::string_view unit;
    double factor;  ///< from the unit of the member, in which an arcsec stands for a m/s or a second
    noise::Coefficient noise::NoiseFit::*member;
};

/// Names that an instrument's results have.
struct InstrumentNames {
    std::string_view name;           ///< "gyro"
    std::string_view rate_unit;      ///< of deviations; empty where they have none
    std::string_view integral_unit;  ///< of deviations of time, mtie and tierms
    std::span<const CoefficientName> coefficients;
    // Correlated noise and sinusoids.
    std::string_view driving_key, driving_unit;  ///< amplitude of correlated noise, in the units of the random walk
    double driving_factor;
    std::string_view rms_key, amplitude_key;  ///< in the units of deviations
};

const InstrumentNames& names_of(quantity::Instrument instrument);

/// A unit that can be requested for the random walk: a random walk or a spectral density.
struct WalkUnit {
    std::string_view name;
    quantity::Instrument instrument;
    double factor;  ///< from deg/sqrt(h), or from (m/s)/sqrt(h) of an accelerometer
};

/// Throws InputError where the instrument has no such unit; the message names `option` and lists the units.
const WalkUnit& walk_unit(const std::string& name, quantity::Instrument instrument, std::string_view option);

}  // namespace ringlock::allan_run
