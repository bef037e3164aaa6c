#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "engine/simd/lanes.hpp"

namespace ringlock::allan {

/// Phase of up to simd::lanes gyros at few enough instants to be kept: every 2^k-th sample of a run whose length is
/// known beforehand. It serves methods that need a record (a fit of noise coefficients), but not its shortest averaging
/// times.
///
/// Phase is sampled, not averaged: differences of kept samples are whole increments of the longer interval.
class BoundedRecord {
   public:
    /// \param total  samples that add() will be given altogether, >= 1
    /// \param most   samples that may be kept, >= 2
    ///
    /// Throws std::invalid_argument outside that.
    BoundedRecord(std::int64_t total, std::int64_t most);

    /// Samples from one kept to the next: the least power of two with which no more than `most` of `total` are kept.
    std::int64_t interval() const { return interval_; }

    /// Takes the next samples: rows of counts as for OctaveStream. Throws std::length_error beyond `total`.
    void add(std::span<const simd::LaneCounts> counts);

    /// Samples kept so far: those with the numbers 0, interval(), 2 interval(), ...
    std::size_t size() const { return rows_.size(); }

    /// The record of one gyro, ready for noise::fit_noise(): counts from the first sample on, less a line through the
    /// origin whose slope is the mean increment to the nearest count, times the unit.
    ///
    /// \param lane            column, below simd::lanes
    /// \param unit_per_count  unit of phase that one count stands for
    /// \return size() values, the first of them 0
    ///
    /// Counts may wrap around: two increments over interval() must differ by less than 2^63, they themselves need not
    /// be smaller. The line is taken away in whole counts, before anything is rounded.
    std::vector<double> phase(std::size_t lane, double unit_per_count) const;

   private:
    std::vector<simd::LaneCounts> rows_;
    std::int64_t total_ = 0;
    std::int64_t seen_ = 0;
    std::int64_t interval_ = 1;
};

}  // namespace ringlock::allan
