#include "analysis/quantity/unit.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::quantity {
namespace {

constexpr double arcsec_per_rad = 180.0 * units::arcsec_per_deg / units::pi;
constexpr double standard_gravity_m_s2 = 9.80665;  // exact, by the 3rd General Conference on Weights and Measures

/// A unit and its other spellings, as normalised() writes them.
struct Entry {
    const char* name;
    Instrument instrument;
    bool is_rate;
    double factor;
    std::vector<std::string_view> spellings;
};

const std::vector<Entry>& table() {
    using enum Instrument;
    static const std::vector<Entry> entries = {
        {"arcsec", gyro, false, 1.0, {"arcsecond", "arcseconds", "as", "asec", "\""}},
        {"mdeg", gyro, false, 1e-3 * units::arcsec_per_deg, {"millideg", "millidegree", "millidegrees"}},
        {"deg", gyro, false, units::arcsec_per_deg, {"degree", "degrees"}},
        {"urad", gyro, false, 1e-6 * arcsec_per_rad, {"microrad", "microradian", "microradians"}},
        {"mrad", gyro, false, 1e-3 * arcsec_per_rad, {"millirad", "milliradian", "milliradians"}},
        {"rad", gyro, false, arcsec_per_rad, {"radian", "radians"}},
        {"deg/h", gyro, true, 1.0, {"dph", "degph"}},
        {"arcsec/s", gyro, true, 1.0, {"as/s"}},
        {"mdeg/s", gyro, true, 1e-3 * units::arcsec_per_deg, {"mdps"}},
        {"deg/s", gyro, true, units::arcsec_per_deg, {"dps", "degps"}},
        {"deg/min", gyro, true, units::arcsec_per_deg / 60.0, {"dpm"}},
        {"urad/s", gyro, true, 1e-6 * arcsec_per_rad, {"urps"}},
        {"mrad/s", gyro, true, 1e-3 * arcsec_per_rad, {"mrps"}},
        {"rad/s", gyro, true, arcsec_per_rad, {"rps", "radps"}},
        {"m/s", accelerometer, false, 1.0, {}},
        {"mm/s", accelerometer, false, 1e-3, {}},
        {"m/s^2", accelerometer, true, 1.0, {"m/s/s"}},
        {"mm/s^2", accelerometer, true, 1e-3, {"mm/s/s"}},
        {"g", accelerometer, true, standard_gravity_m_s2, {"gn", "g0", "gee"}},
        {"mg", accelerometer, true, 1e-3 * standard_gravity_m_s2, {"milli-g", "millig"}},
        {"ug", accelerometer, true, 1e-6 * standard_gravity_m_s2, {"micro-g", "microg"}},
        {"s", clock, false, 1.0, {}},
        {"ms", clock, false, 1e-3, {}},
        {"us", clock, false, 1e-6, {}},
        {"ns", clock, false, 1e-9, {"nanos"}},
        {"ps", clock, false, 1e-12, {}},
        {"1", clock, true, 1.0, {"hz/hz", "s/s"}},
    };
    return entries;
}

bool replace_all(std::string& text, std::string_view from, std::string_view to) {
    bool any = false;
    for (std::size_t at = 0; (at = text.find(from, at)) != std::string::npos; at += to.size()) {
        text.replace(at, from.size(), to);
        any = true;
    }
    return any;
}

/// One factor of a unit: "degrees" is "deg", "seconds" is "s", "hour" is "h".
std::string short_form(const std::string& word) {
    static constexpr std::array<std::pair<const char*, const char*>, 20> words = {
        {{"degree", "deg"},      {"degrees", "deg"},     {"radian", "rad"},     {"radians", "rad"},
         {"second", "s"},        {"seconds", "s"},       {"sec", "s"},          {"secs", "s"},
         {"hour", "h"},          {"hours", "h"},         {"hr", "h"},           {"minute", "min"},
         {"meter", "m"},         {"meters", "m"},        {"metre", "m"},        {"metres", "m"},
         {"milliseconds", "ms"}, {"microseconds", "us"}, {"nanoseconds", "ns"}, {"nanosecond", "ns"}}};
    for (const auto& [spelt, meant] : words) {
        if (word == spelt) return meant;
    }
    return word;
}

/// Lower case without blanks and brackets, with "/" for a negative power and "deg" and "u" for their signs.
std::string normalised(std::string_view spelling) {
    std::string text(spelling);
    replace_all(text, "\xC2\xB0", "deg");         // degree sign
    replace_all(text, "\xC2\xBA", "deg");         // masculine ordinal, which keyboards have
    replace_all(text, "\xC2\xB5", "u");           // micro sign
    replace_all(text, "\xCE\xBC", "u");           // Greek mu
    replace_all(text, "\xC2\xB2", "^2");          // superscript two
    replace_all(text, "\xE2\x81\xBB", "^-");      // superscript minus
    replace_all(text, "\xC2\xB9", "1");           // superscript one
    replace_all(text, "\xC2\xB7", " ");           // middle dot
    replace_all(text, "\xE2\x8B\x85", " ");       // dot operator
    replace_all(text, "\xE2\x80\xB3", "arcsec");  // double prime
    replace_all(text, "^-^2", "^-2");
    replace_all(text, "**", "^");
    for (char& c : text) {
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
        if (c == '*' || c == '_' || c == '\t') c = ' ';
    }
    while (!text.empty() && std::string_view(" [(").find(text.front()) != std::string_view::npos) text.erase(0, 1);
    while (!text.empty() && std::string_view(" ])").find(text.back()) != std::string_view::npos) text.pop_back();
    replace_all(text, " per ", "/");
    replace_all(text, " / ", "/");
    replace_all(text, "/ ", "/");
    replace_all(text, " /", "/");
    // Words, one after the other, each with "/" before it where it divides.
    std::string out;
    std::string word;
    bool divides = false;
    const auto take = [&] {
        if (word.empty()) return;
        for (const char* power : {"^-1", "-1"}) {
            if (word.size() > std::string_view(power).size() && word.ends_with(power)) {
                word.erase(word.size() - std::string_view(power).size());
                divides = true;
            }
        }
        for (const char* power : {"^-2", "-2"}) {
            if (word.size() > std::string_view(power).size() && word.ends_with(power)) {
                word.erase(word.size() - std::string_view(power).size());
                word = short_form(word) + "^2";
                divides = true;
            }
        }
        if (word == "s2" || word == "sec2") word = "s^2";
        if (word == "sec^2" || word == "second^2") word = "s^2";
        out += (divides ? "/" : "") + short_form(word);
        word.clear();
        divides = false;
    };
    for (const char c : text) {
        if (c == '/' || c == ' ') {
            take();
            divides = c == '/';
        } else {
            word += c;
        }
    }
    take();
    return out;
}

}  // namespace

std::optional<Unit> find_unit(std::string_view spelling) {
    const std::string wanted = normalised(spelling);
    for (const Entry& entry : table()) {
        const bool known = wanted == entry.name || std::any_of(entry.spellings.begin(), entry.spellings.end(),
                                                               [&](std::string_view other) { return wanted == other; });
        if (known) return Unit{entry.name, entry.instrument, entry.is_rate, entry.factor};
    }
    return std::nullopt;
}

std::string known_units(bool is_rate) {
    std::string out;
    for (const Entry& entry : table()) {
        if (entry.is_rate != is_rate) continue;
        if (!out.empty()) out += ", ";
        out += entry.name;
    }
    return out;
}

Unit unit_for(std::string_view spelling, bool is_rate, std::string_view option) {
    const std::optional<Unit> unit = find_unit(spelling);
    if (!unit) {
        throw InputError(fmt::format("{} '{}' is not known; allowed are {}", option, spelling, known_units(is_rate)));
    }
    if (unit->is_rate == is_rate) return *unit;
    throw InputError(fmt::format("{} {} is a unit of {}, but the numbers are {}; allowed are {}", option, spelling,
                                 unit->is_rate ? "rates" : "angles, velocities or times",
                                 is_rate ? "rates" : "angles, velocities or times", known_units(is_rate)));
}

}  // namespace ringlock::quantity
