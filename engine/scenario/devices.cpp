#include "engine/scenario/devices.hpp"

#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>

#include "engine/scenario/text/parse.hpp"

namespace ringlock::scenario {

const DeviceFile* find_device(std::string_view name) {
    const auto files = device_files();
    const auto found = std::find_if(files.begin(), files.end(), [name](const DeviceFile& f) { return f.name == name; });
    return found == files.end() ? nullptr : &*found;
}

NamedDevice read_device(const DeviceFile& file) {
    NamedDevice device;
    device.name = file.name;
    device.scenario = parse_string(fmt::format("device = \"{}\"\n", file.name), file.name);
    const toml::table root = toml::parse(file.text, file.name);
    device.summary = root["summary"].value_or(std::string());
    const toml::table* sections = root["source"].as_table();
    if (sections == nullptr) return device;
    for (const auto& [section, keys] : *sections) {
        const toml::table* table = keys.as_table();
        if (table == nullptr) continue;
        for (const auto& [key, text] : *table) {
            device.sources.push_back({fmt::format("{}.{}", section.str(), key.str()), text.value_or(std::string())});
        }
    }
    return device;
}

}  // namespace ringlock::scenario
