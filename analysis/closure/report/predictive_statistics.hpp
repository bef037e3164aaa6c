#pragma once
#include <cstddef>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/report/predictive.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/closure/turns/model/series.hpp"
#include "engine/gyro/setup.hpp"

/// Statistics by which the predictive check compares the measured record with simulated ones.
namespace ringlock::closure {

/// One statistic of one record.
struct Curve {
    std::vector<double> x, y;  ///< in the units of `blank_statistics()`; y is NaN where it is not defined
};
/// All statistics of one record, in the order of `blank_statistics()`.
using Curves = std::vector<Curve>;

/// Names and units of the curves.
/// \param turns  whether the record is one of turns, which has the folded statistics too
std::vector<PredictiveStatistic> blank_statistics(bool turns);

/// Statistics of records of turns, computed as for the measured one.
class TurnStatistics {
   public:
    TurnStatistics(const record::Record& record, const Closure& closure);

    /// Peak rate of the dither, from the mean amplitude [deg/s].
    double peak_rate_deg_s(const record::Record& record) const;
    Curves curves_of(const record::Turns& turns) const;

   private:
    gyro::Ellipse ellipse_;
    bool count_again_ = false;
    TurnSeries measured_;
};

/// Statistics of records of samples, computed as for the measured one.
class SampleStatistics {
   public:
    SampleStatistics(const record::Record& record, const Closure& closure);

    /// Disturbed stretches and gaps are excluded from simulations as from the record: their rows get the mean of the
    /// others.
    Curves curves_of(std::vector<double> increment_arcsec) const;
    /// The same with the disturbed stretches and gaps.
    Curves curves_of_whole(std::vector<double> increment_arcsec) const;
    const SampleSeries& measured() const { return measured_; }

   private:
    std::vector<double> less_input(std::vector<double> increment_arcsec) const;

    SampleSeries measured_;
    Rows left_out_;
};

/// Ranks the first of the curves, the measured one, among all of them.
///
/// Each curve is compared with the mean and the standard deviation of the others, at every point, and its largest
/// deviation is ranked. Curves of one distribution are exchangeable, so that all ranks are equally probable, whatever
/// the distribution and the correlation of the points.
void rank(const std::vector<std::vector<double>>& curves, PredictiveStatistic& statistic);

/// Mean over simulations of statistic k, point by point; of its logarithm where it is positive.
std::vector<double> mean_of(const std::vector<Curves>& all, std::size_t k, std::size_t points, bool positive);

}  // namespace ringlock::closure
