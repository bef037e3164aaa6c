#include "analysis/closure/samples/model/filter.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "analysis/closure/samples/model/lanes.hpp"

namespace ringlock::closure {

template <int D>
void SampleFilter::advance(const SampleFilter& filter, std::array<double, D>& x) {
    std::array<double, D> next{};
    for (int i = 0; i < D; ++i) {
        const Terms& terms = filter.states_.nonzero[i];
        for (int k = 0; k < terms.count; ++k) next[i] += filter.states_.f[i][terms.at[k]] * x[terms.at[k]];
    }
    x = next;
}

/// Same as pass_turns() of the lanes (lanes.cpp), for the states alone.
template <int D>
void SampleFilter::pass_turns(std::size_t row, std::array<double, D>& x, std::array<double, D>& h) const {
    const DitherRows& rows = *states_.dither;
    double& last = x[states_.of_dither];
    double& next = x[states_.of_dither + 1];
    double& follower = x[states_.of_dither + 2];
    const auto& [kept, by_last, by_next] = states_.dither_follower;
    for (int turn = 0; turn < rows.passed[row]; ++turn) {
        follower = kept * follower + by_last * last + by_next * next;
        last = next;
        next *= states_.dither_memory;
    }
    h[states_.of_dither] = rows.last[row];
    h[states_.of_dither + 1] = rows.next[row];
    h[states_.of_dither + 2] = rows.follower[row];
}

SampleFilter::SampleFilter(const SampleNoise& noise, std::size_t rows, double interval_s) : states_(noise, interval_s) {
    filter_gains(states_, rows, [&](const SampleGains& row) {
        gain_.insert(gain_.end(), row.gain.begin(), row.gain.end());
        sd_.push_back(std::sqrt(row.variance));
        if (!states_.resampled) return;
        ticks_.push_back(static_cast<std::uint8_t>(row.ticks));
        share_.push_back(row.share);
    });
}

SampleFilter::Many::Many(const SampleFilter& filter, std::span<const double> readings)
    : filter_(filter),
      count_(readings.size()),
      x_(static_cast<std::size_t>(filter.states_.count) * count_, 0.0),
      next_(x_.size()) {
    std::copy(readings.begin(), readings.end(), x_.begin());
}

void SampleFilter::Many::predict(std::span<double> readings) {
    const std::size_t count = count_;
    std::fill(readings.begin(), readings.end(), 0.0);
    for (int i = 0; i < filter_.states_.count; ++i) {
        double* to = next_.data() + static_cast<std::size_t>(i) * count;
        const Terms& terms = filter_.states_.nonzero[i];
        std::fill_n(to, count, 0.0);
        for (int k = 0; k < terms.count; ++k) {
            const double f = filter_.states_.f[i][terms.at[k]];
            const double* from = x_.data() + static_cast<std::size_t>(terms.at[k]) * count;
            for (std::size_t p = 0; p < count; ++p) to[p] += f * from[p];
        }
        if (filter_.states_.h[i] == 0.0) continue;
        for (std::size_t p = 0; p < count; ++p) readings[p] += filter_.states_.h[i] * to[p];
    }
    x_.swap(next_);
}

void SampleFilter::Many::take(std::size_t row, std::span<const double> innovations) {
    const auto n = static_cast<std::size_t>(filter_.states_.count);
    const double* gain = filter_.gain_.data() + std::min(row, filter_.sd_.size() - 1) * n;
    for (std::size_t i = 0; i < n; ++i) {
        double* x = x_.data() + i * count_;
        for (std::size_t p = 0; p < count_; ++p) x[p] += gain[i] * innovations[p];
    }
}

void SampleFilter::Many::continue_from(std::span<const std::uint8_t> others) {
    for (std::size_t i = 0; i < static_cast<std::size_t>(filter_.states_.count); ++i) {
        const double* from = x_.data() + i * count_;
        double* to = next_.data() + i * count_;
        for (std::size_t p = 0; p < count_; ++p) to[p] = from[others[p]];
    }
    x_.swap(next_);
}

std::vector<double> SampleFilter::apply(std::span<const double> increments) const {
    std::vector<double> out(increments.size());
    for_states(states_.count, [&](auto d) {
        constexpr int D = decltype(d)::value;
        std::array<double, D> x{};
        std::array<double, D> h;
        for (int i = 0; i < D; ++i) h[i] = states_.h[i];
        double before = 0.0;
        const std::size_t rows = sd_.size();
        for (std::size_t k = 0; k < increments.size(); ++k) {
            const std::size_t g = std::min(k, rows - 1);
            const int ticks = states_.resampled ? ticks_[k] : 1;
            for (int i = 0; i < ticks; ++i) advance<D>(*this, x);
            if constexpr (D >= 2) {
                if (states_.resampled) {
                    h[D - 2] = 1.0 - share_[k];
                    h[D - 1] = share_[k];
                }
            }
            if constexpr (D > SampleStates::dither_states) {
                if (states_.dither) pass_turns<D>(k, x, h);
            }
            before += increments[k];
            double e = before;
            for (int i = 0; i < D; ++i) e -= h[i] * x[i];
            const double* gain = gain_.data() + g * D;
            for (int i = 0; i < D; ++i) x[i] += gain[i] * e;
            out[k] = e / sd_[g];
        }
    });
    return out;
}

std::vector<double> SampleFilter::minus_log_likelihoods(std::span<const SampleNoise> noises, double interval_s,
                                                        std::span<const double> increments,
                                                        std::span<const std::uint8_t> rows) {
    std::vector<SampleStates> states;
    for (const SampleNoise& noise : noises) states.emplace_back(noise, interval_s);
    // Filters of the same structure together, as many as there are lanes.
    std::vector<std::vector<std::size_t>> parts;
    for (std::size_t k = 0; k < noises.size(); ++k) {
        const auto part = std::find_if(parts.begin(), parts.end(), [&](const std::vector<std::size_t>& of) {
            return of.size() < most_lanes && states[of.front()].is_like(states[k]);
        });
        if (part == parts.end()) {
            parts.push_back({k});
        } else {
            part->push_back(k);
        }
    }
    std::vector<double> all(noises.size());
    oneapi::tbb::parallel_for(std::size_t{0}, parts.size(), [&](std::size_t at) {
        const std::vector<std::size_t>& part = parts[at];
        std::vector<SampleStates> alike;
        for (const std::size_t k : part) alike.push_back(states[k]);
        std::array<double, most_lanes> sums{};
        // Of variances: the logarithm of each would cost more than all other operations.
        std::array<double, most_lanes> products;
        products.fill(1.0);
        filter_lanes(alike, increments, [&](std::size_t row, const double* e, const double* variances) {
            if (!rows[row]) return;
            for (std::size_t k = 0; k < part.size(); ++k) {
                sums[k] += 0.5 * e[k] * e[k] / variances[k];
                products[k] *= variances[k];
                if (products[k] > 1e-200 && products[k] < 1e200) continue;
                sums[k] += 0.5 * std::log(products[k]);
                products[k] = 1.0;
            }
        });
        for (std::size_t k = 0; k < part.size(); ++k) all[part[k]] = sums[k] + 0.5 * std::log(products[k]);
    });
    return all;
}

}  // namespace ringlock::closure
