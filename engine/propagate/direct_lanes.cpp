#include "engine/propagate/direct_lanes.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <complex>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/propagate/direct_lanes.cpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

#ifndef RINGLOCK_DIRECT_BATCH
#define RINGLOCK_DIRECT_BATCH
namespace ringlock::propagate {
namespace {

/// Stretches side by side, one in each lane.
struct Batch {
    simd::Lanes sign, amplitude_rad, duration_s, angular_frequency_rad_s, rate_rad_s;
    simd::Lanes harmonic_ratio, harmonic_cosine, harmonic_sine;
    simd::Lanes amplitude_change_rad;
    simd::Lanes b_rad_s, turn_asymmetry;
    simd::Lanes second_sine, second_cosine;  ///< of 2 theta in the coupling, over that of sin(theta)
    simd::Lanes start_fringes;               ///< theta = psi + coupling phase
    simd::Lanes end_s, first_scale_s, shortest_s, step_tolerance_rad;
    bool second = false;    ///< some coupling has a second harmonic
    bool changing = false;  ///< some amplitude changes over its half cycle
    bool swing = false;     ///< some coupling differs from turn to turn
    // Results
    simd::Lanes lockin_rad, cosine, sine, steps;
    simd::Lanes failed;  ///< not 0 where the steps became too short
};

}  // namespace
}  // namespace ringlock::propagate
#endif

HWY_BEFORE_NAMESPACE();
namespace ringlock::propagate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

/// Taylor order. Work per step is proportional to its square, and the length of a step is that of convergence (the
/// solution has poles at ln(2 g/b)/g in imaginary time) times the order-th root of the tolerance: between 1e-8 and
/// 1e-11 rad, 20 to 24 cost least.
constexpr std::size_t order = 24;

/// Approximately the order-th root of a value near one, by square roots, which are exact on every machine: power 1/32 +
/// 1/128.
HWY_INLINE V root(V x) {
    for (int i = 0; i < 5; ++i) x = hn::Sqrt(x);
    return x * hn::Sqrt(hn::Sqrt(x));
}

/// `group` vectors side by side: the sums of one hide the latency of the other's.
template <std::size_t group, bool second, bool swing>
void integrate_vectors(Batch& batch, std::size_t first_lane) {
    const D d;
    const std::size_t width = hn::Lanes(d);
    const V zero = hn::Zero(d);
    const V one = hn::Set(d, 1.0);
    const V two = hn::Set(d, 2.0);
    const V per_two_pi = hn::Set(d, 0.15915494309189535);
    const auto load = [&](const simd::Lanes& from, std::size_t g)
                          HWY_ATTR { return hn::Load(d, from.data() + first_lane + g * width); };
    const auto store = [&](V value, simd::Lanes& to, std::size_t g)
                           HWY_ATTR { hn::Store(value, d, to.data() + first_lane + g * width); };

    const bool changing = batch.changing;
    V t[group], scale[group], gain[group], steps[group], end[group], failed[group];
    for (std::size_t g = 0; g < group; ++g) {
        t[g] = gain[g] = steps[g] = failed[g] = zero;
        scale[g] = load(batch.first_scale_s, g);
        end[g] = load(batch.end_s, g);
    }
    for (bool first = true;; first = false) {
        bool done = true;
        for (std::size_t g = 0; g < group; ++g) done = done && hn::AllTrue(d, t[g] >= end[g]);
        if (done && !first) break;

        // Series in powers of (time - t)/scale: theta' = plain + coupling, S = sin theta, Q = cos theta.
        V s[order][group], q[order][group];
        V weighted[order + 1][group];                                    // n theta_n
        V lockin[order + 1][group];                                      // of the phase that the lock-in adds
        V s2[second ? order : 1][group], q2[second ? order : 1][group];  // sine and cosine of 2 theta
        V f[swing ? order : 1][group], bs[swing ? order : 1][group];
        V cycle[4][group], doubled[4][group];  // sin(w t) and sin(2 w t + f) with their derivatives
        V x[group], first_term[group], second_term[group], swing_term[group], growth_term[group], b[group];
        for (std::size_t g = 0; g < group; ++g) {
            V half_sine, half_cosine;
            sm::sincos(d, hn::Set(d, 0.25) * (t[g] / load(batch.duration_s, g)), half_sine, half_cosine);
            const V versine = two * half_sine * half_sine;
            const V sine = two * half_sine * half_cosine;
            const V cosine = one - versine;
            const V cf = load(batch.harmonic_cosine, g);
            const V sf = load(batch.harmonic_sine, g);
            const V shifted_sine = sm::fma(d, sine, cf, cosine * sf);  // sin(w t + f)
            const V shifted_cosine = sm::fnma(d, sine, sf, cosine * cf);
            const V sign = load(batch.sign, g);
            const V ratio = load(batch.harmonic_ratio, g);
            const V amplitude = load(batch.amplitude_rad, g);
            const V rate = load(batch.rate_rad_s, g);
            const V swings = sm::fma(d, sign, versine, ratio * shifted_sine * sine);
            V plain = sm::fma(d, rate, t[g], amplitude * swings);
            if (changing) {
                // (sin x - x cos x)/pi - (1 - cos x)/2, x = w t
                const V angle = hn::Set(d, 3.141592653589793) * (t[g] / load(batch.duration_s, g));
                const V grown = sm::fma(d, sm::fnma(d, angle, cosine, sine), hn::Set(d, 0.3183098861837907),
                                        versine * hn::Set(d, -0.5));
                plain = sm::fma(d, sign * load(batch.amplitude_change_rad, g), grown, plain);
            }
            const V theta = sm::fma(d, plain + gain[g], per_two_pi, load(batch.start_fringes, g));
            sm::sincos(d, theta, s[0][g], q[0][g]);
            if constexpr (second) {
                s2[0][g] = two * s[0][g] * q[0][g];
                q2[0][g] = sm::fnma(d, two * s[0][g], s[0][g], one);
            }
            if (first) {
                store(s[0][g], batch.sine, g);
                store(q[0][g], batch.cosine, g);
            }
            cycle[0][g] = sine;
            cycle[1][g] = cosine;
            doubled[0][g] = sm::fma(d, shifted_sine, cosine, shifted_cosine * sine);
            doubled[1][g] = sm::fnma(d, shifted_sine, sine, shifted_cosine * cosine);
            for (std::size_t i = 0; i < 2; ++i) {
                cycle[i + 2][g] = hn::Neg(cycle[i][g]);
                doubled[i + 2][g] = hn::Neg(doubled[i][g]);
            }
            x[g] = load(batch.angular_frequency_rad_s, g) * scale[g];
            first_term[g] = sign * amplitude * x[g];
            second_term[g] = ratio * amplitude * x[g];
            growth_term[g] = zero;
            if (changing) {
                const V change = sign * load(batch.amplitude_change_rad, g);
                const V share = t[g] / load(batch.duration_s, g);
                const V grown = change * (share - hn::Set(d, 0.5));
                first_term[g] = sm::fma(d, grown, x[g], first_term[g]);
                growth_term[g] = change * hn::Set(d, 0.3183098861837907) * x[g] * x[g];
            }
            b[g] = load(batch.b_rad_s, g) * scale[g];
            swing_term[g] = sign * load(batch.turn_asymmetry, g) * b[g];
        }
        for (std::size_t n = 0; n < order; ++n) {
            const V inverse = hn::Set(d, 1.0 / static_cast<double>(std::max<std::size_t>(n, 1)));
            if (n > 0) {
                // Even and odd terms side by side halve the chain of dependent operations.
                V sum_s[2][group], sum_q[2][group], sum_s2[2][group], sum_q2[2][group];
                for (std::size_t p = 0; p < 2; ++p) {
                    for (std::size_t g = 0; g < group; ++g) sum_s[p][g] = sum_q[p][g] = zero;
                    for (std::size_t g = 0; g < group; ++g) sum_s2[p][g] = sum_q2[p][g] = zero;
                }
                const auto add = [&](std::size_t p, std::size_t j) HWY_ATTR {
                    for (std::size_t g = 0; g < group; ++g) {
                        const V factor = weighted[j][g];
                        sum_s[p][g] = sm::fma(d, factor, q[n - j][g], sum_s[p][g]);
                        sum_q[p][g] = sm::fnma(d, factor, s[n - j][g], sum_q[p][g]);
                        if constexpr (second) {
                            sum_s2[p][g] = sm::fma(d, factor, q2[n - j][g], sum_s2[p][g]);
                            sum_q2[p][g] = sm::fnma(d, factor, s2[n - j][g], sum_q2[p][g]);
                        }
                    }
                };
                std::size_t j = 1;
                for (; j < n; j += 2) {
                    add(0, j);
                    add(1, j + 1);
                }
                if (j == n) add(0, j);
                for (std::size_t g = 0; g < group; ++g) {
                    s[n][g] = (sum_s[0][g] + sum_s[1][g]) * inverse;
                    q[n][g] = (sum_q[0][g] + sum_q[1][g]) * inverse;
                    if constexpr (second) {
                        s2[n][g] = (sum_s2[0][g] + sum_s2[1][g]) * (inverse + inverse);
                        q2[n][g] = (sum_q2[0][g] + sum_q2[1][g]) * (inverse + inverse);
                    }
                    const V factor = x[g] * inverse;
                    first_term[g] = first_term[g] * factor;
                    second_term[g] = second_term[g] * (factor + factor);
                    swing_term[g] = swing_term[g] * factor;
                }
            }
            for (std::size_t g = 0; g < group; ++g) {
                V right = sm::fma(d, first_term[g], cycle[n % 4][g], second_term[g] * doubled[n % 4][g]);
                if (changing && n > 0) {
                    right = sm::fma(d, growth_term[g], cycle[(n - 1) % 4][g], right);
                    growth_term[g] = growth_term[g] * x[g] * inverse;
                }
                if (n == 0) right = sm::fma(d, load(batch.rate_rad_s, g), scale[g], right);
                V coupled = s[n][g];
                if constexpr (second) {
                    coupled = sm::fma(d, load(batch.second_sine, g), s2[n][g], coupled);
                    coupled = sm::fma(d, load(batch.second_cosine, g), q2[n][g], coupled);
                }
                V added = b[g] * coupled;
                if constexpr (swing) {
                    f[n][g] = coupled;
                    bs[n][g] = swing_term[g] * cycle[(n + 1) % 4][g];
                    for (std::size_t j = 0; j <= n; ++j) added = sm::fma(d, bs[j][g], f[n - j][g], added);
                }
                weighted[n + 1][g] = right + added;
                lockin[n + 1][g] = added * hn::Set(d, 1.0 / static_cast<double>(n + 1));
            }
        }
        for (std::size_t g = 0; g < group; ++g) {
            const auto active = t[g] < end[g];
            // The last term below the tolerance, and the one before it as good as.
            const V last = hn::Max(hn::Abs(lockin[order][g]), hn::Abs(lockin[order - 1][g]));
            V step = root(load(batch.step_tolerance_rad, g) / (last + hn::Set(d, 1e-300)));
            step = hn::Min(step, two);  // both terms may be small by chance
            const V wanted = step * scale[g];
            const auto too_short = hn::AndNot(wanted > load(batch.shortest_s, g), active);
            failed[g] = hn::IfThenElse(too_short, one, failed[g]);
            // The step taken is the difference of two representable times.
            V next = hn::Min(t[g] + wanted, end[g]);
            next = hn::IfThenElse(too_short, end[g], next);
            const V h = next - t[g];
            const V along = h / scale[g];
            V sum = lockin[order][g];
            for (std::size_t n = order - 1; n >= 1; --n) sum = sm::fma(d, sum, along, lockin[n][g]);
            gain[g] = hn::IfThenElse(active, sm::fma(d, sum, along, gain[g]), gain[g]);
            scale[g] = hn::IfThenElse(active, h, scale[g]);
            t[g] = hn::IfThenElse(active, next, t[g]);
            steps[g] = steps[g] + hn::IfThenElseZero(active, one);
        }
    }
    for (std::size_t g = 0; g < group; ++g) {
        store(gain[g], batch.lockin_rad, g);
        store(steps[g], batch.steps, g);
        store(failed[g], batch.failed, g);
    }
}

template <bool second, bool swing>
void integrate_lanes(Batch& batch, std::size_t lanes) {
    const std::size_t width = hn::Lanes(D());
    std::size_t lane = 0;
    for (; lane + width < lanes; lane += 2 * width) integrate_vectors<2, second, swing>(batch, lane);
    for (; lane < lanes; lane += width) integrate_vectors<1, second, swing>(batch, lane);
}

void integrate_batch(Batch& batch, std::size_t lanes) {
    // A coupling that a lane does not have adds exact zeros there.
    if (batch.second) {
        batch.swing ? integrate_lanes<true, true>(batch, lanes) : integrate_lanes<true, false>(batch, lanes);
    } else {
        batch.swing ? integrate_lanes<false, true>(batch, lanes) : integrate_lanes<false, false>(batch, lanes);
    }
}

}  // namespace ringlock::propagate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::propagate {

HWY_EXPORT(integrate_batch);

namespace {

void prepare(Batch& batch, std::size_t lane, const Stretch& stretch, double tolerance_rad) {
    const gyro::HalfCycle& half = stretch.half;
    const gyro::Coupling& coupling = stretch.coupling;
    batch.sign[lane] = half.sign;
    batch.amplitude_rad[lane] = half.amplitude_rad;
    batch.duration_s[lane] = half.duration_s;
    batch.angular_frequency_rad_s[lane] = half.angular_frequency_rad_s();
    batch.rate_rad_s[lane] = half.rate_rad_s;
    batch.harmonic_ratio[lane] = half.harmonic_ratio;
    batch.harmonic_cosine[lane] = std::cos(half.harmonic_phase_rad);
    batch.harmonic_sine[lane] = std::sin(half.harmonic_phase_rad);
    batch.amplitude_change_rad[lane] = half.amplitude_change_rad;
    batch.changing = batch.changing || half.amplitude_change_rad != 0.0;
    batch.b_rad_s[lane] = coupling.b_rad_s;
    batch.turn_asymmetry[lane] = coupling.turn_asymmetry;
    batch.second_sine[lane] = coupling.second_ratio * std::cos(coupling.second_from_first_rad());
    batch.second_cosine[lane] = coupling.second_ratio * std::sin(coupling.second_from_first_rad());
    batch.second = batch.second || coupling.second_ratio != 0.0;
    batch.swing = batch.swing || coupling.turn_asymmetry != 0.0;
    const double start = stretch.start_fringes + coupling.phase_rad / units::two_pi;
    batch.start_fringes[lane] = start - std::nearbyint(start);
    batch.end_s[lane] = stretch.end_s;
    const double fast = std::abs(coupling.b_rad_s) + std::abs(half.rate_rad_s) +
                        std::sqrt(half.end_acceleration_rad_s2()) + 1.0 / half.duration_s;
    batch.first_scale_s[lane] = 1.0 / fast;
    batch.shortest_s[lane] = 1e-12 * half.duration_s;
    // At most two steps a fringe, each with its share of the tolerance.
    const double travelled = 2.0 * half.amplitude_rad + std::abs(half.rate_rad_s) * half.duration_s;
    batch.step_tolerance_rad[lane] = tolerance_rad / (4.0 + travelled / units::pi);
}

}  // namespace

void integrate(std::span<const Stretch> stretches, double tolerance_rad, std::span<StretchResult> results) {
    for (std::size_t first = 0; first < stretches.size(); first += simd::lanes) {
        const std::size_t count = std::min(simd::lanes, stretches.size() - first);
        Batch batch;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            Stretch stretch = stretches[first + std::min(lane, count - 1)];
            if (lane >= count) stretch.end_s = 0.0;
            prepare(batch, lane, stretch, tolerance_rad);
        }
        HWY_DYNAMIC_DISPATCH(integrate_batch)(batch, count);
        for (std::size_t lane = 0; lane < count; ++lane) {
            if (batch.failed[lane] != 0.0) {
                throw RunError(
                    fmt::format("direct integrator: the step fell below {:.3g} s at a tolerance of {:.3g} rad; "
                                "raise propagation.direct_tolerance_rad",
                                batch.shortest_s[lane], tolerance_rad));
            }
            results[first + lane] = {batch.lockin_rad[lane], batch.cosine[lane], batch.sine[lane],
                                     static_cast<std::int64_t>(batch.steps[lane])};
        }
    }
}

DirectLanes::DirectLanes(std::span<const gyro::Device> devices, double tolerance_rad)
    : devices_(devices.begin(), devices.end()),
      tolerance_rad_(tolerance_rad),
      stretches_(devices.size()),
      results_(devices.size()) {}

void DirectLanes::step(const gyro::LaneDrive& drive, gyro::LaneTurns* turns) {
    if (turns != nullptr) {
        turns->resize(drive.turns);
        turns->lockin_whole = whole_;
        // Nothing is known of the frame of the turn map.
        for (simd::Lanes& row : turns->lockin_middle_fringes) {
            std::fill(std::begin(row.values), std::end(row.values), std::nan(""));
        }
    }
    for (std::size_t i = 0; i < drive.turns; ++i) {
        for (std::size_t lane = 0; lane < devices_.size(); ++lane) {
            Stretch& stretch = stretches_[lane];
            stretch.half = gyro::half_cycle_of(devices_[lane], drive, i + 1, lane);
            stretch.coupling = gyro::coupling_of(devices_[lane], drive, i + 1, lane);
            stretch.start_fringes = drive.plain_fringes[i][lane] + lockin_fringes_[lane];
            stretch.end_s = stretch.half.duration_s;
        }
        integrate(stretches_, tolerance_rad_, results_);
        for (std::size_t lane = 0; lane < devices_.size(); ++lane) {
            if (turns != nullptr) {
                std::complex<double> turn{results_[lane].cosine, results_[lane].sine};
                if (drive.phases_vary) {
                    const auto& phase_fringes = drive.coupling_phase_fringes;
                    turn *= std::polar(1.0, units::two_pi * (phase_fringes[i][lane] - phase_fringes[i + 1][lane]));
                }
                turns->cosine[i][lane] = turn.real();
                turns->sine[i][lane] = turn.imag();
                turns->lockin_fringes[i][lane] = lockin_fringes_[lane];
            }
            lockin_fringes_[lane] += results_[lane].lockin_rad / units::two_pi;
        }
    }
    for (std::size_t lane = 0; lane < devices_.size(); ++lane) {
        const double whole = std::nearbyint(lockin_fringes_[lane]);
        lockin_fringes_[lane] -= whole;
        whole_[lane] += whole;
    }
}

}  // namespace ringlock::propagate
#endif
