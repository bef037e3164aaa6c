#pragma once
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "analysis/allan/allan.hpp"
#include "analysis/allan/sums/difference_sums.hpp"

namespace ringlock::allan {

/// Deviations of a record that is never kept: samples go by, every octave of averaging time is summed at once.
///
/// The estimator is the overlapping one with a stride of tau/8: S_m = sum over i = 0, s, 2s, ... of the squared
/// differences at step m, s = max(1, m/8). Memory grows with the logarithm of the record, about 5 KB for every octave.
/// docs/dev/allan-streams.md gives the cost of the stride: next to nothing for rate noise, a factor of m/8 in degrees
/// of freedom for white phase noise.
class RunningDeviation {
   public:
    /// \param kind       kind of the samples
    /// \param tau0_s     sampling interval [s], > 0
    /// \param estimator  Estimator::oadev or Estimator::ohdev
    /// \param scale      unit of the samples
    ///
    /// Throws InputError outside that.
    RunningDeviation(Kind kind, double tau0_s, Estimator estimator = Estimator::oadev, double scale = 1.0);

    /// Takes the next samples; NaN where one is missing, else finite.
    void add(std::span<const double> data);

    /// Samples so far, and how many of them were missing.
    std::int64_t samples() const { return samples_; }
    std::int64_t missing() const { return missing_; }

    /// Phase at few enough instants to be kept, for methods that need a record (a fit of noise coefficients), but not
    /// its shortest times: every thinning()-th point, at most 32 768; empty where a sample is missing.
    std::vector<double> thinned_phase() const;
    std::int64_t thinning() const { return thinning_; }

    /// m = 1, 2, 4, ... as far as there is a term.
    std::vector<Point> points(double confidence = Options{}.confidence) const;

   private:
    /// Every 2^k-th point of the phase: the last ones, and the sums that are made of them.
    struct Level {
        std::vector<double> rows;  ///< `history` points that are done, then up to `batch` waiting ones
        std::size_t before = 0;    ///< points of the history that are there
        std::size_t waiting = 0;
        bool hand_on = true;        ///< whether the first waiting point goes to the next level
        std::vector<double> sums;   ///< one for each step
        std::vector<double> rests;  ///< rounding errors of the sums
        std::vector<std::int64_t> terms;
    };

    void take(std::span<const double> data);
    void put_all(const double* points, std::size_t count);
    RunningDeviation completed() const;
    void push(std::size_t level, const double* points, std::size_t count);
    void process(std::size_t level);
    void break_off();
    std::size_t history() const;

    Kind kind_;
    double tau0_s_;
    double scale_;
    int differences_;
    bool skipping_ = false;  ///< a NaN is among the points
    std::int64_t samples_ = 0;
    std::int64_t missing_ = 0;
    std::vector<double> lead_;  ///< the first samples, until they determine a line to be removed
    bool started_ = false;
    double origin_ = 0.0;
    double slope_ = 0.0;
    std::int64_t index_ = 0;  ///< of the next sample of phase
    double phase_ = 0.0;      ///< running sum of increments or rates, and its rounding error
    double rest_ = 0.0;
    bool broken_ = true;  ///< the next increment begins a new origin
    std::vector<Level> levels_;
    std::vector<double> thin_;   ///< every thinning-th point
    std::int64_t thinning_ = 1;  ///< a power of two
    std::int64_t points_ = 0;    ///< of the phase so far
};

}  // namespace ringlock::allan
