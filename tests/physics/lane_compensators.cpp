// The compensators of blocks: against their formula, against the true error, and in other pieces, lanes and
// instruction sets.
#include <algorithm>
#include <bit>
#include <cstdio>
#include <memory>
#include <vector>

#include "engine/compensate/exact.hpp"
#include "engine/compensate/first_order.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/simd/target.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace lane_compensators_test {
namespace {

using simd::lanes;
using Make = std::function<std::unique_ptr<compensate::LaneCompensator>(const compensate::Calibration&)>;

compensate::Calibration calibration_of(const std::vector<gyro::Setup>& setups) {
    compensate::Calibration calibration;
    calibration.lanes = setups.size();
    for (std::size_t g = 0; g < setups.size(); ++g) {
        const gyro::Device device(setups[g]);
        calibration.b_rad_s[g] = device.coupling.b_rad_s;
        calibration.dither_amplitude_rad[g] = device.dither_amplitude_rad;
        calibration.positive_duration_s[g] = device.positive_duration_s;
        calibration.negative_duration_s[g] = device.negative_duration_s;
    }
    return calibration;
}

Make exact() {
    return [](const compensate::Calibration& calibration) {
        return std::make_unique<compensate::Exact>(calibration, 1e-10);
    };
}

Make first_order(double factor) {
    return [factor](const compensate::Calibration& calibration) {
        return std::make_unique<compensate::FirstOrder>(calibration, factor);
    };
}

struct Gyros {
    double rate_deg_h = 15.0;
    double threshold_deg_h = 300.0;
    double asymmetry = 0.0;
    double coupling_phase_rad = 0.0;

    std::vector<gyro::Setup> setups(std::size_t count) const {
        std::vector<gyro::Setup> all;
        for (std::size_t g = 0; g < count; ++g) {
            gyro::Setup setup = paper_device();
            setup.input_rate_deg_h = rate_deg_h;
            setup.lockin_threshold_deg_h = threshold_deg_h;
            setup.dither_asymmetry_ratio = asymmetry;
            setup.coupling_phase_rad = coupling_phase_rad;
            setup.initial_phase_rad = 0.4 * static_cast<double>(g);
            setup.dither_peak_rate_deg_s *= 1.0 + 1e-4 * static_cast<double>(g);  // 0.6 rad: unlike bands
            all.push_back(setup);
        }
        return all;
    }
};

scenario::Scenario ideal_readout() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::ideal;
    scenario.ensemble.seed = 601;
    return scenario;
}

/// Readings of a run, as one piece, and what is true: [turn][gyro].
struct Seen {
    readout::LaneReadings readings;
    std::vector<simd::Lanes> error_rad;
    std::vector<gyro::Setup> setups;
};

Seen look(const scenario::Scenario& scenario, bool injected, const std::vector<gyro::Setup>& setups,
          std::size_t turns) {
    const std::vector<scenario::Arm> arms{scenario::parse_arm(injected ? "noise_injected+compensated" : "compensated")};
    ensemble::GyroBlock block(scenario, arms, 0, setups);
    Seen seen;
    seen.setups = setups;
    seen.readings.resize(turns);
    for (std::size_t done = 0; done < turns;) {
        const std::size_t count = std::min<std::size_t>(128, turns - done);
        block.advance(count);
        const auto& r = block.readings(0);
        for (std::size_t i = 0; i < count; ++i) {
            auto& to = seen.readings;
            to.sine[done + i] = r.sine[i];
            to.cosine[done + i] = r.cosine[i];
            to.phase_fringes[done + i] = r.phase_fringes[i];
            to.phase_whole[done + i] = r.phase_whole[i];
            to.accel_before_rad_s2[done + i] = r.accel_before_rad_s2[i];
            to.accel_after_rad_s2[done + i] = r.accel_after_rad_s2[i];
            seen.error_rad.emplace_back();
            for (std::size_t g = 0; g < setups.size(); ++g) {
                seen.error_rad.back()[g] = block.lockin_error_rad(0, i, g);
            }
        }
        done += count;
    }
    return seen;
}

/// Rows [first, first + count) of readings.
readout::LaneReadings rows(const readout::LaneReadings& all, std::size_t first, std::size_t count) {
    readout::LaneReadings some = all;
    const auto cut = [&](std::vector<simd::Lanes>& column) {
        column = std::vector<simd::Lanes>(column.begin() + static_cast<std::ptrdiff_t>(first),
                                          column.begin() + static_cast<std::ptrdiff_t>(first + count));
    };
    for (auto* column : {&some.sine, &some.cosine, &some.phase_fringes, &some.phase_whole, &some.accel_before_rad_s2,
                         &some.accel_after_rad_s2}) {
        cut(*column);
    }
    some.turns = count;
    some.first_turn = all.first_turn + static_cast<std::int64_t>(first);
    return some;
}

struct Found {
    std::vector<simd::Lanes> fringes, whole;
    double rad(std::size_t turn, std::size_t lane) const {
        return units::two_pi * (whole[turn][lane] + fringes[turn][lane]);
    }
};

Found find(compensate::LaneCompensator& compensator, const Seen& seen, const std::vector<std::size_t>& pieces) {
    Found found;
    compensate::LaneErrors errors;
    std::size_t done = 0;
    for (std::size_t piece = 0; done < seen.readings.turns; ++piece) {
        // The last size again and again.
        const std::size_t count = std::min(pieces[std::min(piece, pieces.size() - 1)], seen.readings.turns - done);
        compensator.observe(rows(seen.readings, done, count), errors);
        for (std::size_t i = 0; i < count; ++i) {
            found.fringes.push_back(errors.fringes[i]);
            found.whole.push_back(errors.whole);
        }
        done += count;
    }
    return found;
}

/// What a compensator leaves of the error gained from one turn to the next (or the one after, stride 2: cycles), after
/// `skip` turns: rms [rad], and of the raw error.
struct Left {
    double raw_rad = 0.0;
    double left_rad = 0.0;
    double drift_rad = 0.0;  ///< largest mean of what is left per half cycle: adds up
    double gain() const { return raw_rad / left_rad; }
};

Left left_of(const Seen& seen, const Found& found, std::size_t skip, std::size_t stride) {
    Left result;
    double n = 0.0;
    for (std::size_t g = 0; g < seen.setups.size(); ++g) {
        for (std::size_t i = skip + stride; i < seen.error_rad.size(); i += stride) {
            const double raw = seen.error_rad[i][g] - seen.error_rad[i - stride][g];
            const double left = raw - (found.rad(i, g) - found.rad(i - stride, g));
            result.raw_rad += raw * raw;
            result.left_rad += left * left;
            n += 1.0;
        }
        const std::size_t last = seen.error_rad.size() - 1;
        const double kept =
            (seen.error_rad[last][g] - found.rad(last, g)) - (seen.error_rad[skip][g] - found.rad(skip, g));
        result.drift_rad = std::max(result.drift_rad, std::abs(kept) / static_cast<double>(last - skip));
    }
    result.raw_rad = std::sqrt(result.raw_rad / n);
    result.left_rad = std::sqrt(result.left_rad / n);
    return result;
}

Left run(const scenario::Scenario& scenario, bool injected, const std::vector<gyro::Setup>& setups, std::size_t turns,
         const Make& make, const std::vector<std::size_t>& pieces = {128}, std::size_t skip = 0,
         std::size_t stride = 1) {
    const Seen seen = look(scenario, injected, setups, turns);
    const auto compensator = make(calibration_of(setups));
    return left_of(seen, find(*compensator, seen, pieces), skip, stride);
}

// ---- First order.

TEST(FirstOrderCompensator, IsItsFormula) {
    auto scenario = ideal_readout();
    scenario.readout.model = scenario::ReadoutModel::latched;
    scenario.readout.clock_hz = 1e6;  // coarse: intervals of a few ticks
    scenario.readout.detector_noise_relative = 0.02;
    Gyros gyros{40.0, 300.0, 0.01, 0.0};
    Seen seen = look(scenario, true, gyros.setups(5), 3000);
    for (std::size_t i = 100; i < 3000; i += 97) seen.readings.accel_after_rad_s2[i][2] = 0.0;  // not told apart
    for (const double factor : {compensate::FirstOrder::corrected, compensate::FirstOrder::published}) {
        const auto compensator = first_order(factor)(calibration_of(seen.setups));
        const Found found = find(*compensator, seen, {7, 128, 1, 300});
        double worst = 0.0;
        for (std::size_t g = 0; g < seen.setups.size(); ++g) {
            const double b = gyro::Device(seen.setups[g]).coupling.b_rad_s;
            long double error = 0.0L;
            double mean[2][2] = {};
            double count[2][2] = {};
            double after = 0.0;
            for (std::size_t i = 0; i < seen.readings.turns; ++i) {
                const std::size_t maximum = i % 2;
                const double psi = std::atan2(seen.readings.sine[i][g], seen.readings.cosine[i][g]);
                const double accel[2] = {seen.readings.accel_before_rad_s2[i][g],
                                         seen.readings.accel_after_rad_s2[i][g]};
                double kick[2] = {};
                for (const std::size_t side : {0U, 1U}) {
                    if (accel[side] > 0.0) {
                        count[maximum][side] = std::min(count[maximum][side] + 1.0, 512.0);
                        mean[maximum][side] += (accel[side] - mean[maximum][side]) / count[maximum][side];
                    }
                    const double a = mean[maximum][side];
                    if (!(a > 0.0)) continue;
                    kick[side] = factor * b * std::sqrt(units::pi / a) *
                                 (maximum == 0 ? std::sin(psi) + std::cos(psi) : std::sin(psi) - std::cos(psi));
                }
                error += after + kick[0];
                after = kick[1];
                worst = std::max(worst, std::abs(static_cast<double>(error) - found.rad(i, g)));
            }
        }
        std::printf("worst of 3000 turns: %.2g rad\n", worst);
        // Rounding of 3000 sums of some fringes.
        EXPECT_LT(worst, 1e-11);
    }
}

// ---- Exact.

TEST(ExactCompensator, LeavesNextToNothingOfAHalfCycle) {
    // Levels of exact.hpp, with a margin of two. Errors between a dither's turn and the phase's are taken back in the
    // next half cycle. What adds up has no sign of its own under injected noise.
    for (const bool injected : {false, true}) {
        for (const double threshold_deg_h : {30.0, 300.0, 1500.0}) {
            for (const double rate_deg_h : {0.0, 15.0, 500.0, 5000.0}) {
                const Gyros gyros{rate_deg_h, threshold_deg_h, 0.003, 0.0};
                const Left left = run(ideal_readout(), injected, gyros.setups(8), 2000, exact());
                std::printf("%s, %4.0f deg/h, threshold %4.0f: raw %.3g, left %.3g rad, gain %.3g, adding up %.2g\n",
                            injected ? "injected" : "plain   ", rate_deg_h, threshold_deg_h, left.raw_rad,
                            left.left_rad, left.gain(), left.drift_rad);
                EXPECT_GT(left.gain(), !injected ? 1.7e4 : rate_deg_h < 5000.0 ? 1.5e4 : 2e3);
                EXPECT_LT(left.drift_rad, injected ? 0.05 * left.left_rad + 1e-9 : 5e-5 * left.raw_rad);
            }
        }
    }
}

std::size_t differing(const std::vector<simd::Lanes>& a, std::size_t lane_a, const std::vector<simd::Lanes>& b,
                      std::size_t lane_b) {
    std::size_t count = a.size() == b.size() ? 0 : 1;
    for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
        count += std::bit_cast<std::uint64_t>(a[i][lane_a]) == std::bit_cast<std::uint64_t>(b[i][lane_b]) ? 0 : 1;
    }
    return count;
}

TEST(Compensators, PiecesAfterTheFirstDoNotMatter) {
    const Gyros gyros{30.0, 300.0, 0.003, 0.0};
    const Seen seen = look(ideal_readout(), true, gyros.setups(3), 700);
    for (const Make& make : {exact(), first_order(0.5)}) {
        const auto whole = make(calibration_of(seen.setups));
        const Found reference = find(*whole, seen, {128, 572});
        for (const auto& pieces : std::vector<std::vector<std::size_t>>{{128}, {128, 1}, {128, 7}, {128, 64, 300}}) {
            const auto compensator = make(calibration_of(seen.setups));
            const Found found = find(*compensator, seen, pieces);
            for (std::size_t i = 0; i < 700; ++i) {
                for (std::size_t g = 0; g < 3; ++g) {
                    // The same but for where whole fringes are put apart: one rounding, or with first order one a
                    // piece.
                    ASSERT_NEAR(found.rad(i, g), reference.rad(i, g), 1e-12) << i;
                }
            }
        }
    }
}

TEST(Compensators, LaneMatesAndInstructionSetsDoNotMatter) {
    const Gyros gyros{30.0, 300.0, 0.003, 0.0};
    const Seen seen = look(ideal_readout(), true, gyros.setups(lanes), 600);
    for (const Make& make : {exact(), first_order(0.5)}) {
        const auto together = make(calibration_of(seen.setups));
        const Found reference = find(*together, seen, {128});
        for (const std::string& target : simd::available_targets()) {
            simd::use_target(target);
            const Found same = find(*make(calibration_of(seen.setups)), seen, {128});
            for (std::size_t g = 0; g < lanes; ++g) EXPECT_EQ(differing(same.fringes, g, reference.fringes, g), 0U);
            for (const std::size_t g : {0U, 5U, 15U}) {
                Seen alone = seen;
                alone.setups = {seen.setups[g]};
                auto& r = alone.readings;
                for (auto* column : {&r.sine, &r.cosine, &r.phase_fringes, &r.phase_whole, &r.accel_before_rad_s2,
                                     &r.accel_after_rad_s2}) {
                    for (simd::Lanes& row : *column) row[0] = row[g];
                }
                const Found found = find(*make(calibration_of(alone.setups)), alone, {128});
                EXPECT_EQ(differing(found.fringes, 0, reference.fringes, g), 0U) << target << " " << g;
                EXPECT_EQ(differing(found.whole, 0, reference.whole, g), 0U) << target << " " << g;
            }
        }
        simd::use_best_target();
    }
}

TEST(ExactCompensator, AThresholdThatIsWrongLeavesItsError) {
    const Gyros gyros;
    for (const double wrong : {0.9, 1.05}) {
        const Left left = run(
            ideal_readout(), true, gyros.setups(8), 4000,
            [wrong](compensate::Calibration c) {
                for (double& b : c.b_rad_s) b *= wrong;
                return exact()(c);
            },
            {128}, 0, 2);
        // Over whole cycles: half cycles have a constant that goes with b squared. The kick is b to first order; its
        // third, kappa^2/16, is 1e-3 of that, and 16 000 cycles are worth 0.8 % of the ratio at most.
        EXPECT_NEAR(left.left_rad / left.raw_rad, std::abs(wrong - 1.0), 0.02 * std::abs(wrong - 1.0));
    }
}

TEST(ExactCompensator, ACouplingPhaseThatIsNotToldLeavesTwiceTheSineOfItsHalf) {
    const double phase = 10.0 * units::pi / 180.0;
    Gyros gyros;
    gyros.coupling_phase_rad = phase;
    const Left left = run(ideal_readout(), true, gyros.setups(8), 4000, exact(), {128}, 0, 2);
    const double expected = 2.0 * std::sin(0.5 * phase);
    // 16 000 cycles: 4 standard errors of an rms, of both numerator and denominator.
    EXPECT_NEAR(left.left_rad / left.raw_rad, expected, 4.0 * expected / std::sqrt(16000.0));
}

TEST(ExactCompensator, DetectorNoiseLeavesItsShare) {
    // The derivative of a kick has the kick's rms: noise of s rad leaves s of it, as with first order. Correlation of
    // the two ends of neighbouring half cycles is in raw and left alike.
    auto scenario = ideal_readout();
    scenario.readout.model = scenario::ReadoutModel::latched;
    for (const double noise : {0.005, 0.02}) {
        scenario.readout.detector_noise_relative = noise;
        const Gyros gyros;
        const Left left = run(scenario, true, gyros.setups(8), 4000, exact());
        std::printf("noise %g leaves %.4g\n", noise, left.left_rad / left.raw_rad);
        EXPECT_NEAR(left.left_rad / left.raw_rad, noise, 0.1 * noise);
    }
}

TEST(LongExactCompensator, FollowsARateThatVaries) {
    auto ramp = ideal_readout();
    ramp.effects["bias_ramp"]["deg_h_per_h"] = 1000.0;
    auto vibration = ideal_readout();
    vibration.effects["base_vibration"]["rate_deg_h"] = 100.0;
    vibration.effects["base_vibration"]["frequency_hz"] = 10.0;
    for (const bool injected : {false, true}) {
        const Gyros gyros;
        const Left ramped = run(ramp, injected, gyros.setups(4), 10000, exact());
        const Left shaken = run(vibration, injected, gyros.setups(4), 4000, exact());
        std::printf("ramp: gain %.3g, adding up %.2g rad; vibration: gain %.3g, adding up %.2g rad\n", ramped.gain(),
                    ramped.drift_rad, shaken.gain(), shaken.drift_rad);
        EXPECT_GT(ramped.gain(), 4e4);
        // 100 deg/h that the mean rate knows nothing of, 1260 rad/s, shift the zero-rate point by 3e-7 s, in which the
        // lock-in adds 1e-3 rad, 1/60 of its error: next to all of that is taken back.
        EXPECT_GT(shaken.gain(), 300.0);
    }
}

TEST(ExactCompensator, AVeryShortFirstPieceCostsItsFirstTurnsOnly) {
    for (const std::size_t first : {1U, 2U, 3U}) {
        for (const double rate_deg_h : {15.0, 5000.0}) {
            const Gyros gyros{rate_deg_h, 300.0, 0.0, 0.0};
            const Left all = run(ideal_readout(), true, gyros.setups(4), 3000, exact(), {first, 128});
            const Left later = run(ideal_readout(), true, gyros.setups(4), 3000, exact(), {first, 128}, 64);
            std::printf("first piece of %zu turns at %.0f deg/h: gain %.3g, after 64 turns %.3g\n", first, rate_deg_h,
                        all.gain(), later.gain());
            EXPECT_GT(all.gain(), 30.0);
            EXPECT_GT(later.gain(), 1e3);
        }
    }
}

}  // namespace
}  // namespace lane_compensators_test
}  // namespace ringlock::test
