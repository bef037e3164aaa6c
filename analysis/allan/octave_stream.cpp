#include "analysis/allan/octave_stream.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "analysis/allan/octave_stream.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include <algorithm>
#include <cmath>
#include <stdexcept>

HWY_BEFORE_NAMESPACE();
namespace ringlock::allan::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Products of the low halves of 64-bit lanes, taken as 32-bit numbers of the lanes' kind.
template <class D, class V>
HWY_INLINE V product(D d, V a, V b) {
#if HWY_TARGET == HWY_SCALAR
    using Whole = hn::TFromD<D>;
    using Half = hwy::MakeNarrow<Whole>;
    return hn::Set(d, static_cast<Whole>(static_cast<Half>(hn::GetLane(a))) *
                          static_cast<Whole>(static_cast<Half>(hn::GetLane(b))));
#else
    (void)d;
    const hn::Repartition<hwy::MakeNarrow<hn::TFromD<D>>, D> halves;
    return hn::MulEven(hn::BitCast(halves, a), hn::BitCast(halves, b));
#endif
}

/// |x|; that of -2^63 is 2^63.
template <class D, class V>
HWY_INLINE hn::Vec<hn::RebindToUnsigned<D>> magnitude(D d, V x) {
    (void)d;
    const hn::RebindToUnsigned<D> bits;
#if HWY_TARGET == HWY_SCALAR
    const auto sign = hn::BroadcastSignBit(x);  // the sign is chance, and a jump on it the dearest part of the loop
    return hn::BitCast(bits, hn::Xor(x, sign)) - hn::BitCast(bits, sign);
#else
    return hn::BitCast(bits, hn::Abs(x));
#endif
}

/// x_2m - 2 x_m + x_0 of the rows that end at `last`.
template <class D>
HWY_INLINE hn::Vec<D> second_difference(D d, const std::int64_t* last, std::size_t step) {
    const auto middle = hn::Load(d, last - step);
    return (hn::Load(d, last) - middle) - (middle - hn::Load(d, last - 2 * step));
}

/// Squares of second differences that fit 32 bits with their sign, one product each. Returns whether all of them do;
/// otherwise nothing is added.
template <class D>
HWY_INLINE bool add_narrow(D d, const std::int64_t* x, std::size_t step, std::size_t rows,
                           std::uint64_t* HWY_RESTRICT words) {
    const hn::RebindToUnsigned<D> bits;
    const auto half = hn::Set(bits, std::uint64_t{1} << 31);
    auto low = hn::Load(bits, words);
    auto low_tops = hn::Load(bits, words + simd::lanes);
    auto seen = hn::Zero(bits);
    for (std::size_t row = 0; row < rows; ++row, x += simd::lanes) {
        const auto difference = second_difference(d, x, step);
        const auto square = hn::BitCast(bits, product(d, difference, difference));
        seen = hn::Or(seen, hn::BitCast(bits, difference) + half);  // in 0 ... 2^32 - 1 if it fits
        low = low + square;
        low_tops = low_tops + hn::ShiftRight<32>(square);
    }
    const auto beyond = hn::ShiftRight<32>(seen);
    if (!hn::AllTrue(bits, hn::Eq(beyond, hn::Zero(bits)))) return false;
    hn::Store(low, bits, words);
    hn::Store(low_tops, bits, words + simd::lanes);
    return true;
}

/// Squares of any second differences, three products each.
template <class D>
HWY_INLINE void add_wide(D d, const std::int64_t* x, std::size_t step, std::size_t rows,
                         std::uint64_t* HWY_RESTRICT words) {
    const hn::RebindToUnsigned<D> bits;
    auto low = hn::Load(bits, words);
    auto low_tops = hn::Load(bits, words + simd::lanes);
    auto cross = hn::Load(bits, words + 2 * simd::lanes);
    auto cross_tops = hn::Load(bits, words + 3 * simd::lanes);
    auto high = hn::Load(bits, words + 4 * simd::lanes);
    auto high_tops = hn::Load(bits, words + 5 * simd::lanes);
    for (std::size_t row = 0; row < rows; ++row, x += simd::lanes) {
        const auto size = magnitude(d, second_difference(d, x, step));
        const auto size_high = hn::ShiftRight<32>(size);
        const auto low_low = product(bits, size, size);
        const auto low_high = product(bits, size, size_high);
        const auto high_high = product(bits, size_high, size_high);
        low = low + low_low;
        low_tops = low_tops + hn::ShiftRight<32>(low_low);
        cross = cross + low_high;
        cross_tops = cross_tops + hn::ShiftRight<32>(low_high);
        high = high + high_high;
        high_tops = high_tops + hn::ShiftRight<32>(high_high);
    }
    hn::Store(low, bits, words);
    hn::Store(low_tops, bits, words + simd::lanes);
    hn::Store(cross, bits, words + 2 * simd::lanes);
    hn::Store(cross_tops, bits, words + 3 * simd::lanes);
    hn::Store(high, bits, words + 4 * simd::lanes);
    hn::Store(high_tops, bits, words + 5 * simd::lanes);
}

/// Adds the squares of the second differences with step `lag` rows that end at the `rows` rows from `newest` on to
/// words[6][simd::lanes], for at least `lanes` columns. Tries the cheap way first if `narrow`; returns whether it
/// sufficed. The sums are the same either way.
bool add_squares(const std::int64_t* newest, std::size_t lag, std::size_t rows, std::size_t lanes, bool narrow,
                 std::uint64_t* words) {
    const hn::CappedTag<std::int64_t, simd::lanes> d;
    const std::size_t step = lag * simd::lanes;
    bool fits = narrow;
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        if (narrow && add_narrow(d, newest + lane, step, rows, words + lane)) continue;
        add_wide(d, newest + lane, step, rows, words + lane);
        fits = false;
    }
    return fits;
}

}  // namespace ringlock::allan::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::allan {

HWY_EXPORT(add_squares);

namespace {

__extension__ using Wide = unsigned __int128;

/// The second difference of counts that wrap around.
std::int64_t second_difference(std::int64_t first, std::int64_t middle, std::int64_t last) {
    const auto x = static_cast<std::uint64_t>(middle);
    return static_cast<std::int64_t>((static_cast<std::uint64_t>(last) - x) - (x - static_cast<std::uint64_t>(first)));
}

}  // namespace

void SquareSum::add(std::uint64_t value, std::size_t word) {
    words[word] += value;
    bool carry = words[word] < value;
    for (std::size_t i = word + 1; carry && i < words.size(); ++i) carry = ++words[i] == 0;
}

void SquareSum::add_square(std::int64_t value) {
    const auto bits = static_cast<std::uint64_t>(value);
    const std::uint64_t size = value < 0 ? 0 - bits : bits;
    const Wide square = static_cast<Wide>(size) * size;
    add(static_cast<std::uint64_t>(square), 0);
    add(static_cast<std::uint64_t>(square >> 64), 1);
}

double SquareSum::rounded() const {
    std::size_t top = words.size() - 1;
    while (top > 0 && words[top] == 0) --top;
    if (top == 0) return static_cast<double>(words[0]);
    // The 64 leading bits, the last of them set if anything is lost below it: that rounds as the whole number does.
    const int spare = __builtin_clzll(words[top]);
    const Wide two = static_cast<Wide>(words[top]) << 64 | words[top - 1];
    const Wide leading = two << spare;
    bool rest = static_cast<std::uint64_t>(leading) != 0;
    for (std::size_t i = 0; i + 1 < top; ++i) rest = rest || words[i] != 0;
    const std::uint64_t mantissa = static_cast<std::uint64_t>(leading >> 64) | (rest ? 1U : 0U);
    return std::ldexp(static_cast<double>(mantissa), 64 * static_cast<int>(top) - spare);
}

void OctaveStream::finish(const Running& running, std::size_t lane, SquareSum& sum) {
    // The sum of the products' parts below 32 bits is less than 2^64, and it is known modulo 2^64.
    const auto whole = [&](std::size_t kind) {
        const Wide tops = static_cast<Wide>(running.words[2 * kind + 1][lane]) << 32;
        return tops + (running.words[2 * kind][lane] - static_cast<std::uint64_t>(tops));
    };
    const Wide lower = whole(0) + (whole(1) << 33);
    const Wide upper = whole(2);
    sum.add(static_cast<std::uint64_t>(lower), 0);
    sum.add(static_cast<std::uint64_t>(lower >> 64), 1);
    sum.add(static_cast<std::uint64_t>(upper), 1);
    sum.add(static_cast<std::uint64_t>(upper >> 64), 2);
}

void OctaveStream::process(std::size_t level) {
    // Far below the 2^32 terms after which sums of 32-bit parts would overflow, and far above a batch.
    constexpr std::int64_t most_running_terms = 1 << 16;
    Level& here = levels_[level];
    for (std::size_t i = 0; i < here.sums.size(); ++i) {
        const std::size_t lag = level == 0 ? std::size_t{1} << i : starts_per_tau;
        const std::size_t first = 2 * lag - std::min(2 * lag, here.before);
        Sums& sums = here.sums[i];
        // Where one second difference was wide others will be: they are not tried again.
        sums.narrow = HWY_DYNAMIC_DISPATCH(add_squares)(here.rows[history + first].data(), lag, batch - first, lanes_,
                                                        sums.narrow, sums.running.words[0]);
        sums.running_terms += static_cast<std::int64_t>(batch - first);
        if (sums.running_terms < most_running_terms) continue;
        for (std::size_t lane = 0; lane < lanes_; ++lane) finish(sums.running, lane, sums.done[lane]);
        sums.running = {};
        sums.running_terms = 0;
    }
    push(level + 1, &here.rows[history], batch / 2, 2);
    Level& still_here = levels_[level];  // a new level may have moved it
    std::copy(still_here.rows.end() - history, still_here.rows.end(), still_here.rows.begin());
    still_here.before = history;
    still_here.waiting = 0;
}

void OctaveStream::push(std::size_t level, const simd::LaneCounts* rows, std::size_t count, std::size_t step) {
    if (level == levels_.size()) {
        Level fresh;
        fresh.rows.resize(history + batch);
        std::size_t lags = 1;
        for (std::int64_t lag = 1; level == 0 && lag < starts_per_tau; lag *= 2) ++lags;
        fresh.sums.resize(lags);
        levels_.push_back(std::move(fresh));
    }
    while (count > 0) {
        Level& here = levels_[level];
        const std::size_t fitting = std::min(count, batch - here.waiting);
        for (std::size_t i = 0; i < fitting; ++i, rows += step) here.rows[history + here.waiting + i] = *rows;
        here.waiting += fitting;
        count -= fitting;
        if (here.waiting == batch) process(level);
    }
}

void OctaveStream::add(std::span<const simd::LaneCounts> counts, std::size_t lanes) {
    if (lanes < 1 || lanes > simd::lanes || (lanes_ != 0 && lanes != lanes_)) {
        throw std::invalid_argument("octave stream: lanes must be 1...16 and the same in every call");
    }
    lanes_ = lanes;
    samples_ += static_cast<std::int64_t>(counts.size());
    push(0, counts.data(), counts.size(), 1);
}

std::vector<Octave> OctaveStream::octaves(std::size_t lane) const {
    if (samples_ > 0 && lane >= lanes_) throw std::out_of_range("octave stream: no such lane");
    std::vector<Octave> out;
    std::vector<std::int64_t> handed;  // rows that the level below still has to hand over
    std::int64_t samples = samples_;   // of the level
    std::int64_t interval = 1;
    for (std::size_t level = 0;; ++level, interval *= 2, samples = (samples + 1) / 2) {
        const Level* const kept = level < levels_.size() ? &levels_[level] : nullptr;
        std::vector<std::int64_t> x;
        const std::size_t before = kept ? kept->before : 0;
        if (kept) {
            for (std::size_t i = history - before; i < history + kept->waiting; ++i) x.push_back(kept->rows[i][lane]);
        }
        x.insert(x.end(), handed.begin(), handed.end());

        std::size_t which = 0;
        for (std::int64_t lag = level == 0 ? 1 : starts_per_tau; lag <= starts_per_tau; lag *= 2, ++which) {
            const std::int64_t terms = samples - 2 * lag;
            if (terms < 1) return out;
            Octave octave{lag * interval, {}, terms};
            if (kept) {
                octave.sum = kept->sums[which].done[lane];
                finish(kept->sums[which].running, lane, octave.sum);
            }
            const auto step = static_cast<std::size_t>(lag);
            for (std::size_t i = std::max(before, 2 * step); i < x.size(); ++i) {
                octave.sum.add_square(second_difference(x[i - 2 * step], x[i - step], x[i]));
            }
            out.push_back(octave);
        }
        handed.clear();
        for (std::size_t i = before; i < x.size(); i += 2) handed.push_back(x[i]);
    }
}

}  // namespace ringlock::allan
#endif
