// Pulse tables in vector lanes, for sources that are compiled once for each instruction set.
#if defined(RINGLOCK_PULSE_TABLES) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGLOCK_PULSE_TABLES
#undef RINGLOCK_PULSE_TABLES
#else
#define RINGLOCK_PULSE_TABLES
#endif

#include "engine/readout/pulse_tables.hpp"
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::readout::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

/// One of four quarter fringes in each lane: 2 upper + odd.
template <class D>
struct QuarterOf {
    hn::Mask<D> odd, upper;
};

/// Of whole numbers of quarter fringes, modulo 4.
template <class D, class V>
HWY_INLINE QuarterOf<D> quarter_of(D d, V number) {
    const V index = number - hn::Set(d, 4.0) * hn::Floor(number * hn::Set(d, 0.25));  // 0...3
    const auto upper = index > hn::Set(d, 1.5);
    const V in_pair = index - hn::IfThenElseZero(upper, hn::Set(d, 2.0));
    return {in_pair > hn::Set(d, 0.5), upper};
}

/// What of four lanes' values belongs to the quarter.
template <class D, class Table>
HWY_INLINE hn::Vec<D> pick(D d, const QuarterOf<D>& quarter, const Table& of, std::size_t lane) {
    const auto value = [&](std::size_t number) HWY_ATTR { return hn::Load(d, of[number].data() + lane); };
    return hn::IfThenElse(quarter.upper, hn::IfThenElse(quarter.odd, value(3), value(2)),
                          hn::IfThenElse(quarter.odd, value(1), value(0)));
}

/// Times of pulses over the roots of twice their distances, R of PulseTables: [before, after][nearest first].
template <class V, std::size_t pulses>
struct PulseFactors {
    V values[2][pulses];
};

/// \param sides    tables of minima or of maxima
/// \param quarter  in which the phase, turned upright, has its extremum
/// \param x        2 sqrt(d1/(pi/2)) - 1, d1 the distance of the first pulse
template <std::size_t pulses, class D, class Sides, class V = hn::Vec<D>>
HWY_INLINE PulseFactors<V, pulses> pulse_factors(D d, const Sides& sides, std::size_t used, std::size_t lane,
                                                 const QuarterOf<D>& quarter, V x) {
    PulseFactors<V, pulses> sums;
    for (auto& side : sums.values) {
        for (V& sum : side) sum = hn::Zero(d);
    }
    for (std::size_t k = used; k-- > 0;) {
        for (std::size_t side = 0; side < 2; ++side) {
            for (std::size_t pulse = 0; pulse < pulses; ++pulse) {
                const PulseTables::Times& times = sides[side][pulse];
                const auto value = [&](std::size_t number)
                                       HWY_ATTR { return hn::Load(d, times[number][k].data() + lane); };
                const V low = hn::IfThenElse(quarter.odd, value(1), value(0));
                const V high = hn::IfThenElse(quarter.odd, value(3), value(2));
                V& sum = sums.values[side][pulse];
                sum = sm::fma(d, sum, x, hn::IfThenElse(quarter.upper, high, low));
            }
        }
    }
    return sums;
}

}  // namespace ringlock::readout::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
