#include "analysis/allan/sums/difference_sums.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "analysis/allan/sums/difference_sums.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include <tbb/cache_aligned_allocator.h>

#include <algorithm>
#include <array>
#include <cmath>

HWY_BEFORE_NAMESPACE();
namespace ringlock::allan::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Number of running sums, independent of the width of a vector: term i goes to the (i mod columns)-th.
constexpr std::size_t columns = 32;
/// The same of four octaves at once.
constexpr std::size_t octave_columns = 8;

template <int order, class D>
HWY_INLINE hn::Vec<D> difference_at(D d, const double* x, std::size_t m) {
    if constexpr (order == 1) {
        return hn::Sub(hn::LoadU(d, x + m), hn::LoadU(d, x));
    } else if constexpr (order == 2) {
        const auto middle = hn::LoadU(d, x + m);
        return hn::Sub(hn::Sub(hn::LoadU(d, x + 2 * m), middle), hn::Sub(middle, hn::LoadU(d, x)));
    } else {
        const auto inner = hn::Sub(hn::LoadU(d, x + 2 * m), hn::LoadU(d, x + m));
        const auto outer = hn::Sub(hn::LoadU(d, x + 3 * m), hn::LoadU(d, x));
        return hn::Sub(outer, hn::Mul(inner, hn::Set(d, 3.0)));
    }
}

template <int order, bool skipping>
void add_differences(const double* HWY_RESTRICT x, std::size_t m, std::size_t count, double* HWY_RESTRICT sums,
                     std::int64_t& terms) {
    const hn::CappedTag<double, 8> d;
    constexpr std::size_t width = hn::MaxLanes(d);
    constexpr std::size_t vectors = columns / width;
    hn::Vec<decltype(d)> total[vectors];
    for (std::size_t v = 0; v < vectors; ++v) total[v] = hn::LoadU(d, sums + v * width);
    std::size_t i = 0;
    std::size_t skipped = 0;
    for (; i + columns <= count; i += columns) {
        for (std::size_t v = 0; v < vectors; ++v) {
            const auto z = difference_at<order>(d, x + i + v * width, m);
            const auto square = hn::Mul(z, z);
            if constexpr (skipping) {
                const auto there = hn::Eq(square, square);
                skipped += width - hn::CountTrue(d, there);
                total[v] = hn::Add(total[v], hn::IfThenElseZero(there, square));
            } else {
                total[v] = hn::Add(total[v], square);
            }
        }
    }
    for (std::size_t v = 0; v < vectors; ++v) hn::StoreU(total[v], d, sums + v * width);
    const hn::CappedTag<double, 1> one;
    for (; i < count; ++i) {
        const double z = hn::GetLane(difference_at<order>(one, x + i, m));
        if (skipping && std::isnan(z)) {
            ++skipped;
            continue;
        }
        sums[i % columns] += z * z;
    }
    terms += static_cast<std::int64_t>(count - skipped);
}

/// Adds the squares of `count` differences from x on to sums[32], and their number to terms.
void add_squares_of_differences(const double* x, int order, bool skipping, std::size_t m, std::size_t count,
                                double* sums, std::int64_t& terms) {
    if (order == 1) {
        return skipping ? add_differences<1, true>(x, m, count, sums, terms)
                        : add_differences<1, false>(x, m, count, sums, terms);
    }
    if (order == 2) {
        return skipping ? add_differences<2, true>(x, m, count, sums, terms)
                        : add_differences<2, false>(x, m, count, sums, terms);
    }
    return skipping ? add_differences<3, true>(x, m, count, sums, terms)
                    : add_differences<3, false>(x, m, count, sums, terms);
}

/// Adds the squares of `count` second differences at each of the steps m, 2m, 4m, 8m to sums[4][8]: x_{i+2m} of one
/// step is x_{i+m} of the next, so that a difference costs one load. count must be a multiple of 8.
void add_four_octaves(const double* HWY_RESTRICT x, std::size_t m, std::size_t count, double* HWY_RESTRICT sums) {
    const hn::CappedTag<double, octave_columns> d;
    constexpr std::size_t width = hn::MaxLanes(d);
    constexpr std::size_t vectors = octave_columns / width;
    using V = hn::Vec<decltype(d)>;
    V total[4][vectors];
    for (std::size_t k = 0; k < 4; ++k) {
        for (std::size_t v = 0; v < vectors; ++v) total[k][v] = hn::LoadU(d, sums + k * octave_columns + v * width);
    }
    const V minus_two = hn::Set(d, -2.0);
    for (std::size_t i = 0; i < count; i += octave_columns) {
        for (std::size_t v = 0; v < vectors; ++v) {
            const double* at = x + i + v * width;
            const V first = hn::LoadU(d, at);
            V near = hn::Sub(hn::LoadU(d, at + m), first);
            for (std::size_t k = 0; k < 4; ++k) {
                const V far = hn::Sub(hn::LoadU(d, at + (m << (k + 1))), first);
                // Twice a number is exact, so that a fused rounding is the same as two.
                const V z = hn::MulAdd(near, minus_two, far);
                total[k][v] = hn::Add(total[k][v], hn::Mul(z, z));
                near = far;
            }
        }
    }
    for (std::size_t k = 0; k < 4; ++k) {
        for (std::size_t v = 0; v < vectors; ++v) hn::StoreU(total[k][v], d, sums + k * octave_columns + v * width);
    }
}

}  // namespace ringlock::allan::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::allan {

HWY_EXPORT(add_squares_of_differences);
HWY_EXPORT(add_four_octaves);

namespace {

using Aligned = std::vector<double, tbb::cache_aligned_allocator<double>>;

/// Memory of a thread that is kept from piece to piece: to ask the system for it anew costs more than to fill it.
Aligned& workspace() {
    thread_local Aligned memory;
    return memory;
}

/// The longest step that is taken from pieces of the record.
constexpr std::size_t longest_short_step = 8192;
/// Points of a column that is copied out of the record.
constexpr std::size_t column_points = 40960;

/// Number of starts of a difference in a record.
std::size_t starts_of(std::size_t size, int order, std::size_t m) {
    const std::size_t reach = static_cast<std::size_t>(order) * m;
    return size > reach ? size - reach : 0;
}

/// Starts of a piece that are taken at once where the steps are so short that they fit the first-level cache.
constexpr std::size_t cached_starts = 2048;
constexpr std::size_t cached_step = 512;

/// A step in a piece of work: its index among the requested ones, and the number of its starts there.
struct Step {
    std::size_t which;
    std::size_t m;
    std::size_t starts;
};

/// Whether four steps from this one on double from each to the next.
bool four_octaves(std::span<const Step> steps) {
    if (steps.size() < 4) return false;
    for (std::size_t k = 1; k < 4; ++k) {
        if (steps[k].m != 2 * steps[k - 1].m) return false;
    }
    return true;
}

/// Sums of all steps over one stretch of memory, x[0] being where their first difference begins. Steps ascend, so that
/// starts do not.
void add_steps(const double* x, Difference difference, std::span<const Step> steps, std::vector<SquareMean>& parts,
               std::size_t piece, std::size_t pieces) {
    const auto part = [&](const Step& step) -> SquareMean& { return parts[step.which * pieces + piece]; };
    for (std::size_t s = 0; s < steps.size();) {
        std::size_t done = 0;
        const std::span<const Step> left = steps.subspan(s);
        const bool four = difference.order == 2 && !difference.skipping && four_octaves(left);
        if (four) {
            done = left[3].starts / 8 * 8;
            alignas(64) std::array<double, 32> sums{};
            const std::size_t at_once = left[3].m <= cached_step ? cached_starts : done;
            for (std::size_t i = 0; i < done; i += at_once) {
                HWY_DYNAMIC_DISPATCH(add_four_octaves)(x + i, left[0].m, std::min(at_once, done - i), sums.data());
            }
            for (std::size_t k = 0; k < 4; ++k) {
                const double* c = sums.data() + 8 * k;
                part(left[k]) += {((c[0] + c[4]) + (c[1] + c[5])) + ((c[2] + c[6]) + (c[3] + c[7])),
                                  static_cast<std::int64_t>(done)};
            }
        }
        const std::size_t taken = four ? 4 : 1;
        for (std::size_t k = 0; k < taken; ++k) {
            if (left[k].starts <= done) continue;
            DifferenceSums rest;
            rest.add(x + done, difference, left[k].m, left[k].starts - done);
            part(left[k]) += rest.folded();
        }
        s += taken;
    }
}

void gather(const std::vector<SquareMean>& parts, std::span<const std::size_t> which, std::size_t pieces,
            std::vector<SquareMean>& out) {
    for (std::size_t k = 0; k < which.size(); ++k) {
        out[which[k]] = pairwise({parts.begin() + static_cast<std::ptrdiff_t>(k * pieces),
                                  parts.begin() + static_cast<std::ptrdiff_t>((k + 1) * pieces)});
    }
}

/// Steps that fit the cache, ascending.
void short_steps(std::span<const double> x, Difference difference, std::span<const std::size_t> m,
                 std::span<const std::size_t> which, std::vector<SquareMean>& out) {
    const std::size_t pieces = (x.size() + piece_starts - 1) / piece_starts;
    std::vector<SquareMean> parts(pieces * which.size());
    for_pieces(pieces, [&](std::size_t piece) {
        const std::size_t first = piece * piece_starts;
        std::vector<Step> steps;
        for (std::size_t k = 0; k < which.size(); ++k) {
            const std::size_t step = m[which[k]];
            const std::size_t last = std::min(first + piece_starts, starts_of(x.size(), difference.order, step));
            if (last > first) steps.push_back({k, step, last - first});
        }
        if (steps.empty()) return;
        const std::size_t reach = static_cast<std::size_t>(difference.order) * steps.back().m;
        const std::size_t end = std::min(x.size(), first + piece_starts + reach);
        // Copied to where a cache line begins: a vector that lies across two lines costs two loads.
        Aligned& here = workspace();
        here.assign(x.begin() + static_cast<std::ptrdiff_t>(first), x.begin() + static_cast<std::ptrdiff_t>(end));
        add_steps(here.data(), difference, steps, parts, piece, pieces);
    });
    gather(parts, which, pieces, out);
}

/// Steps that are multiples of `row`, ascending: the record is written in rows of that length and taken column by
/// column.
void long_steps(std::span<const double> x, Difference difference, std::span<const std::size_t> m,
                std::span<const std::size_t> which, std::size_t row, std::vector<SquareMean>& out) {
    const std::size_t rows = (x.size() + row - 1) / row;
    const std::size_t width = std::min(row, std::max<std::size_t>(8, column_points / rows / 8 * 8));
    const std::size_t pieces = (row + width - 1) / width;
    std::vector<SquareMean> parts(pieces * which.size());
    for_pieces(pieces, [&](std::size_t piece) {
        const std::size_t left = piece * width;
        const std::size_t wide = std::min(width, row - left);
        Aligned& column = workspace();
        column.resize(rows * wide);
        for (std::size_t r = 0; r < rows && r * row + left < x.size(); ++r) {
            const std::size_t there = std::min(wide, x.size() - r * row - left);
            std::copy_n(x.data() + r * row + left, there, column.data() + r * wide);
        }
        std::vector<Step> steps;
        for (std::size_t k = 0; k < which.size(); ++k) {
            const std::size_t step = m[which[k]];
            // Starts r row + left + c < starts: whole rows first, then a part of one.
            const std::size_t starts = starts_of(x.size(), difference.order, step);
            if (starts <= left) continue;
            const std::size_t whole = starts >= left + wide ? (starts - left - wide) / row + 1 : 0;
            const std::size_t beyond = whole * row + left;
            const std::size_t rest = starts > beyond ? std::min(wide, starts - beyond) : 0;
            steps.push_back({k, step / row * wide, whole * wide + rest});
        }
        add_steps(column.data(), difference, steps, parts, piece, pieces);
    });
    gather(parts, which, pieces, out);
}

}  // namespace

void DifferenceSums::add(const double* x, Difference difference, std::size_t m, std::size_t count) {
    HWY_DYNAMIC_DISPATCH(add_squares_of_differences)
    (x, difference.order, difference.skipping, m, count, columns_.data(), terms_);
}

SquareMean DifferenceSums::folded() const { return {folded_sum(columns_), terms_}; }

SquareMean sum_of_differences(std::span<const double> x, Difference difference, std::size_t m, std::size_t first,
                              std::size_t last) {
    if (last <= first) return {};
    const std::size_t pieces = (last - first + piece_starts - 1) / piece_starts;
    std::vector<SquareMean> parts(pieces);
    for_pieces(pieces, [&](std::size_t piece) {
        const std::size_t from = first + piece * piece_starts;
        DifferenceSums sums;
        sums.add(x.data() + from, difference, m, std::min(piece_starts, last - from));
        parts[piece] = sums.folded();
    });
    return pairwise(std::move(parts));
}

SquareMean sum_of_strided_differences(std::span<const double> x, Difference difference, std::size_t m,
                                      std::size_t stride) {
    const std::size_t starts = starts_of(x.size(), difference.order, m);
    const std::size_t count = (starts + stride - 1) / stride;
    // Only every stride-th point counts where steps are a whole number of strides, as they are here.
    std::vector<double> every(count + static_cast<std::size_t>(difference.order) * m / stride);
    if (count == 0) return {};
    for (std::size_t i = 0; i < every.size(); ++i) every[i] = x[i * stride];
    return sum_of_differences(every, difference, m / stride, 0, count);
}

std::vector<SquareMean> sums_of_differences(std::span<const double> x, Difference difference,
                                            std::span<const std::size_t> m) {
    std::vector<SquareMean> out(m.size());
    std::vector<std::size_t> near;
    std::vector<std::size_t> far;
    for (std::size_t k = 0; k < m.size(); ++k) {
        (m[k] <= longest_short_step ? near : far).push_back(k);
    }
    for (std::vector<std::size_t>* list : {&near, &far}) {
        std::sort(list->begin(), list->end(), [&](std::size_t a, std::size_t b) { return m[a] < m[b]; });
    }
    if (!near.empty()) short_steps(x, difference, m, near, out);
    if (far.empty()) return out;
    const std::size_t row = m[far.front()];
    std::vector<std::size_t> regular;
    for (const std::size_t k : far) {
        if (m[k] % row == 0) {
            regular.push_back(k);
        } else {
            out[k] = sum_of_differences(x, difference, m[k], 0, starts_of(x.size(), difference.order, m[k]));
        }
    }
    long_steps(x, difference, m, regular, row, out);
    return out;
}

}  // namespace ringlock::allan
#endif  // HWY_ONCE
