#pragma once
#include <cstddef>
#include <functional>
#include <string>

namespace ringlock::record {

/// Says for a message where row or element `row` stands: "FILE:LINE: column NAME".
using SayPlace = std::function<std::string(std::size_t row)>;

/// Places rows on the grid of a sampling rate by their time stamps.
///
/// The grid follows the stamps, so that a clock that runs off from the rate and the rounding of single stamps are both
/// told from gaps. All errors are InputErrors with place and both times.
class TimeGrid {
   public:
    /// `rate_hz` is positive. `place` is asked for the rows given to steps_to().
    TimeGrid(double rate_hz, SayPlace place);

    /// How many points the grid goes on from the row before to this one: 1 where none is missing between; 1 for the
    /// first. Throws where the time is not finite, does not increase, lies more than a quarter of an interval off the
    /// grid, or where more than 1e9 points have been left out in all.
    std::size_t steps_to(double time_s, std::size_t row);

    /// To be called behind the last row: throws where the stamps keep another rate than they should.
    void check_rate() const;

   private:
    struct Drift {
        double slope = 0.0;  ///< of (times the rate - points of the grid) per point
        double error = 0.0;  ///< standard error of the slope
    };
    Drift drift() const;
    bool contradicts_rate() const;
    [[noreturn]] void fail_rate() const;
    [[noreturn]] void fail_off_grid(double time_s, std::size_t row, double advance) const;
    std::string row_before() const;
    void note(double lag);

    double rate_hz_;
    SayPlace place_;
    double first_s_ = 0.0;
    double last_s_ = 0.0;
    std::size_t last_row_ = 0;
    double rows_ = 0.0;
    double point_ = 0.0;     ///< of the last row: points of the grid since the first
    double position_ = 0.0;  ///< where that point lies, in nominal intervals since the first time
    double left_out_ = 0.0;
    double fewest_steps_ = 0.0;
    // Regression of (time times rate - point) on points, updated row by row (Welford).
    double mean_point_ = 0.0, mean_lag_ = 0.0, points_squared_ = 0.0, points_by_lag_ = 0.0, lag_squared_ = 0.0;
};

}  // namespace ringlock::record
