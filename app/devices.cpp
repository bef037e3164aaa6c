#include "engine/scenario/devices.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "app/command.hpp"
#include "app/output.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/units.hpp"
#include "engine/gyro/theory.hpp"
#include "engine/scenario/active_effects.hpp"

namespace ringlock::app {
namespace {

/// Figures that follow from a device's constants, to first order (docs/physics.md).
struct DeviceFigures {
    double scale_factor_arcsec, lockin_threshold_deg_h, dither_frequency_hz, dither_peak_rate_deg_s;
    double fringes_per_half_cycle, modulation_depth_rad, kick_rad;
    double arw_deg_rt_h;
    double dead_band_deg_h, largest_dead_band_deg_h;
};

DeviceFigures figures_of(const scenario::NamedDevice& device) {
    const gyro::Setup setup = scenario::configured_setup(device.scenario);
    const double depth_rad = gyro::modulation_depth_rad(setup);
    return {setup.scale_factor_arcsec,
            setup.lockin_threshold_deg_h,
            setup.dither_frequency_hz,
            setup.dither_peak_rate_deg_s,
            depth_rad / units::pi,
            depth_rad,
            gyro::turn_kick_rad(setup),
            gyro::randomised_arw_deg_rt_h(setup),
            gyro::band_half_width_deg_h(setup, 0),
            gyro::band_envelope_deg_h(setup)};
}

std::string table_of(const std::vector<scenario::NamedDevice>& devices) {
    std::string text = fmt::format(
        "{:<15}{:>8}{:>9}{:>10}{:>8}{:>7}{:>7}{:>14}{:>18}\n{:<15}{:>8}{:>9}{:>10}{:>8}{:>7}{:>7}{:>14}{:>18}\n",
        "device", "K", "fringes", "threshold", "dither", "kick", "M", "ARW", "dead band", "", "[arcsec]", "[1/half]",
        "[deg/h]", "[Hz]", "[rad]", "[rad]", "[deg/sqrt(h)]", "(at most) [deg/h]");
    for (const scenario::NamedDevice& device : devices) {
        const DeviceFigures f = figures_of(device);
        text += fmt::format("{:<15}{:>8.4g}{:>9.0f}{:>10.4g}{:>8.4g}{:>7.3f}{:>7.0f}{:>14.4g}{:>18}\n", device.name,
                            f.scale_factor_arcsec, f.fringes_per_half_cycle, f.lockin_threshold_deg_h,
                            f.dither_frequency_hz, f.kick_rad, f.modulation_depth_rad, f.arw_deg_rt_h,
                            fmt::format("{:.3g} ({:.3g})", f.dead_band_deg_h, f.largest_dead_band_deg_h));
    }
    return text +
           "\nK: rotation per fringe. Fringes: in a half cycle of the dither. Kick: of the phase by the lock-in,\n"
           "at a turn. M: amplitude of the dither in optical phase. ARW: with turns fully randomised. Dead\n"
           "band: half width around zero, at this amplitude (and at any). In a scenario, device = \"NAME\"\n"
           "before all sections takes these constants for defaults; --json gives the source of each.\n";
}

nlohmann::ordered_json json_of(const std::vector<scenario::NamedDevice>& devices) {
    auto list = nlohmann::ordered_json::array();
    for (const scenario::NamedDevice& device : devices) {
        const DeviceFigures f = figures_of(device);
        nlohmann::ordered_json sources;
        for (const scenario::ValueSource& source : device.sources) sources[source.key] = source.text;
        list.push_back({{"name", device.name},
                        {"summary", device.summary},
                        {"scale_factor_arcsec", f.scale_factor_arcsec},
                        {"lockin_threshold_deg_h", f.lockin_threshold_deg_h},
                        {"dither_frequency_hz", f.dither_frequency_hz},
                        {"dither_peak_rate_deg_s", f.dither_peak_rate_deg_s},
                        {"fringes_per_half_cycle", f.fringes_per_half_cycle},
                        {"kick_rad", f.kick_rad},
                        {"modulation_depth_rad", f.modulation_depth_rad},
                        {"arw_deg_rt_h", f.arw_deg_rt_h},
                        {"dead_band_deg_h", f.dead_band_deg_h},
                        {"largest_dead_band_deg_h", f.largest_dead_band_deg_h},
                        {"sources", std::move(sources)}});
    }
    return {{"devices", std::move(list)}};
}

}  // namespace

void add_devices(CLI::App& root) {
    CLI::App* command = root.add_subcommand("devices", "List the gyros that a scenario can name, with their constants");
    const auto json = std::make_shared<bool>(false);
    command->add_flag("--json", *json, "Print one JSON object, with the source of every constant");
    command->callback([json] {
        std::vector<scenario::NamedDevice> devices;
        for (const scenario::DeviceFile& file : scenario::device_files()) devices.push_back(read_device(file));
        put(*json ? json_text(json_of(devices), 2) + "\n" : table_of(devices));
    });
}

}  // namespace ringlock::app
