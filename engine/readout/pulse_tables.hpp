#pragma once
#include <array>
#include <span>

#include "engine/gyro/device.hpp"
#include "engine/readout/electronics.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::readout {

/// arcsin(y) = y (1 + y^2 (these in powers of y^2)).
inline constexpr double arcsin_series[] = {1.0 / 6,       3.0 / 40,         15.0 / 336,         105.0 / 3456,
                                           945.0 / 42240, 10395.0 / 599040, 135135.0 / 9676800, 2027025.0 / 175472640};

/// When the phase passes quarter fringes next to a turn: times of the pulses nearest to the zero-rate point on each
/// side, as functions of the phase there.
///
/// With x the phase turned upright (psi + coupling phase at minima, its negative at maxima), d the phase from the
/// extremum to the pulse and a the phase acceleration, t sqrt(a) = sqrt(2 d) (S + R). S = arccos(1 - s)/sqrt(2 s) is
/// that of the dither's cosine, s = d w^2/a; a parabola has S = 1. R is the bend by the lock-in, a smooth function of
/// sqrt(d), since it is proportional to the third power of t, for each of the four quarters that the pulse may begin:
/// polynomials from the equation of motion, solved from the zero-rate point outwards. Amplitude noise and rates that
/// vary enter through a.
///
/// The half cycle of that side is assumed to apply from the zero-rate point on, even where the dither turns only
/// between that point and the pulses. Where accelerations differ between the sides by a share q, both pulses of one
/// side are misplaced by up to q times the time between the two turns; the interval between them is not, to first
/// order.
struct PulseTables {
    static constexpr std::size_t terms = 10;
    static constexpr std::size_t quarters = 4;
    /// Phases of the coupling at which tables stand where it varies: evenly round the circle, from the gyro's own on. R
    /// is interpolated between them by the first two harmonics of the phase; first order in b/sqrt(a) has no others.
    static constexpr std::size_t phases = 5;

    /// Polynomial in 2 sqrt(d1/(pi/2)) - 1, d1 the distance of the first pulse: [quarter][power].
    using Times = std::array<std::array<simd::Lanes, terms>, quarters>;
    /// [minimum, maximum][before, after][pulse, nearest first]
    std::array<std::array<std::array<Times, kept_pulses>, 2>, 2> times;
    std::size_t used = 1;  ///< terms that some gyro needs; they are zero for gyros that do not need them
    /// For each gyro, the inverse of b/sqrt(a) of the tables, to which R is proportional; 0 without lock-in. [sides:
    /// positive, negative]
    simd::Lanes inverse_bend[2];

    /// Makes the tables of one gyro for so many pulses on each side, at most kept_pulses. Throws RunError where the
    /// phase does not pass as many quarter fringes on either side of a turn.
    void make(std::size_t lane, const gyro::Device& device, std::size_t pulses);

    /// S of a cosine, at s = d w^2/a below 0.5.
    static double sinusoid_factor(double share);
    /// Polynomial of a table at the quarter and distance, for tests: R.
    static double at(const Times& times, std::size_t lane, std::size_t quarter, double first_distance_rad);
};

}  // namespace ringlock::readout
