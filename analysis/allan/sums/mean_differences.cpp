#include "analysis/allan/sums/mean_differences.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "analysis/allan/sums/mean_differences.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include <algorithm>
#include <array>
#include <cmath>
#include <tuple>

#include "analysis/allan/sums/exact_sum.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::allan::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr std::size_t sum_count = std::tuple_size_v<Columns>;

template <class D>
HWY_INLINE hn::Vec<D> third_difference(D d, const double* x, std::size_t m) {
    const auto inner = hn::Sub(hn::LoadU(d, x + 2 * m), hn::LoadU(d, x + m));
    const auto outer = hn::Sub(hn::LoadU(d, x + 3 * m), hn::LoadU(d, x));
    return hn::Sub(outer, hn::Mul(inner, hn::Set(d, 3.0)));
}

/// out[i] = x[i + 3m] - 3 x[i + 2m] + 3 x[i + m] - x[i].
void third_differences(const double* HWY_RESTRICT x, std::size_t m, std::size_t count, double* HWY_RESTRICT out) {
    const hn::CappedTag<double, 8> d;
    const std::size_t width = hn::Lanes(d);
    std::size_t i = 0;
    for (; i + width <= count; i += width) hn::StoreU(third_difference(d, x + i, m), d, out + i);
    const hn::CappedTag<double, 1> one;
    for (; i < count; ++i) out[i] = hn::GetLane(third_difference(one, x + i, m));
}

/// Adds the squares of base + z[i] to sums[32].
void add_squares(const double* HWY_RESTRICT z, double base, std::size_t count, double* HWY_RESTRICT sums) {
    const hn::CappedTag<double, 8> d;
    constexpr std::size_t width = hn::MaxLanes(d);
    constexpr std::size_t vectors = sum_count / width;
    hn::Vec<decltype(d)> total[vectors];
    for (std::size_t v = 0; v < vectors; ++v) total[v] = hn::LoadU(d, sums + v * width);
    const auto from = hn::Set(d, base);
    std::size_t i = 0;
    for (; i + sum_count <= count; i += sum_count) {
        for (std::size_t v = 0; v < vectors; ++v) {
            const auto term = hn::Add(from, hn::LoadU(d, z + i + v * width));
            total[v] = hn::Add(total[v], hn::Mul(term, term));
        }
    }
    for (std::size_t v = 0; v < vectors; ++v) hn::StoreU(total[v], d, sums + v * width);
    for (; i < count; ++i) {
        const double term = base + z[i];
        sums[i % sum_count] += term * term;
    }
}

}  // namespace ringlock::allan::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::allan {

HWY_EXPORT(third_differences);
HWY_EXPORT(add_squares);

namespace {

/// Squares of the sums from `first` on: each is the one before and a third difference of the phase. Eight independent
/// chains of additions hide the latency of an addition.
SquareMean mean_difference_piece(const double* x, std::size_t m, std::size_t count, double begin) {
    constexpr std::size_t chains = 8;
    alignas(64) std::array<double, piece_starts> z;
    // z[i] is to be term i less the chain's first term.
    const std::size_t length = (count + chains - 1) / chains;
    HWY_DYNAMIC_DISPATCH(third_differences)(x, m, count - 1, z.data() + 1);
    z[0] = 0.0;
    std::array<double, chains> running{};
    for (std::size_t i = 0; i < length; ++i) {
        for (std::size_t k = 0; k < chains; ++k) {
            const std::size_t at = k * length + i;
            if (at >= count) break;
            running[k] += z[at];
            z[at] = running[k];
        }
    }
    alignas(64) Columns columns{};
    double base = begin;
    for (std::size_t k = 0; k < chains && k * length < count; ++k) {
        const std::size_t there = std::min(length, count - k * length);
        HWY_DYNAMIC_DISPATCH(add_squares)(z.data() + k * length, base, there, columns.data());
        base += running[k];
    }
    return {folded_sum(columns), static_cast<std::int64_t>(count)};
}

}  // namespace

void MeanDifferences::Exact::add(double x) {
    const ExactSum sum = two_sum(value, x);
    rest += sum.error;
    value = sum.value;
}

MeanDifferences::MeanDifferences(std::span<const double> x) : x_(x) {
    before_.reserve(x.size() / spacing + 1);
    Exact total;
    for (std::size_t i = 0; i <= x.size(); ++i) {
        if (i % spacing == 0) before_.push_back(total);
        if (i < x.size()) total.add(x[i]);
    }
}

MeanDifferences::Exact MeanDifferences::before(std::size_t i) const {
    Exact total = before_[i / spacing];
    for (std::size_t k = i / spacing * spacing; k < i; ++k) total.add(x_[k]);
    return total;
}

double MeanDifferences::difference(std::size_t i, std::size_t m) const {
    const std::array<Exact, 4> at = {before(i), before(i + m), before(i + 2 * m), before(i + 3 * m)};
    // The sums over m points first, then their differences: each step carries its rounding error along.
    const auto over = [&](std::size_t k) {
        Exact sum = at[k + 1];
        sum.add(-at[k].value);
        sum.add(-at[k].rest);
        return sum;
    };
    Exact z = over(2);
    const Exact middle = over(1);
    const Exact first = over(0);
    for (const double v : {-2.0 * middle.value, -2.0 * middle.rest, first.value, first.rest}) z.add(v);
    return z.value + z.rest;
}

SquareMean MeanDifferences::sum(std::size_t m) const {
    if (m == 0 || x_.size() < 3 * m) return {};
    const std::size_t starts = x_.size() - 3 * m + 1;
    const std::size_t pieces = (starts + piece_starts - 1) / piece_starts;
    std::vector<SquareMean> parts(pieces);
    for_pieces(pieces, [&](std::size_t piece) {
        const std::size_t first = piece * piece_starts;
        parts[piece] =
            mean_difference_piece(x_.data() + first, m, std::min(piece_starts, starts - first), difference(first, m));
    });
    SquareMean total = pairwise(std::move(parts));
    total.sum /= static_cast<double>(m) * static_cast<double>(m);
    return total;
}

}  // namespace ringlock::allan
#endif  // HWY_ONCE
