// Mean phase accelerations at turns in vector lanes, for sources that are compiled once for each instruction set.
#if defined(RINGLOCK_ACCELERATION_AVERAGE) == defined(HWY_TARGET_TOGGLE)
#ifdef RINGLOCK_ACCELERATION_AVERAGE
#undef RINGLOCK_ACCELERATION_AVERAGE
#else
#define RINGLOCK_ACCELERATION_AVERAGE
#endif

#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::compensate::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Mean of the positive values seen: of all of them at first, then of about the last 512. The lock-in distorts the
/// acceleration that two pulses give, in step with the phase; over many turns that averages out.
template <class V>
struct AverageOf {
    V mean, count;

    template <class D>
    HWY_INLINE V update(D d, V value) {
        constexpr double memory_turns = 512.0;
        const V zero = hn::Zero(d);
        const auto seen = value > zero;
        count = hn::IfThenElse(seen, hn::Min(count + hn::Set(d, 1.0), hn::Set(d, memory_turns)), count);
        const V share = (value - mean) / hn::Max(count, hn::Set(d, 1.0));
        mean = mean + hn::IfThenElseZero(seen, share);
        return mean;
    }
};

}  // namespace ringlock::compensate::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#endif
