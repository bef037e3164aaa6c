#include "app/arguments.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

#include "analysis/allan_run/deviations.hpp"
#include "analysis/study/design_points.hpp"
#include "engine/core/error.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::app {

std::int64_t whole_number(std::string_view option, const std::string& text, std::int64_t largest,
                          std::string_view allowed) {
    std::int64_t value = -1;
    const char* const last = text.data() + text.size();
    const auto [end, error] = std::from_chars(text.data(), last, value);
    if (error != std::errc() || end != last || value < 0 || value > largest) {
        throw InputError(fmt::format("{} {}: must be a whole number {}", option, text, allowed));
    }
    return value;
}

int thread_count(const std::string& asked) {
    constexpr int most = 4096;
    const auto threads = static_cast<int>(
        whole_number("--threads", asked, most, fmt::format("between 1 and {}, or 0 for all cores", most)));
    return threads > 0 ? threads : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

void add_settings(CLI::App& command, Changes& changes) {
    command
        .add_option("--set", changes.settings,
                    "replaces the value of a key in the file: --set gyro.lockin_threshold_deg_h=140; "
                    "may be given several times")
        ->type_name("KEY=VALUE")
        ->take_all()
        ->allow_extra_args(false);
}

scenario::Scenario load_scenario(const std::string& file, const Changes& changes) {
    std::vector<std::string> settings = changes.settings;
    if (const auto& seed = changes.seed) {
        constexpr std::int64_t largest = std::numeric_limits<std::int64_t>::max();  // integers of TOML are signed
        settings.push_back(fmt::format(
            "ensemble.seed={}", whole_number("--seed", *seed, largest, fmt::format("between 0 and {}", largest))));
    }
    return scenario::parse_file(file, settings, study::complaints);
}

std::vector<allan::Estimator> parse_deviations(const std::string& list) {
    return allan_run::deviations_named(allan_run::split(list), "--dev");
}

std::vector<AveragingTime> parse_averaging_times(std::string_view option, const std::string& list) {
    constexpr std::string_view allowed =
        "times with a unit (100s, 2min, 1h) or averaging factors (whole numbers of samples from 1), "
        "separated by commas";
    if (list.find_first_not_of(' ') == std::string::npos) {
        throw InputError(fmt::format("{}: the list is empty; say {}", option, allowed));
    }
    const std::vector<std::string> parts = allan_run::split(list);
    constexpr std::size_t most = 100;
    if (parts.size() > most) {
        throw InputError(
            fmt::format("{}: {} averaging times; at most {} can be asked for at once; use another call for the others",
                        option, parts.size(), most));
    }
    std::vector<AveragingTime> out;
    for (const std::string& part : parts) {
        const auto time = averaging_time(part);
        if (!time) throw InputError(fmt::format("{} '{}': must be {}", option, part, allowed));
        out.push_back(*time);
    }
    return out;
}

void add_follow_links(CLI::App& command, bool& follow) {
    command.add_flag("--follow-links", follow,
                     "also read other files to which an HDF5 file refers by external links, "
                     "external raw data or virtual datasets; by default only the named file is read");
}

double duration_s(std::string_view option, const std::string& text) {
    const auto time = averaging_time(text);
    if (!time || !time->time_s || !(*time->time_s > 0.0)) {
        throw InputError(fmt::format("{} '{}': must be a time with its unit, as 90s, 20min or 2h", option, text));
    }
    return *time->time_s;
}

}  // namespace ringlock::app
