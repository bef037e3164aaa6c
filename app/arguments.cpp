#include "app/arguments.hpp"

#include <fmt/format.h>

#include <charconv>
#include <limits>
#include <system_error>

#include "engine/core/error.hpp"
#include "engine/scenario/parse.hpp"

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

scenario::Scenario load_scenario(const std::string& file, const std::optional<std::string>& seed) {
    scenario::Scenario scenario = scenario::parse_file(file);
    if (seed) {
        constexpr std::int64_t largest = std::numeric_limits<std::int64_t>::max();  // integers of TOML are signed
        scenario.ensemble.seed = static_cast<std::uint64_t>(
            whole_number("--seed", *seed, largest, fmt::format("between 0 and {}", largest)));
    }
    return scenario;
}

}  // namespace ringlock::app
