#pragma once
#include <algorithm>
#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/closure/samples/model/states.hpp"

namespace ringlock::closure {

/// Kalman filter that transforms increments into innovations. These are independent and of unit variance if the noise
/// is that of the model.
///
/// The angle is a sum of white and slow rates, z = angle + resonances + white reading error. In a resampled record z
/// lies on the straight line between two readings of the source, which are states of the filter.
class SampleFilter {
   public:
    SampleFilter(const SampleNoise& noise, std::size_t rows, double interval_s);
    /// Innovations divided by their standard deviations, one per increment; linear in the increments.
    std::vector<double> apply(std::span<const double> increments) const;
    double sd(std::size_t row) const { return sd_[std::min(row, sd_.size() - 1)]; }
    /// Minus the log-likelihood of the rows that count, up to a constant, one value per noise. All noises are evaluated
    /// together, which takes much less time than one after the other; no gains are kept.
    /// \param rows  not zero for rows that count
    static std::vector<double> minus_log_likelihoods(std::span<const SampleNoise> noises, double interval_s,
                                                     std::span<const double> increments,
                                                     std::span<const std::uint8_t> rows);

    /// Many filters that run step by step, for readings of the angle that are not known beforehand (imputation). Not
    /// for resampled records or records with noise of the dither.
    class Many {
       public:
        /// Each filter starts at one of these readings [arcsec].
        Many(const SampleFilter& filter, std::span<const double> readings);
        /// Advances all filters by one row and writes the readings that they predict.
        void predict(std::span<double> readings);
        /// Updates the states of all filters with the innovations of this row, one per filter.
        void take(std::size_t row, std::span<const double> innovations);
        /// Replaces the states of each filter by those of the filter with the given index.
        void continue_from(std::span<const std::uint8_t> others);

       private:
        const SampleFilter& filter_;
        std::size_t count_;
        std::vector<double> x_;  ///< of all filters, one state after the other
        std::vector<double> next_;
    };

   private:
    using Terms = SampleStates::Terms;
    template <int D>
    static void advance(const SampleFilter& filter, std::array<double, D>& x);
    template <int D>
    void pass_turns(std::size_t row, std::array<double, D>& x, std::array<double, D>& h) const;

    SampleStates states_;
    std::vector<double> gain_;  ///< one per state and row, up to the row from which they stay the same
    std::vector<double> sd_;
    std::vector<std::uint8_t> ticks_;  ///< resampled: intervals of the source since the row before
    std::vector<double> share_;
};

}  // namespace ringlock::closure
