#include <fmt/format.h>
#include <gtest/gtest.h>

#include <fstream>
#include <string>
#include <vector>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace effects_page_test {
namespace {

std::string_view name_of(Role role) {
    switch (role) {
        case Role::size:
            return "size";
        case Role::phase:
            return "phase";
        case Role::time:
            return "time";
        case Role::frequency:
            return "frequency";
        case Role::deviation:
            return "deviation";
        case Role::probability:
            return "probability";
        case Role::sampled:
            return "sampled";
        case Role::setting:
            return "setting";
    }
    return "";
}

/// First two cells of an effect's row in the page.
std::string row_of(const Effect& effect) {
    std::vector<std::string> parameters;
    for (const Parameter& p : effect.parameters()) {
        parameters.push_back(fmt::format("`{}` {}, {:g} to {:g}", p.name, name_of(p.role), p.min, p.max));
    }
    return fmt::format("| `{}` | {} |", effect.name(), fmt::join(parameters, "; "));
}

TEST(EffectsPage, HasARowForEveryEffectWithItsParametersRolesAndBounds) {
    std::ifstream file(RINGLOCK_SOURCE_DIR "/docs/effects.md");
    ASSERT_TRUE(file.good());
    std::vector<std::string> rows;
    for (std::string line; std::getline(file, line);) {
        if (line.starts_with("| `")) rows.push_back(line);
    }
    const auto all = registry();
    ASSERT_EQ(rows.size(), all.size());
    for (std::size_t i = 0; i < all.size(); ++i) {
        const std::string expected = row_of(*all[i]);
        EXPECT_EQ(rows[i].substr(0, expected.size()), expected);
    }
}

}  // namespace
}  // namespace effects_page_test
}  // namespace ringlock::effects
