#include "engine/propagate/phase_kernel.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/propagate/phase_kernel.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::propagate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

/// Amplitude, rate and coupling scaled to [-1, 1].
struct Scaled {
    V amplitude, rate, coupling;
};

HWY_INLINE Scaled scaled(D d, const PhaseTables& tables, const gyro::LaneDrive& drive, std::size_t row,
                         std::size_t lane) {
    const auto one = [&](const std::vector<simd::Lanes>& rows, std::size_t variable) HWY_ATTR {
        const V value = hn::Load(d, rows[row].data() + lane);
        const V centre = hn::Load(d, tables.centre()[variable].data() + lane);
        return (value - centre) * hn::Load(d, tables.inverse_half_width()[variable].data() + lane);
    };
    return {one(drive.amplitude_rad, 0), one(drive.rate_rad_s, 1), one(drive.b_rad_s, 2)};
}

/// Coefficient of one harmonic. Terms that a gyro does not have are zeros: 0 x + c is c to the bit.
HWY_INLINE sm::Complex<V> coefficient(D d, const PhaseTables::Harmonic& harmonic, std::size_t lane, const Scaled& at) {
    const auto [amplitudes, rates, couplings, changes] = harmonic.terms;
    const simd::Lanes* row = harmonic.coefficients.data() + 2 * amplitudes * rates * couplings;
    const V zero = hn::Zero(d);
    sm::Complex<V> sum{zero, zero};
    for (std::size_t c = 0; c < couplings; ++c) {
        sm::Complex<V> over_rate{zero, zero};
        for (std::size_t b = 0; b < rates; ++b) {
            row -= 2;
            sm::Complex<V> over_amplitude{hn::Load(d, row[0].data() + lane), hn::Load(d, row[1].data() + lane)};
            for (std::size_t a = 1; a < amplitudes; ++a) {
                row -= 2;
                over_amplitude.re = sm::fma(d, over_amplitude.re, at.amplitude, hn::Load(d, row[0].data() + lane));
                over_amplitude.im = sm::fma(d, over_amplitude.im, at.amplitude, hn::Load(d, row[1].data() + lane));
            }
            over_rate.re = sm::fma(d, over_rate.re, at.rate, over_amplitude.re);
            over_rate.im = sm::fma(d, over_rate.im, at.rate, over_amplitude.im);
        }
        sum.re = sm::fma(d, sum.re, at.coupling, over_rate.re);
        sum.im = sm::fma(d, sum.im, at.coupling, over_rate.im);
    }
    return sum;
}

/// Harmonics of a part but for the constant one, at an angle of which sine and cosine are given [fringes].
HWY_INLINE V waves(D d, const PhaseTables::Part& part, std::size_t lane, const Scaled& at, V sine, V cosine) {
    const sm::Complex<V> w{cosine, sine};
    sm::Complex<V> sum{hn::Zero(d), hn::Zero(d)};
    for (std::size_t k = part.size() - 1; k >= 1; --k) {
        sum = sm::mul_add(d, sum, w, coefficient(d, part[k], lane, at));
    }
    return sm::fnma(d, sum.im, sine, sum.re * cosine);
}

/// `group` vectors side by side: the turns of one hide the latency of the other's.
template <std::size_t group>
void step(const PhaseTables& tables, const gyro::LaneDrive& drive, std::size_t first_lane, PhaseState& state,
          gyro::LaneTurns* turns) {
    const D d;
    const std::size_t width = hn::Lanes(d);
    V lockin[group], phase[group];
    Scaled before[group];
    for (std::size_t g = 0; g < group; ++g) {
        const std::size_t lane = first_lane + g * width;
        lockin[g] = hn::Load(d, state.lockin_fringes.data() + lane);
        phase[g] = hn::Load(d, state.coupling_phase_fringes.data() + lane);
        before[g] = scaled(d, tables, drive, 0, lane);
        if (turns != nullptr) hn::Store(hn::Load(d, state.whole.data() + lane), d, turns->lockin_whole.data() + lane);
    }
    const bool middles = turns != nullptr && turns->middles;
    for (std::size_t i = 0; i < drive.turns; ++i) {
        const double direction = drive.direction(i);
        const PhaseTables::Part& begin = tables.part(direction, 0);
        const PhaseTables::Part& end = tables.part(-direction, 1);
        const bool arriving = i > 0 || state.under_way;
        for (std::size_t g = 0; g < group; ++g) {
            const std::size_t lane = first_lane + g * width;
            if (drive.phases_vary) phase[g] = hn::Load(d, drive.coupling_phase_fringes[i].data() + lane);
            const V plain = hn::Load(d, drive.plain_fringes[i].data() + lane) + phase[g];
            V sine, cosine;
            if (arriving) {
                const sm::Complex<V> constant = coefficient(d, end[0], lane, before[g]);
                const V shifted = lockin[g] + constant.im;
                sm::sincos(d, plain + shifted, sine, cosine);
                lockin[g] = shifted + (constant.re + waves(d, end, lane, before[g], sine, cosine));
            }
            sm::sincos(d, plain + lockin[g], sine, cosine);
            if (turns != nullptr) {
                hn::Store(cosine, d, turns->cosine[i].data() + lane);
                hn::Store(sine, d, turns->sine[i].data() + lane);
                hn::Store(lockin[g], d, turns->lockin_fringes[i].data() + lane);
            }
            if (drive.phases_vary) {
                // psi is continuous, and psi + coupling phase jumps with the coupling phase.
                const V next = hn::Load(d, drive.coupling_phase_fringes[i + 1].data() + lane);
                sm::sincos(d, plain + (next - phase[g]) + lockin[g], sine, cosine);
            }
            before[g] = scaled(d, tables, drive, i + 1, lane);
            const V constant = coefficient(d, begin[0], lane, before[g]).re;
            lockin[g] = lockin[g] + (constant + waves(d, begin, lane, before[g], sine, cosine));
            if (middles) hn::Store(lockin[g], d, turns->lockin_middle_fringes[i].data() + lane);
        }
    }
    for (std::size_t g = 0; g < group; ++g) {
        const std::size_t lane = first_lane + g * width;
        const V whole = sm::nearest(d, lockin[g]);
        hn::Store(lockin[g] - whole, d, state.lockin_fringes.data() + lane);
        hn::Store(hn::Load(d, state.whole.data() + lane) + whole, d, state.whole.data() + lane);
    }
}

void step_lanes(const PhaseTables& tables, const gyro::LaneDrive& drive, std::size_t lanes, PhaseState& state,
                gyro::LaneTurns* turns) {
    const std::size_t width = hn::Lanes(D());
    std::size_t lane = 0;
    for (; lane + width < lanes; lane += 2 * width) step<2>(tables, drive, lane, state, turns);
    for (; lane < lanes; lane += width) step<1>(tables, drive, lane, state, turns);
}

}  // namespace ringlock::propagate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::propagate {

HWY_EXPORT(step_lanes);

void step_phases(const PhaseTables& tables, const gyro::LaneDrive& drive, std::size_t lanes, PhaseState& state,
                 gyro::LaneTurns* turns) {
    if (turns != nullptr) turns->resize(drive.turns);
    HWY_DYNAMIC_DISPATCH(step_lanes)(tables, drive, lanes, state, turns);
    state.under_way = state.under_way || drive.turns > 0;
}

}  // namespace ringlock::propagate
#endif
