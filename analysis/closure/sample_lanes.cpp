#include "analysis/closure/sample_lanes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>
#include <type_traits>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "analysis/closure/sample_lanes.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.

HWY_BEFORE_NAMESPACE();
namespace ringlock::closure::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Tag = hn::CappedTag<double, most_lanes>;
using V = hn::Vec<Tag>;

/// As many filters as there are lanes in a vector. D states.
template <int D>
class Lanes {
   public:
    using Line = std::array<V, D>;

    /// The last filter again in lanes that no other is in.
    void begin(std::span<const SampleStates> filters, std::size_t first) {
        of_ = &filters.front();
        const auto from = [&](auto&& value) {
            double values[most_lanes];
            for (std::size_t k = 0; k < hn::Lanes(d_); ++k) {
                values[k] = value(filters[std::min(first + k, filters.size() - 1)]);
            }
            return hn::LoadU(d_, values);
        };
        for (int i = 0; i < D; ++i) {
            for (int j = 0; j < D; ++j) {
                p_[i][j] = from([&](const SampleStates& s) { return s.start[i][j]; });
                q_[i][j] = from([&](const SampleStates& s) { return s.q[i][j]; });
                f_[i][j] = from([&](const SampleStates& s) { return s.f[i][j]; });
            }
            h_[i] = from([&](const SampleStates& s) { return s.h[i]; });
            x_[i] = hn::Zero(d_);
            gain_[i] = hn::Zero(d_);
        }
        floor_ = from([](const SampleStates& s) { return s.floor; });
        ratio_ = from([](const SampleStates& s) { return s.ratio; });
        place_ = from([](const SampleStates& s) { return s.first_place; });
        for (std::size_t k = 0; k < hn::Lanes(d_); ++k) {
            const SampleStates& s = filters[std::min(first + k, filters.size() - 1)];
            swing_[k] = {s.swing_by_row, s.swing_cos, s.swing_sin};
        }
    }

    void row(std::size_t row, double angle, double* innovation, double* variance) {
        if (settled_) {
            step_states();
        } else {
            step_row();
        }
        V e = hn::Set(d_, angle);
        for (int i = 0; i < D; ++i) {
            if (reads(i)) e = hn::NegMulAdd(h_[i], x_[i], e);
        }
        if (!settled_) weigh(row);
        for (int i = 0; i < D; ++i) x_[i] = hn::MulAdd(gain_[i], e, x_[i]);
        hn::StoreU(e, d_, innovation);
        hn::StoreU(variance_, d_, variance);
    }

   private:
    bool reads(int i) const { return of_->resampled ? i >= D - 2 : of_->h[i] != 0.0; }

    /// On to the row, by as many intervals of the source as lie between.
    void step_row() {
        if (!of_->resampled) return step();
        place_ = hn::Add(place_, ratio_);
        const V whole = hn::Floor(place_);
        place_ = hn::Sub(place_, whole);
        if constexpr (D >= 2) {
            h_[D - 2] = hn::Sub(hn::Set(d_, 1.0), place_);
            h_[D - 1] = place_;
        }
        constexpr double most_ticks = 250.0;
        double ticks[most_lanes];
        hn::StoreU(hn::Min(whole, hn::Set(d_, most_ticks)), d_, ticks);
        const auto [least, most] = std::minmax_element(ticks, ticks + hn::Lanes(d_));
        double tick = 0.0;
        for (; tick < *least; ++tick) step();
        if (tick == *most) return;
        // Some are there before others.
        const V all = hn::LoadU(d_, ticks);
        for (; tick < *most; ++tick) {
            const auto goes = hn::Lt(hn::Set(d_, tick), all);
            const auto p = p_;
            const auto x = x_;
            step();
            for (int i = 0; i < D; ++i) {
                x_[i] = hn::IfThenElse(goes, x_[i], x[i]);
                for (int j = 0; j < D; ++j) p_[i][j] = hn::IfThenElse(goes, p_[i][j], p[i][j]);
            }
        }
    }

    void step() {
        step_states();
        // P <- F (F P)' + Q, P being symmetric
        std::array<Line, D> turned;
        for (int i = 0; i < D; ++i) {
            Line fp;
            for (V& v : fp) v = hn::Zero(d_);
            const auto& terms = of_->nonzero[i];
            for (int k = 0; k < terms.count; ++k) {
                const int l = terms.at[k];
                for (int j = 0; j < D; ++j) fp[j] = hn::MulAdd(f_[i][l], p_[l][j], fp[j]);
            }
            for (int j = 0; j < D; ++j) turned[j][i] = fp[j];
        }
        for (int i = 0; i < D; ++i) {
            Line sum = q_[i];
            const auto& terms = of_->nonzero[i];
            for (int k = 0; k < terms.count; ++k) {
                const int l = terms.at[k];
                for (int j = 0; j < D; ++j) sum[j] = hn::MulAdd(f_[i][l], turned[l][j], sum[j]);
            }
            p_[i] = sum;
        }
    }

    void step_states() {
        Line next;
        for (int i = 0; i < D; ++i) {
            next[i] = hn::Zero(d_);
            const auto& terms = of_->nonzero[i];
            for (int k = 0; k < terms.count; ++k) {
                next[i] = hn::MulAdd(f_[i][terms.at[k]], x_[terms.at[k]], next[i]);
            }
        }
        x_ = next;
    }

    /// Variance and gains of this row, and what is known after it.
    void weigh(std::size_t row) {
        Line ph;
        for (V& v : ph) v = hn::Zero(d_);
        for (int j = 0; j < D; ++j) {
            if (!reads(j)) continue;
            for (int i = 0; i < D; ++i) ph[i] = hn::MulAdd(p_[j][i], h_[j], ph[i]);
        }
        variance_ = floor_;
        if (of_->swings) {
            double factors[most_lanes];
            for (std::size_t k = 0; k < hn::Lanes(d_); ++k) {
                const double phase = swing_[k].by_row * static_cast<double>(row);
                factors[k] = std::exp(swing_[k].cosine * std::cos(phase) + swing_[k].sine * std::sin(phase));
            }
            variance_ = hn::Mul(variance_, hn::LoadU(d_, factors));
        }
        for (int i = 0; i < D; ++i) {
            if (reads(i)) variance_ = hn::MulAdd(h_[i], ph[i], variance_);
        }
        const V over = hn::Div(hn::Set(d_, 1.0), variance_);
        const Line last = gain_;
        for (int i = 0; i < D; ++i) gain_[i] = hn::Mul(ph[i], over);
        for (int i = 0; i < D; ++i) {
            for (int j = 0; j < D; ++j) p_[i][j] = hn::NegMulAdd(gain_[i], ph[j], p_[i][j]);
        }
        if (!of_->resampled && !of_->swings) settle(last);
    }

    /// Whether gains have stopped changing: each, since those of slow rates settle long after the variance has.
    void settle(const Line& last) {
        constexpr int rows = 50;
        const V little = hn::Set(d_, 1e-9);
        bool same = true;
        for (int i = 0; i < D && same; ++i) {
            const V most = hn::Mul(little, hn::Abs(gain_[i]));
            same = hn::AllTrue(d_, hn::Le(hn::Abs(hn::Sub(gain_[i], last[i])), most));
        }
        settled_rows_ = same ? settled_rows_ + 1 : 0;
        settled_ = settled_rows_ > rows;
    }

    struct Swing {
        double by_row, cosine, sine;
    };
    Tag d_;
    const SampleStates* of_ = nullptr;  ///< what all have in common
    std::array<Line, D> p_, q_, f_;
    Line h_, x_, gain_;
    V floor_, ratio_, place_;
    V variance_;
    std::array<Swing, most_lanes> swing_{};
    int settled_rows_ = 0;
    bool settled_ = false;
};

template <int D>
void lanes_with(std::span<const SampleStates> filters, std::span<const double> increments, const TakeLanes& take) {
    const Tag d;
    // On the stack: what the heap gives is not aligned for the longest vectors.
    Lanes<D> vectors[most_lanes / hn::MaxLanes(d)];
    const std::size_t count = (filters.size() + hn::Lanes(d) - 1) / hn::Lanes(d);
    for (std::size_t k = 0; k < count; ++k) vectors[k].begin(filters, k * hn::Lanes(d));
    double innovations[most_lanes] = {};
    double variances[most_lanes] = {};
    double angle = 0.0;
    for (std::size_t row = 0; row < increments.size(); ++row) {
        angle += increments[row];
        for (std::size_t k = 0; k < count; ++k) {
            const std::size_t at = k * hn::Lanes(d);
            vectors[k].row(row, angle, innovations + at, variances + at);
        }
        take(row, innovations, variances);
    }
}

/// Calls `with` with the number of states as a constant.
template <int D = 1, class With>
void for_states(int states, With&& with) {
    if constexpr (D <= SampleStates::most) {
        if (states == D) return with(std::integral_constant<int, D>{});
        for_states<D + 1>(states, with);
    }
}

void lanes(std::span<const SampleStates> filters, std::span<const double> increments, const TakeLanes& take) {
    for_states(filters.front().count,
               [&](auto states) { lanes_with<decltype(states)::value>(filters, increments, take); });
}

}  // namespace ringlock::closure::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::closure {

HWY_EXPORT(lanes);

void filter_lanes(std::span<const SampleStates> filters, std::span<const double> increments, const TakeLanes& take) {
    if (filters.empty()) return;
    const bool alike =
        std::all_of(filters.begin(), filters.end(), [&](const SampleStates& s) { return s.is_like(filters.front()); });
    if (filters.size() > most_lanes || !alike) throw std::logic_error("filter_lanes: filters that are not alike");
    HWY_DYNAMIC_DISPATCH(lanes)(filters, increments, take);
}

}  // namespace ringlock::closure
#endif
