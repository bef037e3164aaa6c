#pragma once
#include <string>
#include <string_view>

namespace ringlock::app {

/// A unit that the command line may name for the numbers of a file.
struct AngleUnit {
    std::string_view name;
    bool is_rate;      ///< of a rate, else of an angle
    double to_arcsec;  ///< or to arcsec/s, which is deg/h
};

/// The unit of that name. Throws InputError where it is not known, or is one of angles where rates are asked for or the
/// other way round.
const AngleUnit& angle_unit(const std::string& name, bool of_rate);

}  // namespace ringlock::app
