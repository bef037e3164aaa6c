#include "engine/scenario/text/render.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <nlohmann/json.hpp>

#include "engine/scenario/arm.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/keys/schema.hpp"

namespace ringlock::scenario {
namespace {

/// Lines of at most 120 columns, the first after `first` and the others after `next`. None of the others begins like
/// an item of a Markdown list.
std::string wrapped(std::string_view text, std::string_view first, std::string_view next) {
    const std::size_t columns = 120 - next.size();
    const auto splits = [&text](std::size_t at) {
        const std::string_view rest = text.substr(at + 1);
        return !(rest.size() > 1 && rest[1] == ' ' &&
                 std::string_view("-+*#>|=").find(rest[0]) != std::string_view::npos);
    };
    std::string out;
    std::string_view lead = first;
    while (text.size() > columns) {
        std::size_t end = text.rfind(' ', columns);
        while (end != std::string_view::npos && end > 0 && !splits(end)) end = text.rfind(' ', end - 1);
        if (end == std::string_view::npos || end == 0) end = columns;
        out += fmt::format("{}{}\n", lead, text.substr(0, end));
        text.remove_prefix(std::min(text.size(), end + 1));
        lead = next;
    }
    return out + fmt::format("{}{}\n", lead, text);
}

std::string comment(std::string_view text) { return wrapped(text, "# ", "# "); }

/// "A number between 1 and 100000: mechanical dither runs at some hundred Hz."
std::string allowed_sentence(const Key& key) {
    std::string text = allowed_text(key);
    text[0] = static_cast<char>(std::toupper(static_cast<unsigned char>(text[0])));
    return key.bounds.why.empty() ? text + "." : fmt::format("{}: {}.", text, key.bounds.why);
}

/// The elements of a section that may stand several times, each with the keys that it has.
std::string elements_text(const Section& section, const Scenario& scenario) {
    std::string out;
    const std::size_t count = section.elements->count(scenario);
    for (std::size_t i = 0; i < count; ++i) {
        Scenario up_to_it = scenario;
        section.elements->resize(up_to_it, i + 1);
        const VariationForm form = section.elements->form(up_to_it);
        out += fmt::format("\n[[{}]]\n", section.name);
        for (const Key& key : section.keys) {
            const auto is_it = [&](std::string_view name) { return name == key.name; };
            const bool has = &key == &section.keys.front() ||
                             std::any_of(form.required.begin(), form.required.end(), is_it) ||
                             std::any_of(form.optional.begin(), form.optional.end(), is_it);
            if (has) out += fmt::format("{} = {}\n", key.name, to_toml(key.get(up_to_it)));
        }
    }
    return out;
}

/// An example of an element of the section, as a comment: by default there is no element.
std::string commented_element(const Section& section) {
    std::string out = fmt::format("# [[{}]]\n", section.name);
    for (const Key& key : section.keys) {
        out += comment(fmt::format("{} {}", key.doc, allowed_sentence(key)));
        out += fmt::format("# {} = {}\n", key.name, to_toml(key.default_value()));
    }
    return out;
}

using Remarks = std::map<std::string, std::string>;

std::string write(const Scenario& scenario, bool commented, const Remarks& remarks = {}) {
    std::string out;
    if (!scenario.device.empty()) out += fmt::format("device = \"{}\"\n", scenario.device);
    for (const Section& section : schema()) {
        if (section.elements) {
            out +=
                commented ? '\n' + comment(section.doc) + commented_element(section) : elements_text(section, scenario);
            continue;
        }
        if (!out.empty()) out += '\n';
        if (commented) out += comment(section.doc);
        out += fmt::format("[{}]\n", section.name);
        for (const Key& key : section.keys) {
            if (commented) out += comment(fmt::format("{} {}", key.doc, allowed_sentence(key)));
            const auto remark = remarks.find(fmt::format("{}.{}", section.name, key.name));
            if (remark != remarks.end()) out += toml_comment(remark->second);
            out += fmt::format("{} = {}\n", key.name, to_toml(key.get(scenario)));
        }
    }
    return out;
}

std::string_view type_name(Type type) {
    switch (type) {
        case Type::boolean:
            return "boolean";
        case Type::integer:
            return "integer";
        case Type::real:
            return "float";
        case Type::word:
        case Type::text:
            return "string";
        case Type::reals:
            return "list of floats";
        case Type::arms:
            break;
    }
    return "list of strings";
}

struct JsonWriter {
    nlohmann::ordered_json operator()(const std::vector<Arm>& arms) const {
        auto names = nlohmann::ordered_json::array();
        for (const Arm& arm : arms) names.push_back(arm.name);
        return names;
    }
    nlohmann::ordered_json operator()(const auto& value) const { return value; }
};

nlohmann::ordered_json json_of(const Value& value) { return std::visit(JsonWriter{}, value); }

}  // namespace

std::string toml_comment(std::string_view text) {
    std::string printable;
    for (const char c : text) {
        const auto byte = static_cast<unsigned char>(c);
        printable += byte < 0x20 || byte == 0x7f ? fmt::format("\\x{:02x}", byte) : std::string(1, c);
    }
    return comment(printable);
}

std::string to_toml(const Scenario& scenario) { return write(scenario, false); }

std::string to_toml(const Scenario& scenario, const Remarks& remarks) { return write(scenario, false, remarks); }

std::string schema_text() {
    return comment("Every key of a ringlock scenario at its default. A scenario names only the keys that differ.") +
           comment(
               "device = \"NAME\", before all sections, takes the constants of a known gyro for defaults; "
               "ringlock devices lists them.") +
           '\n' + write(Scenario{}, true);
}

std::string schema_markdown() {
    std::string out =
        "# Scenario keys\n\n"
        "<!-- Made by `ringlock run --print-schema=markdown`; a test compares the two. -->\n\n";
    out += wrapped(
        "A scenario is a TOML file. A key that is not named has its default, so an empty file is valid: "
        "it is the device of Gao and Deng (2007) with the default ensemble. Every key carries its unit in its name. "
        "An unknown key, a wrong type or a value out of bounds is an error that names file, line, column, "
        "key and value; all errors of a file are reported at once. Integers are accepted for floats. "
        "`ringlock run --print-schema` prints a commented file with every default.",
        "", "");
    out +=
        '\n' + wrapped(
                   "`device = \"NAME\"` at the top of a scenario, before all sections, "
                   "takes the constants of a known gyro for defaults; keys of the scenario override them one by one. "
                   "`ringlock devices` lists the gyros and where their constants come from.",
                   "", "");
    for (const Section& section : schema()) {
        const std::string heading =
            section.elements ? fmt::format("[[{}]]", section.name) : fmt::format("[{}]", section.name);
        out += fmt::format("\n## `{}`\n\n{}\n", heading, wrapped(section.doc, "", ""));
        out += "| key | type | default | allowed | meaning |\n|---|---|---|---|---|\n";
        for (const Key& key : section.keys) {
            out += fmt::format("| `{}` | {} | `{}` | {} | {} |\n", key.name, type_name(key.type),
                               to_toml(key.default_value()), allowed_sentence(key), key.doc);
        }
    }
    out += "\n## Rules between keys\n\n";
    for (const std::string_view rule : rules()) out += wrapped(rule, "- ", "  ");
    return out;
}

std::string schema_json() {
    using Json = nlohmann::ordered_json;
    Json sections = Json::array();
    for (const Section& section : schema()) {
        Json keys = Json::array();
        for (const Key& key : section.keys) {
            Json entry = {{"name", key.name},
                          {"type", type_name(key.type)},
                          {"default", json_of(key.default_value())},
                          {"allowed", allowed_text(key)},
                          {"doc", key.doc}};
            if (key.type == Type::integer || key.type == Type::real || key.type == Type::reals) {
                entry["min"] = json_of(key.bounds.min);
                entry["max"] = json_of(key.bounds.max);
            }
            if (key.type == Type::word) entry["words"] = key.words;
            if (key.type == Type::arms) entry["words"] = arm_names();
            keys.push_back(std::move(entry));
        }
        Json entry{{"name", section.name}, {"doc", section.doc}, {"keys", std::move(keys)}};
        if (section.elements) entry["several"] = true;
        sections.push_back(std::move(entry));
    }
    return Json{{"sections", std::move(sections)}, {"rules", rules()}}.dump(2) + "\n";
}

}  // namespace ringlock::scenario
