#include "analysis/record/series/time_grid.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "engine/core/error.hpp"

namespace ringlock::record {
namespace {

constexpr double furthest_off = 0.25;     // intervals
constexpr double most_allowance = 0.25;   // intervals
constexpr double rounding = 1e-6;         // intervals: of times in decimals
constexpr double rate_tolerance = 1e-3;   // relative
constexpr double least_left_out = 1e6;    // points that may always be left out
constexpr double most_left_out_row = 20;  // and how many for each row that is there
constexpr double standard_errors = 5.0;   // that the grid near by may be off
// Number of rows from which the stamps determine the length of an interval better than the rate, for the far side of a
// gap.
constexpr double rows_to_know_rate = 1000.0;
constexpr std::size_t rows_to_judge_rate = 5;
constexpr double rows_to_judge_steps = 10.0;

}  // namespace

TimeGrid::TimeGrid(double rate_hz, SayPlace place, text::TimeUnit unit, UnitBy unit_by)
    : rate_hz_(rate_hz),
      per_unit_(rate_hz * unit.seconds),
      place_(std::move(place)),
      unit_(std::move(unit)),
      unit_by_(unit_by) {}

std::string TimeGrid::unit_advice(const std::string& unit) const {
    if (unit_by_ == UnitBy::option) return fmt::format("say --time-unit {}", unit);
    return fmt::format("declare them in the header, as in \"time [{}]\"", unit);
}

void TimeGrid::check_order(const text::Stamp& stamp, std::size_t row, const StampedRow& before) const {
    const double value = stamp.value();
    if (!std::isfinite(value)) {
        throw InputError(
            fmt::format("{}: {}; every row needs its time, for it says where the row belongs. "
                        "Leave rows without a time out",
                        place_(row), std::isnan(value) ? "has no time" : "the time is infinite"));
    }
    if (row == before.row) return;  // the first
    const double ahead = stamp.since(before.stamp);
    if (ahead > 0.0) return;
    throw InputError(
        fmt::format("{}: the time {} {} {} of the row before it ({}); times must increase from row to row. "
                    "Remove the repeated rows, or sort them",
                    place_(row), said({stamp, row}), ahead == 0.0 ? "repeats the" : "is before the", said(before),
                    place_(before.row)));
}

/// Stamps in nanoseconds that are read as seconds would be gaps of millions of samples.
void TimeGrid::check_unit(std::span<const StampedRow> first) const {
    std::vector<double> steps;
    for (std::size_t i = 1; i < first.size(); ++i) steps.push_back(first[i].stamp.since(first[i - 1].stamp));
    if (steps.size() < 2 || unit_.iso) return;
    const auto middle = steps.begin() + static_cast<std::ptrdiff_t>((steps.size() - 1) / 2);
    std::nth_element(steps.begin(), middle, steps.end());
    const double usual = *middle;
    if (const double intervals = usual * per_unit_; intervals > 0.5 && intervals < 1.5) return;
    for (const auto& [name, what] : {std::pair{"s", "seconds"},
                                     {"ms", "milliseconds"},
                                     {"us", "microseconds"},
                                     {"ns", "nanoseconds"},
                                     {"mjd", "days"}}) {
        const double intervals = usual * text::time_unit(name).seconds * rate_hz_;
        if (intervals < 0.75 || intervals > 1.25) continue;
        throw InputError(
            fmt::format("{}: the times are taken to be in {}, in which their steps of {:.10g} are {:.6g} sampling "
                        "intervals (1/rate = {:.6g} s); the steps of {:.10g} are 1/rate in {}: {}",
                        place_(first[1].row), unit_.name, usual, usual * per_unit_, 1.0 / rate_hz_, usual, what,
                        unit_advice(name)));
    }
}

/// Straight line through lags over points, both less their means.
TimeGrid::Drift TimeGrid::line_through(std::span<const Lag> lags) {
    double point = 0.0, lag = 0.0;
    for (const Lag& l : lags) {
        point += l.point / static_cast<double>(lags.size());
        lag += l.lag / static_cast<double>(lags.size());
    }
    double points_squared = 0.0, by_lag = 0.0, lag_squared = 0.0;
    for (const Lag& l : lags) {
        points_squared += (l.point - point) * (l.point - point);
        by_lag += (l.point - point) * (l.lag - lag);
        lag_squared += (l.lag - lag) * (l.lag - lag);
    }
    const double slope = by_lag / points_squared;
    const double rest = std::max(0.0, lag_squared - slope * by_lag);
    return {slope, std::sqrt(rest / (static_cast<double>(lags.size()) - 2.0) / points_squared)};
}

/// The lags of rows that follow each other about the mean of the others: the grid that all of them make, not the one
/// that the first happens to be on.
void TimeGrid::check_first(std::span<const StampedRow> first, std::span<const double> points) const {
    const std::size_t n = first.size();
    if (n < 3) return;
    std::vector<Lag> lags;
    for (std::size_t i = 0; i < n; ++i) lags.push_back({points[i], position(first[i].stamp) - points[i]});
    const Drift tilt = line_through(lags);
    constexpr std::size_t enough = 16;
    constexpr double errors = 4.0;
    const bool tilted = n >= enough && std::abs(tilt.slope) > errors * tilt.error;
    const double slope = tilted ? std::clamp(tilt.slope, -rate_tolerance, rate_tolerance) : 0.0;
    double sum = 0.0, squares = 0.0;
    double least = lags[0].lag, most = lags[0].lag;
    for (Lag& l : lags) {
        l.lag -= slope * (l.point - points[0]);
        sum += l.lag;
        squares += l.lag * l.lag;
        least = std::min(least, l.lag);
        most = std::max(most, l.lag);
    }
    std::size_t worst = 1;
    double worst_off = 0.0, worst_excess = -furthest_off;
    for (std::size_t i = 1; i < n; ++i) {
        const auto others = static_cast<double>(n - 1);
        const double mean = (sum - lags[i].lag) / others;
        const double variance = std::max(0.0, (squares - lags[i].lag * lags[i].lag) / others - mean * mean);
        const double off = lags[i].lag - mean;
        const double allowance = std::min(most_allowance, standard_errors * std::sqrt(variance / others));
        const double excess = std::abs(off) - furthest_off - allowance;
        if (excess <= worst_excess) continue;
        worst = i;
        worst_off = off;
        worst_excess = excess;
    }
    const bool spread = most - least > 2.0 * furthest_off + rounding;
    if (!spread && worst_excess <= rounding) return;
    // For stamps that scatter evenly the middle of their range is the best estimate of the grid.
    if (spread) worst_off = std::copysign(0.5 * (most - least), worst_off);
    if (n >= rows_to_judge_rate && std::abs(tilt.slope) > rate_tolerance + errors * tilt.error) {
        fail_rate(first[n - 1].row, tilt.slope);
    }
    fail_off_grid(first[worst], first[worst - 1], worst_off);
}

void TimeGrid::begin(std::span<const StampedRow> first) {
    if (first.empty()) return;
    first_ = first[0].stamp;
    check_order(first[0].stamp, first[0].row, first[0]);
    for (std::size_t i = 1; i < first.size(); ++i) check_order(first[i].stamp, first[i].row, first[i - 1]);
    check_unit(first);
    start_points_.assign(1, 0.0);
    constexpr double memory_rows = 16.0;
    double mean = 0.0;
    std::size_t stretch = 0;  // begin of the rows that no long gap parts
    for (std::size_t i = 1; i < first.size(); ++i) {
        const double at = position(first[i].stamp);
        const double point = std::nearbyint(at - mean);
        const double steps = point - start_points_.back();
        if (steps < 1.0) fail_off_grid(first[i], first[i - 1], at - mean - point);
        last_ = first[i - 1];
        check_left_out(first[i].stamp, first[i].row, steps);
        const std::span<const double> points(start_points_);
        if (steps > near_rows) {
            check_first(first.subspan(stretch, i - stretch), points.subspan(stretch));
            stretch = i;
        }
        start_points_.push_back(point);
        // Behind a gap the clock may have run off.
        const double weight = std::max({1.0 / (static_cast<double>(i) + 1.0), 1.0 / memory_rows, steps / near_rows});
        mean += std::min(1.0, weight) * (at - point - mean);
    }
    left_out_ = 0.0;
    check_first(first.subspan(stretch), std::span<const double>(start_points_).subspan(stretch));
}

/// Slope of the clock against the rate, where the stamps determine it well enough to be followed over that many steps.
double TimeGrid::known_slope(double steps) const {
    if (rows_ < static_cast<double>(rows_to_judge_rate)) return 0.0;
    if (rows_ >= rows_to_know_rate) return points_by_lag_ / points_squared_;
    const Drift found = drift();
    return steps <= near_rows && std::abs(found.slope) > 4.0 * found.error ? found.slope : 0.0;
}

TimeGrid::Centre TimeGrid::centre_at(double point, double steps) const {
    const double slope = known_slope(steps);
    const auto count = static_cast<double>(near_count_);
    const double lag = near_sum_.lag + slope * (count * point - near_sum_.point);
    const double mean_off = offs_ / rows_;
    const double scatter = std::sqrt(std::max(0.0, offs_squared_ / rows_ - mean_off * mean_off));
    return {lag / count, std::min(most_allowance, standard_errors * scatter / std::sqrt(count))};
}

/// Range of the lags near by and one more: the largest less the smallest.
double TimeGrid::spread_with(const Lag& added, double slope) const {
    double least = added.lag, most = added.lag;
    for (std::size_t i = 0; i < near_count_; ++i) {
        const double lag = near_[i].lag + slope * (added.point - near_[i].point);
        least = std::min(least, lag);
        most = std::max(most, lag);
    }
    return most - least;
}

void TimeGrid::check_left_out(const text::Stamp& stamp, std::size_t row, double steps) {
    left_out_ += steps - 1.0;
    const double most = std::max(least_left_out, most_left_out_row * rows_);
    if (left_out_ <= most) return;
    throw InputError(
        fmt::format("{}: the time {} leaves {:.6g} samples out since {} of the row before it ({}), {:.6g} in all; "
                    "allowed are {:g}: 20 for each row so far, or 1e6. Is the time in {} and the rate {} Hz? "
                    "Where the times are in ns, say, {}. Else cut the record at the gap",
                    place_(row), said({stamp, row}), steps - 1.0, said(last_), place_(last_.row), left_out_, most,
                    unit_.name, rate_hz_, unit_advice("ns")));
}

void TimeGrid::remember(const Lag& lag, double steps) {
    // Far behind a gap the rows before it do not determine the grid.
    if (steps > near_rows) {
        near_count_ = near_next_ = 0;
        near_sum_ = {};
    }
    if (near_count_ == near_rows) {
        near_sum_.point -= near_[near_next_].point;
        near_sum_.lag -= near_[near_next_].lag;
    }
    near_[near_next_] = lag;
    near_sum_.point += lag.point;
    near_sum_.lag += lag.lag;
    near_next_ = (near_next_ + 1) % near_rows;
    near_count_ = std::min(near_count_ + 1, near_rows);
    if (near_next_ != 0) return;
    near_sum_ = {};  // summed again from the start, or rounding would add up
    for (const Lag& l : near_) {
        near_sum_.point += l.point;
        near_sum_.lag += l.lag;
    }
}

std::size_t TimeGrid::steps_to(const text::Stamp& stamp, std::size_t row) {
    if (rows_ == 0.0) {
        first_ = stamp;
        last_ = {stamp, row};
    }
    check_order(stamp, row, last_);
    double steps = 1.0;
    const auto before = static_cast<std::size_t>(rows_);
    const double at = position(stamp);
    if (before < start_points_.size()) {
        const double point = start_points_[before];
        steps = before == 0 ? 1.0 : point - point_;
        check_left_out(stamp, row, steps);
        const double off = near_count_ > 0 ? at - point - near_[(near_next_ + near_rows - 1) % near_rows].lag : 0.0;
        offs_ += off;
        offs_squared_ += 0.5 * off * off;  // of two stamps, each off by itself
        remember({point, at - point}, steps);
        point_ = point;
    } else if (before > 0) {
        const double advance = at - point_;
        Centre centre = centre_at(point_, advance);
        const double slope = known_slope(advance);
        steps = std::nearbyint((advance - centre.lag) / (1.0 + slope));
        centre.lag += slope * steps;
        const Lag found{point_ + steps, at - point_ - steps};
        const double off = found.lag - centre.lag;
        const bool far = std::abs(off) > furthest_off + centre.allowance + rounding;
        const bool spread = std::abs(off) > furthest_off - rounding &&
                            spread_with(found, slope) > 2.0 * furthest_off + rounding && near_count_ > 1;
        if (steps < 1.0 || far || spread) fail_off_grid({stamp, row}, last_, off);
        check_left_out(stamp, row, steps);
        offs_ += off;
        offs_squared_ += off * off;
        remember(found, steps);
        point_ = found.point;
    }
    if (before > 0) fewest_steps_ = before == 1 ? steps : std::min(fewest_steps_, steps);
    rows_ += 1.0;
    note(at - point_);
    last_ = {stamp, row};
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
    if (rows_ < static_cast<double>(rows_to_judge_rate)) return false;
    const Drift found = drift();
    constexpr double errors = 4.0;  // or rounded stamps of a short record would contradict every rate
    return std::abs(found.slope) > rate_tolerance && std::abs(found.slope) > errors * found.error;
}

void TimeGrid::fail_rate(std::size_t row, double slope) const {
    throw InputError(
        fmt::format("{}: up to here the times say {:.8g} samples a second, "
                    "gaps allowed for, which contradicts the rate of {} Hz by more than {:g} of it; "
                    "give the rate that the instrument had, and times in seconds; for other units {}",
                    place_(row), rate_hz_ / (1.0 + slope), rate_hz_, rate_tolerance, unit_advice("ms")));
}

void TimeGrid::fail_off_grid(const StampedRow& row, const StampedRow& before, double off) const {
    if (contradicts_rate()) fail_rate(last_.row, drift().slope);
    throw InputError(
        fmt::format("{}: the time {} is {:.6g} sampling intervals (1/rate = {:.6g} s) "
                    "after {} of the row before it ({}), and {:.3g} intervals off the grid of the rows near by; "
                    "allowed is a whole number of intervals, give or take {}. "
                    "Give the rate that the instrument had, and times in seconds (for other units {}); "
                    "samples that are not uniform must be resampled knowingly",
                    place_(row.row), said(row), row.stamp.since(before.stamp) * per_unit_, 1.0 / rate_hz_, said(before),
                    place_(before.row), off, furthest_off, unit_advice("ms")));
}

void TimeGrid::check_rate() const {
    if (contradicts_rate()) fail_rate(last_.row, drift().slope);
    if (rows_ >= rows_to_judge_steps && fewest_steps_ > 1.0) {
        throw InputError(fmt::format(
            "{}: up to here no two rows are closer than {} intervals of the rate of {} Hz; "
            "the rate is too high, or the times are not in {} ({})",
            place_(last_.row), fewest_steps_, rate_hz_, unit_.name == "s" ? "seconds" : unit_.name, unit_advice("ms")));
    }
}

}  // namespace ringlock::record
