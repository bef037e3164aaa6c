#include "engine/scenario/text/parse.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <toml++/toml.h>

#include <algorithm>
#include <cctype>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <map>
#include <optional>
#include <utility>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/waiting.hpp"
#include "engine/effects/effect.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/devices.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/text/text.hpp"

namespace ringlock::scenario {
namespace {

constexpr std::string_view effects_prefix = "effects.";

std::string type_text(const toml::node& node) {
    switch (node.type()) {
        case toml::node_type::table:
            return "a table";
        case toml::node_type::array:
            return "a list";
        case toml::node_type::string:
            return "a string";
        case toml::node_type::integer:
            return "a whole number";
        case toml::node_type::floating_point:
            return "a float";
        case toml::node_type::boolean:
            return "a boolean";
        default:
            return "a date or time";
    }
}

std::string value_text(const toml::node& node) {
    if (const auto* v = node.as_string()) return in_quotes(v->get());
    if (const auto* v = node.as_integer()) return fmt::format("{}", v->get());
    if (const auto* v = node.as_floating_point()) return format_real(v->get());
    if (const auto* v = node.as_boolean()) return v->get() ? "true" : "false";
    return type_text(node);
}

/// A name as it may stand in a message: bare, or quoted where it holds anything unusual.
std::string name_text(std::string_view name) {
    const bool bare = !name.empty() && name.size() <= 60 && std::all_of(name.begin(), name.end(), [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
               c == '.';
    });
    return bare ? std::string(name) : in_quotes(name);
}

/// Walks a parsed file, sets correct values and notes the errors.
class Reader {
   public:
    Reader(std::string_view file, const Rules& rules, std::string_view setting_word)
        : file_(printable(file)), rules_(rules), setting_word_(setting_word) {}

    /// Settings are applied after the file and replace its values: the text of each, and its parsed table.
    Scenario read(const toml::table& root, const std::vector<std::pair<std::string, toml::table>>& settings) {
        const toml::node* device = root.get("device");
        std::string device_from;
        for (const auto& [text, table] : settings) {
            if (const toml::node* other = table.get("device")) {
                device = other;
                device_from = text;
            }
        }
        setting_ = device_from;
        if (device != nullptr) read_device_name(*device);
        setting_.clear();
        read_keys(root);
        for (const auto& [text, table] : settings) {
            setting_ = text;
            read_keys(table);
        }
        // A file that gives the strength of a drive's noise does not give the other strength, which has a default.
        if (scenario_.noise_injection.drive_noise_relative > 0.0 &&
            !places_.contains("noise_injection.turn_phase_rms_rad")) {
            scenario_.noise_injection.turn_phase_rms_rad = 0.0;
        }
        if (problems_.empty()) apply_rules();
        if (!problems_.empty()) throw InputError(report());
        return std::move(scenario_);
    }

   private:
    /// In the file, or in a setting of the command line.
    struct Place {
        toml::source_position where;
        std::string setting;
        std::string value = {};  ///< as it stands there
    };
    struct Problem {
        Place place;
        std::string text;
    };

    void note(toml::source_position where, std::string text) {
        problems_.push_back({{where, setting_}, std::move(text)});
    }

    std::string report() {
        // Those of the file in its order, then those of settings in theirs.
        std::stable_sort(problems_.begin(), problems_.end(), [](const Problem& a, const Problem& b) {
            if (a.place.setting.empty() != b.place.setting.empty()) return a.place.setting.empty();
            return a.place.setting.empty() && a.place.where < b.place.where;
        });
        std::vector<std::string> lines;
        for (const auto& [place, text] : problems_) {
            if (!place.setting.empty()) {
                lines.push_back(fmt::format("{} {}: {}", setting_word_, printable(place.setting), text));
            } else if (place.where) {
                lines.push_back(fmt::format("{}:{}:{}: {}", file_, place.where.line, place.where.column, text));
            } else {
                lines.push_back(fmt::format("{}: {}", file_, text));
            }
        }
        return fmt::format("{}", fmt::join(lines, "\n"));
    }

    void read_keys(const toml::table& root) {
        for (const auto& [name, node] : root) {
            if (name != "device") read_top(name, node);
        }
    }

    /// The constants of a device, which the keys of the file itself override.
    void read_device_name(const toml::node& node) {
        const auto* name = node.as_string();
        const DeviceFile* device = name == nullptr ? nullptr : find_device(name->get());
        if (device == nullptr) {
            std::vector<std::string> known;
            for (const DeviceFile& file : device_files()) known.emplace_back(file.name);
            const std::string hint = name == nullptr ? "" : did_you_mean(name->get(), known);
            return note(node.source().begin,
                        fmt::format("key \"device\" = {}: must be the name of a known device{}; devices are: {}",
                                    value_text(node), hint, fmt::join(known, ", ")));
        }
        scenario_.device = device->name;
        const toml::table constants = toml::parse(device->text, device->name);
        for (const auto& [section_name, section_node] : constants) {
            const Section* section = find_section(section_name);
            if (section != nullptr && section_node.is_table()) read_section(*section, *section_node.as_table());
        }
        places_.clear();  // of the device's file, which the user has not written
    }

    void read_top(const toml::key& name, const toml::node& node) {
        if (name == "effects") return read_effects(name, node);
        const Section* section = find_section(name);
        if (section == nullptr || section->elements) return unknown_top(name, node);
        const toml::table* table = as_table(*section, name, node);
        if (table != nullptr) read_section(*section, *table);
    }

    void read_effects(const toml::key& name, const toml::node& node) {
        const toml::table* table = node.as_table();
        if (table == nullptr) {
            return note(name.source().begin, fmt::format("key \"effects\" = {}: must be tables [effects.NAME], not {}",
                                                         value_text(node), type_text(node)));
        }
        for (const auto& [effect, settings] : *table) {
            const Section* section = find_section(fmt::format("{}{}", effects_prefix, effect.str()));
            if (section == nullptr) {
                unknown_effect(effect);
            } else if (const toml::table* values = as_table(*section, effect, settings)) {
                read_section(*section, *values);
            }
        }
    }

    const toml::table* as_table(const Section& section, const toml::key& name, const toml::node& node) {
        const toml::table* table = node.as_table();
        if (table == nullptr) {
            note(name.source().begin,
                 fmt::format("key \"{}\" = {}: must be a table, not {}; write [{}] and its keys below", section.name,
                             value_text(node), type_text(node), section.name));
        }
        return table;
    }

    void read_section(const Section& section, const toml::table& table) {
        for (const auto& [name, node] : table) {
            const Section* list = find_section(fmt::format("{}.{}", section.name, name.str()));
            if (list != nullptr && list->elements) {
                read_elements(*list, name, node);
                continue;
            }
            const auto found = std::find_if(section.keys.begin(), section.keys.end(),
                                            [&k = name](const Key& key) { return key.name == k.str(); });
            if (found == section.keys.end()) {
                unknown_key(section, name, node);
            } else {
                places_[found->path()] = {node.source().begin, setting_};
                read_value(*found, node);
            }
        }
    }

    /// Tables [[NAME]], in the place of any that there were.
    void read_elements(const Section& section, const toml::key& name, const toml::node& node) {
        const toml::array* list = node.as_array();
        const bool tables = list != nullptr &&
                            std::all_of(list->begin(), list->end(), [](const toml::node& n) { return n.is_table(); });
        if (!tables) {
            return note(
                name.source().begin,
                fmt::format("key \"{}\" = {}: must be tables, not {}; write [[{}]] and its keys below, once for each",
                            section.name, value_text(node), type_text(node), section.name));
        }
        section.elements->resize(scenario_, 0);
        for (std::size_t i = 0; i < list->size(); ++i) {
            section.elements->resize(scenario_, i + 1);
            read_element(section, fmt::format("{}[{}]", section.name, i + 1), *(*list)[i].as_table());
        }
    }

    /// One of them, with the keys that belong together and no others.
    void read_element(const Section& section, const std::string& element, const toml::table& table) {
        const std::size_t before = problems_.size();
        read_section(section, table);
        const std::string& first = section.keys.front().name;
        for (const auto& [name, node] : table) {
            places_[fmt::format("{}.{}", element, name.str())] = {node.source().begin, setting_, value_text(node)};
        }
        if (problems_.size() > before) return;
        const VariationForm form = section.elements->form(scenario_);
        std::vector<std::string_view> missing;
        if (!table.contains(first)) missing.emplace_back(first);
        for (const std::string_view key : form.required) {
            if (!table.contains(key)) missing.push_back(key);
        }
        if (!missing.empty()) {
            note(table.source().begin,
                 fmt::format("[[{}]] lacks {}; {} has the keys {}, {}", section.name, fmt::join(missing, ", "),
                             form.name, first, fmt::join(form.required, ", ")));
        }
        for (const auto& [name, node] : table) {
            const auto is_it = [&k = name](std::string_view key) { return k.str() == key; };
            if (name == first || std::any_of(form.required.begin(), form.required.end(), is_it) ||
                std::any_of(form.optional.begin(), form.optional.end(), is_it)) {
                continue;
            }
            note(node.source().begin,
                 fmt::format("key \"{}.{}\" = {}: does not belong to {}, which has the keys {}, {}", section.name,
                             name.str(), value_text(node), form.name, first, fmt::join(form.required, ", ")));
        }
    }

    void read_value(const Key& key, const toml::node& node) {
        if (key.type == Type::arms) return read_arms(key, node);
        if (key.type == Type::reals) return read_reals(key, node);
        const std::optional<Value> value = convert(key, node);
        if (!value) {
            return wrong(key, node, fmt::format("must be {}, not {}", allowed_text(key), type_text(node)));
        }
        if (const auto* word = std::get_if<std::string>(&*value)) {
            if (key.type == Type::word && std::find(key.words.begin(), key.words.end(), *word) == key.words.end()) {
                return wrong(key, node, fmt::format("must be {}{}", range_text(key), did_you_mean(*word, key.words)));
            }
        } else if (key.type != Type::boolean && !within_bounds(key, *value)) {
            const auto* real = std::get_if<double>(&*value);
            const std::string_view finite = real != nullptr && !std::isfinite(*real) ? "finite and " : "";
            const std::string why = key.bounds.why.empty() ? "" : fmt::format(" ({})", key.bounds.why);
            return wrong(key, node, fmt::format("must be {}{}{}", finite, range_text(key), why));
        }
        key.set(scenario_, *value);
    }

    /// The node's value where it has the key's type; a whole number counts as a float.
    static std::optional<Value> convert(const Key& key, const toml::node& node) {
        const auto* integer = node.as_integer();
        if (key.type == Type::boolean && node.is_boolean()) return node.as_boolean()->get();
        if (key.type == Type::integer && integer != nullptr) return integer->get();
        if (key.type == Type::real && integer != nullptr) return static_cast<double>(integer->get());
        if (key.type == Type::real && node.is_floating_point()) return node.as_floating_point()->get();
        if ((key.type == Type::word || key.type == Type::text) && node.is_string()) return node.as_string()->get();
        return {};
    }

    void read_reals(const Key& key, const toml::node& node) {
        const toml::array* list = node.as_array();
        if (list == nullptr) {
            return wrong(key, node, fmt::format("must be {}, not {}", allowed_text(key), type_text(node)));
        }
        std::vector<double> values;
        for (const toml::node& element : *list) {
            if (const auto* integer = element.as_integer()) {
                values.push_back(static_cast<double>(integer->get()));
            } else if (const auto* real = element.as_floating_point()) {
                values.push_back(real->get());
            } else {
                return wrong(key, element, fmt::format("must be a number, not {}", type_text(element)));
            }
            if (!within_bounds(key, std::vector<double>{values.back()})) {
                const std::string_view finite = std::isfinite(values.back()) ? "" : "finite and ";
                return wrong(key, element, fmt::format("must be {}{} ({})", finite, range_text(key), key.bounds.why));
            }
        }
        key.set(scenario_, values);
    }

    void read_arms(const Key& key, const toml::node& node) {
        const toml::array* list = node.as_array();
        if (list == nullptr) {
            return wrong(key, node, fmt::format("must be {}, not {}", allowed_text(key), type_text(node)));
        }
        if (list->empty()) return wrong(key, node, fmt::format("is empty; must be {}", allowed_text(key)));
        std::vector<Arm> arms;
        for (const toml::node& element : *list) {
            if (!element.is_string()) {
                wrong(key, element, fmt::format("must be the name of an arm, not {}", type_text(element)));
                continue;
            }
            try {
                Arm arm = parse_arm(element.as_string()->get());
                if (std::find(arms.begin(), arms.end(), arm) != arms.end()) {
                    wrong(key, element, "is given twice; an arm is run once");
                }
                arms.push_back(std::move(arm));
            } catch (const InputError& error) {
                wrong(key, element, error.what());
            }
        }
        key.set(scenario_, arms);
    }

    void wrong(const Key& key, const toml::node& node, std::string_view problem) {
        note(node.source().begin, fmt::format("key \"{}\" = {}: {}", key.path(), value_text(node), problem));
    }

    void unknown_key(const Section& section, const toml::key& name, const toml::node& node) {
        std::vector<std::string> known;
        for (const Key& key : section.keys) known.push_back(key.name);
        std::string hint = did_you_mean(name.str(), known);
        if (hint.empty()) hint = elsewhere(name.str());
        note(name.source().begin,
             fmt::format("key \"{}.{}\" = {}: unknown key{}; keys of [{}]: {}", section.name, name_text(name.str()),
                         value_text(node), hint, section.name, fmt::join(known, ", ")));
    }

    /// A hint for messages: the sections that do have a key of that name.
    static std::string elsewhere(std::string_view name) {
        for (const Section& section : schema()) {
            for (const Key& key : section.keys) {
                if (section.elements) continue;
                if (key.path() == name) return fmt::format(" (write {} without quotes)", name);
                if (key.name == name) return fmt::format(" (\"{}\" belongs to [{}])", name, section.name);
            }
        }
        return "";
    }

    void unknown_top(const toml::key& name, const toml::node& node) {
        std::vector<std::string> known;
        for (const Section& section : schema()) {
            if (!section.name.starts_with(effects_prefix) && !section.elements) known.push_back(section.name);
        }
        known.emplace_back("effects");
        const std::string sections = fmt::format("{}", fmt::join(known, ", "));
        known.emplace_back("device");
        if (node.is_table()) {
            return note(name.source().begin,
                        fmt::format("section [{}]: unknown section{}; sections are: {}", name_text(name.str()),
                                    did_you_mean(name.str(), known), sections));
        }
        std::string hint = elsewhere(name.str());
        if (hint.empty()) hint = did_you_mean(name.str(), known);
        note(name.source().begin, fmt::format("key \"{}\" = {}: unknown key outside of any section{}; sections are: {}",
                                              name_text(name.str()), value_text(node), hint, sections));
    }

    void unknown_effect(const toml::key& name) {
        std::vector<std::string> known;
        for (const effects::Effect* effect : effects::registry()) known.emplace_back(effect->name());
        const auto planned = effects::planned();
        const bool is_planned = std::find(planned.begin(), planned.end(), name.str()) != planned.end();
        note(name.source().begin, fmt::format("section [effects.{}]: {}; effects are: {}", name_text(name.str()),
                                              is_planned ? "known but not available yet"
                                                         : "unknown effect" + did_you_mean(name.str(), known),
                                              fmt::join(known, ", ")));
    }

    static const Section* find_section(std::string_view name) {
        const auto& all = schema();
        const auto found = std::find_if(all.begin(), all.end(), [name](const Section& s) { return s.name == name; });
        return found == all.end() ? nullptr : &*found;
    }

    /// Each broken rule is reported at the first of its keys that the file names.
    void apply_rules() {
        for (const Complaint& complaint : rules_(scenario_)) {
            const auto named = std::find_if(complaint.keys.begin(), complaint.keys.end(),
                                            [this](const std::string& key) { return places_.contains(key); });
            const std::string& key = named == complaint.keys.end() ? complaint.keys.front() : *named;
            const auto found = places_.find(key);
            const Place place = found == places_.end() ? Place{} : found->second;
            const Key* known = find_key(key);
            problems_.push_back({place, fmt::format("key \"{}\" = {}: {}", key,
                                                    known != nullptr ? to_toml(known->get(scenario_)) : place.value,
                                                    complaint.problem)});
        }
    }

    std::string file_;
    const Rules& rules_;
    std::string setting_word_;
    Scenario scenario_;
    std::vector<Problem> problems_;
    std::map<std::string, Place> places_;
    std::string setting_;  ///< that is being read; empty: the file
};

/// A setting as a table. Throws InputError.
toml::table parse_setting(const std::string& setting, std::string_view word_before) {
    const auto refuse = [&](std::string_view why) {
        throw InputError(fmt::format("{} {}: {}", word_before, in_quotes(setting), why));
    };
    const std::size_t equals = setting.find('=');
    if (equals == std::string::npos || equals == 0) {
        refuse(
            "must be KEY=VALUE, as in gyro.lockin_threshold_deg_h=140; `ringlock run --print-schema` prints all keys");
    }
    const bool one_line = std::none_of(setting.begin(), setting.end(),
                                       [](char c) { return static_cast<unsigned char>(c) < ' ' || c == '#'; });
    if (!one_line) refuse("must be one line without comments");
    std::string value = setting.substr(equals + 1);
    value.erase(0, value.find_first_not_of(' '));
    value.erase(value.find_last_not_of(' ') + 1);
    if (value.empty()) refuse("has no value");
    // Shells take quotes away: a word that TOML does not define is a string.
    const bool word = value != "true" && value != "false" && value != "inf" && value != "nan" &&
                      std::isalpha(static_cast<unsigned char>(value.front())) != 0 &&
                      std::all_of(value.begin(), value.end(), [](char c) {
                          return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_' || c == '-' || c == '+';
                      });
    if (word) value = in_quotes(value);
    const std::string text = setting.substr(0, equals) + " = " + value;
    refuse_before_parsing(text, fmt::format("{} {}", word_before, printable(setting)));
    try {
        return toml::parse(text);
    } catch (const toml::parse_error& error) {
        refuse(fmt::format("not valid TOML: {}", printable(std::string(error.description()))));
    }
    return {};
}

}  // namespace

void refuse_before_parsing(std::string_view text, std::string_view name) {
    constexpr int most = 32;
    constexpr int most_keys = 20000;
    constexpr int most_values = 500000;
    int dots = 0;
    int keys = 0;
    int values = 0;
    std::size_t line = 1;
    std::size_t column = 0;
    bool blank = true;     // nothing on this line yet
    bool comment = false;  // the line is one
    for (std::size_t i = 0; i < text.size(); ++i) {
        const char c = text[i];
        ++column;
        comment = comment || (blank && c == '#');
        if (!comment && (c == '=' || (blank && c == '['))) ++keys;
        if (!comment && c == ',') ++values;
        if (keys > most_keys || values > most_values) {
            const std::string much = keys > most_keys ? fmt::format("{} keys and sections", most_keys)
                                                      : fmt::format("{} values", most_values);
            throw InputError(fmt::format("{}:{}:{}: more than {}: not a scenario", name, line, column, much));
        }
        blank = blank && (c == ' ' || c == '\t');
        if (c == '\n') {
            ++line;
            column = 0;
            blank = true;
            comment = false;
        }
        const bool second_point = c == '.' && i > 0 && text[i - 1] == '.';
        if (comment || second_point || std::string_view("\n=,{}[]").find(c) != std::string_view::npos) {
            dots = 0;
        } else if (c == '.' && ++dots > most) {
            throw InputError(
                fmt::format("{}:{}:{}: a key of more than {} parts; the longest, effects.NAME.PARAMETER, have 3", name,
                            line, column, most));
        }
    }
}

Scenario parse_string(std::string_view text, std::string_view name, std::span<const std::string> settings,
                      const Rules& rules, std::string_view setting_word) {
    std::vector<std::pair<std::string, toml::table>> set;
    for (const std::string& setting : settings) {
        set.emplace_back(setting, parse_setting(setting, setting_word));
    }
    refuse_before_parsing(text, printable(name));
    toml::table root;
    try {
        root = toml::parse(text, name);
    } catch (const toml::parse_error& error) {
        const toml::source_position where = error.source().begin;
        throw InputError(fmt::format("{}:{}:{}: not valid TOML: {}", printable(name), where.line, where.column,
                                     printable(std::string(error.description()))));
    }
    return Reader(name, rules, setting_word).read(root, set);
}

std::string text_of_file(const std::filesystem::path& path) {
    constexpr std::size_t largest = 16 << 20;
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) {
        throw InputError(fmt::format("{}: is a directory; a scenario is a TOML file", printable(path)));
    }
    const Descriptor file = open_to_read(path);
    if (!file.valid()) throw InputError(fmt::format("{}: cannot be read: {}", printable(path), std::strerror(errno)));
    std::string text(largest + 1, '\0');
    std::size_t filled = 0;
    while (filled < text.size()) {
        const ssize_t got = read_some(file.get(), text.data() + filled, text.size() - filled);
        if (got < 0) throw InputError(fmt::format("{}: cannot be read: {}", printable(path), std::strerror(errno)));
        if (got == 0) break;
        filled += static_cast<std::size_t>(got);
    }
    text.resize(filled);
    if (text.size() > largest)
        throw InputError(fmt::format("{}: is larger than 16 MiB: not a scenario", printable(path)));
    return text;
}

Scenario parse_file(const std::filesystem::path& path, std::span<const std::string> settings, const Rules& rules,
                    std::string_view setting_word) {
    return parse_string(text_of_file(path), path.string(), settings, rules, setting_word);
}

}  // namespace ringlock::scenario
