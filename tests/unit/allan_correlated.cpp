#include <gtest/gtest.h>

#include <cmath>

#include "analysis/noise/fit.hpp"
#include "analysis/noise/model/shapes.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_correlated_test {
namespace {

using namespace ringlock;
using noise::NoiseFit;
using test::Truth;

bool holds(const noise::Estimate& e, double truth) { return e.lo <= truth && truth <= e.hi; }

TEST(AllanCorrelated, IsNamedWithItsErrors) {
    constexpr int records = 60;
    const double time_s = 40.0;
    const Truth truth{.q = 0.3, .n = 0.3, .correlated_rms = 0.25, .correlation_time_s = time_s};
    int described = 0;
    int found = 0;
    int time_held = 0;
    int drive_held = 0;
    int rms_held = 0;
    int arw_held = 0;
    for (int k = 0; k < records; ++k) {
        const NoiseFit f = noise::fit_noise(test::simulate_angle(truth, 4096, 2.0, 700 + k), 2.0);
        described += f.described ? 1 : 0;
        if (f.arw_deg_rt_h.resolved) {
            arw_held += *f.arw_deg_rt_h.lo <= truth.n / 60.0 && truth.n / 60.0 <= *f.arw_deg_rt_h.hi ? 1 : 0;
        }
        if (!f.correlated) continue;
        ++found;
        EXPECT_FALSE(f.bias_instability_deg_h.resolved) << k;
        time_held += holds(f.correlated->correlation_time_s, time_s) ? 1 : 0;
        drive_held += holds(f.correlated->amplitude_deg_h_rt_h, 60.0 * 0.25 * std::sqrt(2.0 / time_s)) ? 1 : 0;
        rms_held += holds(f.correlated->rms_rate_deg_h, 0.25) ? 1 : 0;
    }
    EXPECT_GE(described, records - 2);
    EXPECT_GE(found, records * 9 / 10);
    // 41 of 60 expected, standard deviation 3.6: four of them
    for (const int held : {time_held, drive_held, rms_held, arw_held}) EXPECT_NEAR(held, 41, 14.4);
}

// Its three figures belong together: q_c^2 T_c/2 is the variance.
TEST(AllanCorrelated, FiguresAgree) {
    const Truth truth{.n = 0.3, .correlated_rms = 0.3, .correlation_time_s = 20.0};
    const NoiseFit f = noise::fit_noise(test::simulate_angle(truth, 4096, 1.0, 5), 1.0);
    ASSERT_TRUE(f.correlated);
    const double drive_deg_h_rt_s = f.correlated->amplitude_deg_h_rt_h.value / 60.0;
    const double variance = drive_deg_h_rt_s * drive_deg_h_rt_s * f.correlated->correlation_time_s.value / 2.0;
    EXPECT_NEAR(std::sqrt(variance), f.correlated->rms_rate_deg_h.value, 1e-9);
}

TEST(AllanCorrelated, StandsBesideALine) {
    const Truth truth{.n = 0.3,
                      .correlated_rms = 0.3,
                      .correlation_time_s = 20.0,
                      .lines = {{.amplitude = 1.0, .frequency_hz = 0.21, .phase_rad = 2.0}}};
    const NoiseFit f = noise::fit_noise(test::simulate_angle(truth, 4096, 1.0, 6), 1.0);
    EXPECT_TRUE(f.described) << f.reason;
    EXPECT_EQ(f.sinusoids.size(), 1u);
    ASSERT_TRUE(f.correlated);
    EXPECT_NEAR(std::log(f.correlated->correlation_time_s.value / 20.0), 0.0, 0.5);
}

// Too weak to be claimed in four records of five, it pulls N by 5 %, twice N's error, where it is left out of the
// model. In records of other seeds half of the intervals hold N beside it, without it a fifth to a quarter; standard
// error of 150 records 4 %. What it feigns of flicker is claimed less often.
TEST(LongAllanCorrelated, PullsNoOtherTermWhereItCannotBeExcluded) {
    constexpr int records = 150;
    const Truth truth{.n = 0.3, .correlated_rms = 0.1, .correlation_time_s = 30.0};
    const auto held = [&](const NoiseFit& f) {
        const noise::Coefficient& n = f.arw_deg_rt_h;
        return n.resolved && *n.lo <= truth.n / 60.0 && truth.n / 60.0 <= *n.hi ? 1 : 0;
    };
    int beside = 0;
    int without = 0;
    int flicker_beside = 0;
    int flicker_without = 0;
    for (int k = 0; k < records; ++k) {
        const auto angle = test::simulate_angle(truth, 4096, 1.0, 60'000 + k);
        const NoiseFit with_it = noise::fit_noise(angle, 1.0);
        const NoiseFit as_claimed = noise::fit_noise(angle, 1.0, {.nuisance_significance = 1e-3});
        EXPECT_EQ(with_it.correlated.has_value(), as_claimed.correlated.has_value()) << k;
        beside += held(with_it);
        without += held(as_claimed);
        flicker_beside += with_it.bias_instability_deg_h.resolved ? 1 : 0;
        flicker_without += as_claimed.bias_instability_deg_h.resolved ? 1 : 0;
    }
    EXPECT_GE(beside, records * 40 / 100);
    EXPECT_LE(without, records * 34 / 100);
    EXPECT_LE(flicker_beside, flicker_without * 2 / 3);
    RecordProperty("held_beside", beside);
    RecordProperty("held_without", without);
}

// Records without it hardly notice: one in a hundred passes by chance. 300 records allow nine (2 % would be 6 +- 2.4).
TEST(LongAllanCorrelated, IsLeftOutWhereNothingShowsIt) {
    int changed = 0;
    for (int k = 0; k < 300; ++k) {
        const Truth truth = k % 2 == 0 ? Truth{.n = 0.3, .b = 0.1} : Truth{.q = 0.3, .n = 0.3, .k = 0.01};
        const auto angle = test::simulate_angle(truth, 2048, 1.0, 70'000 + k);
        const NoiseFit f = noise::fit_noise(angle, 1.0);
        const NoiseFit as_claimed = noise::fit_noise(angle, 1.0, {.nuisance_significance = 1e-3});
        changed += f.arw_deg_rt_h.value != as_claimed.arw_deg_rt_h.value ? 1 : 0;
    }
    EXPECT_LE(changed, 9);
}

// Where flicker, random walk or a ramp do as well it is not claimed: three kinds of records, one false claim allowed
// of 150, where one in a thousand is expected at most.
TEST(AllanCorrelated, DoesNotTakeTheirPlace) {
    int claims = 0;
    for (std::uint64_t seed = 0; seed < 50; ++seed) {
        for (const Truth& truth : {Truth{.n = 0.3, .b = 0.2}, Truth{.n = 0.3, .k = 0.02},
                                   Truth{.q = 0.3, .n = 0.3, .b = 0.1, .k = 0.01, .r = 1e-4}}) {
            claims += noise::fit_noise(test::simulate_angle(truth, 2048, 1.0, 800 + seed), 1.0).correlated ? 1 : 0;
        }
    }
    EXPECT_LE(claims, 1);
}

}  // namespace
}  // namespace allan_correlated_test
