#include "analysis/allan/running_deviation.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "analysis/allan/interval.hpp"
#include "analysis/allan/octave_deviation.hpp"
#include "analysis/allan/sums/exact_sum.hpp"
#include "engine/core/error.hpp"

namespace ringlock::allan {
namespace {

/// Samples from which the line is taken that is removed: any will do, this one keeps phase small.
constexpr std::size_t lead_samples = 1024;
constexpr std::size_t batch = 512;
constexpr auto starts = static_cast<std::size_t>(OctaveStream::starts_per_tau);

/// Slope of the line through the first and the last of them (phase), or their mean.
double lead_slope(std::span<const double> lead, Kind kind) {
    double first = 0.0;
    double last = 0.0;
    double sum = 0.0;
    std::size_t first_at = lead.size();
    std::size_t last_at = 0;
    std::size_t count = 0;
    for (std::size_t i = 0; i < lead.size(); ++i) {
        if (std::isnan(lead[i])) continue;
        if (count == 0) {
            first = lead[i];
            first_at = i;
        }
        last = lead[i];
        last_at = i;
        sum += lead[i];
        ++count;
    }
    if (count == 0) return 0.0;
    if (kind != Kind::phase) return sum / static_cast<double>(count);
    return last_at > first_at ? (last - first) / static_cast<double>(last_at - first_at) : 0.0;
}

}  // namespace

RunningDeviation::RunningDeviation(Kind kind, double tau0_s, Estimator estimator, double scale)
    : kind_(kind),
      tau0_s_(tau0_s),
      scale_(kind == Kind::rate ? scale * tau0_s : scale),
      differences_(traits(estimator).differences) {
    check_deviation_input(tau0_s, Options{}.confidence);
    if (estimator != Estimator::oadev && estimator != Estimator::ohdev) {
        throw InputError(fmt::format("{}: a record that is not kept has oadev and ohdev only", name(estimator)));
    }
}

std::size_t RunningDeviation::history() const { return static_cast<std::size_t>(differences_) * starts; }

void RunningDeviation::add(std::span<const double> data) {
    samples_ += static_cast<std::int64_t>(data.size());
    missing_ += std::count_if(data.begin(), data.end(), [](double v) { return std::isnan(v); });
    if (!started_) {
        const std::size_t more = std::min(data.size(), lead_samples - lead_.size());
        lead_.insert(lead_.end(), data.begin(), data.begin() + static_cast<std::ptrdiff_t>(more));
        if (lead_.size() < lead_samples) return;
        slope_ = lead_slope(lead_, kind_);
        started_ = true;
        take(lead_);
        lead_ = {};
        data = data.subspan(more);
    }
    take(data);
}

void RunningDeviation::take(std::span<const double> data) {
    constexpr double nan = std::numeric_limits<double>::quiet_NaN();
    double points[batch];
    std::size_t count = 0;
    const auto put = [&](double x) {
        points[count++] = x;
        if (count == batch) put_all(points, std::exchange(count, 0));
    };
    for (const double v : data) {
        const bool there = !std::isnan(v);
        if (kind_ == Kind::phase) {
            if (there && index_ == 0) origin_ = v;
            // Points before the first known one have no position on the line and need none.
            if (index_ == 0 && !there) continue;
            const ExactSum d = two_sum(v, -origin_);
            put(there ? (std::fma(-slope_, static_cast<double>(index_), d.value) + d.error) * scale_ : nan);
            skipping_ = skipping_ || !there;
            ++index_;
            continue;
        }
        if (!there) {
            put_all(points, std::exchange(count, 0));
            break_off();
            broken_ = true;
            continue;
        }
        if (broken_) {
            phase_ = rest_ = 0.0;
            put(0.0);
            broken_ = false;
        }
        const ExactSum step = two_sum(v, -slope_);
        const ExactSum next = two_sum(phase_, step.value);
        phase_ = next.value;
        rest_ += next.error + step.error;
        put((phase_ + rest_) * scale_);
    }
    put_all(points, count);
}

void RunningDeviation::put_all(const double* points, std::size_t count) {
    constexpr std::size_t most_thin = 32768;
    // The first of these points that is kept, then every thinning-th.
    const auto first = static_cast<std::size_t>((thinning_ - (points_ & (thinning_ - 1))) & (thinning_ - 1));
    for (std::size_t i = first; i < count; i += static_cast<std::size_t>(thinning_)) {
        if (thin_.size() == most_thin) {
            for (std::size_t k = 0; k < most_thin / 2; ++k) thin_[k] = thin_[2 * k];
            thin_.resize(most_thin / 2);
            thinning_ *= 2;  // the point at hand, the 2 x most_thin-th step, is one of the fewer
        }
        thin_.push_back(points[i]);
    }
    points_ += static_cast<std::int64_t>(count);
    push(0, points, count);
}

void RunningDeviation::push(std::size_t level, const double* points, std::size_t count) {
    if (level == levels_.size()) {
        Level fresh;
        fresh.rows.resize(history() + batch);
        std::size_t steps = 1;
        for (std::size_t step = 1; level == 0 && step < starts; step *= 2) ++steps;
        fresh.sums.resize(steps);
        fresh.rests.resize(steps);
        fresh.terms.resize(steps);
        levels_.push_back(std::move(fresh));
    }
    while (count > 0) {
        Level& here = levels_[level];
        const std::size_t fitting = std::min(count, batch - here.waiting);
        std::copy_n(points, fitting, here.rows.data() + history() + here.waiting);
        points += fitting;
        here.waiting += fitting;
        count -= fitting;
        if (here.waiting == batch) process(level);
    }
}

void RunningDeviation::process(std::size_t level) {
    Level& here = levels_[level];
    const Difference difference{.order = differences_, .skipping = skipping_};
    const std::size_t old = history();
    for (std::size_t k = 0; k < here.sums.size(); ++k) {
        const std::size_t step = level == 0 ? std::size_t{1} << k : starts;
        const std::size_t reach = static_cast<std::size_t>(differences_) * step;
        // Differences end at the waiting points; those that would begin before the first kept point are left out.
        const std::size_t short_of = reach - std::min(reach, here.before);
        if (here.waiting <= short_of) continue;
        DifferenceSums sums;
        sums.add(here.rows.data() + old + short_of - reach, difference, step, here.waiting - short_of);
        const SquareMean more = sums.folded();
        const ExactSum total = two_sum(here.sums[k], more.sum);
        here.sums[k] = total.value;
        here.rests[k] += total.error;
        here.terms[k] += more.terms;
    }
    double even[batch];
    std::size_t count = 0;
    for (std::size_t i = here.hand_on ? 0 : 1; i < here.waiting; i += 2) even[count++] = here.rows[old + i];
    here.hand_on = here.hand_on == (here.waiting % 2 == 0);
    const std::size_t kept = std::min(old, here.before + here.waiting);
    std::copy_n(here.rows.data() + old + here.waiting - kept, kept, here.rows.data() + old - kept);
    here.before = kept;
    here.waiting = 0;
    push(level + 1, even, count);
}

void RunningDeviation::break_off() {
    for (std::size_t level = 0; level < levels_.size(); ++level) {
        // So few points make no difference here, and the levels above have fewer still.
        const Level& here = levels_[level];
        if (level > 0 && here.before < history() && here.before + here.waiting <= history()) break;
        if (here.waiting > 0) process(level);  // may add a level
    }
    for (Level& level : levels_) {
        level.before = level.waiting = 0;
        level.hand_on = true;
    }
}

RunningDeviation RunningDeviation::completed() const {
    RunningDeviation done(*this);
    if (!done.started_) {
        done.slope_ = lead_slope(done.lead_, kind_);
        done.started_ = true;
        done.take(done.lead_);
    }
    return done;
}

std::vector<double> RunningDeviation::thinned_phase() const {
    if (missing_ > 0) return {};
    return started_ ? thin_ : completed().thin_;
}

std::vector<Point> RunningDeviation::points(double confidence) const {
    RunningDeviation done = completed();
    done.break_off();
    std::vector<OctaveMean> octaves;
    std::int64_t interval = 1;
    for (std::size_t level = 0; level < done.levels_.size(); ++level, interval *= 2) {
        const Level& here = done.levels_[level];
        for (std::size_t k = 0; k < here.sums.size(); ++k) {
            const std::int64_t step = level == 0 ? std::int64_t{1} << k : static_cast<std::int64_t>(starts);
            if (here.terms[k] == 0) continue;
            const auto n = static_cast<double>(here.terms[k]);
            octaves.push_back({step * interval, (here.sums[k] + here.rests[k]) / n, here.terms[k]});
        }
    }
    const std::int64_t points = samples_ + (kind_ == Kind::phase ? 0 : 1);
    return octave_points(octaves, differences_, points, tau0_s_, confidence);
}

}  // namespace ringlock::allan
