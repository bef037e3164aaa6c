#include "app/starter.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <string_view>
#include <vector>

#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/text/render.hpp"

namespace ringlock::app {
namespace {

using scenario::Key;
using scenario::NamedDevice;
using scenario::Scenario;
using scenario::Section;
using scenario::Type;

/// Sections that a study begins with, in the order in which it is thought of; the others follow in that of the schema.
constexpr std::array first_sections = {"gyro",    "dither",   "input", "noise_injection",
                                       "readout", "ensemble", "arms",  "output"};

/// Keys that most studies choose.
constexpr std::array chosen_keys = {"gyro.scale_factor_arcsec",
                                    "gyro.lockin_threshold_deg_h",
                                    "dither.frequency_hz",
                                    "dither.peak_rate_deg_s",
                                    "input.rate_deg_h",
                                    "noise_injection.turn_phase_rms_rad",
                                    "readout.detector_noise_relative",
                                    "ensemble.gyros",
                                    "ensemble.duration_s",
                                    "ensemble.seed",
                                    "arms.names",
                                    "output.angle_record"};

template <class List>
bool is_in(const List& list, std::string_view name) {
    return std::find(list.begin(), list.end(), name) != list.end();
}

/// "A number between 0 and 100000 [deg/h]."
std::string bounds_sentence(const Key& key) {
    std::string text = scenario::allowed_text(key);
    text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
    const bool is_number = key.type == Type::integer || key.type == Type::real || key.type == Type::reals;
    const std::string_view unit = scenario::unit_of(key.name);
    return is_number && unit != "1" ? fmt::format("{} [{}].", text, unit) : text + ".";
}

std::string key_text(const Key& key, const Scenario& values, bool is_active, std::string_view from_device) {
    std::string meaning = fmt::format("{} {}", key.doc, bounds_sentence(key));
    if (!from_device.empty()) meaning += fmt::format(" Of the device, {}", from_device);
    return scenario::toml_comment(meaning) +
           fmt::format("{}{} = {}\n", is_active ? "" : "#", key.name, scenario::to_toml(key.get(values)));
}

std::string source_of(const NamedDevice* device, const Key& key) {
    if (device == nullptr) return "";
    for (const scenario::ValueSource& source : device->sources) {
        if (source.key == key.path()) return source.text;
    }
    return "";
}

std::string section_text(const Section& section, const NamedDevice* device) {
    const Scenario values = device == nullptr ? Scenario{} : device->scenario;
    std::string active;
    std::string others;
    for (const Key& key : section.keys) {
        const std::string source = source_of(device, key);
        const bool is_active = is_in(chosen_keys, key.path()) && source.empty();
        (is_active ? active : others) += "\n" + key_text(key, values, is_active, source);
    }
    return "\n\n" + scenario::toml_comment(section.doc) +
           fmt::format("{}[{}]\n", active.empty() ? "#" : "", section.name) + active + others;
}

/// Sections that may stand several times have no default to begin with, but an example.
constexpr const char* design_example =
    "\n# A design runs the study at several points. With kind = \"grid\" above, for example:\n"
    "#\n"
    "#   [[design.vary]]\n"
    "#   key = \"gyro.lockin_threshold_deg_h\"\n"
    "#   values = [100.0, 200.0, 300.0]\n"
    "#\n"
    "# docs/studies.md describes ranges, distributions and correlations.\n";

}  // namespace

std::string starter_text(const NamedDevice* device) {
    std::string out = scenario::toml_comment(
        device == nullptr ? std::string("A scenario for ringlock: the device of Gao and Deng (2007).")
                          : fmt::format("A scenario for ringlock: the device {} ({}).", device->name, device->summary));
    out += "#\n" +
           scenario::toml_comment(
               "The keys below are at their defaults. Those that most studies choose are set; the others are comments "
               "that begin with # and the name of the key: take the # away, also that of the section's line above, "
               "and change the value. The unit of a key is the end of its name.") +
           "#\n"
           "#   ringlock validate FILE.toml         checks this file\n"
           "#   ringlock run FILE.toml -o OUT.h5    simulates it and compares the arms\n";
    if (device != nullptr) {
        out += fmt::format("\n# Constants of this gyro are the defaults of [gyro] and [dither].\ndevice = \"{}\"\n",
                           device->name);
    }
    std::vector<const Section*> order;
    for (const char* name : first_sections) {
        for (const Section& section : scenario::schema()) {
            if (section.name == name) order.push_back(&section);
        }
    }
    for (const Section& section : scenario::schema()) {
        if (!is_in(first_sections, section.name) && !section.elements) order.push_back(&section);
    }
    for (const Section* section : order) {
        out += section_text(*section, device);
        if (section->name == "design") out += design_example;
    }
    return out;
}

}  // namespace ringlock::app
