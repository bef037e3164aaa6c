// Pulse tables in vector lanes, for sources that are compiled once for each instruction set.
#if defined(RINGLOCK_PULSE_TABLES) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGLOCK_PULSE_TABLES
#undef RINGLOCK_PULSE_TABLES
#else
#define RINGLOCK_PULSE_TABLES
#endif

#include <array>
#include <span>

#include "engine/gyro/lane_drive.hpp"
#include "engine/readout/pulse_tables.hpp"
#include "engine/readout/readout_constants.hpp"
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

/// The quarter of whole numbers of quarter fringes, modulo 4.
template <class D, class V>
HWY_INLINE QuarterOf<D> quarter_of(D d, V number) {
    const V index = number - hn::Set(d, 4.0) * hn::Floor(number * hn::Set(d, 0.25));  // 0...3
    const auto upper = index > hn::Set(d, 1.5);
    const V in_pair = index - hn::IfThenElseZero(upper, hn::Set(d, 2.0));
    return {in_pair > hn::Set(d, 0.5), upper};
}

/// The one of four tables' values that belongs to the quarter, in each lane.
template <class D, class Table>
HWY_INLINE hn::Vec<D> pick(D d, const QuarterOf<D>& quarter, const Table& of, std::size_t lane) {
    const auto value = [&](std::size_t number) HWY_ATTR { return hn::Load(d, of[number].data() + lane); };
    return hn::IfThenElse(quarter.upper, hn::IfThenElse(quarter.odd, value(3), value(2)),
                          hn::IfThenElse(quarter.odd, value(1), value(0)));
}

/// S of PulseTables: the times of pulses on the dither's cosine over those on a parabola.
template <class D, class V>
HWY_INLINE V sinusoid_factor(D d, V share) {
    const V half = share * hn::Set(d, 0.5);
    return sm::fma(d, half, sm::polynomial(d, half, arcsin_series), hn::Set(d, 1.0));
}

/// Bends of the times of pulses by the lock-in, R of PulseTables: [before, after][nearest first].
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

/// Shares of the tables at PulseTables::phases, for the half cycles before and after a turn; not set where the
/// coupling's phase does not vary.
template <class V>
struct PhaseWeights {
    V values[2][PulseTables::phases];
};

/// Trigonometric interpolation (A. Zygmund, "Trigonometric Series", 1959, chapter X): (1 + 2 cos x_j + 2 cos 2 x_j)/5,
/// x_j the phase less that of table j.
template <class D, class V = hn::Vec<D>>
HWY_INLINE PhaseWeights<V> phase_weights(D d, const ReadoutConstants& constants, const gyro::LaneDrive& drive,
                                         std::size_t i, std::size_t lane) {
    PhaseWeights<V> weights;
    if (!drive.phases_vary) return weights;
    const V own = hn::Load(d, constants.coupling_phase_fringes.data() + lane);
    for (std::size_t side = 0; side < 2; ++side) {
        const V beyond = hn::Load(d, drive.coupling_phase_fringes[i + side].data() + lane) - own;
        for (std::size_t j = 0; j < PulseTables::phases; ++j) {
            V sine, cosine;
            sm::sincos(d, beyond - hn::Set(d, static_cast<double>(j) / PulseTables::phases), sine, cosine);
            // 1 + 2 cos x + 2 cos 2 x = 4 cos^2 x + 2 cos x - 1
            const V two = cosine + cosine;
            weights.values[side][j] =
                sm::fma(d, two, two, two - hn::Set(d, 1.0)) * hn::Set(d, 1.0 / PulseTables::phases);
        }
    }
    return weights;
}

/// The same by the tables of `tables`: one, or as many as there are weights.
template <std::size_t pulses, class D, class V = hn::Vec<D>>
HWY_INLINE PulseFactors<V, pulses> pulse_factors(D d, std::span<const PulseTables> tables, std::size_t after_side,
                                                 std::size_t lane, const QuarterOf<D>& quarter, V x,
                                                 const PhaseWeights<V>& weights) {
    auto factors = pulse_factors<pulses>(d, tables[0].times[after_side], tables[0].used, lane, quarter, x);
    for (std::size_t j = 0; tables.size() > 1 && j < tables.size(); ++j) {
        const auto at = pulse_factors<pulses>(d, tables[j].times[after_side], tables[j].used, lane, quarter, x);
        for (std::size_t side = 0; side < 2; ++side) {
            for (std::size_t pulse = 0; pulse < pulses; ++pulse) {
                V& sum = factors.values[side][pulse];
                sum = sm::fma(d, at.values[side][pulse], weights.values[side][j], j == 0 ? hn::Zero(d) : sum);
            }
        }
    }
    return factors;
}

}  // namespace ringlock::readout::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
