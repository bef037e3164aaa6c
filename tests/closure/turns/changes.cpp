// Effects by what they change: parameters found by their part in a gyro, and several changes that come at one time.
#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>
#include <string>
#include <vector>

#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/turns/fit/fit.hpp"
#include "analysis/closure/turns/model/effect_roles.hpp"
#include "analysis/closure/turns/screen/score_tests.hpp"
#include "engine/core/units.hpp"
#include "tests/closure/generator/generator.hpp"

namespace ringlock::test::closure {
namespace turns_changes_test {
namespace {

using namespace ringlock::closure;
using effects::Role;

/// Bias, threshold and phase of the coupling that change at one time: an effect that the library need not have.
class Hop final : public effects::Effect {
   public:
    std::string_view name() const override { return "hop"; }
    std::string_view summary() const override { return "Three steps at one time."; }
    std::string_view advice() const override { return ""; }
    std::string_view equation() const override { return "From time_s on."; }
    std::span<const effects::Parameter> parameters() const override {
        static constexpr std::array all = {
            effects::Parameter{"step_deg_h", 0.0, -1e4, 1e4, Role::size, ""},
            effects::Parameter{"threshold_ratio", 0.0, -0.9, 0.9, Role::size, ""},
            effects::Parameter{"phase_rad", 0.0, -units::pi, units::pi, Role::phase, ""},
            effects::Parameter{"time_s", 0.0, 0.0, 1e9, Role::time, ""},
        };
        return all;
    }
    bool active(const effects::Values& values) const override {
        return values.at("step_deg_h") != 0.0 || values.at("threshold_ratio") != 0.0 || values.at("phase_rad") != 0.0;
    }
    effects::Changes changes() const override { return {.angle = true, .threshold = true, .coupling_phase = true}; }
    effects::ChangeOver change(const effects::Values& values) const override {
        return [step_deg_h = values.at("step_deg_h"), ratio = values.at("threshold_ratio"),
                phase_rad = values.at("phase_rad"), time_s = values.at("time_s")](const effects::Interval& at) {
            const bool on = at.start_s + 0.5 * at.duration_s >= time_s;
            return effects::Change{
                .angle_arcsec = step_deg_h * std::clamp(at.start_s + at.duration_s - time_s, 0.0, at.duration_s),
                .threshold_factor = on ? 1.0 + ratio : 1.0,
                .coupling_phase_rad = on ? phase_rad : 0.0};
        };
    }
};
const Hop hop;

/// A gyro that hops in the middle of its record.
Truth hopping(std::size_t turns) {
    Truth truth;
    truth.turns = turns;
    truth.bias_deg_h = 25.0;
    truth.mode_hop = {3.0, 0.2, 0.4, 0.5 * 0.5 * static_cast<double>(turns) / truth.dither_frequency_hz};
    return truth;
}
effects::Values values_of(const ModeHop& truth) {
    return {{"step_deg_h", truth.step_deg_h},
            {"threshold_ratio", truth.threshold_ratio},
            {"phase_rad", truth.phase_rad},
            {"time_s", truth.time_s}};
}

/// A record, read and prepared.
struct Read {
    JoinedPhase joined;
    TurnSeries series;
    explicit Read(const record::Record& record)
        : joined(join(*record.turns, {}, false)), series(prepare(record, joined)) {}
};

TEST(EffectRoles, AreThoseOfTheirSetups) {
    const EffectRoles& roles = effect_roles();
    const auto configured = [](const effects::Effect* effect, effects::Values values) {
        for (const auto& [name, value] : values_at_rest(*effect)) values.emplace(name, value);
        gyro::Setup setup;
        effect->configure(values, setup);
        return setup;
    };
    ASSERT_NE(roles.asymmetry.effect, nullptr);
    EXPECT_EQ(configured(roles.asymmetry.effect, {{roles.asymmetry.ratio, 0.2}}).dither_asymmetry_ratio, 0.2);
    ASSERT_NE(roles.harmonic.effect, nullptr);
    const gyro::Setup harmonic =
        configured(roles.harmonic.effect, {{roles.harmonic.ratio, 0.1}, {roles.harmonic.phase_rad, 0.7}});
    EXPECT_EQ(harmonic.dither_harmonic_ratio, 0.1);
    EXPECT_EQ(harmonic.dither_harmonic_phase_rad, 0.7);
    ASSERT_NE(roles.ellipse.effect, nullptr);
    const auto& e = roles.ellipse;
    const gyro::Setup ellipse =
        configured(e.effect, {{e.gain, 0.1}, {e.offset_sin, 0.2}, {e.offset_cos, 0.3}, {e.orthogonality_rad, 0.4}});
    EXPECT_EQ(ellipse.ellipse, (gyro::Ellipse{0.1, 0.2, 0.3, 0.4}));
    ASSERT_NE(roles.missed_counts.effect, nullptr);
    EXPECT_EQ(configured(roles.missed_counts.effect, {{roles.missed_counts.probability, 0.3}}).missed_count_probability,
              0.3);
    for (const auto* effect :
         {roles.asymmetry.effect, roles.harmonic.effect, roles.ellipse.effect, roles.missed_counts.effect}) {
        EXPECT_TRUE(estimated_from_other_columns(*effect)) << effect->name();
    }
    EXPECT_FALSE(estimated_from_other_columns(hop));
}

TEST(EffectRoles, APhaseOfItsOwnTurnsNoSize) {
    const auto of_hop = amplitudes_of(hop);
    ASSERT_EQ(of_hop.size(), 3U);
    for (const Amplitude& amplitude : of_hop) EXPECT_EQ(amplitude.turned_by, nullptr) << amplitude.value->name;
    EXPECT_EQ(of_hop[2].value->role, Role::phase);
    // Of the library: a phase after a size turns it, unless it does something by itself.
    for (const effects::Effect* effect : effects::registry()) {
        for (const effects::Parameter& parameter : effect->parameters()) {
            if (parameter.role != Role::phase) continue;
            const bool has_size = effects::first_of(*effect, Role::size) != nullptr;
            EXPECT_EQ(is_own_phase(*effect, parameter), !has_size) << effect->name();
        }
    }
    EXPECT_FALSE(changes_angle_only(hop));
}

/// The largest of 60 dependent chi-squared is beyond the bound's level as often as that says, or less often, but not
/// by an order of magnitude: of one degree of freedom and of three.
TEST(Chance, TheBoundOfDaviesHoldsForSeveralDegreesOfFreedom) {
    constexpr int simulations = 4000;
    constexpr double level = 0.05;
    for (const int freedom : {1, 3}) {
        std::mt19937_64 random(7);
        std::normal_distribution<double> normal;
        int beyond = 0;
        for (int k = 0; k < simulations; ++k) {
            // Scores of a step in white noise, standardised: its ends are left out.
            std::vector<std::vector<double>> scores;
            for (int s = 0; s < freedom; ++s) {
                std::vector<double> walk(401, 0.0);
                for (std::size_t i = 1; i < walk.size(); ++i) walk[i] = walk[i - 1] + normal(random);
                std::vector<double> score;
                for (std::size_t i = 50; i <= 350; i += 5) {
                    const double t = static_cast<double>(i) / 400.0;
                    score.push_back((walk[i] - t * walk.back()) / std::sqrt(400.0 * t * (1.0 - t)));
                }
                scores.push_back(score);
            }
            std::vector<double> roots;
            double largest = 0.0;
            for (std::size_t i = 0; i < scores.front().size(); ++i) {
                double chi2 = 0.0;
                for (const auto& score : scores) chi2 += score[i] * score[i];
                roots.push_back(freedom == 1 ? scores[0][i] : std::sqrt(chi2));
                largest = std::max(largest, chi2);
            }
            if (davies_bound(largest, roots, freedom) < level) ++beyond;
        }
        const double share = static_cast<double>(beyond) / simulations;
        std::printf("%d degrees of freedom: %.3f below %.2f\n", freedom, share, level);
        // Four standard errors of a binomial share.
        EXPECT_LT(share, level + 4.0 * std::sqrt(level * (1.0 - level) / simulations)) << freedom;
        EXPECT_GT(share, 0.1 * level) << freedom;
    }
}

TEST(LongTurnModel, FollowsACouplingThatHops) {
    const Truth truth = hopping(1500);
    const record::Record record = generate({&truth, 1}).front();
    const Read read(record);
    const TurnModel model(read.series, read.joined.phase_rad);
    const auto left = [&](bool with) {
        TurnParameters p;
        p.threshold_deg_h = truth.lockin_threshold_deg_h;
        p.bias_deg_h = truth.bias_deg_h;
        p.effects.push_back({&hop, values_of(with ? truth.mode_hop : ModeHop{})});
        p.effects.back().values.at("time_s") -= read.series.start_s;
        const auto prediction = model.predict(p);
        // But for offset, amplitude and, where the hop is not in it, rates before and after.
        Eigen::MatrixXd x(read.series.size(), 4);
        Eigen::VectorXd y(read.series.size());
        for (std::size_t i = 0; i < read.series.size(); ++i) {
            const double t = read.series.time_s[i];
            x.row(static_cast<Eigen::Index>(i)) << 1.0, prediction.frame.sign[i], t,
                with ? 0.0 : std::max(0.0, t - truth.mode_hop.time_s);
            y(static_cast<Eigen::Index>(i)) = read.joined.phase_rad[i] - prediction.phase_rad[i];
        }
        const Eigen::VectorXd c = x.completeOrthogonalDecomposition().solve(y);
        return (y - x * c).cwiseAbs().maxCoeff();
    };
    const double with_it = left(true);
    const double without = left(false);
    std::printf("largest difference %.2g rad, without the hop of the coupling %.2g rad\n", with_it, without);
    // What is left of the times of turns, as of a gyro that does not hop (test TurnModel.FollowsAnotherSimulatorsGyro);
    // a hop moves the turn next to it by a part of a kick's own change.
    EXPECT_LT(with_it, 5e-4);
    EXPECT_GT(without, 20.0 * with_it);
}

class LongHop : public testing::Test {
   protected:
    static Truth truth() {
        Truth truth = hopping(4000);
        truth.injected_noise_rad = 0.05;
        truth.readout_noise = 1e-3;
        // No more than the coupling's changes show: a large step would hide them in the noise of a fit without it.
        truth.mode_hop.step_deg_h = 0.05;
        return truth;
    }
    const Truth truth_ = truth();
    const record::Record record_ = generate({&truth_, 1}).front();
    const Read read_{record_};
    const TurnModel model_{read_.series, read_.joined.phase_rad};
    const Rows rows_ = Rows(read_.series.size(), 1);

    TurnParameters start() const {
        TurnParameters p;
        p.readout_sd_rad = read_.joined.readout_sd_rad;
        p.threshold_deg_h = read_.series.setup.lockin_threshold_deg_h;
        // As the swings of the dither say.
        p.injected_sd_rad = truth_.injected_noise_rad;
        p.wander_sd_rad = 1e-3 * truth_.injected_noise_rad;
        return p;
    }
};

TEST_F(LongHop, IsFoundAndFittedInAllThatItChanges) {
    const TurnFit base(model_, start(), rows_);
    const TurnModel::Prediction without = model_.predict(base.parameters());
    const auto candidate = score_test(base, without, hop);
    ASSERT_TRUE(candidate.has_value());
    EXPECT_LT(candidate->p_value, 1e-6);
    // A step of the bias alone, which the library has, explains less than that by more than two degrees of freedom do
    // by chance.
    for (const effects::Effect* effect : effects::registry()) {
        if (effects::first_of(*effect, Role::time) == nullptr || !changes_angle_only(*effect)) continue;
        const auto alone = score_test(base, without, *effect);
        ASSERT_TRUE(alone.has_value()) << effect->name();
        EXPECT_LT(chi2_tail(candidate->chi2 - alone->chi2, 2), 1e-6) << effect->name();
    }

    TurnParameters p = base.parameters();
    p.effects.push_back({candidate->effect, candidate->values});
    const TurnFit fit(model_, p, rows_);
    effects::Values truth = values_of(truth_.mode_hop);
    truth["bias_deg_h"] = truth_.bias_deg_h;
    truth["lockin_threshold_deg_h"] = truth_.lockin_threshold_deg_h;
    std::size_t found = 0;
    for (const Estimate& estimate : fit.estimates()) {
        const auto expected = truth.find(estimate.name);
        if (expected == truth.end()) continue;
        ++found;
        std::printf("%s: %.6g +- %.2g, true %.6g\n", estimate.name.c_str(), estimate.value, estimate.sd,
                    expected->second);
        EXPECT_GT(estimate.sd, 0.0) << estimate.name;
        // Four standard errors; the time also to a turn, as the coupling is the same over each half cycle.
        const double least = estimate.name == "time_s" ? read_.series.interval_s : 0.0;
        EXPECT_LT(std::abs(estimate.value - expected->second), 4.0 * estimate.sd + least) << estimate.name;
    }
    EXPECT_EQ(found, truth.size());
}

}  // namespace
}  // namespace turns_changes_test
}  // namespace ringlock::test::closure
