// What a kick extrapolated from the pulses on both sides would be worth with more pulses than the readout keeps (Lim,
// US patent 4,605,307, 1982: a counter has them all), on the paths of the equation of motion.
#include <cmath>
#include <cstdio>
#include <vector>

#include "engine/gyro/theory.hpp"
#include "tests/physics/extrapolation.hpp"
#include "tests/physics/readout_support.hpp"

namespace ringlock::test {
namespace extrapolated_pulses_test {
namespace {

constexpr int pulse_numbers[] = {4, 6, 16, 64};
constexpr int most_pulses = 64;

/// What pulses are known with.
struct Instrument {
    double comparator_rad = 0.0;
    double tick_s = 0.0;
    double amplitude_relative = 0.0;  ///< rms of half cycles' amplitudes, of which the mean is known
};

/// Pulses of one turn on one side: distances from the extremum as believed and times as seen.
struct Side {
    double acceleration_rad_s2;
    double curve_per_rad;  ///< w^2/(12 a)
    std::vector<double> distance_rad, time_s;
};

/// The kick [rad], upright, as extrapolated.hpp says: straight lines of a common slope tau through the nearest
/// `pulses`.
double extrapolated_kick(const Side (&sides)[2], int pulses, const Instrument& instrument) {
    constexpr double model_rad = 1e-6;
    double n[2]{}, sg[2]{}, sy[2]{};
    double top = 0.0, bottom = 0.0;
    for (const int side : {0, 1}) {
        double sgg = 0.0, sgy = 0.0;
        for (std::size_t k = 0; k < static_cast<std::size_t>(pulses); ++k) {
            const auto& [a, curve, distances, times] = sides[side];
            const double factor = 1.0 + curve * distances[k];
            const double g = a * times[k] / (factor * factor);
            const double y = 0.5 * g * times[k] - distances[k];
            const double tick_rad = std::sqrt(2.0 * a * distances[k]) * instrument.tick_s;
            const double weight = 1.0 / (instrument.comparator_rad * instrument.comparator_rad +
                                         tick_rad * tick_rad / 12.0 + model_rad * model_rad);
            n[side] += weight;
            sg[side] += weight * g;
            sy[side] += weight * y;
            sgg += weight * g * g;
            sgy += weight * g * y;
        }
        top += sgy - sg[side] / n[side] * sy[side];
        bottom += sgg - sg[side] / n[side] * sg[side];
    }
    const double tau = top / bottom;
    return (sg[1] * tau - sy[1]) / n[1] - (sg[0] * tau - sy[0]) / n[0];
}

/// Rms over the phases at a turn of what is left of the kick over that of the kick, by pulses of a side.
std::vector<double> left(double threshold_deg_h, const Instrument& instrument, int phases) {
    std::mt19937_64 engine(701);
    std::normal_distribution<double> normal;
    Uniform uniform(702);
    std::vector<double> sums(std::size(pulse_numbers)), squares(std::size(pulse_numbers));
    double kick2 = 0.0;
    for (int i = 0; i < phases; ++i) {
        Turn turn;
        turn.setup = paper_device();
        turn.setup.lockin_threshold_deg_h = threshold_deg_h;
        turn.setup.input_rate_deg_h = 0.0;
        turn.phase_rad = units::two_pi * (i + uniform(0.0, 1.0)) / phases;
        turn.before_ratio = 1.0 + instrument.amplitude_relative * normal(engine);
        turn.after_ratio = 1.0 + instrument.amplitude_relative * normal(engine);
        const TurnPath path = turn.path(1);
        const double x = path.zero_rate_phase_rad();
        const double near = (std::floor(x / quarter_rad) + 1.0) * quarter_rad - x;
        const gyro::HalfCycle half = turn.half(1, 1.0);
        const double a = half.end_acceleration_rad_s2();
        const double w = half.angular_frequency_rad_s();
        Side sides[2];
        for (const int side : {0, 1}) {
            sides[side] = {a, w * w / (12.0 * a), {}, {}};
            std::vector<double> crossed;
            for (int k = 0; k < most_pulses; ++k) {
                sides[side].distance_rad.push_back(near + k * quarter_rad);
                // The nearest comes at any time where the phase barely gets there; it is believed to be where it is.
                crossed.push_back(std::max(near + k * quarter_rad + instrument.comparator_rad * normal(engine), 1e-9));
            }
            sides[side].time_s = path.crossing_times_s(side == 0 ? -1 : 1, std::span<const double>(crossed));
            for (double& time : sides[side].time_s) {
                time -= path.zero_rate_time_s();
                if (instrument.tick_s > 0.0) time = (std::floor(time / instrument.tick_s) + 0.5) * instrument.tick_s;
            }
        }
        // Without a second order in the phase at the extremum (docs/physics.md).
        const double kick = gyro::turn_kick_rad(turn.setup) * std::sin(x + 0.25 * units::pi);
        kick2 += kick * kick;
        for (std::size_t n = 0; n < sums.size(); ++n) {
            const double error = extrapolated_kick(sides, pulse_numbers[n], instrument) - kick;
            sums[n] += error;
            squares[n] += error * error;
        }
    }
    // The mean is that of second-order delays, which maxima take back.
    std::vector<double> result;
    for (std::size_t n = 0; n < sums.size(); ++n) {
        result.push_back(std::sqrt((squares[n] - sums[n] * sums[n] / phases) / kick2));
    }
    return result;
}

void print(const char* what, const std::vector<double>& shares) {
    std::printf("%s:", what);
    for (std::size_t n = 0; n < shares.size(); ++n) std::printf("  %d: %.4f", pulse_numbers[n], shares[n]);
    std::printf("\n");
}

TEST(ExtrapolationFromMorePulses, LeavesWhatTheSumSays) {
    std::vector<double> expected;
    for (const int pulses : pulse_numbers) expected.push_back(first_order_left(pulses));
    print("left of the error by pulses of a side, first order", expected);
    for (const double threshold_deg_h : {30.0, 300.0}) {
        const std::vector<double> shares = left(threshold_deg_h, {}, 400);
        std::printf("threshold %3.0f deg/h, ", threshold_deg_h);
        print("path of the equation of motion", shares);
        // Higher orders: kappa^2 = 2 %.
        for (std::size_t n = 0; n < shares.size(); ++n) EXPECT_NEAR(shares[n], expected[n], 0.02 * expected[n]);
    }
}

TEST(ExtrapolationFromMorePulses, IsLimitedByTheAmplitudeBehindInjectedNoise) {
    constexpr double no_threshold_deg_h = 1e-3;
    const double kick_rad = gyro::turn_kick_rad(paper_device()) / std::sqrt(2.0);
    const Instrument standard{0.005, 1e-8, 0.0};
    Instrument injected = standard;
    injected.amplitude_relative = 3.0 / std::sqrt(2.0) / gyro::Device(paper_device()).dither_amplitude_rad;
    for (const Instrument& instrument : {standard, injected}) {
        const bool spread = instrument.amplitude_relative > 0.0;
        const auto alone = left(no_threshold_deg_h, instrument, 1000);
        const auto shares = left(300.0, instrument, 1000);
        print(spread ? "and amplitudes of injected noise, 3 rad, taken for their mean" : "comparators and clock",
              shares);
        for (std::size_t n = 0; n < shares.size(); ++n) {
            const double noise = alone[n] * no_threshold_deg_h / 300.0;
            // Weights fall with the clock's share: another mean of the same tail.
            const double expected = std::hypot(first_order_left(pulse_numbers[n]), noise);
            EXPECT_NEAR(shares[n], expected, 0.06 * expected);
        }
        if (!spread) continue;
        // D times the amplitude's deviation, half its difference between the sides: a line through g^2/(2 a), equally
        // many pulses to each D, meets g = 0 at -0.3 D of the last.
        const double by_line = 0.6 / std::sqrt(2.0) * instrument.amplitude_relative * most_pulses * quarter_rad;
        std::printf("the amplitudes' part with 64 pulses: %.4f\n", by_line / kick_rad);
        EXPECT_NEAR(shares.back(), std::hypot(first_order_left(most_pulses), by_line / kick_rad), 0.1 * shares.back());
    }
}

}  // namespace
}  // namespace extrapolated_pulses_test
}  // namespace ringlock::test
