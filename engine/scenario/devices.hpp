#pragma once
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "engine/scenario/scenario.hpp"

/// The gyros that a scenario can name, `device = "NAME"`: files of scenarios/devices, which are part of the program.
namespace ringlock::scenario {

/// One file: its name without ending, and its text.
struct DeviceFile {
    std::string_view name;
    std::string_view text;
};

/// All of them, by name.
std::span<const DeviceFile> device_files();

/// The file of that name; null if there is no such file.
const DeviceFile* find_device(std::string_view name);

/// Where a value of a device comes from.
struct ValueSource {
    std::string key;   ///< "gyro.scale_factor_arcsec"
    std::string text;  ///< begins with "published: ", "derived: " or "assumed: "
};

/// A gyro with its constants.
struct NamedDevice {
    std::string name;
    std::string summary;
    Scenario scenario;  ///< the empty scenario of this device
    std::vector<ValueSource> sources;
};

/// Reads a device. Throws InputError where its file is wrong.
NamedDevice read_device(const DeviceFile& file);

}  // namespace ringlock::scenario
