// Compensators that are told no threshold: what they find, what they leave, and in other pieces, lanes and instruction
// sets.
#include <algorithm>
#include <bit>
#include <cmath>
#include <cstdio>
#include <functional>
#include <memory>
#include <vector>

#include "engine/compensate/extrapolated.hpp"
#include "engine/compensate/two_train.hpp"
#include "engine/core/error.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/simd/target.hpp"
#include "tests/physics/extrapolation.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace compensators_learned_test {
namespace {

using simd::lanes;

/// Nothing of the coupling: it is to be learnt.
compensate::Calibration untold(const std::vector<gyro::Setup>& setups) {
    compensate::Calibration calibration;
    calibration.lanes = setups.size();
    for (std::size_t g = 0; g < setups.size(); ++g) {
        const gyro::Device device(setups[g]);
        calibration.dither_amplitude_rad[g] = device.dither_amplitude_rad;
        calibration.positive_duration_s[g] = device.positive_duration_s;
        calibration.negative_duration_s[g] = device.negative_duration_s;
    }
    return calibration;
}

std::vector<gyro::Setup> unlike(std::size_t count, double threshold_deg_h = 300.0, double coupling_step_rad = 0.35) {
    std::vector<gyro::Setup> all;
    for (std::size_t g = 0; g < count; ++g) {
        gyro::Setup setup = paper_device();
        setup.lockin_threshold_deg_h = threshold_deg_h;
        setup.dither_asymmetry_ratio = 0.003;
        setup.coupling_phase_rad = coupling_step_rad * static_cast<double>(g);
        setup.initial_phase_rad = 0.4 * static_cast<double>(g);
        setup.dither_peak_rate_deg_s *= 1.0 + 1e-4 * static_cast<double>(g);
        all.push_back(setup);
    }
    return all;
}

scenario::Scenario quiet(scenario::ReadoutModel model) {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = model;
    scenario.noise_injection.turn_phase_rms_rad = 3.0;
    scenario.ensemble.seed = 602;
    return scenario;
}

scenario::Scenario noiseless_instrument() {
    scenario::Scenario scenario = quiet(scenario::ReadoutModel::instrument);
    scenario.readout.clock_hz = 0.0;
    scenario.readout.detector_noise_relative = 0.0;
    scenario.readout.comparator_noise_relative = 0.0;
    scenario.readout.comparator_hysteresis_relative = 0.0;
    scenario.readout.detector_bandwidth_hz = 0.0;
    scenario.readout.adc_bits = 0;
    return scenario;
}

readout::Electronics electronics_of(const scenario::Scenario& scenario) {
    const auto& r = scenario.readout;
    readout::Electronics electronics{false, true, r.clock_hz, r.detector_noise_relative};
    electronics.comparator_noise_relative = r.comparator_noise_relative;
    electronics.comparator_hysteresis_relative = r.comparator_hysteresis_relative;
    return electronics;
}

using Watch =
    std::function<void(const readout::LaneReadings& readings, const std::function<double(std::size_t, std::size_t)>&)>;

/// Runs gyros and shows the readings piece by piece, with the true lock-in error [rad] by turn and gyro.
void run(const scenario::Scenario& scenario, bool injected, const std::vector<gyro::Setup>& setups, std::size_t turns,
         const Watch& watch) {
    const std::vector<scenario::Arm> arms{scenario::parse_arm(injected ? "noise_injected+compensated" : "compensated")};
    ensemble::GyroBlock block(scenario, arms, 0, setups);
    for (std::size_t done = 0; done < turns;) {
        const std::size_t count = std::min<std::size_t>(128, turns - done);
        block.advance(count);
        watch(block.readings(0),
              [&](std::size_t turn, std::size_t gyro) { return block.lockin_error_rad(0, turn, gyro); });
        done += count;
    }
}

double told_rad(const compensate::LaneErrors& errors, std::size_t turn, std::size_t lane) {
    return units::two_pi * (errors.whole[lane] + errors.fringes[turn][lane]);
}

/// Sums over what one cycle adds, from minimum to minimum.
struct Cycles {
    double raw2 = 0.0, left2 = 0.0, product = 0.0, found2 = 0.0;
    double count = 0.0;
    std::vector<double> last_true = std::vector<double>(lanes, 0.0);
    std::vector<double> last_found = std::vector<double>(lanes, 0.0);
    bool begun = false;

    void see(const readout::LaneReadings& readings, const std::function<double(std::size_t, std::size_t)>& truth_rad,
             const compensate::LaneErrors& errors, std::size_t gyros) {
        for (std::size_t i = 0; i < readings.turns; ++i) {
            if (!readings.minimum(i)) continue;
            for (std::size_t g = 0; g < gyros; ++g) {
                const double truth = truth_rad(i, g);
                const double found = told_rad(errors, i, g);
                if (begun) {
                    const double raw = truth - last_true[g];
                    const double got = found - last_found[g];
                    raw2 += raw * raw;
                    left2 += (raw - got) * (raw - got);
                    product += raw * got;
                    found2 += got * got;
                    count += 1.0;
                }
                last_true[g] = truth;
                last_found[g] = found;
            }
            begun = true;
        }
    }
    double left() const { return std::sqrt(left2 / raw2); }
    double gain() const { return product / raw2; }
    double correlation() const { return product / std::sqrt(raw2 * found2); }
};

// ---- Extrapolated.

Cycles extrapolated(const scenario::Scenario& scenario, bool injected, const std::vector<gyro::Setup>& setups,
                    std::size_t turns) {
    compensate::Extrapolated compensator(untold(setups), electronics_of(scenario));
    compensate::LaneErrors errors;
    Cycles cycles;
    run(scenario, injected, setups, turns, [&](const auto& readings, const auto& truth_rad) {
        compensator.observe(readings, errors);
        cycles.see(readings, truth_rad, errors, setups.size());
    });
    return cycles;
}

TEST(ExtrapolatedCompensator, LeavesWhatIsNotOverAtTheFourthPulse) {
    // 64 000 cycles: 1 %; second order, kappa^2, 2 %.
    const double expected = first_order_left(4);
    std::printf("first order, pulses of a side:");
    for (const int pulses : {3, 4, 6, 8, 16, 64, 256}) std::printf(" %d: %.3g", pulses, first_order_left(pulses));
    std::printf("\n");
    for (const double threshold_deg_h : {150.0, 300.0}) {
        const Cycles noiseless = extrapolated(noiseless_instrument(), true, unlike(lanes, threshold_deg_h), 8000);
        std::printf("threshold %.0f: left %.4g (first order %.4g), gain %.4g, correlation %.4g\n", threshold_deg_h,
                    noiseless.left(), expected, noiseless.gain(), noiseless.correlation());
        EXPECT_NEAR(noiseless.left(), expected, 0.03 * expected);
    }
}

TEST(ExtrapolatedCompensator, TheInstrumentsNoiseAddsItsShare) {
    // What the noise adds does not depend on the threshold: it is measured without one and expected with one.
    const auto scenario = quiet(scenario::ReadoutModel::instrument);
    const Cycles alone = extrapolated(scenario, true, unlike(lanes, 1e-3), 8000);
    const double noise_rad = std::sqrt(alone.left2 / alone.count);
    for (const double threshold_deg_h : {30.0, 300.0, 1500.0}) {
        const Cycles cycles = extrapolated(scenario, true, unlike(lanes, threshold_deg_h), 8000);
        const double noise = noise_rad / std::sqrt(cycles.raw2 / cycles.count);
        const double expected = std::hypot(first_order_left(4), noise);
        std::printf("threshold %4.0f: noise %.3g rad, left %.4g, expected %.4g, gain %.4g, correlation %.4g\n",
                    threshold_deg_h, noise_rad, cycles.left(), expected, cycles.gain(), cycles.correlation());
        // Pulses of unequal weight are another mean of the same tail.
        EXPECT_NEAR(cycles.left(), expected, 0.06 * expected);
    }
}

TEST(ExtrapolatedCompensator, SaysWhereThereAreNoPulses) {
    const auto setups = unlike(2);
    compensate::Extrapolated compensator(untold(setups), {});
    readout::LaneReadings readings;
    readings.resize(4);
    compensate::LaneErrors errors;
    EXPECT_THROW(compensator.observe(readings, errors), RunError);
}

// ---- TwoTrain.

struct Learnt {
    double rms = 0.0;  ///< of B1 and B2 about b cos phi and b sin phi, over b
    double mean_size = 0.0;
    Cycles last;  ///< of the last 2000 turns
};

/// All gyros of one threshold, told nothing of it.
Learnt learn(const scenario::Scenario& scenario, bool injected, const std::vector<gyro::Setup>& setups,
             std::size_t turns) {
    compensate::TwoTrain compensator(untold(setups));
    compensate::LaneErrors errors;
    Learnt learnt;
    std::size_t done = 0;
    run(scenario, injected, setups, turns, [&](const auto& readings, const auto& truth_rad) {
        compensator.observe(readings, errors);
        done += readings.turns;
        if (done > turns - 2000) learnt.last.see(readings, truth_rad, errors, setups.size());
    });
    double squares = 0.0;
    for (std::size_t g = 0; g < setups.size(); ++g) {
        const gyro::Device device(setups[g]);
        const double first = compensator.first_rad_s(g) / device.coupling.b_rad_s;
        const double second = compensator.second_rad_s(g) / device.coupling.b_rad_s;
        const double phase = device.coupling.phase_rad;
        squares += std::pow(first - std::cos(phase), 2) + std::pow(second - std::sin(phase), 2);
        learnt.mean_size += std::hypot(first, second) / static_cast<double>(setups.size());
    }
    learnt.rms = std::sqrt(squares / (2.0 * static_cast<double>(setups.size())));
    return learnt;
}

std::vector<gyro::Setup> turning(std::vector<gyro::Setup> setups, double rate_deg_h) {
    for (gyro::Setup& setup : setups) setup.input_rate_deg_h = rate_deg_h;
    return setups;
}

/// Of two_train.hpp, over b.
double predicted_rms(const gyro::Setup& setup, double noise_rad, std::size_t turns) {
    const gyro::Device device(setup);
    const double a = device.half_cycle(1, device.dither_amplitude_rad).end_acceleration_rad_s2(0);
    const double kappa = device.coupling.b_rad_s * std::sqrt(units::two_pi / a);
    const double cycles = 0.5 * static_cast<double>(turns) - 8.0 / device.period_s();
    return noise_rad / kappa * std::sqrt(2.5 / (cycles * 0.5 / device.period_s()));
}

TEST(TwoTrainCompensator, LearnsThresholdAndCouplingPhaseBehindInjectedNoise) {
    constexpr std::size_t turns = 50048;  // 200 s
    for (const auto model : {scenario::ReadoutModel::ideal, scenario::ReadoutModel::latched}) {
        for (const double threshold_deg_h : {100.0, 300.0}) {
            for (const double rate_deg_h : {0.0, 15.0, -5000.0}) {
                const auto setups = turning(unlike(lanes, threshold_deg_h), rate_deg_h);
                const double expected = predicted_rms(setups[0], 3.0, turns);
                const Learnt learnt = learn(quiet(model), true, setups, turns);
                std::printf(
                    "%s, threshold %3.0f, %5.0f deg/h: B off by %.4f b (predicted %.4f), size %.4f, left %.4f\n",
                    model == scenario::ReadoutModel::ideal ? "ideal  " : "latched", threshold_deg_h, rate_deg_h,
                    learnt.rms, expected, learnt.mean_size, learnt.last.left());
                // 32 numbers: four standard errors of their rms are a half.
                EXPECT_NEAR(learnt.rms, expected, 0.5 * expected);
                // Their mean, four standard errors; half a per cent of bias from second order is allowed for.
                EXPECT_NEAR(learnt.mean_size, 1.0, expected + 0.005);
                // What B's error leaves of the kicks, beside the 1 % that the first order and the detectors leave.
                EXPECT_NEAR(learnt.last.left(), std::sqrt(2.0) * learnt.rms, 0.1 * learnt.rms + 0.01);
            }
        }
    }
}

TEST(TwoTrainCompensator, LearnsFasterFromLessNoise) {
    auto scenario = quiet(scenario::ReadoutModel::ideal);
    constexpr std::size_t turns = 50048;
    scenario.noise_injection.turn_phase_rms_rad = 1.5;
    // Turning: 1.5 rad alone leave a dead band and a phase that knows of its noise (two_train.hpp).
    const auto setups = turning(unlike(lanes), 15.0);
    const double expected = predicted_rms(setups[0], 1.5, turns);
    const Learnt learnt = learn(scenario, true, setups, turns);
    std::printf("1.5 rad: B off by %.4f b (predicted %.4f)\n", learnt.rms, expected);
    EXPECT_NEAR(learnt.rms, expected, 0.5 * expected);
}

TEST(TwoTrainCompensator, WithoutNoiseLearnsFromAPhaseThatMovesOnly) {
    const auto scenario = quiet(scenario::ReadoutModel::latched);
    // Out of the dead band of some 5 deg/h.
    const Learnt moving = learn(scenario, false, turning(unlike(lanes), 15.0), 50048);
    std::printf("15 deg/h: B off by %.4f b, left %.4f\n", moving.rms, moving.last.left());
    EXPECT_LT(moving.rms, 0.02);
    EXPECT_LT(moving.last.left(), 0.03);
    // In it, what the lock-in does is taken back at once: nothing to be learnt.
    const Learnt locked = learn(scenario, false, turning(unlike(lanes), 0.0), 20096);
    std::printf("locked: B off by %.4f b\n", locked.rms);
    EXPECT_GT(locked.rms, 0.1);
}

TEST(TwoTrainCompensator, DoesNothingForSixteenSeconds) {
    const auto setups = unlike(3);
    compensate::TwoTrain compensator(untold(setups));
    compensate::LaneErrors errors;
    double seen_s = 0.0;
    double largest_rad = 0.0;
    run(quiet(scenario::ReadoutModel::ideal), true, setups, 8064, [&](const auto& readings, const auto&) {
        compensator.observe(readings, errors);
        for (std::size_t i = 0; i < readings.turns; ++i) {
            seen_s += 0.5 * gyro::Device(setups[0]).period_s();
            for (std::size_t g = 0; g < 3; ++g) {
                const double told = std::abs(told_rad(errors, i, g));
                EXPECT_TRUE(seen_s > 16.0 || told == 0.0) << seen_s;
                largest_rad = std::max(largest_rad, told);
            }
        }
    });
    EXPECT_GT(largest_rad, 0.1);
}

// ---- Both.

/// Readings of a run, one after the other, and whatever a compensator makes of them in pieces.
struct Readings {
    readout::LaneReadings all;
    std::vector<gyro::Setup> setups;

    static std::vector<std::vector<simd::Lanes>*> columns(readout::LaneReadings& r) {
        std::vector<std::vector<simd::Lanes>*> all{&r.sine,
                                                   &r.cosine,
                                                   &r.phase_fringes,
                                                   &r.phase_whole,
                                                   &r.accel_before_rad_s2,
                                                   &r.accel_after_rad_s2,
                                                   &r.pulses.first_quarter};
        for (auto& side : r.pulses.time_s) {
            for (auto& column : side) all.push_back(&column);
        }
        return all;
    }

    explicit Readings(std::size_t gyros, std::size_t turns) : setups(unlike(gyros)) {
        run(quiet(scenario::ReadoutModel::instrument), true, setups, turns, [&](const auto& some, const auto&) {
            readout::LaneReadings piece = some;
            const auto to = columns(all);
            const auto from = columns(piece);
            for (std::size_t c = 0; c < to.size(); ++c) to[c]->insert(to[c]->end(), from[c]->begin(), from[c]->end());
            all.turns += piece.turns;
        });
    }

    readout::LaneReadings rows(std::size_t first, std::size_t count) const {
        readout::LaneReadings some;
        readout::LaneReadings whole = all;
        const auto to = columns(some);
        const auto from = columns(whole);
        for (std::size_t c = 0; c < to.size(); ++c) {
            const auto begin = from[c]->begin() + static_cast<std::ptrdiff_t>(first);
            to[c]->assign(begin, begin + static_cast<std::ptrdiff_t>(count));
        }
        some.turns = count;
        some.first_turn = static_cast<std::int64_t>(first);
        return some;
    }
};

using Make = std::function<std::unique_ptr<compensate::LaneCompensator>(const std::vector<gyro::Setup>&)>;

const std::vector<Make> makers{
    [](const auto& setups) {
        return std::make_unique<compensate::Extrapolated>(untold(setups),
                                                          electronics_of(quiet(scenario::ReadoutModel::instrument)));
    },
    [](const auto& setups) { return std::make_unique<compensate::TwoTrain>(untold(setups)); },
};

struct Told {
    std::vector<simd::Lanes> fringes, whole;
};

Told tell(compensate::LaneCompensator& compensator, const Readings& readings, const std::vector<std::size_t>& pieces) {
    Told told;
    compensate::LaneErrors errors;
    std::size_t done = 0;
    for (std::size_t piece = 0; done < readings.all.turns; ++piece) {
        // The last size again and again.
        const std::size_t count = std::min(pieces[std::min(piece, pieces.size() - 1)], readings.all.turns - done);
        compensator.observe(readings.rows(done, count), errors);
        for (std::size_t i = 0; i < count; ++i) {
            told.fringes.push_back(errors.fringes[i]);
            told.whole.push_back(errors.whole);
        }
        done += count;
    }
    return told;
}

TEST(LongLearningCompensators, PiecesDoNotMatter) {
    const Readings readings(3, 4608);  // 18.5 s
    for (const Make& make : makers) {
        const Told reference = tell(*make(readings.setups), readings, {4608});
        double largest_rad = 0.0;
        for (const auto& pieces : std::vector<std::vector<std::size_t>>{{128}, {1, 7, 500}, {4480, 1}}) {
            const Told told = tell(*make(readings.setups), readings, pieces);
            for (std::size_t i = 0; i < 4608; ++i) {
                for (std::size_t g = 0; g < 3; ++g) {
                    // The same but for where whole fringes are put apart for the reader: one rounding. A state that
                    // was another would come back at later turns, where B multiplies it.
                    const double all = reference.whole[i][g] + reference.fringes[i][g];
                    ASSERT_NEAR(told.whole[i][g] + told.fringes[i][g], all, 1e-14 * (1.0 + std::abs(all))) << i;
                    largest_rad = std::max(largest_rad, std::abs(all) * units::two_pi);
                }
            }
        }
        EXPECT_GT(largest_rad, 0.1);
    }
}

TEST(LearningCompensators, LaneMatesAndInstructionSetsDoNotMatter) {
    const Readings readings(lanes, 4352);
    const auto differing = [](const std::vector<simd::Lanes>& a, std::size_t lane_a, const std::vector<simd::Lanes>& b,
                              std::size_t lane_b) {
        std::size_t count = a.size() == b.size() ? 0 : 1;
        for (std::size_t i = 0; i < std::min(a.size(), b.size()); ++i) {
            count += std::bit_cast<std::uint64_t>(a[i][lane_a]) == std::bit_cast<std::uint64_t>(b[i][lane_b]) ? 0 : 1;
        }
        return count;
    };
    for (const Make& make : makers) {
        const Told reference = tell(*make(readings.setups), readings, {4352});
        for (const std::string& target : simd::available_targets()) {
            simd::use_target(target);
            const Told same = tell(*make(readings.setups), readings, {4352});
            for (std::size_t g = 0; g < lanes; ++g) EXPECT_EQ(differing(same.fringes, g, reference.fringes, g), 0U);
            for (const std::size_t g : {0U, 5U, 15U}) {
                Readings alone = readings;
                alone.setups = {readings.setups[g]};
                for (auto* column : Readings::columns(alone.all)) {
                    for (simd::Lanes& row : *column) row[0] = row[g];
                }
                const Told told = tell(*make(alone.setups), alone, {4352});
                EXPECT_EQ(differing(told.fringes, 0, reference.fringes, g), 0U) << target << " " << g;
                EXPECT_EQ(differing(told.whole, 0, reference.whole, g), 0U) << target << " " << g;
            }
        }
        simd::use_best_target();
    }
}

}  // namespace
}  // namespace compensators_learned_test
}  // namespace ringlock::test
