// Effects that were added to the library after the loop was built, named in records of the independent generator. The
// loop has no line of code for any of them.
#include <gtest/gtest.h>

#include <cstdint>
#include <string>
#include <vector>

#include "tests/closure/suite/suite.hpp"

namespace ringlock::test::closure {
namespace turns_named_test {
namespace {

/// Two records, at rest and with a moving input, of an effect at six times its detection limit.
std::vector<Outcome> judged_at_six_times_the_limit(const std::string& effect, std::uint64_t seed) {
    std::vector<Case> cases;
    for (const std::size_t condition : {0, 2}) {
        Case of{.kind = Kind::single, .truth = {}, .multiple = 6.0, .condition = &conditions[condition]};
        of.direct = true;
        of.seed = seed++;
        of.truth = {draw(effect, of.multiple * start_size(effect), of.seed, duration_s(of))};
        EXPECT_TRUE(settle(of));
        cases.push_back(std::move(of));
    }
    const auto records = make(cases);
    std::vector<Outcome> outcomes;
    for (std::size_t k = 0; k < cases.size(); ++k) outcomes.push_back(judge(cases[k], records[k]));
    return outcomes;
}

/// Expects the effect to be named, alone or in a tie, without any false name.
void expect_named(const std::string& effect) {
    for (const Outcome& outcome : judged_at_six_times_the_limit(effect, 4100)) {
        EXPECT_TRUE(outcome.judged == Judged::right || outcome.judged == Judged::tie)
            << outcome.verdict << " " << outcome.named;
        EXPECT_FALSE(outcome.false_name) << outcome.named;
    }
}

TEST(LongNamed, AHopOfModesAloneOrInATieThatHoldsIt) { expect_named("mode_hop"); }

TEST(LongNamed, ANullShiftThatFollowsTheSlopeOfTheTemperature) { expect_named("null_shift_ramp"); }

// A hop whose changes of threshold and phase show is no step of the bias, and a step of the bias that comes without
// them is no hop.
TEST(LongHopOrStep, AreToldApartWhereTheRecordCouldShowTheDifference) {
    const auto named = [](const Added& added) {
        Case of{.kind = Kind::single, .truth = {added}, .condition = &conditions[0], .direct = true, .seed = 4200};
        return judge(of, make({&of, 1}).front());
    };
    const Outcome hop =
        named({"mode_hop", {{"step_deg_h", 0.08}, {"threshold_ratio", 0.012}, {"phase_rad", 0.05}, {"time_s", 30.0}}});
    EXPECT_EQ(hop.judged, Judged::right) << hop.named;
    const Outcome step = named({"bias_step", {{"step_deg_h", 0.08}, {"time_s", 30.0}}});
    EXPECT_EQ(step.judged, Judged::right) << step.named;
}

}  // namespace
}  // namespace turns_named_test
}  // namespace ringlock::test::closure
