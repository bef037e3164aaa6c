#pragma once
#include <CLI/App.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/allan/estimator.hpp"
#include "analysis/allan_run/taus.hpp"
#include "engine/scenario/scenario.hpp"

/// Arguments that several commands share.
namespace ringlock::app {

using allan_run::averaging_time;
using allan_run::AveragingTime;

/// A whole number from 0 in plain decimal digits. CLI11 would read 010 as eight and would cut a number that is too
/// large without an error. Throws InputError.
std::int64_t whole_number(std::string_view option, const std::string& text, std::int64_t largest,
                          std::string_view allowed);

/// Threads of --threads; 0 means all cores. Throws InputError.
int thread_count(const std::string& asked);

/// Changes of a scenario that the command line makes in addition to its file.
struct Changes {
    std::vector<std::string> settings;  ///< of --set, "section.key=value"
    std::optional<std::string> seed;    ///< of --seed
};

/// Adds --set.
void add_settings(CLI::App& command, Changes& changes);

/// Adds --follow-links.
void add_follow_links(CLI::App& command, bool& follow);

/// The scenario of the file with these changes.
scenario::Scenario load_scenario(const std::string& file, const Changes& changes);

/// The deviations of a list such as --dev has, each once. Throws InputError.
std::vector<allan::Estimator> parse_deviations(const std::string& list);

/// Numbers with a unit are times (100s, 2min, 1h), those without are averaging factors. Throws InputError.
std::vector<AveragingTime> parse_averaging_times(std::string_view option, const std::string& list);

/// Seconds of a time with a unit, as in 90s, 20min, 2h. Throws InputError.
double duration_s(std::string_view option, const std::string& text);

}  // namespace ringlock::app
