#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/octave_stream.hpp"
#include "engine/simd/lanes.hpp"

namespace ringlock::allan {

/// Running Allan sum of up to simd::lanes gyros at one averaging factor, which may be any; at octaves its sums equal
/// those of OctaveStream. Counts wrap around as there; the sum is exact. Keeps some 25 rows.
class FactorStream {
   public:
    /// \param m  averaging factor [samples], >= 1
    explicit FactorStream(std::int64_t m);

    /// Takes the next samples: one row a sample, one column a gyro, `lanes` columns that are meant.
    void add(std::span<const simd::LaneCounts> counts, std::size_t lanes);

    std::int64_t samples() const { return samples_; }

    /// The sum of one gyro over the starts i = 0, s, 2 s, ... with s = max(1, m / OctaveStream::starts_per_tau).
    /// `terms` is 0 before the first second difference.
    Octave sum(std::size_t lane) const;

   private:
    /// Every stride-th row from `first` on: the last ones.
    struct Ring {
        std::vector<simd::LaneCounts> rows;
        std::int64_t first = 0;
        void take(std::int64_t sample, std::int64_t stride, const simd::LaneCounts& row);
        const simd::LaneCounts& at(std::int64_t sample, std::int64_t stride) const;
    };

    std::int64_t m_;
    std::int64_t stride_;
    std::int64_t samples_ = 0;
    std::int64_t terms_ = 0;
    Ring starts_;   ///< samples i
    Ring middles_;  ///< samples i + m
    std::vector<SquareSum> sums_;
};

/// The Allan deviation of one gyro at that factor, with its interval.
///
/// \param octaves  the gyro's octaves, whose noise nearest to the factor is taken for that of the factor
/// The other parameters are those of deviation() of an OctaveStream. Throws InputError where unit, tau0 or confidence
/// are out of range, or the record has no term.
Point deviation(const FactorStream& stream, std::size_t lane, const std::vector<Point>& octaves, double unit_per_count,
                double tau0_s, double confidence = Options{}.confidence);

}  // namespace ringlock::allan
