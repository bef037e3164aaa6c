#include "analysis/allan/sums/phase.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/allan/sums/exact_sum.hpp"

namespace ringlock::allan {
namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

/// Stretches of samples that are there.
template <class There>
std::vector<Stretch> stretches_of(std::size_t size, const There& there) {
    std::vector<Stretch> out;
    for (std::size_t i = 0; i < size; ++i) {
        if (!there(i)) continue;
        if (out.empty() || out.back().end != i) out.push_back({i, i});
        out.back().end = i + 1;
    }
    return out;
}

/// Real samples: sums carry their rounding errors along.
class Reals {
   public:
    explicit Reals(std::span<const double> data) : data_(data) {}

    std::size_t size() const { return data_.size(); }
    bool there(std::size_t i) const { return !std::isnan(data_[i]); }
    void take_line(std::size_t first, std::size_t last) {
        origin_ = data_[first];
        slope_ = last > first ? (data_[last] - origin_) / static_cast<double>(last - first) : 0.0;
    }
    void take_mean(const std::vector<Stretch>& stretches) {
        double total = 0.0;
        double count = 0.0;
        for (const Stretch& s : stretches) {
            for (std::size_t i = s.begin; i < s.end; ++i) total += data_[i];
            count += static_cast<double>(s.size());
        }
        slope_ = total / count;
    }
    double slope() const { return slope_; }
    /// Sample i less the line, `steps` samples after where the line begins.
    double above_line(std::size_t i, std::size_t steps) const {
        const ExactSum d = two_sum(data_[i], -origin_);
        return std::fma(-slope_, static_cast<double>(steps), d.value) + d.error;
    }
    void begin() { running_ = {0.0, 0.0}; }
    double add(std::size_t i) {
        const ExactSum step = two_sum(data_[i], -slope_);
        const ExactSum next = two_sum(running_.value, step.value);
        running_ = {next.value, running_.error + next.error + step.error};
        return running_.value + running_.error;
    }

   private:
    std::span<const double> data_;
    double origin_ = 0.0;
    double slope_ = 0.0;
    ExactSum running_{0.0, 0.0};
};

/// Whole counts in two's complement: nothing is rounded.
class Counts {
   public:
    Counts(std::span<const std::int64_t> data, std::span<const double> present) : data_(data), present_(present) {}

    std::size_t size() const { return data_.size(); }
    bool there(std::size_t i) const { return present_.empty() || !std::isnan(present_[i]); }
    void take_line(std::size_t first, std::size_t last) {
        origin_ = at(first);
        if (last == first) return;
        const auto rise = static_cast<double>(static_cast<std::int64_t>(at(last) - origin_));
        slope_ = std::llround(rise / static_cast<double>(last - first));
    }
    void take_mean(const std::vector<Stretch>& stretches) {
        long double total = 0.0L;
        long double count = 0.0L;
        for (const Stretch& s : stretches) {
            for (std::size_t i = s.begin; i < s.end; ++i) total += static_cast<long double>(data_[i]);
            count += static_cast<long double>(s.size());
        }
        slope_ = std::llround(static_cast<double>(total / count));
    }
    double slope() const { return static_cast<double>(slope_); }
    double above_line(std::size_t i, std::size_t steps) const {
        return whole(at(i) - origin_ - static_cast<std::uint64_t>(slope_) * steps);
    }
    void begin() { running_ = 0; }
    double add(std::size_t i) {
        running_ += at(i) - static_cast<std::uint64_t>(slope_);
        return whole(running_);
    }

   private:
    std::uint64_t at(std::size_t i) const { return static_cast<std::uint64_t>(data_[i]); }
    static double whole(std::uint64_t bits) { return static_cast<double>(static_cast<std::int64_t>(bits)); }

    std::span<const std::int64_t> data_;
    std::span<const double> present_;
    std::uint64_t origin_ = 0;
    std::int64_t slope_ = 0;
    std::uint64_t running_ = 0;
};

template <class Samples>
void from_phase(Samples& samples, const std::vector<Stretch>& there, Phase& out) {
    const std::size_t first = there.front().begin;
    const std::size_t last = there.back().end - 1;
    samples.take_line(first, last);
    out.x.assign(last - first + 1, nan);
    for (const Stretch& s : there) {
        for (std::size_t i = s.begin; i < s.end; ++i) out.x[i - first] = samples.above_line(i, i - first);
        out.stretches.push_back({s.begin - first, s.end - first});
    }
}

/// A stretch of k increments makes k + 1 points. Where only one increment is missing, two stretches have a point each
/// at its ends: nothing lies between them, and no difference may join them.
template <class Samples>
void from_increments(Samples& samples, const std::vector<Stretch>& there, Phase& out) {
    const std::size_t first = there.front().begin;
    samples.take_mean(there);
    out.x.assign(there.back().end - first + 1, nan);
    out.one_origin = there.size() == 1;
    for (const Stretch& s : there) {
        std::size_t point = s.begin - first;
        out.stretches.push_back({point, point + s.size() + 1});
        samples.begin();
        out.x[point] = 0.0;
        for (std::size_t i = s.begin; i < s.end; ++i) out.x[++point] = samples.add(i);
    }
}

template <class Samples>
Phase phase_from(Samples samples, Kind kind, double tau0_s, double scale) {
    Phase out;
    const std::vector<Stretch> there = stretches_of(samples.size(), [&](std::size_t i) { return samples.there(i); });
    if (there.empty()) return out;
    if (kind == Kind::phase) {
        from_phase(samples, there, out);
    } else {
        from_increments(samples, there, out);
    }
    if (kind == Kind::rate) scale *= tau0_s;
    out.line_per_sample = samples.slope() * scale;
    if (scale != 1.0) {
        for (double& x : out.x) x *= scale;
    }
    return out;
}

}  // namespace

Phase phase_of(std::span<const double> data, Kind kind, double tau0_s, double scale) {
    return phase_from(Reals(data), kind, tau0_s, scale);
}

Phase phase_of(std::span<const std::int64_t> counts, std::span<const double> present, Kind kind, double tau0_s,
               double scale) {
    return phase_from(Counts(counts, present), kind, tau0_s, scale);
}

std::vector<double> centred_phase(std::span<const double> data, Kind kind, double tau0_s) {
    return phase_of(data, kind, tau0_s).x;
}

}  // namespace ringlock::allan
