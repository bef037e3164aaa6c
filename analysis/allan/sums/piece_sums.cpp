#include "analysis/allan/sums/piece_sums.hpp"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "analysis/allan/sums/piece_sums.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include <algorithm>
#include <vector>

#include "analysis/allan/sums/exact_sum.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::allan::HWY_NAMESPACE {

/// Number of sums side by side, term i in the (i mod columns)-th, independent of the width of a vector: the compiler
/// may take several at once without changing a bit.
constexpr std::size_t columns = 16;

HWY_INLINE double folded(double (&part)[columns]) {
    for (std::size_t half = columns / 2; half > 0; half /= 2) {
        for (std::size_t c = 0; c < half; ++c) part[c] += part[c + half];
    }
    return part[0];
}

/// term(0) + ... + term(count - 1). Rounding does not grow with the count: every 4096 terms go into an exact sum.
template <class Term>
HWY_INLINE double sum_of(std::size_t count, const Term& term) {
    constexpr std::size_t chunk = 4096;
    double total = 0.0;
    double rest = 0.0;
    for (std::size_t first = 0; first < count; first += chunk) {
        const std::size_t end = std::min(count, first + chunk);
        double part[columns] = {};
        std::size_t i = first;
        for (; i + columns <= end; i += columns) {
            for (std::size_t c = 0; c < columns; ++c) part[c] += term(i + c);
        }
        for (; i < end; ++i) part[(i - first) % columns] += term(i);
        const ExactSum sum = two_sum(total, folded(part));
        total = sum.value;
        rest += sum.error;
    }
    return total + rest;
}

/// A running sum with twice the digits of a double.
struct Running {
    double value = 0.0;
    double rest = 0.0;
    HWY_INLINE double add(double x) {
        const ExactSum sum = two_sum(value, x);
        value = sum.value;
        rest += sum.error;
        return value + rest;
    }
};

/// Sum over c = 0...starts-1 of the trapezoidal sums of f(k) over k = c...c+length (docs/dev/allan-totals.md, equation
/// (5)): k counts i + 1/2 times at its i-th place from either end, until all windows have it.
template <class Term>
HWY_INLINE double sum_over_windows(std::size_t length, std::size_t starts, const Term& f) {
    const std::size_t points = starts + length;
    const std::size_t most = std::min(starts, length);
    const double ramps =
        sum_of(most, [&](std::size_t i) { return (static_cast<double>(i) + 0.5) * (f(i) + f(points - 1 - i)); });
    const double plateau = sum_of(points - 2 * most, [&](std::size_t i) { return f(most + i); });
    return ramps + static_cast<double>(most) * plateau;
}

/// Sum over k = first...first+starts-1 of the trapezoidal sums over j = 0...length of p[k + j] p[k + length - j]
/// (docs/dev/allan-totals.md, equation (6)).
///
/// \param chain  chain[a + 2] = p[a] + p[a - 2] + ...; chain[0] = chain[1] = 0
double sum_of_mirrored(const double* HWY_RESTRICT p, const double* HWY_RESTRICT chain, std::size_t length,
                       std::size_t first, std::size_t starts) {
    const std::size_t upper = (length + 1) / 2;
    const std::size_t lower = length / 2;
    const std::size_t last = first + starts - 1;
    // Pairs a <= b with b - a <= length and of its parity, first <= (a + b - length)/2 <= last. For each b the chain up
    // to the nearest a, less that up to the one before the farthest; either is cut off by the range of k for some b.
    const double* at = p + first + upper;
    const double* to = chain + 2 + first + lower;
    const double near = length % 2 == 0 ? sum_of(starts, [&](std::size_t i) { return at[i] * (2.0 * to[i] - at[i]); })
                                        : sum_of(starts, [&](std::size_t i) { return at[i] * (2.0 * to[i]); });
    at = p + last + upper + 1;
    to = chain + 2 + last + lower - 1;
    const double near_cut = sum_of(lower, [&](std::size_t i) { return at[i] * *(to - i); });
    at = p + first + upper;
    to = chain + first + lower;
    const double far_cut = sum_of(lower, [&](std::size_t i) { return at[i] * *(to - i); });
    at = p + first + length;
    to = chain + first;
    const double* next = p + first;
    const double far = sum_of(starts, [&](std::size_t i) { return at[i] * (2.0 * to[i] + next[i]); });
    return (near - far) + 2.0 * (near_cut - far_cut);
}

/// Pieces of one averaging factor that begin at neighbouring samples. Sums are those of the 6m squares of each piece,
/// over all pieces, times m^2.
class Block {
   public:
    /// \param x          first sample of the first piece
    /// \param m          averaging factor
    /// \param starts     number of pieces
    /// \param workspace  is made as large as is wanted
    Block(const double* x, std::size_t m, std::size_t starts, std::vector<double>& workspace)
        : m_(m), starts_(starts), samples_(3 * m + starts - 1) {
        workspace.resize(std::max(workspace.size(), samples_ + 1 + std::max(9 * m + 1, 3 * (samples_ + 1) + 2)));
        p_ = workspace.data();
        scratch_ = p_ + samples_ + 1;
        sum_samples(x);
    }

    /// As the definition stands.
    double sum_of_single_pieces() {
        double total = 0.0;
        for (std::size_t c = 0; c < starts_; ++c) total += sum_of_piece(p_ + c);
        return total;
    }

    /// All pieces together: docs/dev/allan-totals.md, equations (4) and (7).
    double sum() {
        const double* p = p_;
        const std::size_t m = m_;
        const double squares = sum_over_windows(3 * m, starts_, [=](std::size_t i) { return p[i] * p[i]; });
        const double near = sum_over_windows(2 * m, starts_, [=](std::size_t i) { return p[i] * p[i + m]; });
        const double far = sum_over_windows(m, starts_, [=](std::size_t i) { return p[i] * p[i + 2 * m]; });
        const double sum = (40.0 * squares - 60.0 * near + 24.0 * far) + mirrored() + single();
        lost_ = 40.0 * squares > most_lost * sum;
        // A sum of squares that is nearly zero may be rounded to less.
        return std::max(0.0, sum);
    }
    /// Whether so much has cancelled from the last sum() that it lacks two digits and more.
    bool lost() const { return lost_; }

   private:
    static constexpr double most_lost = 100.0;

    /// The sums over the samples before each, less the line that suits the samples best, and their mean. The line is
    /// fitted with each sample weighted by the number of pieces that contain it; the remaining sums are then of the
    /// size of the pieces' own sums.
    void sum_samples(const double* x) {
        const double origin = x[samples_ / 2];
        const double middle = 0.5 * static_cast<double>(samples_ - 1);
        const auto time = [=](std::size_t i) { return static_cast<double>(i) - middle; };
        const double size = 3.0 * static_cast<double>(m_);
        const auto starts = static_cast<double>(starts_);
        const double count = size * starts;
        // The weights are two boxes convolved, whose variances add.
        const double square = count * ((size * size - 1.0) + (starts * starts - 1.0)) / 12.0;
        const double level = origin + sum_over_samples([=](std::size_t i) { return x[i] - origin; }) / count;
        const double slope = sum_over_samples([=](std::size_t i) { return time(i) * (x[i] - origin); }) / square;
        // Two parts of 24 bits: multiples of them are exact.
        const double coarse = leading_bits(slope);
        const double fine = leading_bits(slope - coarse);
        double* HWY_RESTRICT p = p_;
        for (std::size_t i = 0; i < samples_; ++i) {
            const ExactSum above = two_sum(x[i], -level);
            const ExactSum tilted = two_sum(above.value, -coarse * time(i));
            const ExactSum flat = two_sum(tilted.value, -fine * time(i));
            p[i + 1] = flat.value + (flat.error + (tilted.error + above.error));
        }
        Running total;
        p[0] = 0.0;
        for (std::size_t i = 1; i <= samples_; ++i) p[i] = total.add(p[i]);
        const double centre = sum_over_windows(3 * m_, starts_, [=](std::size_t i) { return p[i]; }) / count;
        for (std::size_t i = 0; i <= samples_; ++i) p[i] -= centre;
    }

    /// Sum of f(i) over the samples i, each as often as there are pieces that have it.
    template <class Term>
    double sum_over_samples(const Term& f) const {
        const std::size_t most = std::min(starts_, 3 * m_);
        const std::size_t last = samples_ - 1;
        const double ramps =
            sum_of(most - 1, [&](std::size_t i) { return static_cast<double>(i + 1) * (f(i) + f(last - i)); });
        const double plateau = sum_of(samples_ - 2 * (most - 1), [&](std::size_t i) { return f(most - 1 + i); });
        return ramps + static_cast<double>(most) * plateau;
    }

    static double leading_bits(double x) {
        const double big = x * 536870913.0;  // 2^29 + 1 (T. Dekker, Numer. Math. 18 (1971) 224)
        return big - (big - x);
    }

    /// The squares of the piece whose sums begin at p.
    double sum_of_piece(const double* p) {
        const std::size_t m = m_;
        const std::size_t size = 3 * m;
        const double slope = half_slope(p);
        // Sums of the piece less its line, which is taken through zero in the middle.
        double* q = scratch_;
        for (std::size_t i = 0; i <= size; ++i) {
            const auto k = static_cast<double>(i);
            q[i] = (p[i] - p[0]) - slope * (0.5 * k * (k - static_cast<double>(size)));
        }
        // Piece, mirror image, piece: one period of 6m of the piece mirrored repeatedly, and the samples that its last
        // terms reach.
        const double all = q[size];
        for (std::size_t i = 1; i <= size; ++i) q[size + i] = 2.0 * all - q[size - i];
        for (std::size_t i = 1; i <= size; ++i) q[2 * size + i] = 2.0 * all + q[i];
        return sum_of(2 * size, [=](std::size_t i) {
            const double z = (q[i + 3 * m] - q[i]) - 3.0 * (q[i + 2 * m] - q[i + m]);
            return z * z;
        });
    }

    /// The mean of the second half of a piece less that of the first, over the distance between the middles of the
    /// halves. An odd sample in the middle belongs to neither half.
    double half_slope(const double* p) const {
        const std::size_t size = 3 * m_;
        const std::size_t half = size / 2;
        const double difference = (p[size] - p[size - half]) - (p[half] - p[0]);
        return difference / (static_cast<double>(half) * static_cast<double>(size - half));
    }

    /// The part of equation (4) that the mirror images at both ends make: products of sums about one centre.
    double mirrored() {
        double* chain = scratch_;
        chain[0] = chain[1] = 0.0;
        Running even;
        Running odd;
        for (std::size_t i = 0; i <= samples_; i += 2) {
            chain[i + 2] = even.add(p_[i]);
            if (i < samples_) chain[i + 3] = odd.add(p_[i + 1]);
        }
        const auto about = [&](std::size_t taus, std::size_t from) {
            return sum_of_mirrored(p_, chain, taus * m_, from * m_, starts_);
        };
        return 4.0 * about(3, 0) - 12.0 * (about(2, 0) + about(2, 1)) + 30.0 * (about(1, 0) + about(1, 2));
    }

    /// The contribution of each piece by itself: the part of equation (4) with the sums at its ends, and its slope,
    /// equation (7).
    double single() {
        // Trapezoidal sums of p, k p and k^2 p from the first on.
        double* sums = scratch_;
        double* lines = sums + samples_ + 1;
        double* parabolas = lines + samples_ + 1;
        const double middle = static_cast<double>(samples_ / 2);
        Running sum;
        Running line;
        Running parabola;
        sums[0] = lines[0] = parabolas[0] = 0.0;
        for (std::size_t i = 1; i <= samples_; ++i) {
            const double to = static_cast<double>(i) - middle;
            const double from = to - 1.0;
            const double left = from * p_[i - 1];
            const double right = to * p_[i];
            sums[i] = sum.add(0.5 * (p_[i - 1] + p_[i]));
            lines[i] = line.add(0.5 * (left + right));
            parabolas[i] = parabola.add(0.5 * (from * left + to * right));
        }
        const double* p = p_;
        const std::size_t m = m_;
        const std::size_t size = 3 * m;
        const auto n = static_cast<double>(m);
        const double end_weight = (4.0 * n * n - 2.0) * n;
        const double slope_weight = (22.0 * n * n * n * n - 2.0) * n / 5.0;
        return sum_of(starts_, [=, this](std::size_t c) {
            const double first = p[c];
            const double last = p[c + size];
            const double s1 = sums[c + m] - sums[c];
            const double s2 = sums[c + 2 * m] - sums[c + m];
            const double s3 = sums[c + 3 * m] - sums[c + 2 * m];
            const double ends = first * (40.0 * s2 - 80.0 * s1 - 8.0 * s3) + last * (40.0 * s2 - 80.0 * s3 - 8.0 * s1) +
                                24.0 * n * (first * first + last * last);
            // Moments of the three parts about the beginning, the middle and the end of the piece.
            const double from = static_cast<double>(c) - middle;
            const double centre = from + 1.5 * n;
            const double to = from + 3.0 * n;
            const double l1 = lines[c + m] - lines[c];
            const double l2 = lines[c + 2 * m] - lines[c + m];
            const double l3 = lines[c + 3 * m] - lines[c + 2 * m];
            const double q1 = parabolas[c + m] - parabolas[c] - from * (2.0 * l1 - from * s1);
            const double q2 = parabolas[c + 2 * m] - parabolas[c + m] - centre * (2.0 * l2 - centre * s2);
            const double q3 = parabolas[c + 3 * m] - parabolas[c + 2 * m] - to * (2.0 * l3 - to * s3);
            const double with_line = 22.0 * (q1 + q3) - 24.0 * n * ((l1 - from * s1) + (to * s3 - l3)) - 20.0 * q2 +
                                     3.0 * n * n * s2 + end_weight * (first + last);
            const double slope = half_slope(p + c);
            return ends - slope * (2.0 * with_line - slope * slope_weight);
        });
    }

    std::size_t m_;
    std::size_t starts_;
    std::size_t samples_;        ///< of all pieces together
    double* p_ = nullptr;        ///< sums of the samples before each: samples_ + 1
    double* scratch_ = nullptr;  ///< room beyond
    bool lost_ = false;
};

/// Pieces that are summed one by one where together they have lost digits.
constexpr std::size_t most_repeated = 1024;

double sum_of_block(const double* x, std::size_t m, std::size_t starts, bool singly, std::vector<double>& workspace) {
    Block block(x, m, starts, workspace);
    if (singly) return block.sum_of_single_pieces();
    const double sum = block.sum();
    // A wave of period m with its crest where a piece begins shows in none of its differences. Where pieces begin at
    // every phase of it others show it.
    return block.lost() && starts <= most_repeated ? block.sum_of_single_pieces() : sum;
}

}  // namespace ringlock::allan::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::allan {

HWY_EXPORT(sum_of_block);

namespace {

/// Pieces of so short a step are summed one by one, which is faster.
constexpr std::size_t longest_single_step = 8;

SquareMean sum_of_blocks(std::span<const double> x, std::size_t m, bool singly) {
    const std::size_t size = 3 * m;
    const std::size_t pieces = x.size() - size + 1;
    // Blocks of up to 3m pieces, of which the middle sample is in every one; some blocks at a time where they are
    // short.
    const std::size_t most = singly ? size + 16 : size;
    const std::size_t blocks = (pieces + most - 1) / most;
    const std::size_t starts = (pieces + blocks - 1) / blocks;
    const std::size_t batch = (piece_starts + starts - 1) / starts * starts;
    std::vector<SquareMean> parts((pieces + batch - 1) / batch);
    for_pieces(parts.size(), [&](std::size_t k) {
        std::vector<double> workspace;
        const std::size_t end = std::min(pieces, (k + 1) * batch);
        for (std::size_t first = k * batch; first < end; first += starts) {
            const std::size_t there = std::min(starts, end - first);
            parts[k] += {HWY_DYNAMIC_DISPATCH(sum_of_block)(x.data() + first, m, there, singly, workspace),
                         static_cast<std::int64_t>(there)};
        }
    });
    SquareMean total = pairwise(std::move(parts));
    const auto n = static_cast<double>(m);
    total.sum /= 6.0 * n * n * n;
    return total;
}

}  // namespace

SquareMean sum_of_pieces(std::span<const double> x, std::size_t m) {
    if (m == 0 || x.size() < 3 * m) return {};
    return sum_of_blocks(x, m, m <= longest_single_step);
}

SquareMean sum_of_single_pieces(std::span<const double> x, std::size_t m) {
    if (m == 0 || x.size() < 3 * m) return {};
    return sum_of_blocks(x, m, true);
}

}  // namespace ringlock::allan
#endif  // HWY_ONCE
