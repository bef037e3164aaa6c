#pragma once
#include <optional>
#include <string>
#include <string_view>

/// Units of measured data.
namespace ringlock::quantity {

/// Kind of instrument by its measured quantity. It determines the names and units of the noise coefficients.
enum class Instrument {
    gyro,           ///< an angle and its rate
    accelerometer,  ///< a velocity and the acceleration
    clock,          ///< a time error and the fractional frequency
};

struct Unit {
    std::string name;  ///< as the tables of the documentation have it, such as "deg/s"
    Instrument instrument = Instrument::gyro;
    bool is_rate = false;  ///< of a rate, acceleration or fractional frequency; else of its integral over time
    /// One of it in arcsec, m/s or s; of a rate in arcsec/s, m/s^2 or 1. An arcsec/s is a deg/h.
    double factor = 1.0;
};

/// The unit that is meant by a spelling of the field: "deg/s", "dps", "°/s", "[rad s^-1]", "degrees/second", "mg".
/// Upper and lower case, blanks and brackets around it do not matter, unless two units differ by nothing else.
/// Nothing where the spelling is not known.
std::optional<Unit> find_unit(std::string_view spelling);

/// "deg/h, deg/s, ...": the units of numbers that are rates, or that are their integrals, for a message.
std::string known_units(bool is_rate);

/// The unit of that spelling for numbers that are rates or are not. Throws InputError, naming `option`, where it is
/// not known or is one of rates where integrals are expected or the other way round; says which are allowed.
Unit unit_for(std::string_view spelling, bool is_rate, std::string_view option);

}  // namespace ringlock::quantity
