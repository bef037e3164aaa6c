// Half turns of the tables in vector lanes, for sources that are compiled once for each instruction set.
#if defined(RINGLOCK_TURN_TABLES) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGLOCK_TURN_TABLES
#undef RINGLOCK_TURN_TABLES
#else
#define RINGLOCK_TURN_TABLES
#endif

#include "engine/propagate/turn_tables.hpp"
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::propagate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

/// One half of a half cycle.
template <class V>
struct HalfMapOf {
    V shift, z_re, z_im;
};

/// The half turn in the middle of the ranges.
template <class D>
HWY_INLINE HalfMapOf<hn::Vec<D>> middle(D d, const TurnTables::Part& part, std::size_t lane) {
    const simd::Lanes* row = part.coefficients.data();
    return {hn::Load(d, row[0].data() + lane), hn::Load(d, row[1].data() + lane), hn::Load(d, row[2].data() + lane)};
}

/// Polynomials of one part at the scaled variables.
template <class D, class V>
HWY_INLINE HalfMapOf<V> evaluate(D d, const TurnTables::Part& part, std::size_t lane, V amplitude, V rate, V coupling,
                                 V change) {
    const auto [amplitudes, rates, couplings, changes] = part.terms;
    std::size_t group = rates * couplings * changes;
    // Terms that a gyro does not have are zeros: 0 x + c is c to the bit.
    const V zero = hn::Zero(d);
    V sum[3] = {zero, zero, zero};
    for (std::size_t e = 0; e < changes; ++e) {
        V over_coupling[3] = {zero, zero, zero};
        for (std::size_t c = 0; c < couplings; ++c) {
            V over_rate[3] = {zero, zero, zero};
            for (std::size_t b = 0; b < rates; ++b) {
                --group;
                const simd::Lanes* row =
                    part.coefficients.data() + 3 * (group * amplitudes + part.amplitude_terms[group]) - 3;
                V over_amplitude[3];
                for (std::size_t k = 0; k < 3; ++k) over_amplitude[k] = hn::Load(d, row[k].data() + lane);
                for (std::size_t a = 1; a < part.amplitude_terms[group]; ++a) {
                    row -= 3;
                    for (std::size_t k = 0; k < 3; ++k) {
                        over_amplitude[k] = sm::fma(d, over_amplitude[k], amplitude, hn::Load(d, row[k].data() + lane));
                    }
                }
                for (std::size_t k = 0; k < 3; ++k) over_rate[k] = sm::fma(d, over_rate[k], rate, over_amplitude[k]);
            }
            for (std::size_t k = 0; k < 3; ++k) {
                over_coupling[k] = sm::fma(d, over_coupling[k], coupling, over_rate[k]);
            }
        }
        for (std::size_t k = 0; k < 3; ++k) sum[k] = sm::fma(d, sum[k], change, over_coupling[k]);
    }
    return {sum[0], sum[1], sum[2]};
}

}  // namespace ringlock::propagate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
