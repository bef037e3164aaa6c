#pragma once
#include <filesystem>
#include <optional>
#include <ringlock/settings.hpp>
#include <string>
#include <string_view>
#include <vector>

namespace ringlock {
inline namespace v1 {

/// Constants of a gyro. A scenario that uses the device takes those that have a value; its other keys keep theirs.
struct Device {
    std::string name;
    std::string summary;                           ///< one sentence; may be empty
    std::optional<double> scale_factor_arcsec;     ///< K: arcsec of rotation per fringe, 2 pi of optical phase
    std::optional<double> lockin_threshold_deg_h;  ///< Omega_L
    std::optional<double> dither_frequency_hz;
    std::optional<double> dither_peak_rate_deg_s;  ///< amplitude of the dither's rate
    Settings more;                                 ///< any other keys of a scenario, such as effects of the device

    /// Reads a TOML file with sections as a scenario has them, of which [gyro] and [dither] are the usual ones;
    /// `summary` and the tables [source.*] are for people. The name is that of the file. Throws InputError.
    static Device from_file(const std::filesystem::path& path);
    static Device from_text(std::string_view toml, std::string_view name);
};

/// Names of the devices that are part of the library: values of the key "device" of a scenario.
std::vector<std::string> known_devices();

}  // namespace v1
}  // namespace ringlock
