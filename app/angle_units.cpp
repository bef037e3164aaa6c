#include "app/angle_units.hpp"

#include <fmt/format.h>

#include <array>

#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::app {

namespace {

constexpr std::array<AngleUnit, 6> known = {{{"arcsec", false, 1.0},
                                             {"deg", false, units::arcsec_per_deg},
                                             {"rad", false, 180.0 * units::arcsec_per_deg / units::pi},
                                             {"deg/h", true, 1.0},
                                             {"deg/s", true, units::arcsec_per_deg},
                                             {"rad/s", true, 180.0 * units::arcsec_per_deg / units::pi}}};

}  // namespace

const AngleUnit& angle_unit(const std::string& name, bool of_rate) {
    for (const AngleUnit& unit : known) {
        if (unit.name != name) continue;
        if (unit.is_rate == of_rate) return unit;
        throw InputError(fmt::format("--unit {} is a unit of {}, but the numbers are {}; allowed are {}", name,
                                     unit.is_rate ? "rates" : "angles", of_rate ? "rates" : "angles",
                                     of_rate ? "deg/h, deg/s, rad/s" : "arcsec, deg, rad"));
    }
    throw InputError(fmt::format(
        "--unit '{}' is not known; allowed are arcsec, deg, rad (angles) and deg/h, deg/s, rad/s (rates)", name));
}

}  // namespace ringlock::app
