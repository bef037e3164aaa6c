#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/simd/lanes.hpp"

/// Allan statistics of records that are never kept: many gyros at once, exact, in a memory that grows with log n.
namespace ringlock::allan {

/// A sum of squares of 64-bit integers, exact: three words of 64 bits hold 2^66 of the largest ones.
struct SquareSum {
    std::array<std::uint64_t, 3> words{};  ///< least significant first

    /// Adds `value` times 2^(64 `word`).
    void add(std::uint64_t value, std::size_t word);
    /// Adds a square.
    void add_square(std::int64_t value);
    /// The nearest double, ties to even.
    double rounded() const;
    bool operator==(const SquareSum&) const = default;
};

/// Sum of squares of a record at one averaging factor: sum over `terms` starts i = 0, s, 2 s, ... of
/// (x_{i+2m} - 2 x_{i+m} + x_i)^2 with the stride s = max(1, m / OctaveStream::starts_per_tau).
struct Octave {
    std::int64_t m = 0;      ///< averaging factor, a power of two
    SquareSum sum;           ///< [counts^2]
    std::int64_t terms = 0;  ///< squares in the sum, >= 1
};

/// Running Allan sums of up to simd::lanes gyros at every octave of averaging time; docs/dev/allan-streams.md has the
/// method.
///
/// Phase comes as fixed-point counts that may wrap around in two's complement: only differences count. A second
/// difference x_{i+2m} - 2 x_{i+m} + x_i must fit 64 bits. All sums are exact, so that they do not depend on the pieces
/// that rows come in, on the other gyros of the block and on the instruction set. Costs about 7 KB for every octave.
class OctaveStream {
   public:
    /// Starts of second differences per averaging time: the stride is m / 8, or one sample below m = 8. Eight is the
    /// least power of two with which the deviation stays within 0.15 of its standard error of that of full overlap
    /// (rms; white rate noise and redder, records of 8 tau and more; tests measure it).
    static constexpr std::int64_t starts_per_tau = 8;

    /// Takes the next samples.
    ///
    /// \param counts  one row a sample, one column a gyro; any number of rows
    /// \param lanes   columns that are meant, 1...simd::lanes, the same in every call; the others may hold anything
    ///
    /// Throws std::invalid_argument for another number of lanes.
    void add(std::span<const simd::LaneCounts> counts, std::size_t lanes);

    /// Samples so far.
    std::int64_t samples() const { return samples_; }

    /// The sums of one gyro at m = 1, 2, 4, ... as far as a second difference fits the record: the factors are those
    /// of octave_factors(largest_factor(Estimator::oadev, samples())). Throws std::out_of_range where add() was not
    /// given that lane.
    std::vector<Octave> octaves(std::size_t lane) const;

   private:
    /// A square is made of three products of 32-bit halves: low low, low high, high high. For each kind of product the
    /// low 64 bits of the sum are kept and, next to them, the sum of each product's bits above the 32nd; together they
    /// determine the sum.
    struct alignas(simd::alignment) Running {
        std::uint64_t words[6][simd::lanes] = {};
    };
    struct Sums {
        Running running;
        std::int64_t running_terms = 0;
        bool narrow = true;  ///< all second differences so far fitted 32 bits, which is cheaper
        std::array<SquareSum, simd::lanes> done{};
    };
    /// Every 2^k-th sample: the last ones, and the sums that are made of them.
    struct Level {
        std::vector<simd::LaneCounts> rows;  ///< `history` rows that are done, then up to `batch` waiting ones
        std::size_t before = 0;              ///< rows of the history that are there: none at first
        std::size_t waiting = 0;
        std::vector<Sums> sums;  ///< one for each lag
    };

    static constexpr std::size_t history = 2 * starts_per_tau;
    static constexpr std::size_t batch = 32;
    static_assert(batch % 2 == 0 && batch >= history);

    void push(std::size_t level, const simd::LaneCounts* rows, std::size_t count, std::size_t step);
    void process(std::size_t level);
    static void finish(const Running& running, std::size_t lane, SquareSum& sum);

    std::vector<Level> levels_;
    std::int64_t samples_ = 0;
    std::size_t lanes_ = 0;
};

}  // namespace ringlock::allan
