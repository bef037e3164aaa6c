#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <string>

#include "engine/core/error.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/check.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/render.hpp"

namespace ringlock::scenario {
namespace scenario_property_test {
namespace {

using Random = std::mt19937_64;

std::size_t below(Random& random, std::size_t n) { return random() % n; }

double unit(Random& random) { return std::ldexp(static_cast<double>(random() >> 11), -53); }

/// A real within the bounds, often at their edge, otherwise of any magnitude.
double random_real(const Key& key, Random& random) {
    const double min = std::get<double>(key.bounds.min);
    const double max = std::get<double>(key.bounds.max);
    if (below(random, 4) == 0) return max;
    const double value =
        below(random, 2) == 0 ? min + unit(random) * (max - min) : max * std::pow(10.0, -20.0 * unit(random));
    return within_bounds(key, value) ? value : max;
}

Value random_value(const Key& key, Random& random) {
    switch (key.type) {
        case Type::boolean:
            return below(random, 2) == 0;
        case Type::integer: {
            const auto min = std::get<std::int64_t>(key.bounds.min);
            const auto max = std::get<std::int64_t>(key.bounds.max);
            return min + static_cast<std::int64_t>(random() % (static_cast<std::uint64_t>(max - min) + 1));
        }
        case Type::real:
            return random_real(key, random);
        case Type::word:
            return key.words[below(random, key.words.size())];
        case Type::text:
            return std::string("text");
        case Type::reals: {
            const auto min = std::get<double>(key.bounds.min);
            const auto max = std::get<double>(key.bounds.max);
            std::vector<double> values(below(random, 5));
            for (double& value : values) value = min + unit(random) * (max - min);
            return values;
        }
        case Type::arms:
            break;
    }
    std::vector<std::string> names = arm_names();
    std::shuffle(names.begin(), names.end(), random);
    names.resize(1 + below(random, names.size()));
    return parse_arms(names);
}

void expect_resolved_text_parses_back(int scenarios) {
    Random random(20070301);
    int kept = 0;
    for (int i = 0; i < scenarios; ++i) {
        Scenario scenario;
        for (const Section& section : schema()) {
            if (section.elements) continue;  // scenario_design.cpp has these
            for (const Key& key : section.keys) {
                // A rule may be broken by what is drawn: such a key keeps its default.
                Scenario next = scenario;
                key.set(next, random_value(key, random));
                if (check(next).empty()) scenario = std::move(next);
            }
        }
        kept += scenario.arms != Scenario{}.arms;
        const std::string text = to_toml(scenario);
        const Scenario back = parse_string(text, "resolved");
        ASSERT_EQ(back, scenario) << text;
        ASSERT_EQ(to_toml(back), text);
    }
    // Arms that need pulses are refused beside a latched readout.
    EXPECT_GT(kept, scenarios * 3 / 7) << "the scenarios are hardly random";
}

TEST(ScenarioProperty, ResolvedTextParsesBackToAnEqualScenario) { expect_resolved_text_parses_back(60); }
TEST(LongScenarioProperty, ResolvedTextParsesBackToAnEqualScenario) { expect_resolved_text_parses_back(3000); }

/// Parses or refuses with a message; anything else fails the test.
void parse_or_refuse(const std::string& text, int& parsed) {
    try {
        parse_string(text, "mutant.toml");
        ++parsed;
    } catch (const InputError& error) {
        EXPECT_TRUE(std::string_view(error.what()).starts_with("mutant.toml:")) << error.what() << "\nin\n" << text;
    }
}

TEST(ScenarioProperty, DamagedBytesAreParsedOrRefused) {
    const std::string valid = to_toml(Scenario{});
    Random random(1);
    int parsed = 0;
    constexpr int mutants = 5000;
    for (int i = 0; i < mutants; ++i) {
        std::string text = valid;
        for (std::size_t n = 1 + below(random, 3); n > 0; --n) {
            const std::size_t at = below(random, text.size());
            switch (below(random, 3)) {
                case 0:
                    text[at] =
                        below(random, 2) == 0 ? static_cast<char>(random()) : "0123456789abcdef_ "[below(random, 18)];
                    break;
                case 1:
                    text.erase(at, 1 + below(random, 20));
                    break;
                default:
                    text.insert(at, 1 + below(random, 3), "[]{}\"'=.,#\n-e0\0\xff"[below(random, 17)]);
            }
        }
        ASSERT_NO_THROW(parse_or_refuse(text, parsed)) << text;
    }
    // About one in a hundred stays valid.
    EXPECT_GT(parsed, mutants / 200) << "the mutants die in the TOML parser, before they reach this project's code";
    EXPECT_LT(parsed, mutants);
}

TEST(ScenarioProperty, ShuffledLinesAreParsedOrRefused) {
    const std::string valid = to_toml(Scenario{});
    std::vector<std::string> lines;
    for (std::size_t from = 0; from < valid.size();) {
        const std::size_t end = valid.find('\n', from);
        lines.push_back(valid.substr(from, end - from + 1));
        from = end + 1;
    }
    Random random(2);
    int parsed = 0;
    for (int i = 0; i < 2000; ++i) {
        std::vector<std::string> mutant = lines;
        for (std::size_t n = 1 + below(random, 4); n > 0; --n) {
            const std::size_t at = below(random, mutant.size());
            switch (below(random, 3)) {
                case 0:
                    std::swap(mutant[at], mutant[below(random, mutant.size())]);
                    break;
                case 1:
                    mutant.erase(mutant.begin() + static_cast<std::ptrdiff_t>(at));
                    break;
                default:
                    mutant[at] += mutant[below(random, mutant.size())];
            }
        }
        std::string text;
        for (const std::string& line : mutant) text += line;
        ASSERT_NO_THROW(parse_or_refuse(text, parsed)) << text;
    }
    EXPECT_GT(parsed, 0);
}

}  // namespace
}  // namespace scenario_property_test
}  // namespace ringlock::scenario
