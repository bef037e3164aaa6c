// The instrument: pulses, sampling and the phase recovered from them, against the path of the phase.
#include "engine/readout/pulse_readout.hpp"

#include <array>
#include <cmath>
#include <complex>
#include <cstdio>
#include <numbers>
#include <random>
#include <vector>

#include "engine/ensemble/block.hpp"
#include "engine/readout/fraction_recovery.hpp"
#include "tests/physics/readout_support.hpp"
#include "tests/support/devices.hpp"
#include "tests/support/limits.hpp"

namespace ringlock::test {
namespace pulse_readout_test {
namespace {

using readout::Wanted;
using simd::lanes;

Turn device_turn(Uniform& uniform, double rate_deg_h, double asymmetry, double amplitude_rms) {
    Turn turn;
    turn.setup = paper_device();
    turn.setup.input_rate_deg_h = rate_deg_h;
    turn.setup.dither_asymmetry_ratio = asymmetry;
    turn.setup.coupling_phase_rad = uniform(-3.0, 3.0);
    turn.before_ratio = 1.0 + amplitude_rms * uniform(-1.0, 1.0);
    turn.after_ratio = 1.0 + amplitude_rms * uniform(-1.0, 1.0);
    turn.phase_rad = uniform(-3.1, 3.1);
    return turn;
}

/// Worst difference [s] of the intervals between sampling and pulses from the path's, over pulses at least
/// `least_rad` from the extremum: closer ones come at times that any change of the phase moves at will.
double worst_pulse_s(double rate_deg_h, double asymmetry, double amplitude_off, double threshold_deg_h,
                     double least_rad) {
    Uniform uniform(601);
    double worst = 0.0;
    for (int block = 0; block < 20; ++block) {
        const int direction = block % 2 == 0 ? 1 : -1;
        std::vector<Turn> turns;
        for (std::size_t i = 0; i < lanes; ++i) {
            turns.push_back(device_turn(uniform, rate_deg_h, asymmetry, amplitude_off));
            turns.back().setup.lockin_threshold_deg_h = threshold_deg_h;
        }
        const Read got = read(turns, block, perfect_instrument, {}, Wanted::pulses);
        for (std::size_t i = 0; i < lanes; ++i) {
            const TurnPath path = turns[i].path(direction);
            const double upright = direction * path.zero_rate_phase_rad() / quarter_rad;
            const double first = std::floor(upright) + 1.0;
            EXPECT_EQ(got.readings.pulses.first_quarter[0][i], first);
            const double near = (first - upright) * quarter_rad;
            const auto pulse = [&](std::size_t side, std::size_t k) {
                return got.readings.pulses.time_s[side][k][0][i];
            };
            std::array<std::array<double, readout::kept_pulses>, 2> true_s{};
            for (const std::size_t side : {0U, 1U}) {
                for (const std::size_t k : {0U, 2U}) {
                    const auto two = path.crossing_times_s(
                        side == 0 ? -1 : 1,
                        {near + static_cast<double>(k) * quarter_rad, near + static_cast<double>(k + 1) * quarter_rad});
                    true_s[side][k] = two[0];
                    true_s[side][k + 1] = two[1];
                }
            }
            if (near < least_rad) continue;  // the sampling's own instant hangs on the nearest pulses
            // Times from the extremum go with 1/sqrt(a), sqrt(a) with the inverse of the half cycle's duration.
            const double before_s = turns[i].half(-direction, 1.0).duration_s;
            const double after_s = turns[i].half(direction, 1.0).duration_s;
            const double sampled_s = (after_s * true_s[0][0] + before_s * true_s[1][0]) / (before_s + after_s);
            for (const std::size_t side : {0U, 1U}) {
                for (std::size_t k = 0; k < readout::kept_pulses; ++k) {
                    worst = std::max(worst, std::abs(pulse(side, k) - (true_s[side][k] - sampled_s)));
                }
            }
        }
    }
    std::printf("%6.0f deg/h, asymmetry %5.3f, amplitudes off by %.0e, threshold %4.0f: pulses off by %.2g s\n",
                rate_deg_h, asymmetry, amplitude_off, threshold_deg_h, worst);
    return worst;
}

TEST(PulseReadout, PulsesAreThoseOfThePath) {
    EXPECT_LT(worst_pulse_s(0.0, 0.0, 0.0, 300.0, 0.0), 1e-11);
    EXPECT_LT(worst_pulse_s(500.0, 0.0, 0.0, 300.0, 0.0), 1e-11);
    // Injected noise of 3 rad changes amplitudes by 3.4e-4 rms, studies have asymmetries of 1e-3. Hysteresis of 0.03 is
    // what keeps comparators with noise of 0.005 from chattering.
    EXPECT_LT(worst_pulse_s(15.0, 0.001, 1e-3, 300.0, 0.0), 1e-10);
    EXPECT_LT(worst_pulse_s(500.0, 0.001, 1e-3, 300.0, 0.03), 1e-10);
}

/// Gyros of few fringes, whose pulses lie far out on the cosine and whose amplitudes differ by tenths from turn to
/// turn: what the times of their pulses are wrong by, in phase.
double worst_pulse_rad(const NamedDevice& named, double amplitude_off) {
    Uniform uniform(607);
    double worst = 0.0;
    for (int block = 0; block < 20; ++block) {
        const int direction = block % 2 == 0 ? 1 : -1;
        std::vector<Turn> turns;
        for (std::size_t i = 0; i < lanes; ++i) {
            turns.push_back(device_turn(uniform, 15.0, 0.001, amplitude_off));
            const gyro::Setup drawn = turns.back().setup;
            turns.back().setup = setup_of(named);
            turns.back().setup.input_rate_deg_h = 15.0;
            turns.back().setup.coupling_phase_rad = drawn.coupling_phase_rad;
        }
        const Read got = read(turns, block, perfect_instrument, {}, Wanted::pulses);
        for (std::size_t i = 0; i < lanes; ++i) {
            const TurnPath path = turns[i].path(direction);
            const double upright = direction * path.zero_rate_phase_rad() / quarter_rad;
            const double near = (std::floor(upright) + 1.0 - upright) * quarter_rad;
            const auto& times = got.readings.pulses.time_s;
            for (const std::size_t side : {0U, 1U}) {
                const gyro::HalfCycle half = turns[i].half(side == 0 ? -direction : direction,
                                                           side == 0 ? turns[i].before_ratio : turns[i].after_ratio);
                for (const std::size_t k : {0U, 2U}) {
                    // Intervals, which do not depend on when the sample was taken.
                    const double first = near + static_cast<double>(k) * quarter_rad;
                    const auto two = path.crossing_times_s(side == 0 ? -1 : 1, {first, first + quarter_rad});
                    const double off = (times[side][k + 1][0][i] - times[side][k][0][i]) - (two[1] - two[0]);
                    const double speed = std::sqrt(2.0 * (first + quarter_rad) * half.end_acceleration_rad_s2());
                    worst = std::max(worst, std::abs(off) * speed);
                }
            }
        }
    }
    return worst;
}

TEST(PulseReadout, PulsesOfGyrosWithFewFringesAreThoseOfTheCosine) {
    for (const std::size_t which : {0U, 1U, 7U}) {
        // Four standard deviations of half cycles' amplitudes with noise of 3 rad: a tenth at 26 fringes.
        const double amplitude_off =
            4.0 * 3.0 / std::numbers::sqrt2 / gyro::modulation_depth_rad(setup_of(named_devices[which]));
        const double worst = worst_pulse_rad(named_devices[which], amplitude_off);
        std::printf("%s, amplitudes off by %.2g: intervals of pulses off by %.2g rad\n", named_devices[which].name,
                    amplitude_off, worst);
        EXPECT_LT(worst, 1e-4) << named_devices[which].name;
    }
}

/// Rms [rad] of the error of the phase read, over turns of all phases in a run, and its mean.
struct PhaseError {
    double rms_rad = 0.0;
    double mean_rad = 0.0;
};

scenario::Scenario instrument() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.readout.model = scenario::ReadoutModel::instrument;
    scenario.ensemble.gyros = 16;
    scenario.ensemble.seed = 602;
    return scenario;
}

PhaseError phase_error(const scenario::Scenario& scenario, std::size_t turns = 4000) {
    const std::vector<scenario::Arm> arms{scenario::parse_arm("noise_injected")};
    ensemble::GyroBlock read(scenario, arms, 0, lanes);
    scenario::Scenario perfect = scenario;
    perfect.readout = {};
    perfect.readout.model = scenario::ReadoutModel::ideal;
    // Ideal readouts are read at minima only where nothing is corrected.
    const std::vector<scenario::Arm> every_turn{scenario::parse_arm("noise_injected+compensated")};
    ensemble::GyroBlock truth(perfect, every_turn, 0, lanes);
    PhaseError error;
    double count = 0.0;
    for (std::size_t done = 0; done < turns; done += 100) {
        read.advance(100);
        truth.advance(100);
        for (std::size_t i = 0; i < 100; ++i) {
            if (done + i < 1000) continue;
            for (std::size_t g = 0; g < lanes; ++g) {
                const auto& a = read.readings(0);
                const auto& b = truth.readings(0);
                const double off = units::two_pi * ((a.phase_whole[i][g] - b.phase_whole[i][g]) +
                                                    (a.phase_fringes[i][g] - b.phase_fringes[i][g]));
                error.rms_rad += off * off;
                error.mean_rad += off;
                count += 1.0;
            }
        }
    }
    error.rms_rad = std::sqrt(error.rms_rad / count);
    error.mean_rad /= count;
    return error;
}

scenario::Scenario noiseless() {
    scenario::Scenario scenario = instrument();
    scenario.readout.detector_noise_relative = 0.0;
    scenario.readout.comparator_noise_relative = 0.0;
    scenario.readout.comparator_hysteresis_relative = 0.0;
    scenario.readout.detector_bandwidth_hz = 0.0;
    scenario.readout.adc_bits = 0;
    scenario.readout.clock_hz = 0.0;
    return scenario;
}

TEST(PulseReadout, WithoutImperfectionsTheSampleIsOffByTheLockInsBend) {
    // Half-way between the nearest pulses is not the zero-rate point, as the lock-in bends the two sides unlike.
    scenario::Scenario scenario = noiseless();
    scenario.readout.phase_from = scenario::PhaseFrom::detectors;
    const PhaseError sampled = phase_error(scenario);
    scenario.readout.phase_from = scenario::PhaseFrom::detectors_and_pulses;
    const PhaseError recovered = phase_error(scenario);
    std::printf("sampled %.2g rad rms, recovered %.2g rad rms\n", sampled.rms_rad, recovered.rms_rad);
    EXPECT_LT(sampled.rms_rad, 3e-4);
    EXPECT_LT(recovered.rms_rad, 1e-5);
}

TEST(PulseReadout, HysteresisAndBandwidthAreAccountedFor) {
    scenario::Scenario scenario = noiseless();
    scenario.readout.comparator_hysteresis_relative = 0.03;
    const double hysteresis = phase_error(scenario).rms_rad;
    scenario.readout.detector_bandwidth_hz = 2e6;
    const double both = phase_error(scenario).rms_rad;
    std::printf("hysteresis %.2g, with 2 MHz %.2g rad rms\n", hysteresis, both);
    EXPECT_LT(hysteresis, 3e-5);
    EXPECT_LT(both, 3e-5);
}

TEST(PulseReadout, TheRecoveredPhaseIsAsGoodAsSampleAndEightPulses) {
    scenario::Scenario scenario = instrument();
    scenario.readout.phase_from = scenario::PhaseFrom::detectors;
    const PhaseError sampled = phase_error(scenario, 11000);
    scenario.readout.phase_from = scenario::PhaseFrom::detectors_and_pulses;
    const PhaseError recovered = phase_error(scenario, 11000);
    std::printf("sampled %.5g rad rms, mean %.1g; recovered %.5g rad rms, mean %.1g\n", sampled.rms_rad,
                sampled.mean_rad, recovered.rms_rad, recovered.mean_rad);
    // 160000 turns: 0.2 % of an rms, and 5e-3/400 of a mean.
    EXPECT_NEAR(sampled.rms_rad, 0.005, 0.01 * 0.005);
    EXPECT_LT(recovered.rms_rad, 1.05 * 0.005 / 3.0 * std::sqrt(1.004));
    EXPECT_GT(recovered.rms_rad, 0.99 * 0.005 / 3.0);
    EXPECT_LT(std::abs(recovered.mean_rad), 4.0 * 0.0017 / 400.0 + 1e-6);
}

/// Rms of the recovered phase's error over the bound for a processor that has seen no more than the turn itself, and
/// over that for one that has.
std::pair<double, double> over_bounds(const char* name, const scenario::Scenario& scenario) {
    const PhaseError error = phase_error(scenario, 11000);
    const limits::Bounds bounds = limits::bounds(scenario);
    std::printf("%s: %.5g rad rms, %.4f of the bound, %.4f of that with psi'' known\n", name, error.rms_rad,
                error.rms_rad / bounds.learnt_rad, error.rms_rad / bounds.known_rad);
    return {error.rms_rad / bounds.learnt_rad, error.rms_rad / bounds.known_rad};
}

TEST(PulseReadout, TheRecoveredPhaseIsNotBetterThanItsBound) {
    // 160000 turns tell an rms to 0.18 %: four of these are allowed below.
    const auto check = [](const char* name, const scenario::Scenario& scenario, double most) {
        const auto [learnt, known] = over_bounds(name, scenario);
        EXPECT_GT(learnt, 0.993) << name;
        EXPECT_GE(known, learnt) << name;
        EXPECT_LT(learnt, most) << name;
    };
    check("defaults", instrument(), 1.02);
    scenario::Scenario scenario = instrument();
    scenario.readout.detector_noise_relative = 0.02;
    check("detectors 2 %", scenario, 1.02);
    scenario = instrument();
    scenario.readout.comparator_noise_relative = 0.02;
    scenario.readout.comparator_hysteresis_relative = 0.12;
    check("comparators 2 %", scenario, 1.02);
    scenario = instrument();
    scenario.readout.detector_noise_relative = scenario.readout.comparator_noise_relative = 0.0005;
    check("0.05 %", scenario, 1.02);
    scenario = instrument();
    scenario.readout.clock_hz = 3e6;
    check("3 MHz", scenario, 1.02);
    scenario = instrument();
    scenario.readout.adc_bits = 7;
    check("7 bits", scenario, 1.02);
    for (const double rms_rad : {10.0, 30.0}) {
        scenario = instrument();
        scenario.noise_injection.turn_phase_rms_rad = rms_rad;
        check(rms_rad > 20.0 ? "30 rad injected" : "10 rad injected", scenario, 1.02);
        scenario.readout.detector_noise_relative = scenario.readout.comparator_noise_relative = 0.0005;
        check(rms_rad > 20.0 ? "30 rad injected, 0.05 %" : "10 rad injected, 0.05 %", scenario, 1.02);
    }
}

TEST(PulseReadout, TheConverterRoundsToItsSteps) {
    scenario::Scenario scenario = noiseless();
    scenario.readout.phase_from = scenario::PhaseFrom::detectors;
    scenario.readout.adc_bits = 6;
    // Both detectors are off by a uniform error: of the phase, the same rms.
    const double step = 2.0 * readout::Electronics::adc_range / 64.0;
    const PhaseError error = phase_error(scenario);
    std::printf("6 bits: %.4g rad rms, step/sqrt(12) %.4g\n", error.rms_rad, step / std::sqrt(12.0));
    EXPECT_NEAR(error.rms_rad, step / std::sqrt(12.0), 0.05 * step / std::sqrt(12.0));
}

TEST(PulseReadout, PulsesKnowWholeTicksOnly) {
    Uniform uniform(603);
    readout::Electronics electronics = perfect_instrument;
    electronics.clock_hz = 1e7;
    for (const int number : {0, 1, 1234567}) {
        std::vector<Turn> turns;
        for (std::size_t i = 0; i < lanes; ++i) turns.push_back(device_turn(uniform, 15.0, 0.0, 0.0));
        const Read exact = read(turns, number, perfect_instrument, {}, Wanted::pulses);
        const Read ticked = read(turns, number, electronics, {}, Wanted::pulses);
        for (std::size_t i = 0; i < lanes; ++i) {
            for (const std::size_t side : {0U, 1U}) {
                for (std::size_t k = 1; k < readout::kept_pulses; ++k) {
                    const double ticks = 1e7 * ticked.readings.pulses.time_s[side][k][0][i];
                    EXPECT_NEAR(ticks, std::nearbyint(ticks), 1e-6);
                    EXPECT_NEAR(ticks, 1e7 * exact.readings.pulses.time_s[side][k][0][i], 2.0);
                }
            }
        }
    }
}

/// Extremum and phase there of exp(i psi(t)) behind a first-order low-pass, psi = psi_0 + a t^2/2, by direct summation.
double filtered_extremum_rad(double acceleration, double low_pass_s) {
    // y(t) = int_0^inf exp(-u) x(t - u T) du: Simpson's rule over 40 time constants.
    const auto phase = [&](double t) {
        constexpr int steps = 20000;
        constexpr double reach = 40.0;
        std::complex<double> sum = 0.0;
        for (int i = 0; i <= steps; ++i) {
            const double u = reach * i / steps;
            const double at = t - u * low_pass_s;
            const double weight = (i == 0 || i == steps ? 1.0 : i % 2 == 1 ? 4.0 : 2.0) * std::exp(-u);
            sum += weight * std::polar(1.0, 0.5 * acceleration * at * at);
        }
        return std::arg(sum);
    };
    double best = 1e9;
    for (int i = -20; i <= 20; ++i) best = std::min(best, phase(low_pass_s * (1.0 + 0.01 * i)));
    return best;
}

TEST(PulseReadout, ALowPassBluntsTheExtremum) {
    const gyro::Device device(paper_device());
    const double a = device.half_cycle(1.0, device.dither_amplitude_rad).end_acceleration_rad_s2();
    for (const double bandwidth_hz : {1e6, 2e6, 10e6}) {
        readout::Electronics electronics = perfect_instrument;
        electronics.detector_bandwidth_hz = bandwidth_hz;
        const double t = readout::low_pass_s(electronics);
        const double blunted = filtered_extremum_rad(a, t);
        EXPECT_NEAR(blunted, 0.5 * a * t * t, 0.02 * 0.5 * a * t * t) << bandwidth_hz;
    }
}

TEST(PulseReadout, APhaseThatBarelyReachesAQuarterFringeLosesNoCount) {
    // Extrema within the hysteresis of a quarter fringe: comparators do not switch there, or only on one side's noise.
    for (const double beyond_rad : {-0.05, -0.029, -0.01, -1e-6, 1e-6, 0.01, 0.029, 0.031, 0.05}) {
        for (const int number : {0, 1}) {
            std::vector<Turn> turns(lanes);
            for (std::size_t i = 0; i < lanes; ++i) {
                turns[i].setup = paper_device();
                turns[i].setup.lockin_threshold_deg_h = 0.0;
                turns[i].phase_rad = quarter_rad * static_cast<double>(i) - (number == 0 ? 1.0 : -1.0) * beyond_rad;
            }
            readout::Electronics electronics = perfect_instrument;
            electronics.comparator_hysteresis_relative = 0.03;
            const Read got = read(turns, number, electronics, {}, Wanted::pulses);
            for (std::size_t i = 0; i < lanes; ++i) {
                EXPECT_NEAR(got.phase_rad(i), turns[i].phase_rad, 1e-9) << beyond_rad << " " << number << " " << i;
                // A comparator that has not switched gives no pulse; the next ones do.
                const bool switched = beyond_rad > 0.03;
                const double first = got.readings.pulses.time_s[1][0][0][i];
                if (beyond_rad > 0.0) {
                    EXPECT_EQ(first != 0.0, switched) << beyond_rad;
                }
                EXPECT_GT(got.readings.pulses.time_s[1][1][0][i], 0.0);
                EXPECT_LT(got.readings.pulses.time_s[0][1][0][i], 0.0);
            }
        }
    }
}

TEST(FractionRecovery, PulsesThatContradictTheDetectorsAreCountedAndLeftAside) {
    scenario::Scenario scenario = instrument();
    scenario.readout.phase_from = scenario::PhaseFrom::detectors;
    const std::vector<scenario::Arm> arms{scenario::parse_arm("noise_injected")};
    ensemble::GyroBlock block(scenario, arms, 0, lanes);
    block.advance(100);
    std::vector<gyro::Device> devices;
    for (const gyro::Setup& setup : block.setups()) devices.emplace_back(setup);
    readout::Electronics electronics = perfect_instrument;
    electronics.detector_noise_relative = electronics.comparator_noise_relative = 0.005;
    electronics.comparator_hysteresis_relative = 0.03;
    readout::FractionRecovery recovery(devices, electronics, 3.0 / std::sqrt(2.0));
    readout::LaneReadings readings = block.readings(0);
    // One gyro's counter runs a tenth slow at turns 40 to 49.
    for (std::size_t i = 40; i < 50; ++i) {
        for (auto& side : readings.pulses.time_s) {
            for (auto& pulse : side) pulse[i][3] *= 0.9;
        }
    }
    readout::LaneAngles angles = block.angles(0);
    const readout::LaneReadings sampled = readings;
    recovery.recover(readings, &angles);
    for (std::size_t g = 0; g < lanes; ++g) EXPECT_EQ(recovery.contradictions(g), g == 3 ? 10 : 0) << g;
    for (std::size_t i = 40; i < 50; ++i) EXPECT_EQ(readings.phase_fringes[i][3], sampled.phase_fringes[i][3]);
}

TEST(FractionRecovery, AWrongCouplingCostsSecondOrderOnly) {
    scenario::Scenario scenario = noiseless();
    const auto rms = [&](double factor) {
        const std::vector<scenario::Arm> arms{scenario::parse_arm("noise_injected+compensated")};
        scenario::Scenario raw = scenario;
        raw.readout.phase_from = scenario::PhaseFrom::detectors;
        ensemble::GyroBlock block(raw, arms, 0, lanes);
        scenario::Scenario perfect = scenario;
        perfect.readout = {};
        perfect.readout.model = scenario::ReadoutModel::ideal;
        ensemble::GyroBlock truth(perfect, arms, 0, lanes);
        std::vector<gyro::Device> devices;
        for (const gyro::Setup& setup : block.setups()) {
            devices.emplace_back(setup);
            devices.back().coupling.b_rad_s *= factor;
        }
        readout::Electronics electronics = perfect_instrument;
        // As if all had noise, so that pulses count as much as samples.
        electronics.detector_noise_relative = electronics.comparator_noise_relative = 0.005;
        readout::FractionRecovery recovery(devices, electronics, 3.0 / std::sqrt(2.0));
        double sum = 0.0;
        double count = 0.0;
        for (int piece = 0; piece < 20; ++piece) {
            block.advance(100);
            truth.advance(100);
            readout::LaneReadings readings = block.readings(0);
            readout::LaneAngles angles = block.angles(0);
            recovery.recover(readings, &angles);
            for (std::size_t i = 0; i < 100 && piece > 5; ++i) {
                for (std::size_t g = 0; g < lanes; ++g) {
                    const double off =
                        units::two_pi * (readings.phase_fringes[i][g] - truth.readings(0).phase_fringes[i][g]);
                    sum += off * off;
                    count += 1.0;
                }
            }
        }
        return std::sqrt(sum / count);
    };
    const double known = rms(1.0);
    const double off_30 = rms(0.7);
    const double off_100 = rms(0.0);
    std::printf("coupling known %.2g, 30 %% off %.2g, none %.2g rad rms\n", known, off_30, off_100);
    // The amplitude after the turn, not known to 3e-4 of distances of up to 6 rad.
    EXPECT_LT(known, 5e-4);
    // What a wrong coupling adds goes with the difference of the squares, 0.51 and 1.
    const auto added = [&](double all) { return std::sqrt(all * all - known * known); };
    EXPECT_NEAR(added(off_30) / added(off_100), 1.0 - 0.7 * 0.7, 0.1);
    EXPECT_LT(off_100, 2e-3);
}

}  // namespace
}  // namespace pulse_readout_test
}  // namespace ringlock::test
