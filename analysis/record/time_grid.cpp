#include "analysis/record/time_grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/error.hpp"

namespace ringlock::record {
namespace {

constexpr double furthest_off = 0.25;    // intervals
constexpr double rounding = 1e-6;        // intervals: of times in decimals
constexpr double memory_points = 32.0;   // over which the grid follows the stamps
constexpr double rate_tolerance = 1e-3;  // relative
constexpr double most_left_out = 1e9;
// Rows from which the stamps tell the length of an interval better than the rate, for the far side of a gap.
constexpr double rows_to_know_rate = 1000.0;
constexpr double rows_to_judge_rate = 5.0;
constexpr double rows_to_judge_steps = 10.0;

}  // namespace

TimeGrid::TimeGrid(double rate_hz, SayPlace place) : rate_hz_(rate_hz), place_(std::move(place)) {}

std::string TimeGrid::row_before() const { return fmt::format("the row before it ({})", place_(last_row_)); }

std::size_t TimeGrid::steps_to(double time_s, std::size_t row) {
    if (!std::isfinite(time_s)) {
        throw InputError(
            fmt::format("{}: {}; every row needs its time in seconds, for it says where the row belongs. "
                        "Leave rows without a time out",
                        place_(row), std::isnan(time_s) ? "has no time" : "the time is infinite"));
    }
    double steps = 1.0;
    if (rows_ == 0.0) {
        first_s_ = time_s;
    } else {
        if (time_s <= last_s_) {
            throw InputError(fmt::format(
                "{}: the time {} s {} {} s of {}; times must increase from row to row. Remove "
                "the repeated rows, or sort them",
                place_(row), time_s, time_s == last_s_ ? "repeats the" : "is before the", last_s_, row_before()));
        }
        const double interval = rows_ >= rows_to_know_rate ? 1.0 + drift().slope : 1.0;
        const double advance = ((time_s - first_s_) * rate_hz_ - position_) / interval;
        steps = std::nearbyint(advance);
        const double off = advance - steps;
        if (steps < 1.0 || std::abs(off) > furthest_off + rounding) fail_off_grid(time_s, row, advance);
        left_out_ += steps - 1.0;
        if (left_out_ > most_left_out) {
            throw InputError(fmt::format(
                "{}: the time {} s leaves {:.6g} samples out since {} s of {}, {:.6g} in all; "
                "allowed are {:g}. Is the time in seconds and the rate {} Hz? Else cut the "
                "record at the gap",
                place_(row), time_s, steps - 1.0, last_s_, row_before(), left_out_, most_left_out, rate_hz_));
        }
        // The mean of the first rows, then of the last ones; far behind a gap, that row alone.
        const double weight = std::min(1.0, std::max(1.0 / (rows_ + 1.0), steps / memory_points));
        position_ += (steps + weight * off) * interval;
        point_ += steps;
        fewest_steps_ = rows_ == 1.0 ? steps : std::min(fewest_steps_, steps);
    }
    rows_ += 1.0;
    note((time_s - first_s_) * rate_hz_ - point_);
    last_s_ = time_s;
    last_row_ = row;
    return static_cast<std::size_t>(steps);
}

void TimeGrid::note(double lag) {
    const double from_mean = point_ - mean_point_;
    const double lag_from_mean = lag - mean_lag_;
    mean_point_ += from_mean / rows_;
    mean_lag_ += lag_from_mean / rows_;
    points_squared_ += from_mean * (point_ - mean_point_);
    points_by_lag_ += from_mean * (lag - mean_lag_);
    lag_squared_ += lag_from_mean * (lag - mean_lag_);
}

TimeGrid::Drift TimeGrid::drift() const {
    Drift drift;
    drift.slope = points_by_lag_ / points_squared_;
    const double rest = std::max(0.0, lag_squared_ - drift.slope * points_by_lag_);
    drift.error = std::sqrt(rest / (rows_ - 2.0) / points_squared_);
    return drift;
}

bool TimeGrid::contradicts_rate() const {
    if (rows_ < rows_to_judge_rate) return false;
    const Drift found = drift();
    constexpr double standard_errors = 4.0;  // or rounded stamps of a short record would contradict every rate
    return std::abs(found.slope) > rate_tolerance && std::abs(found.slope) > standard_errors * found.error;
}

void TimeGrid::fail_rate() const {
    throw InputError(
        fmt::format("{}: up to here the times say {:.8g} samples a second, gaps allowed for, which "
                    "contradicts the rate of {} Hz by more than {:g} of it; give the rate that the instrument "
                    "had, and times in seconds",
                    place_(last_row_), rate_hz_ / (1.0 + drift().slope), rate_hz_, rate_tolerance));
}

void TimeGrid::fail_off_grid(double time_s, std::size_t row, double advance) const {
    if (contradicts_rate()) fail_rate();
    throw InputError(
        fmt::format("{}: the time {} s is {:.6g} sampling intervals (1/rate = {:.6g} s) after {} s of "
                    "{}; allowed are 1, 2, 3, ..., give or take {}. Give the rate that the instrument "
                    "had, and times in seconds; samples that are not uniform must be resampled knowingly",
                    place_(row), time_s, advance, 1.0 / rate_hz_, last_s_, row_before(), furthest_off));
}

void TimeGrid::check_rate() const {
    if (contradicts_rate()) fail_rate();
    if (rows_ >= rows_to_judge_steps && fewest_steps_ > 1.0) {
        throw InputError(
            fmt::format("{}: up to here no two rows are closer than {} intervals of the rate of {} Hz; the "
                        "rate is too high, or the times are not in seconds",
                        place_(last_row_), fewest_steps_, rate_hz_));
    }
}

}  // namespace ringlock::record
