#include "tests/closure/suite/device.hpp"

#include <cmath>
#include <initializer_list>
#include <random>

#include "engine/core/units.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/gyro/theory.hpp"

namespace ringlock::test::closure {

namespace {

/// Kicks up to this are those of gyros that are built.
void draw_other(Device& d, std::mt19937_64& random) {
    constexpr double largest_kick_rad = 0.4;
    constexpr double least_fringes = 110.0;  // in a half cycle, for the turn map
    const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    const auto even = [&](double a, double b) { return std::exp(between(std::log(a), std::log(b))); };
    const auto one_of = [&](std::initializer_list<double> all) {
        return all.begin()[std::uniform_int_distribution<std::size_t>(0, all.size() - 1)(random)];
    };
    gyro::Setup setup;
    do {
        setup.scale_factor_arcsec = one_of({0.3, 0.5, 0.8, 1.2, 2.0, 3.0});
        setup.dither_frequency_hz = even(110.0, 600.0);
        setup.dither_peak_rate_deg_s = even(40.0, 300.0);
        setup.lockin_threshold_deg_h = even(40.0, 1500.0);
    } while (gyro::turn_kick_rad(setup) > largest_kick_rad ||
             units::arcsec_per_deg * setup.dither_peak_rate_deg_s <
                 least_fringes * units::pi * setup.scale_factor_arcsec * setup.dither_frequency_hz);
    d.scale_factor_arcsec = setup.scale_factor_arcsec;
    d.dither_frequency_hz = setup.dither_frequency_hz;
    d.peak_rate_deg_s = setup.dither_peak_rate_deg_s;
    d.threshold_deg_h = setup.lockin_threshold_deg_h;
    d.declared_threshold_deg_h = d.threshold_deg_h * between(0.7, 1.3);
    d.readout_noise = one_of({0.001, 0.005, 0.02});
    d.injected_rad = one_of({0.0, 0.0, 0.5, 1.5, 3.0});
    if (between(0.0, 1.0) < 1.0 / 3.0) d.rate_deg_h = between(-1.0, 1.0);  // at rest, its bias alone
}

}  // namespace

Device device_of(const Case& of) {
    std::mt19937_64 random(of.seed);
    const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    const double threshold_deg_h = of.gyro ? of.gyro->lockin_threshold_deg_h : nominal_threshold_deg_h;
    const double peak_rate_deg_s = of.gyro ? of.gyro->dither_peak_rate_deg_s : 109.1;
    Device d{threshold_deg_h * between(0.8, 1.2), peak_rate_deg_s * between(0.9, 1.1), between(-100.0, 100.0)};
    d.declared_threshold_deg_h = threshold_deg_h;
    d.injected_rad = of.condition->injected_rad;
    if (of.gyro) {
        d.scale_factor_arcsec = of.gyro->scale_factor_arcsec;
        d.dither_frequency_hz = of.gyro->dither_frequency_hz;
    }
    if (of.condition->other_gyro) draw_other(d, random);
    d.duration_s = 0.5 * static_cast<double>(of.turns) / d.dither_frequency_hz;
    if (of.condition->moving) {
        d.rate_deg_h = 0.0;
        double time_s = 0.0;
        double rate = between(-300.0, 300.0);
        while (time_s < d.duration_s) {
            const double next = between(-300.0, 300.0);
            const double hold_s = between(0.1, 0.3) * d.duration_s;
            for (const double t : {time_s, time_s + hold_s}) {
                d.profile_time_s.push_back(t);
                d.profile_rate_deg_h.push_back(rate);
            }
            time_s += hold_s + 1.0;
            rate = next;
        }
    }
    return d;
}

}  // namespace ringlock::test::closure
