#include "analysis/closure/samples/model/states.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/closure/stats/gauss_markov.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

/// Stationary covariance of the amplitudes at the last and the next turn and of the state that follows them.
std::array<std::array<double, 3>, 3> covariance_of_dither(double variance, double memory,
                                                          const DitherFollower& follower) {
    std::array<std::array<double, 3>, 3> p{};
    p[0][0] = p[1][1] = variance;
    p[0][1] = p[1][0] = memory * variance;
    // With u' = v and v' = memory v + noise, from stationarity of E[m' u'] = E[m' v], E[m' v'] = memory E[m' v] and
    // E[m'^2].
    const auto& [kept, by_last, by_next] = follower;
    const double with_u = (by_last * memory + by_next) * variance / (1.0 - kept * memory);
    const double with_v = memory * with_u;
    const double new_square = variance * (by_last * by_last + by_next * by_next + 2.0 * memory * by_last * by_next) +
                              2.0 * kept * (by_last * with_u + by_next * with_v);
    p[0][2] = p[2][0] = with_u;
    p[1][2] = p[2][1] = with_v;
    p[2][2] = new_square / (1.0 - kept * kept);
    return p;
}

/// A sinusoid whose phase diffuses, as two quadratures of which the first is read: variance, frequency, and full width
/// at half maximum of its spectrum.
struct Rotation {
    double variance, hz, width_hz;
};

/// Harmonics of the error of counts (SampleNoise::CountError). Where readings are interpolated between two latched
/// counts, and the record does not show when counts were latched, the variance is the mean over all places between
/// them.
std::vector<Rotation> rotations_of(const SampleNoise::CountError& error, bool resampled) {
    std::vector<Rotation> rotations;
    for (int m = 1; m <= error.harmonics; ++m) {
        const double amplitude = error.amplitude_arcsec(m);
        const double hz = std::remainder(m * error.hz, error.latch_hz);
        const double left = resampled ? 1.0 : (2.0 + std::cos(units::two_pi * hz / error.latch_hz)) / 3.0;
        rotations.push_back({left * 0.5 * amplitude * amplitude, hz, m * m * error.width_hz});
    }
    return rotations;
}

}  // namespace

/// Amplitude in the sawtooth, times the characteristic function of the jitter (Widrow and Kollar, "Quantization Noise",
/// 2008, chapter 5).
double SampleNoise::CountError::amplitude_arcsec(int harmonic) const {
    const double jitter_rad = units::two_pi * harmonic * jitter_arcsec / step_arcsec;
    return step_arcsec / (units::pi * harmonic) * std::exp(-0.5 * jitter_rad * jitter_rad);
}

SampleStates::SampleStates(const SampleNoise& noise, double interval_s) {
    resampled = noise.from_hz > 0.0;
    const double dt = resampled ? 1.0 / noise.from_hz : interval_s;
    count = 1;
    f[0][0] = 1.0;
    q[0][0] = noise.rate_arcsec_rt_s * noise.rate_arcsec_rt_s * dt;
    if (noise.kicks && !resampled) {
        kick = noise.kick_variance();
        kicks = noise.kicks;
        q[0][0] = std::max(0.0, q[0][0] - kick * noise.turn_hz * dt);
        f[0][count++] = 1.0;
    }
    Matrix& p = start;
    if (noise.walk_arcsec2_s3 > 0.0) {
        f[0][count] = dt;
        f[count][count] = 1.0;
        q[count][count] = noise.walk_arcsec2_s3 * dt;
        q[0][count] = q[count][0] = 0.5 * q[count][count] * dt;
        q[0][0] += q[count][count] * dt * dt / 3.0;
        p[count][count] = q[count][count];
        ++count;
    }
    for (const auto& term : noise.terms) {
        if (count >= most - 5) break;
        const GaussMarkovStep step(term.time_s, dt);
        const double variance = term.variance_arcsec2_s2;
        f[0][count] = step.gain_s;
        f[count][count] = step.decay;
        q[count][count] = variance * step.rate_variance;
        q[0][count] = q[count][0] = variance * step.covariance_s;
        q[0][0] += variance * step.angle_variance_s2;
        p[count][count] = variance;
        ++count;
    }
    std::vector<int> resonances;
    for (const auto& resonance : noise.resonances) {
        if (!(resonance.arcsec > 0.0) || count + 4 > most) continue;
        resonances.push_back(count);
        const double r = std::exp(-units::pi * resonance.width_hz * dt);
        const double a = 2.0 * r * std::cos(units::two_pi * resonance.hz * dt);
        const double b = r * r;
        const double v = resonance.arcsec * resonance.arcsec;
        f[count][count] = a;
        f[count][count + 1] = -b;
        f[count + 1][count] = 1.0;
        // Variance relative to that of the driving noise (Box and Jenkins, "Time Series Analysis", 1976, section
        // 3.2.4).
        q[count][count] = v * (1.0 - b) * ((1.0 + b) * (1.0 + b) - a * a) / (1.0 + b);
        p[count][count] = p[count + 1][count + 1] = v;
        p[count][count + 1] = p[count + 1][count] = v * a / (1.0 + b);
        count += 2;
    }
    double readout = noise.angle_arcsec * noise.angle_arcsec;
    if (noise.dither && !resampled && count + dither_states <= most) {
        dither = noise.dither;
        of_dither = count;
        dither_variance = noise.dither_share * readout;
        dither_memory = noise.dither_memory;
        dither_follower = noise.dither_follower;
        const auto stationary = covariance_of_dither(dither_variance, dither_memory, dither_follower);
        for (int i = 0; i < dither_states; ++i) {
            f[count + i][count + i] = 1.0;
            for (int j = 0; j < dither_states; ++j) p[count + i][count + j] = stationary[i][j];
            h[count + i] = 1.0;
        }
        count += dither_states;
    }
    // The angle is zero at the first reading, which has an error.
    p[0][0] = readout;
    std::vector<int> read = resonances;  // states that a reading adds to the angle
    const auto add = [&](const Rotation& rotation) {
        const double memory = std::exp(-units::pi * rotation.width_hz * dt);
        const double phase = units::two_pi * rotation.hz * dt;
        const double variance = rotation.variance;
        f[count][count] = f[count + 1][count + 1] = memory * std::cos(phase);
        f[count][count + 1] = memory * std::sin(phase);
        f[count + 1][count] = -f[count][count + 1];
        q[count][count] = q[count + 1][count + 1] = variance * (1.0 - memory * memory);
        p[count][count] = p[count + 1][count + 1] = variance;
        p[0][0] += variance;
        if (!resampled) p[0][count] = p[count][0] = -variance;
        read.push_back(count);
        count += 2;
    };
    if (noise.sidebands.arcsec > 0.0 && count + 4 <= most) {
        // Two quadratures with one correlation time rotate at the frequency of the dither; one of them is read.
        add({noise.sidebands.arcsec * noise.sidebands.arcsec, noise.sidebands.hz, noise.sidebands.width_hz});
    }
    for (const Rotation& rotation : rotations_of(noise.count_error, resampled)) {
        if (count + 4 <= most) add(rotation);
    }
    if (dither) readout -= dither_variance;
    floor = readout;
    if (resampled) {
        const int r0 = count;
        const int r1 = count + 1;
        f[r0][r1] = 1.0;
        // The reading r1 of the new tick is the angle plus the states read with it plus an error; q has the noise of
        // all.
        f[r1] = f[0];
        for (int j = 0; j < count; ++j) q[r1][j] = q[0][j];
        for (const int state : read) {
            for (int j = 0; j < count; ++j) {
                f[r1][j] += f[state][j];
                q[r1][j] += q[state][j];
            }
        }
        q[r1][r1] = q[0][0] + readout;
        for (const int state : read) q[r1][r1] += q[state][state];
        for (int j = 0; j < count; ++j) q[j][r1] = q[r1][j];
        count += 2;
        p[r0][r0] = p[r1][r1] = p[0][0] + q[r1][r1];
        // Interpolated readings have no error of their own except for digits, whose variance does not scale with the
        // noise: otherwise deterministic rows would favour a smaller noise.
        floor = noise.blur_arcsec * noise.blur_arcsec + noise.digits_arcsec * noise.digits_arcsec;
        ratio = interval_s * noise.from_hz;
        first_place = noise.from_phase;
    } else {
        h[0] = 1.0;
        for (const int state : read) h[state] = 1.0;
        swings = noise.swing_hz > 0.0;
        swing_by_row = units::two_pi * noise.swing_hz * interval_s;
        swing_cos = noise.swing_cos;
        swing_sin = noise.swing_sin;
    }
    for (int i = 0; i < count; ++i) {
        auto& terms = nonzero[i];
        for (int j = 0; j < count; ++j) {
            if (f[i][j] != 0.0) terms.at[terms.count++] = j;
        }
    }
}

bool SampleStates::is_like(const SampleStates& other) const {
    const auto same_zeros = [&] {
        return std::equal(h.begin(), h.end(), other.h.begin(),
                          [](double a, double b) { return (a == 0.0) == (b == 0.0); });
    };
    return count == other.count && resampled == other.resampled && kicks == other.kicks && dither == other.dither &&
           swings == other.swings && nonzero == other.nonzero && same_zeros();
}

}  // namespace ringlock::closure
