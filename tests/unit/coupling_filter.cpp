// The filter of the coupling on bends that are drawn, not simulated: as good as its covariances say, and its test for a
// phase that has stepped as rare as derived.
#include "engine/compensate/coupling_filter.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <functional>
#include <random>

namespace ringlock::test {
namespace coupling_filter_test {
namespace {

using compensate::CouplingFilter;

constexpr double turns = 128.0;
constexpr double turn_s = 0.004;
constexpr double memory = CouplingFilter::short_memory_turns / turns;
constexpr CouplingFilter::Coupling told{700.0, 0.0};

/// Bends of 128 turns, each of which shows the coupling with an error of `shown`.
class Gyro {
   public:
    Gyro(unsigned seed, double shown, double sigmas = CouplingFilter::six_sigmas)
        : filter(told, sigmas), engine_(seed), shown_(shown) {}

    void run(int pieces, const std::function<void(double s, CouplingFilter::Coupling& truth)>& change = {}) {
        for (int i = 0; i < pieces; ++i) {
            time_s_ += turns * turn_s;
            if (change) change(time_s_, truth);
            const double weight = turns / (shown_ * shown_);
            const double xy = 0.06 * weight * normal_(engine_);
            const double ratio = truth.b_rad_s / tables_.b_rad_s;
            const double x = ratio * std::cos(truth.phase_rad - tables_.phase_rad) - 1.0;
            const double y = ratio * std::sin(truth.phase_rad - tables_.phase_rad);
            const double first = normal_(engine_);
            const double second = normal_(engine_);
            const double rest = std::sqrt(weight - xy * xy / weight);
            const CouplingFilter::Bends bends{weight, xy, weight, weight * x + xy * y + std::sqrt(weight) * first,
                                              xy * x + weight * y + xy / std::sqrt(weight) * first + rest * second};
            filter.observe(bends, tables_, turns, turns * turn_s);
            if (std::abs(filter.coupling().b_rad_s / tables_.b_rad_s - 1.0) > 0.01 ||
                std::abs(filter.coupling().phase_rad - tables_.phase_rad) > 0.01) {
                tables_ = filter.coupling();
            }
        }
    }
    double phase_off() const { return filter.coupling().phase_rad - truth.phase_rad; }
    double size_off() const { return filter.coupling().b_rad_s / truth.b_rad_s - 1.0; }

    CouplingFilter filter;
    CouplingFilter::Coupling truth = told;

   private:
    std::mt19937_64 engine_;
    std::normal_distribution<double> normal_;
    double shown_;
    CouplingFilter::Coupling tables_ = told;
    double time_s_ = 0.0;
};

TEST(CouplingFilter, KnowsThePhaseToTheRootOfTheTurns) {
    // 400 gyros tell an rms to 3.5 %; four of these, and what the phase is allowed to walk in 270 s: 7e-6 rad.
    constexpr int pieces = 512;
    double square = 0.0;
    for (unsigned g = 0; g < 400; ++g) {
        Gyro gyro(g, 0.1);
        gyro.run(pieces);
        square += std::pow(gyro.phase_off(), 2) / 400.0;
    }
    const double expected = 0.1 / std::sqrt(turns * pieces);
    std::printf("phase off by %.3g rad rms, expected %.3g\n", std::sqrt(square), expected);
    EXPECT_NEAR(std::sqrt(square), expected, 0.14 * expected);
}

TEST(CouplingFilter, FollowsADriftAndIsAsGoodAsDerived) {
    // A steady drift has no lag. In the long run w = (q/r)^(1/4), q and r of the slope's walk and of what a second
    // shows, and the variance of the size is sqrt(2) w r; 200 gyros tell its root to 5 %.
    const double r = 0.01 * turn_s;
    const double q = std::pow(CouplingFilter::slope_walk_s_rt_s, 2);
    const double expected = std::sqrt(std::sqrt(2.0) * std::pow(q / r, 0.25) * r);
    double square = 0.0;
    double mean = 0.0;
    for (unsigned g = 0; g < 200; ++g) {
        Gyro gyro(1000 + g, 0.1);
        gyro.run(6000, [](double s, auto& truth) { truth.b_rad_s = told.b_rad_s * std::exp(0.1 * s / 3600.0); });
        square += std::pow(gyro.size_off(), 2) / 200.0;
        mean += gyro.size_off() / 200.0;
        EXPECT_EQ(gyro.filter.restarts(), 0);
    }
    std::printf("size off by %.3g rms, mean %.2g, expected %.3g\n", std::sqrt(square), mean, expected);
    EXPECT_NEAR(std::sqrt(square), expected, 0.2 * expected);
    EXPECT_NEAR(mean, 0.0, 4.0 * expected / std::sqrt(200.0));
}

TEST(CouplingFilter, TakesABadBeginningForWhatItIs) {
    for (const double phase_rad : {0.5, -2.5, 3.1}) {
        Gyro gyro(7, 0.1);
        gyro.truth = {1.4 * told.b_rad_s, phase_rad};
        gyro.run(128);
        EXPECT_NEAR(gyro.phase_off(), 0.0, 5.0 * 0.1 / std::sqrt(turns * 128));
        EXPECT_NEAR(gyro.size_off(), 0.0, 5.0 * 0.2 / std::sqrt(turns * 128));
        EXPECT_EQ(gyro.filter.restarts(), 0);
    }
}

TEST(CouplingFilter, BeginsThePhaseAnewWhereItSteps) {
    // A step is seen when the short memory has moved by six times 0.1/sqrt(2 * 65536): a hundredth after a fifth of it.
    for (const double step_rad : {0.01, -0.1, 1.5}) {
        for (unsigned g = 0; g < 20; ++g) {
            Gyro gyro(2000 + g, 0.1);
            gyro.run(static_cast<int>(8 * memory));
            ASSERT_EQ(gyro.filter.restarts(), 0);
            gyro.truth.phase_rad += step_rad;
            const int before = static_cast<int>(0.3 * memory);
            gyro.run(before);
            EXPECT_EQ(gyro.filter.restarts(), 1) << step_rad;
            gyro.run(static_cast<int>(memory) - before);
            EXPECT_EQ(gyro.filter.restarts(), 1) << step_rad;
            // Three quarters of a memory since: five sigmas.
            EXPECT_NEAR(gyro.phase_off(), 0.0, 5.0 * 0.1 / std::sqrt(0.7 * memory * turns)) << step_rad;
        }
    }
}

TEST(CouplingFilter, BeginsAnewWithoutCauseAsRarelyAsDerived) {
    // (2/memory) z/sqrt(2 pi) exp(-z^2/2) a turn, at z + 0.583 sqrt(2 * 128/65536) for a look at every 128th turn only
    // (Siegmund 1985); the two memories must part for 1.1 of the short one first. At three sigmas often enough to
    // count.
    const double z = 3.0 + 0.583 * std::sqrt(2.0 / memory);
    const double per_memory = 2.0 * z / std::sqrt(2.0 * M_PI) * std::exp(-0.5 * z * z);
    constexpr int gyros = 40;
    constexpr double memories = 150.0;
    int at_three = 0;
    int at_six = 0;
    for (unsigned g = 0; g < gyros; ++g) {
        Gyro often(3000 + g, 0.1, 3.0);
        often.run(static_cast<int>(memories * memory));
        at_three += often.filter.restarts();
        Gyro never(3000 + g, 0.1);
        never.run(static_cast<int>(memories * memory));
        at_six += never.filter.restarts();
    }
    const double expected = gyros * memories / (1.0 / per_memory + 1.1);
    std::printf("%d times at three sigmas, expected %.0f; %d at six\n", at_three, expected, at_six);
    // Four times the root of the number, and a tenth: the memories part slowly.
    EXPECT_NEAR(at_three, expected, 4.0 * std::sqrt(expected) + 0.1 * expected);
    EXPECT_EQ(at_six, 0);
}

TEST(CouplingFilter, NoiseThatIsToldWrongByAFactorOfTwoDoesNotMatter) {
    // Bends as of 0.1, noise as of 0.2: weights four times too large.
    int restarts = 0;
    for (unsigned g = 0; g < 20; ++g) {
        CouplingFilter filter(told);
        std::mt19937_64 engine(4000 + g);
        std::normal_distribution<double> normal;
        const double weight = turns / 0.01;
        for (int i = 0; i < static_cast<int>(60 * memory); ++i) {
            const double root = 2.0 * std::sqrt(weight);
            filter.observe({weight, 0.0, weight, root * normal(engine), root * normal(engine)}, told, turns,
                           turns * turn_s);
        }
        restarts += filter.restarts();
    }
    EXPECT_EQ(restarts, 0);
}

}  // namespace
}  // namespace coupling_filter_test
}  // namespace ringlock::test
