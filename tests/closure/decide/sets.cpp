// The choice among sets of effects that explain a record about equally well, with sets that are made up.
#include "analysis/closure/decide/sets.hpp"

#include <gmock/gmock.h>

#include <string>
#include <vector>

#include "analysis/closure/types.hpp"

namespace ringlock::test::closure {
namespace decide_sets_test {
namespace {

using ringlock::closure::EffectSet;
using ringlock::closure::name_among;
using ringlock::closure::names_of;
using ringlock::closure::Naming;
using testing::ElementsAre;
using testing::IsEmpty;

const effects::Effect* effect(const char* name) { return effects::find(name); }

const auto any_may_lead = [](const effects::Effect*) { return true; };

std::vector<std::string> confounded(const Naming& naming) {
    std::vector<const effects::Effect*> others;
    for (std::size_t k = 1; k < naming.alternatives.size(); ++k) others.push_back(naming.alternatives[k].effect);
    return names_of(others);
}

TEST(Naming, OneSetNamesItsEffect) {
    const Naming naming = name_among({{{effect("bias_ramp")}, 30.0}}, any_may_lead);
    EXPECT_EQ(naming.named, effect("bias_ramp"));
    EXPECT_THAT(naming.partners, IsEmpty());
    ASSERT_EQ(naming.alternatives.size(), 1U);
    EXPECT_DOUBLE_EQ(naming.alternatives[0].evidence, 30.0);
}

TEST(Naming, AnotherEffectThatExplainsAsMuchIsConfounded) {
    const Naming naming =
        name_among({{{effect("bias_ramp")}, 30.0}, {{effect("rate_random_walk")}, 28.0}}, any_may_lead);
    EXPECT_EQ(naming.named, effect("bias_ramp"));
    EXPECT_THAT(confounded(naming), ElementsAre("rate_random_walk"));
    EXPECT_DOUBLE_EQ(naming.alternatives[1].evidence, 28.0);
}

TEST(Naming, ASetThatHasTheNamedEffectIsNoAlternative) {
    const Naming naming =
        name_among({{{effect("bias_ramp")}, 30.0}, {{effect("bias_ramp"), effect("bias_step")}, 29.0}}, any_may_lead);
    EXPECT_THAT(confounded(naming), IsEmpty());
}

TEST(Naming, OfAPairTheOneThatMoreSetsHoldIsNamed) {
    const std::vector<EffectSet> tied = {{{effect("bias_ramp"), effect("bias_step")}, 40.0},
                                         {{effect("rate_random_walk"), effect("bias_step")}, 39.0}};
    const Naming naming = name_among(tied, any_may_lead);
    EXPECT_EQ(naming.named, effect("bias_step"));
    EXPECT_THAT(names_of(naming.partners), ElementsAre("bias_ramp"));
    EXPECT_THAT(confounded(naming), IsEmpty());
}

TEST(Naming, AnEffectThatDoesNotPassAloneDoesNotLead) {
    const std::vector<EffectSet> tied = {{{effect("bias_ramp"), effect("bias_step")}, 40.0},
                                         {{effect("rate_random_walk"), effect("bias_step")}, 39.0}};
    const Naming naming =
        name_among(tied, [](const effects::Effect* candidate) { return candidate != effect("bias_step"); });
    EXPECT_EQ(naming.named, effect("bias_ramp"));
    EXPECT_THAT(names_of(naming.partners), ElementsAre("bias_step"));
    // The partner is part of the answer and no alternative to it.
    EXPECT_THAT(confounded(naming), ElementsAre("rate_random_walk"));
}

TEST(Naming, AnAlternativeIsListedOnceWithItsBestSet) {
    const std::vector<EffectSet> tied = {{{effect("bias_ramp")}, 30.0},
                                         {{effect("rate_random_walk"), effect("bias_step")}, 29.0},
                                         {{effect("rate_random_walk")}, 27.0}};
    const Naming naming = name_among(tied, any_may_lead);
    EXPECT_THAT(confounded(naming), ElementsAre("rate_random_walk", "bias_step"));
    EXPECT_DOUBLE_EQ(naming.alternatives[1].evidence, 29.0);
}

}  // namespace
}  // namespace decide_sets_test
}  // namespace ringlock::test::closure
