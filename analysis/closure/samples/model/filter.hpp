#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/closure/samples/model/states.hpp"

namespace ringlock::closure {

/// The Kalman filter that makes innovations of increments: independent and of unit variance where the noise is as said.
///
/// The angle is a sum of white and slow rates, z = angle + resonances + white reading error; of a resampled record z
/// lies on the straight line between two such readings, which are states of their own.
class SampleFilter {
   public:
    SampleFilter(const SampleNoise& noise, std::size_t rows, double interval_s);
    /// Innovations over their standard deviations. Linear in the increments.
    std::vector<double> apply(std::span<const double> increments) const;
    double sd(std::size_t row) const { return sd_[std::min(row, sd_.size() - 1)]; }
    /// Minus the log-likelihood of the rows that count, but for a constant, under each of several noises, in much less
    /// time than one after the other and keeping nothing.
    static std::vector<double> minus_log_likelihoods(std::span<const SampleNoise> noises, double interval_s,
                                                     std::span<const double> increments,
                                                     std::span<const std::uint8_t> rows);

    /// Many filters step by step, for readings of the angle that are not known beforehand; not of a resampled record,
    /// nor of one with noise of the dither.
    class Many {
       public:
        /// Each begins at a reading.
        Many(const SampleFilter& filter, std::span<const double> readings);
        /// Of the next readings.
        void foretell(std::span<double> readings);
        void take(std::size_t row, std::span<const double> innovations);
        /// Each becomes a copy of another.
        void continue_from(std::span<const std::uint8_t> others);

       private:
        const SampleFilter& filter_;
        std::size_t count_;
        std::vector<double> x_;  ///< state after state of all
        std::vector<double> next_;
    };

   private:
    using Terms = SampleStates::Terms;
    template <int D>
    static void advance(const SampleFilter& filter, std::array<double, D>& x);
    template <int D>
    void pass_turns(std::size_t row, std::array<double, D>& x, std::array<double, D>& h) const;

    SampleStates states_;
    std::vector<double> gain_;  ///< until they stay the same
    std::vector<double> sd_;
    std::vector<std::uint8_t> ticks_;  ///< resampled: source samples passed before each row
    std::vector<double> share_;
};

}  // namespace ringlock::closure
