#include <fmt/format.h>
#include <toml++/toml.h>

#include <algorithm>
#include <iterator>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

#include "analysis/study/design_points.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/devices.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/render.hpp"
#include "library/detail.hpp"

namespace ringlock {
inline namespace v1 {
namespace {

template <class T>
std::string list_text(const std::vector<T>& values) {
    std::string text;
    for (const T& value : values) text += (text.empty() ? "" : ", ") + scenario::to_toml(scenario::Value(value));
    return "[" + text + "]";
}

std::string value_text(const Value& value) {
    return std::visit(
        [](const auto& v) {
            using T = std::decay_t<decltype(v)>;
            if constexpr (std::is_same_v<T, std::vector<double>> || std::is_same_v<T, std::vector<std::string>>) {
                return list_text(v);
            } else {
                return scenario::to_toml(scenario::Value(v));
            }
        },
        value);
}

std::string setting_text(const Setting& setting) {
    return fmt::format("{} = {}", setting.key, value_text(setting.value));
}

Value value_of(const scenario::Value& value) {
    return std::visit(
        [](const auto& v) -> Value {
            using T = std::decay_t<decltype(v)>;
            if constexpr (std::is_same_v<T, std::vector<scenario::Arm>>) {
                std::vector<std::string> names;
                for (const scenario::Arm& arm : v) names.push_back(arm.name);
                return names;
            } else {
                return v;
            }
        },
        value);
}

/// Settings of a list or a value of a device's file.
Value device_value(const toml::node& node, std::string_view file, const std::string& key) {
    if (const auto* v = node.as_boolean()) return v->get();
    if (const auto* v = node.as_integer()) return v->get();
    if (const auto* v = node.as_floating_point()) return v->get();
    if (const auto* v = node.as_string()) return v->get();
    if (const toml::array* list = node.as_array(); list != nullptr && list->is_homogeneous()) {
        std::vector<double> numbers;
        std::vector<std::string> words;
        for (const toml::node& element : *list) {
            if (const auto number = element.value<double>()) numbers.push_back(*number);
            if (const auto word = element.value<std::string>()) words.push_back(*word);
        }
        if (numbers.size() == list->size()) return numbers;
        if (words.size() == list->size()) return words;
    }
    const toml::source_position at = node.source().begin;
    throw InputError(fmt::format("{}:{}:{}: key \"{}\": must be a number, a string, a boolean or a list of these", file,
                                 at.line, at.column, printable(key)));
}

/// Every key of the sections of a device's file; effects have sections of two names.
void read_sections(const toml::table& table, const std::string& section, std::string_view file, Settings& into) {
    for (const auto& [key, node] : table) {
        const std::string path = section + "." + std::string(key.str());
        if (const toml::table* inner = node.as_table()) {
            read_sections(*inner, path, file, into);
        } else {
            into.push_back({path, device_value(node, file, path)});
        }
    }
}

struct DeviceField {
    std::string_view key;
    std::optional<double> Device::*member;
};
constexpr DeviceField device_fields[] = {{"gyro.scale_factor_arcsec", &Device::scale_factor_arcsec},
                                         {"gyro.lockin_threshold_deg_h", &Device::lockin_threshold_deg_h},
                                         {"dither.frequency_hz", &Device::dither_frequency_hz},
                                         {"dither.peak_rate_deg_s", &Device::dither_peak_rate_deg_s}};

/// Puts a setting into the member that is meant for it; false where there is none.
bool put_into_member(const Setting& setting, Device& device) {
    for (const DeviceField& field : device_fields) {
        if (setting.key != field.key) continue;
        if (const auto* real = std::get_if<double>(&setting.value)) device.*field.member = *real;
        if (const auto* whole = std::get_if<std::int64_t>(&setting.value)) {
            device.*field.member = static_cast<double>(*whole);
        }
        return (device.*field.member).has_value();
    }
    return false;
}

const scenario::Key& key_of(std::string_view path) {
    const scenario::Key* key = scenario::find_key(path);
    if (key != nullptr) return *key;
    throw InputError(
        fmt::format("key \"{}\": no scenario has it; docs/scenario.md and `ringlock run --print-schema` "
                    "list all keys",
                    printable(path)));
}

}  // namespace

Scenario Library::parse(std::string text, std::string name, std::vector<std::string> settings, bool own_device) {
    auto data = std::make_shared<Scenario::Data>();
    data->parsed = scenario::parse_string(text, name, settings, study::complaints, "setting");
    if (own_device) data->parsed.device.clear();
    data->text = std::move(text);
    data->name = std::move(name);
    data->settings = std::move(settings);
    data->own_device = own_device;
    return Scenario(std::move(data));
}

Scenario Library::scenario_of(const scenario::Scenario& parsed, const std::string& name) {
    auto data = std::make_shared<Scenario::Data>();
    data->text = scenario::to_toml(parsed);
    data->name = name;
    data->parsed = parsed;
    return Scenario(std::move(data));
}

Scenario::Scenario(std::shared_ptr<const Data> data) : data_(std::move(data)) {}

Scenario::Scenario() : Scenario(from_text("")) {}

Scenario Scenario::from_file(const std::filesystem::path& path, const Settings& settings) {
    return from_text(scenario::text_of_file(path), settings, path.string());
}

Scenario Scenario::from_text(std::string_view toml, const Settings& settings, std::string_view name) {
    std::vector<std::string> texts;
    for (const Setting& setting : settings) texts.push_back(setting_text(setting));
    return Library::parse(std::string(toml), std::string(name), std::move(texts), false);
}

Scenario& Scenario::set(const Settings& settings) {
    std::vector<std::string> texts = data_->settings;
    for (const Setting& setting : settings) {
        if (data_->own_device && setting.key == "device") {
            throw InputError("device: the scenario uses a device of one's own; begin with another scenario");
        }
        texts.push_back(setting_text(setting));
    }
    *this = Library::parse(data_->text, data_->name, std::move(texts), data_->own_device);
    return *this;
}

Scenario& Scenario::use(const Device& device) {
    std::vector<std::string> texts = data_->settings;
    for (const DeviceField& field : device_fields) {
        if (const auto& value = device.*field.member) {
            texts.push_back(setting_text({std::string(field.key), *value}));
        }
    }
    for (const Setting& setting : device.more) texts.push_back(setting_text(setting));
    try {
        *this = Library::parse(data_->text, data_->name, std::move(texts), true);
    } catch (const InputError& error) {
        throw InputError(fmt::format("device {}: {}", printable(device.name), error.what()));
    }
    return *this;
}

Value Scenario::value(std::string_view key) const {
    if (key == "device") return data_->parsed.device;
    return value_of(key_of(key).get(data_->parsed));
}

double Scenario::number(std::string_view key) const {
    const Value found = value(key);
    if (const auto* real = std::get_if<double>(&found)) return *real;
    if (const auto* whole = std::get_if<std::int64_t>(&found)) return static_cast<double>(*whole);
    throw InputError(fmt::format("key \"{}\": is no number; value() gives what it is", printable(key)));
}

std::string Scenario::to_toml() const { return scenario::to_toml(data_->parsed); }

const std::string& Scenario::name() const { return data_->name; }

Device Device::from_file(const std::filesystem::path& path) {
    Device device = from_text(scenario::text_of_file(path), path.string());
    device.name = path.stem().string();
    return device;
}

Device Device::from_text(std::string_view toml, std::string_view name) {
    const std::string shown = printable(name);
    scenario::refuse_before_parsing(toml, shown);
    toml::table root;
    try {
        root = toml::parse(toml, name);
    } catch (const toml::parse_error& error) {
        const toml::source_position at = error.source().begin;
        throw InputError(fmt::format("{}:{}:{}: not valid TOML: {}", shown, at.line, at.column,
                                     printable(std::string(error.description()))));
    }
    Device device;
    device.name = name;
    Settings settings;
    for (const auto& [key, node] : root) {
        if (key == "source") continue;
        if (key == "summary") {
            device.summary = node.value_or(std::string());
        } else if (const toml::table* section = node.as_table()) {
            read_sections(*section, std::string(key.str()), shown, settings);
        } else {
            const toml::source_position at = key.source().begin;
            throw InputError(
                fmt::format("{}:{}:{}: key \"{}\": a device has sections such as [gyro] and [dither], "
                            "and a summary",
                            shown, at.line, at.column, printable(std::string(key.str()))));
        }
    }
    for (Setting& setting : settings) {
        if (!put_into_member(setting, device)) device.more.push_back(std::move(setting));
    }
    return device;
}

std::vector<std::string> known_devices() {
    std::vector<std::string> names;
    for (const scenario::DeviceFile& file : scenario::device_files()) names.emplace_back(file.name);
    return names;
}

}  // namespace v1
}  // namespace ringlock
