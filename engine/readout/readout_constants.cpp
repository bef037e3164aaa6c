#include "engine/readout/readout_constants.hpp"

#include <algorithm>
#include <cmath>

namespace ringlock::readout {

ComparatorPoints comparator_points(const gyro::Ellipse& ellipse) {
    // (1 + gain) sin psi + offset_sin = 0 and cos(psi + orthogonality) + offset_cos = 0
    const double amplitude = 1.0 + ellipse.gain;
    const double of_sin = std::asin(std::clamp(ellipse.offset_sin / amplitude, -1.0, 1.0));
    const double of_cos = std::asin(std::clamp(ellipse.offset_cos, -1.0, 1.0));
    const double o = ellipse.orthogonality_rad;
    return {{-of_sin, of_cos - o, of_sin, -of_cos - o}, {amplitude, 1.0, amplitude, 1.0}};
}

ReadoutConstants make_readout_constants(std::span<const gyro::Device> devices,
                                        std::span<const gyro::Ellipse> ellipses) {
    ReadoutConstants c;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const std::size_t which = std::min(lane, devices.size() - 1);
        const gyro::Device& device = devices[which];
        const gyro::Ellipse& ellipse = ellipses[which];
        const double root = std::sqrt(device.dither_amplitude_rad);
        c.duration_s[0][lane] = device.positive_duration_s;
        c.duration_s[1][lane] = device.negative_duration_s;
        c.scale_angle[lane] = 1.0 / root;
        for (const std::size_t side : {0U, 1U}) {
            c.angular_frequency_rad_s[side][lane] = units::pi / c.duration_s[side][lane];
            c.scale_s[side][lane] = 1.0 / (c.angular_frequency_rad_s[side][lane] * root);
        }
        c.harmonic_ratio[lane] = device.harmonic_ratio;
        c.harmonic_sine[lane] = std::sin(device.harmonic_phase_rad);
        c.harmonic_cosine[lane] = std::cos(device.harmonic_phase_rad);
        c.turn_asymmetry[lane] = device.coupling.turn_asymmetry;
        c.coupling_cosine[lane] = std::cos(device.coupling.phase_rad);
        c.coupling_sine[lane] = std::sin(device.coupling.phase_rad);
        c.coupling_phase_fringes[lane] = device.coupling.phase_rad / units::two_pi;
        c.gain[lane] = 1.0 + ellipse.gain;
        c.offset_sin[lane] = ellipse.offset_sin;
        c.offset_cos[lane] = ellipse.offset_cos;
        c.orthogonality_cosine[lane] = std::cos(ellipse.orthogonality_rad);
        c.orthogonality_sine[lane] = std::sin(ellipse.orthogonality_rad);
        c.swing_whole[lane] = std::nearbyint(2.0 * device.dither_amplitude_rad / units::two_pi);
        c.second_ratio[lane] = device.coupling.second_ratio;
        c.second_sine[lane] = std::sin(device.coupling.second_from_first_rad());
        c.second_cosine[lane] = std::cos(device.coupling.second_from_first_rad());
        c.extras = c.extras || device.coupling.second_ratio != 0.0 || device.coupling.turn_asymmetry != 0.0 ||
                   device.harmonic_ratio != 0.0;
        const ComparatorPoints points = comparator_points(ellipse);
        for (std::size_t number = 0; number < 4; ++number) {
            c.comparator_shift_rad[number][lane] = points.shift_rad[number];
            c.comparator_amplitude[number][lane] = points.amplitude[number];
        }
    }
    return c;
}

}  // namespace ringlock::readout
