#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>
#include <sstream>

#include "engine/core/error.hpp"
#include "engine/effects/effect.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/render.hpp"

namespace ringlock::scenario {
namespace scenario_schema_test {
namespace {

using testing::HasSubstr;

TEST(Schema, EveryKeyIsDocumentedOnceAndStandsAtAnAllowedDefault) {
    std::set<std::string> paths;
    for (const Section& section : schema()) {
        EXPECT_FALSE(section.doc.empty()) << section.name;
        for (const Key& key : section.keys) {
            EXPECT_EQ(key.section, section.name);
            EXPECT_TRUE(paths.insert(key.path()).second) << key.path();
            EXPECT_TRUE(key.doc.ends_with('.')) << key.path();
            EXPECT_EQ(key.doc.find('|'), std::string::npos) << "breaks the table of the page: " << key.path();
            if (key.type == Type::integer || key.type == Type::real) {
                EXPECT_TRUE(within_bounds(key, key.default_value())) << key.path();
            }
        }
    }
}

TEST(Schema, EveryKeySetsWhatItGets) {
    for (const Section& section : schema()) {
        for (const Key& key : section.keys) {
            Value other;
            switch (key.type) {
                case Type::boolean:
                    other = !std::get<bool>(key.default_value());
                    break;
                case Type::integer:
                case Type::real:
                    other = key.bounds.max == key.default_value() ? key.bounds.min : key.bounds.max;
                    break;
                case Type::word:
                    other = key.words.back() == std::get<std::string>(key.default_value()) ? key.words.front()
                                                                                           : key.words.back();
                    break;
                case Type::text:
                    other = std::string("gyro.lockin_threshold_deg_h");
                    break;
                case Type::reals:
                    other = std::vector<double>{1.0, 2.0};
                    break;
                case Type::arms:
                    other = parse_arms({"ideal"});
                    break;
            }
            Scenario scenario;
            if (section.elements) section.elements->resize(scenario, 1);
            const Scenario before = scenario;
            key.set(scenario, other);
            EXPECT_EQ(key.get(scenario), other) << key.path();
            EXPECT_NE(scenario, before) << key.path();
            key.set(scenario, key.default_value());
            EXPECT_EQ(scenario, before) << key.path() << " is bound to another key's field";
        }
    }
}

TEST(Schema, HoldsEveryParameterOfEveryEffect) {
    std::size_t sections = 0;
    for (const Section& section : schema()) sections += section.name.starts_with("effects.") ? 1 : 0;
    EXPECT_EQ(sections, effects::registry().size());
    EXPECT_EQ(default_effect_settings().size(), effects::registry().size());
}

TEST(Schema, PrintedTextParsesBackToTheDefaults) {
    EXPECT_EQ(parse_string(schema_text(), "schema"), Scenario{});
    EXPECT_EQ(parse_string(to_toml(Scenario{}), "resolved"), Scenario{});
}

TEST(Schema, PrintedTextCommentsEveryKeyWithin120Columns) {
    std::istringstream lines(schema_text());
    std::string before;
    for (std::string line; std::getline(lines, line); before = line) {
        if (line.starts_with('#')) {
            EXPECT_LE(line.size(), 120U) << line;
        }
        if (line.find(" = ") != std::string::npos && !line.starts_with('#')) {
            EXPECT_TRUE(before.starts_with('#')) << line;
        }
    }
}

// Rows of a table cannot be broken in Markdown; everything else can, but not into what looks like a list.
TEST(Schema, PageBreaksItsLinesAt120Columns) {
    std::istringstream lines(schema_markdown());
    bool any_continued = false;
    for (std::string line; std::getline(lines, line);) {
        if (line.starts_with('|')) continue;
        EXPECT_LE(line.size(), 120U) << line;
        any_continued |= line.starts_with("  ");
        EXPECT_FALSE(line.starts_with("+ ") || line.starts_with("= ") || line.starts_with("* ")) << line;
    }
    EXPECT_TRUE(any_continued);
}

TEST(Schema, JsonIsValidAndHoldsEverySection) {
    const nlohmann::json json = nlohmann::json::parse(schema_json());
    ASSERT_EQ(json.at("sections").size(), schema().size());
    const auto& key = json.at("sections").at(0).at("keys").at(0);
    EXPECT_EQ(key.at("name"), "scale_factor_arcsec");
    EXPECT_EQ(key.at("type"), "float");
    EXPECT_EQ(key.at("default"), 0.5);
    EXPECT_EQ(key.at("min"), 1e-3);
}

TEST(Schema, PageInTheDocsIsUpToDate) {
    std::ifstream file(RINGLOCK_SOURCE_DIR "/docs/scenario.md");
    std::ostringstream page;
    page << file.rdbuf();
    EXPECT_EQ(page.str(), schema_markdown())
        << "regenerate the page: ringlock run --print-schema=markdown > docs/scenario.md";
}

TEST(Arm, KnowsEveryName) {
    EXPECT_EQ(parse_arm("ideal"), (Arm{.name = "ideal", .ideal = true}));
    EXPECT_EQ(parse_arm("uncompensated"), (Arm{.name = "uncompensated"}));
    EXPECT_EQ(parse_arm("noise_injected"), (Arm{.name = "noise_injected", .noise_injected = true}));
    EXPECT_EQ(parse_arm("compensated"), (Arm{.name = "compensated", .compensator = Compensator::corrected}));
    EXPECT_EQ(parse_arm("noise_injected+compensated_published"), (Arm{.name = "noise_injected+compensated_published",
                                                                      .noise_injected = true,
                                                                      .compensator = Compensator::published}));
    for (const std::string& name : arm_names()) EXPECT_EQ(parse_arm(name).name, name);
}

TEST(Arm, TellsWhichThereAre) {
    const auto message = [](std::string_view name) -> std::string {
        try {
            parse_arm(name);
        } catch (const InputError& error) {
            return error.what();
        }
        return "";
    };
    EXPECT_THAT(message("noise_injected+compensatd"), HasSubstr("did you mean \"noise_injected+compensated\"?"));
    EXPECT_THAT(message("ideal+compensated"), HasSubstr("unknown arm"));
    EXPECT_THAT(message(""), HasSubstr("unknown arm"));
}

TEST(InputSweep, IsEvenlySpacedWithBothEnds) {
    const InputRate sweep{.rate_deg_h = 0.0, .sweep_stop_deg_h = 0.3, .sweep_points = 4};
    EXPECT_EQ(input_rate_deg_h(sweep, 0), 0.0);
    EXPECT_DOUBLE_EQ(input_rate_deg_h(sweep, 1), 0.1);
    EXPECT_EQ(input_rate_deg_h(sweep, 3), 0.3);
    EXPECT_EQ(input_rate_deg_h({.rate_deg_h = 7.0, .sweep_stop_deg_h = 15.0, .sweep_points = 1}, 0), 7.0);
}

}  // namespace
}  // namespace scenario_schema_test
}  // namespace ringlock::scenario
