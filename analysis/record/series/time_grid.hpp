#pragma once
#include <array>
#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "analysis/text/stamps.hpp"

namespace ringlock::record {

/// Position of row or element `row` for a message: "FILE:LINE: column NAME".
using SayPlace = std::function<std::string(std::size_t row)>;

/// The time of a row.
struct StampedRow {
    text::Stamp stamp;
    std::size_t row = 0;  ///< for messages
};

/// Places rows on the grid of a sampling rate by their time stamps.
///
/// The grid is that of the stamps near by: a stamp is accepted if it lies within a quarter of an interval of the grid,
/// to either side; stamps off the grid are accepted if all near by lie within half an interval of each other. The grid
/// follows a clock that runs off from the rate. All errors are InputErrors with place and both times.
class TimeGrid {
   public:
    /// Source of the unit of the times; for messages.
    enum class UnitBy {
        option,  ///< --time-unit
        header,  ///< the name of the column
    };

    /// `rate_hz` is positive. `place` is called with the rows given to begin() and steps_to().
    TimeGrid(double rate_hz, SayPlace place, text::TimeUnit unit = {}, UnitBy unit_by = UnitBy::option);

    /// Number of rows that begin() needs, or all rows of a shorter table.
    static constexpr std::size_t first_rows = 64;

    /// Looks at the first rows, so that the grid is known before any of them is placed. Throws where steps_to() would,
    /// and where their steps are those of the rate in another unit.
    void begin(std::span<const StampedRow> first);

    /// How many points the grid goes on from the row before to this one: 1 where none is missing between; 1 for the
    /// first. The first calls are for the rows that begin() has had. Throws where the time is not finite, does not
    /// increase, lies off the grid, or where more points have been left out in all than 20 times the rows so far, and
    /// more than 1e6.
    std::size_t steps_to(const text::Stamp& stamp, std::size_t row);

    /// To be called behind the last row: throws where the stamps keep another rate than they should.
    void check_rate() const;

   private:
    /// Where stamps lie off the points that they are given, in nominal intervals.
    struct Lag {
        double point = 0.0;
        double lag = 0.0;
    };
    /// The grid near by: the mean lag, and its uncertainty.
    struct Centre {
        double lag = 0.0;
        double allowance = 0.0;  ///< by which a stamp may be further off than a quarter, for the mean is of few
    };
    struct Drift {
        double slope = 0.0;  ///< of (times the rate - points of the grid) per point
        double error = 0.0;  ///< standard error of the slope
    };
    Drift drift() const;
    double position(const text::Stamp& stamp) const { return stamp.since(first_) * per_unit_; }
    double known_slope(double steps) const;
    Centre centre_at(double point, double steps) const;
    void check_order(const text::Stamp& stamp, std::size_t row, const StampedRow& before) const;
    void check_unit(std::span<const StampedRow> first) const;
    void check_left_out(const text::Stamp& stamp, std::size_t row, double steps);
    static Drift line_through(std::span<const Lag> lags);
    void check_first(std::span<const StampedRow> first, std::span<const double> points) const;
    double spread_with(const Lag& added, double slope) const;
    void remember(const Lag& lag, double steps);
    bool contradicts_rate() const;
    [[noreturn]] void fail_rate(std::size_t row, double slope) const;
    [[noreturn]] void fail_off_grid(const StampedRow& row, const StampedRow& before, double off) const;
    std::string said(const StampedRow& row) const { return text::text_of(row.stamp, unit_); }
    std::string unit_advice(const std::string& unit) const;
    void note(double lag);

    double rate_hz_;
    double per_unit_;  ///< intervals in one unit of the stamps
    SayPlace place_;
    text::TimeUnit unit_;
    UnitBy unit_by_;
    text::Stamp first_;
    StampedRow last_;
    std::vector<double> start_points_;  ///< of the rows that begin() has had
    double rows_ = 0.0;
    double point_ = 0.0;  ///< of the last row: points of the grid since the first
    double left_out_ = 0.0;
    double fewest_steps_ = 0.0;
    static constexpr std::size_t near_rows = 32;
    std::array<Lag, near_rows> near_{};  ///< of the last rows, the oldest of which goes first
    std::size_t near_count_ = 0;
    std::size_t near_next_ = 0;
    Lag near_sum_;
    double offs_ = 0.0, offs_squared_ = 0.0;  ///< sums over rows: their scatter about the grid
    // Regression of (time times rate - point) on points, updated row by row (Welford).
    double mean_point_ = 0.0, mean_lag_ = 0.0, points_squared_ = 0.0, points_by_lag_ = 0.0, lag_squared_ = 0.0;
};

}  // namespace ringlock::record
