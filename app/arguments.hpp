#pragma once
#include <CLI/App.hpp>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/allan/estimator.hpp"
#include "engine/scenario/scenario.hpp"

/// Arguments that several commands share.
namespace ringlock::app {

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

/// The parts of "a, b, c", without white space around them.
std::vector<std::string> split(const std::string& text);

/// Names of all deviations, for help and errors.
std::string known_deviations();

/// The deviations of a list such as --dev has, each once. Throws InputError.
std::vector<allan::Estimator> parse_deviations(const std::string& list);

/// One of the averaging times of a list such as `analyze --tau` has.
struct AveragingTime {
    std::string text;              ///< as given
    std::optional<double> time_s;  ///< of a number with a unit
    std::int64_t samples = 0;      ///< averaging factor; 0 where a time is given and no sampling interval is known yet
};

/// A number with a unit (5ms, 100s, 2min, 1h) is a time, a whole number from 1 without one an averaging factor; nothing
/// where the text is neither.
std::optional<AveragingTime> averaging_time(const std::string& text);

/// Numbers with a unit are times (100s, 2min, 1h), those without are averaging factors. Throws InputError.
std::vector<AveragingTime> parse_averaging_times(std::string_view option, const std::string& list);

/// Seconds of a time with a unit, as in 90s, 20min, 2h. Throws InputError.
double duration_s(std::string_view option, const std::string& text);

}  // namespace ringlock::app
