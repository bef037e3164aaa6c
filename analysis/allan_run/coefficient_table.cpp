#include "analysis/allan_run/coefficient_table.hpp"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::allan_run {
namespace {

using noise::NoiseFit;
using quantity::Instrument;

// A NoiseFit takes arcsec and gives coefficients per square root of an hour. Where the data are u = m/s or s instead:
// N in u/sqrt(s) is 60 times the number that stands for deg/sqrt(h), K in (u/s)/sqrt(s) one 60th, R one 3600th.
constexpr double per_rt_s = 60.0;
constexpr double rt_s_per_rt_h = 60.0;
constexpr double s_per_h = 3600.0;

constexpr std::array<CoefficientName, 5> gyro_names = {{
    {"quantization_arcsec", "angle white noise Q", "arcsec", 1.0, &NoiseFit::quantization_arcsec},
    {"arw_deg_rt_h", "angle random walk N", "deg/sqrt(h)", 1.0, &NoiseFit::arw_deg_rt_h},
    {"bias_instability_deg_h", "bias instability B", "deg/h", 1.0, &NoiseFit::bias_instability_deg_h},
    {"rrw_deg_h_rt_h", "rate random walk K", "(deg/h)/sqrt(h)", 1.0, &NoiseFit::rrw_deg_h_rt_h},
    {"rate_ramp_deg_h_h", "rate ramp R", "(deg/h)/h", 1.0, &NoiseFit::rate_ramp_deg_h_h},
}};

constexpr std::array<CoefficientName, 5> accelerometer_names = {{
    {"velocity_white_noise_m_s", "velocity white noise Q", "m/s", 1.0, &NoiseFit::quantization_arcsec},
    {"vrw_m_s_rt_h", "velocity random walk N", "(m/s)/sqrt(h)", per_rt_s* rt_s_per_rt_h, &NoiseFit::arw_deg_rt_h},
    {"bias_instability_m_s2", "bias instability B", "m/s^2", 1.0, &NoiseFit::bias_instability_deg_h},
    {"acceleration_random_walk_m_s2_rt_h", "acceleration r. w. K", "(m/s^2)/sqrt(h)", 1.0, &NoiseFit::rrw_deg_h_rt_h},
    {"acceleration_ramp_m_s2_h", "acceleration ramp R", "(m/s^2)/h", 1.0, &NoiseFit::rate_ramp_deg_h_h},
}};

constexpr std::array<CoefficientName, 5> clock_names = {{
    {"white_phase_s", "white phase noise Q", "s", 1.0, &NoiseFit::quantization_arcsec},
    {"white_frequency_rt_s", "white frequency N", "sqrt(s)", per_rt_s, &NoiseFit::arw_deg_rt_h},
    {"flicker_frequency", "flicker frequency B", "", 1.0, &NoiseFit::bias_instability_deg_h},
    {"random_walk_frequency_per_rt_s", "frequency r. walk K", "1/sqrt(s)", 1.0 / rt_s_per_rt_h,
     &NoiseFit::rrw_deg_h_rt_h},
    {"frequency_drift_per_s", "frequency drift R", "1/s", 1.0 / s_per_h, &NoiseFit::rate_ramp_deg_h_h},
}};

constexpr InstrumentNames gyro = {.name = "gyro",
                                  .rate_unit = "deg/h",
                                  .integral_unit = "arcsec",
                                  .coefficients = gyro_names,
                                  .driving_key = "amplitude_deg_h_rt_h",
                                  .driving_unit = "(deg/h)/sqrt(h)",
                                  .driving_factor = 1.0,
                                  .rms_key = "rms_rate_deg_h",
                                  .amplitude_key = "rate_amplitude_deg_h"};
constexpr InstrumentNames accelerometer = {.name = "accelerometer",
                                           .rate_unit = "m/s^2",
                                           .integral_unit = "m/s",
                                           .coefficients = accelerometer_names,
                                           .driving_key = "amplitude_m_s2_rt_h",
                                           .driving_unit = "(m/s^2)/sqrt(h)",
                                           .driving_factor = 1.0,
                                           .rms_key = "rms_acceleration_m_s2",
                                           .amplitude_key = "acceleration_amplitude_m_s2"};
constexpr InstrumentNames clock_and_time = {.name = "clock",
                                            .rate_unit = "",
                                            .integral_unit = "s",
                                            .coefficients = clock_names,
                                            .driving_key = "amplitude_per_rt_s",
                                            .driving_unit = "1/sqrt(s)",
                                            .driving_factor = 1.0 / rt_s_per_rt_h,
                                            .rms_key = "rms_frequency",
                                            .amplitude_key = "frequency_amplitude"};

constexpr double ug_per_m_s2 = 1e6 / 9.80665;
constexpr std::array<WalkUnit, 10> walk_units = {{
    // N^2 is the two-sided spectral density of the rate: IEEE Std 952, annex C. (x/sqrt(h)) is (x/h)/sqrt(Hz)/60.
    {"deg/sqrt(h)", Instrument::gyro, 1.0},
    {"deg/h/sqrt(Hz)", Instrument::gyro, 60.0},
    {"deg/s/sqrt(Hz)", Instrument::gyro, 1.0 / 60.0},
    {"rad/s/sqrt(Hz)", Instrument::gyro, units::pi / 180.0 / 60.0},
    {"rad/sqrt(s)", Instrument::gyro, units::pi / 180.0 / 60.0},
    {"arcsec/sqrt(s)", Instrument::gyro, 60.0},
    {"m/s/sqrt(h)", Instrument::accelerometer, 1.0},
    {"m/s^2/sqrt(Hz)", Instrument::accelerometer, 1.0 / 60.0},
    {"mg/sqrt(Hz)", Instrument::accelerometer, 1e-3 * ug_per_m_s2 / 60.0},
    {"ug/sqrt(Hz)", Instrument::accelerometer, ug_per_m_s2 / 60.0},
}};

}  // namespace

const InstrumentNames& names_of(Instrument instrument) {
    switch (instrument) {
        case Instrument::accelerometer:
            return accelerometer;
        case Instrument::clock:
            return clock_and_time;
        case Instrument::gyro:
            break;
    }
    return gyro;
}

const WalkUnit& walk_unit(const std::string& name, Instrument instrument, std::string_view option) {
    std::string known;
    for (const WalkUnit& unit : walk_units) {
        if (unit.instrument != instrument) continue;
        if (unit.name == name) return unit;
        known += fmt::format("{}{}", known.empty() ? "" : ", ", unit.name);
    }
    throw InputError(known.empty() ? fmt::format("{} {}: data of a {} have no unit to choose for it", option, name,
                                                 names_of(instrument).name)
                                   : fmt::format("{} '{}' is not known for a {}; allowed are {}", option, name,
                                                 names_of(instrument).name, known));
}

}  // namespace ringlock::allan_run
