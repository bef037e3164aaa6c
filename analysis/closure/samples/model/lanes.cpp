#include "analysis/closure/samples/model/lanes.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <stdexcept>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "analysis/closure/samples/model/lanes.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.

HWY_BEFORE_NAMESPACE();
namespace ringlock::closure::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

/// Arithmetic on vectors, with one filter per lane.
struct Beside {
    using Tag = hn::CappedTag<double, most_lanes>;
    using Value = hn::Vec<Tag>;
    static std::size_t lanes() { return hn::Lanes(Tag()); }
    static Value set(double v) { return hn::Set(Tag(), v); }
    static Value load(const double* from) { return hn::LoadU(Tag(), from); }
    static void store(Value v, double* to) { hn::StoreU(v, Tag(), to); }
    static Value sub(Value a, Value b) { return hn::Sub(a, b); }
    static Value add(Value a, Value b) { return hn::Add(a, b); }
    static Value mul(Value a, Value b) { return hn::Mul(a, b); }
    static Value div(Value a, Value b) { return hn::Div(a, b); }
    static Value mul_add(Value a, Value b, Value c) { return hn::MulAdd(a, b, c); }
    static Value neg_mul_add(Value a, Value b, Value c) { return hn::NegMulAdd(a, b, c); }
    static Value floor(Value v) { return hn::Floor(v); }
    static Value min(Value a, Value b) { return hn::Min(a, b); }
    static Value abs(Value v) { return hn::Abs(v); }
    static bool none_above(Value a, Value b) { return hn::AllTrue(Tag(), hn::Le(a, b)); }
    /// `yes` where a < b, else `no`.
    static Value where_less(Value a, Value b, Value yes, Value no) { return hn::IfThenElse(hn::Lt(a, b), yes, no); }
};

/// Arithmetic on one filter, whose states the compiler may put in lanes.
struct Alone {
    using Value = double;
    static std::size_t lanes() { return 1; }
    static Value set(double v) { return v; }
    static Value load(const double* from) { return *from; }
    static void store(Value v, double* to) { *to = v; }
    static Value sub(Value a, Value b) { return a - b; }
    static Value add(Value a, Value b) { return a + b; }
    static Value mul(Value a, Value b) { return a * b; }
    static Value div(Value a, Value b) { return a / b; }
    static Value mul_add(Value a, Value b, Value c) { return a * b + c; }
    static Value neg_mul_add(Value a, Value b, Value c) { return c - a * b; }
    static Value floor(Value v) { return std::floor(v); }
    static Value min(Value a, Value b) { return std::min(a, b); }
    static Value abs(Value v) { return std::abs(v); }
    static bool none_above(Value a, Value b) { return a <= b; }
    static Value where_less(Value a, Value b, Value yes, Value no) { return a < b ? yes : no; }
};

/// As many Kalman filters as a value of the arithmetic A has lanes, with D states each.
template <class A, int D>
class Lanes {
   public:
    using V = typename A::Value;
    using Line = std::array<V, D>;

    /// Lanes without a filter of their own repeat the last filter.
    void begin(std::span<const SampleStates> filters, std::size_t first) {
        of_ = &filters.front();
        const auto from = [&](auto&& value) {
            double values[most_lanes];
            for (std::size_t k = 0; k < A::lanes(); ++k) {
                values[k] = value(filters[std::min(first + k, filters.size() - 1)]);
            }
            return A::load(values);
        };
        for (int i = 0; i < D; ++i) {
            for (int j = 0; j < D; ++j) {
                p_[i][j] = from([&](const SampleStates& s) { return s.start[i][j]; });
                q_[i][j] = from([&](const SampleStates& s) { return s.q[i][j]; });
                f_[i][j] = from([&](const SampleStates& s) { return s.f[i][j]; });
            }
            h_[i] = from([&](const SampleStates& s) { return s.h[i]; });
            x_[i] = A::set(0.0);
            gain_[i] = A::set(0.0);
        }
        floor_ = from([](const SampleStates& s) { return s.floor; });
        kick_ = from([](const SampleStates& s) { return s.kick; });
        memory_ = from([](const SampleStates& s) { return s.dither_memory; });
        kept_ = from([](const SampleStates& s) { return s.dither_follower.kept; });
        by_last_ = from([](const SampleStates& s) { return s.dither_follower.by_last; });
        by_next_ = from([](const SampleStates& s) { return s.dither_follower.by_next; });
        renewed_ =
            from([](const SampleStates& s) { return (1.0 - s.dither_memory * s.dither_memory) * s.dither_variance; });
        ratio_ = from([](const SampleStates& s) { return s.ratio; });
        place_ = from([](const SampleStates& s) { return s.first_place; });
        for (std::size_t k = 0; k < A::lanes(); ++k) {
            const SampleStates& s = filters[std::min(first + k, filters.size() - 1)];
            swing_[k] = {s.swing_by_row, s.swing_cos, s.swing_sin};
        }
    }

    void row(std::size_t row, double angle, double* innovation, double* variance) {
        if (settled_) {
            step_states();
        } else {
            step_row();
            if constexpr (D >= 2) {
                if (of_->kicks) kick(row);
            }
            if constexpr (D > SampleStates::dither_states) {
                if (of_->dither) pass_turns(row);
            }
        }
        V e = A::set(angle);
        for (int i = 0; i < D; ++i) {
            if (reads(i)) e = A::neg_mul_add(h_[i], x_[i], e);
        }
        if (!settled_) weigh(row);
        for (int i = 0; i < D; ++i) x_[i] = A::mul_add(gain_[i], e, x_[i]);
        A::store(e, innovation);
        A::store(variance_, variance);
    }

    /// Source intervals between the last two rows, of the first filter.
    int ticks() const { return static_cast<int>(ticks_[0]); }
    V share() const { return place_; }
    const Line& gain() const { return gain_; }
    /// Whether variances and gains no longer change.
    bool settled() const { return settled_; }

   private:
    bool reads(int i) const { return of_->resampled ? i >= D - 2 : of_->h[i] != 0.0; }

    /// Advances to the next row by the source intervals in between.
    void step_row() {
        if (!of_->resampled) {
            ticks_[0] = 1.0;
            return step();
        }
        place_ = A::add(place_, ratio_);
        const V whole = A::floor(place_);
        place_ = A::sub(place_, whole);
        if constexpr (D >= 2) {
            h_[D - 2] = A::sub(A::set(1.0), place_);
            h_[D - 1] = place_;
        }
        constexpr double most_ticks = 250.0;
        A::store(A::min(whole, A::set(most_ticks)), ticks_.data());
        const auto [least, most] = std::minmax_element(ticks_.data(), ticks_.data() + A::lanes());
        double tick = 0.0;
        for (; tick < *least; ++tick) step();
        if (tick == *most) return;
        // Filters with fewer intervals keep their states while the others advance.
        const V all = A::load(ticks_.data());
        for (; tick < *most; ++tick) {
            const auto p = p_;
            const auto x = x_;
            step();
            const V at = A::set(tick);
            for (int i = 0; i < D; ++i) {
                x_[i] = A::where_less(at, all, x_[i], x[i]);
                for (int j = 0; j < D; ++j) p_[i][j] = A::where_less(at, all, p_[i][j], p[i][j]);
            }
        }
    }

    void step() {
        step_states();
        // P <- F (F P)' + Q, P being symmetric
        std::array<Line, D> turned;
        for (int i = 0; i < D; ++i) {
            Line fp;
            for (V& v : fp) v = A::set(0.0);
            const auto& terms = of_->nonzero[i];
            for (int k = 0; k < terms.count; ++k) {
                const int l = terms.at[k];
                for (int j = 0; j < D; ++j) fp[j] = A::mul_add(f_[i][l], p_[l][j], fp[j]);
            }
            for (int j = 0; j < D; ++j) turned[j][i] = fp[j];
        }
        for (int i = 0; i < D; ++i) {
            Line sum = q_[i];
            const auto& terms = of_->nonzero[i];
            for (int k = 0; k < terms.count; ++k) {
                const int l = terms.at[k];
                for (int j = 0; j < D; ++j) sum[j] = A::mul_add(f_[i][l], turned[l][j], sum[j]);
            }
            p_[i] = sum;
        }
    }

    /// Adds the kicks at the turns next to the end of the row.
    void kick(std::size_t row) {
        const KickRows& kicks = *of_->kicks;
        p_[0][0] = A::mul_add(kick_, A::set(kicks.variance[row]), p_[0][0]);
        p_[0][1] = A::mul_add(kick_, A::set(kicks.covariance[row]), p_[0][1]);
        p_[1][0] = p_[0][1];
        p_[1][1] = A::mul_add(kick_, A::set(kicks.carried[row]), p_[1][1]);
    }

    /// Advances the amplitudes of the dither's noise over the turns that were passed, and sets their weights in the
    /// reading.
    void pass_turns(std::size_t row) {
        const DitherRows& rows = *of_->dither;
        const int u = of_->of_dither;
        const int v = u + 1;
        const int m = u + 2;
        const auto pass = [&](V& at_u, V& at_v, V& at_m) {
            at_m = A::mul_add(by_last_, at_u, A::mul_add(by_next_, at_v, A::mul(kept_, at_m)));
            at_u = at_v;
            at_v = A::mul(memory_, at_v);
        };
        for (int turn = 0; turn < rows.passed[row]; ++turn) {
            pass(x_[u], x_[v], x_[m]);
            for (int i = 0; i < D; ++i) pass(p_[i][u], p_[i][v], p_[i][m]);
            for (int i = 0; i < D; ++i) pass(p_[u][i], p_[v][i], p_[m][i]);
            p_[v][v] = A::add(p_[v][v], renewed_);
        }
        h_[u] = A::set(rows.last[row]);
        h_[v] = A::set(rows.next[row]);
        h_[m] = A::set(rows.follower[row]);
    }

    void step_states() {
        Line next;
        for (int i = 0; i < D; ++i) {
            next[i] = A::set(0.0);
            const auto& terms = of_->nonzero[i];
            for (int k = 0; k < terms.count; ++k) {
                next[i] = A::mul_add(f_[i][terms.at[k]], x_[terms.at[k]], next[i]);
            }
        }
        x_ = next;
    }

    /// Variance and gains of this row, and the covariance of the states after it.
    void weigh(std::size_t row) {
        Line ph;
        for (V& v : ph) v = A::set(0.0);
        for (int j = 0; j < D; ++j) {
            if (!reads(j)) continue;
            for (int i = 0; i < D; ++i) ph[i] = A::mul_add(p_[j][i], h_[j], ph[i]);
        }
        variance_ = floor_;
        if (of_->swings) {
            double factors[most_lanes];
            for (std::size_t k = 0; k < A::lanes(); ++k) {
                const double phase = swing_[k].by_row * static_cast<double>(row);
                factors[k] = std::exp(swing_[k].cosine * std::cos(phase) + swing_[k].sine * std::sin(phase));
            }
            variance_ = A::mul(variance_, A::load(factors));
        }
        for (int i = 0; i < D; ++i) {
            if (reads(i)) variance_ = A::mul_add(h_[i], ph[i], variance_);
        }
        const V over = A::div(A::set(1.0), variance_);
        const Line last = gain_;
        for (int i = 0; i < D; ++i) gain_[i] = A::mul(ph[i], over);
        for (int i = 0; i < D; ++i) {
            for (int j = 0; j < D; ++j) p_[i][j] = A::neg_mul_add(gain_[i], ph[j], p_[i][j]);
        }
        if (!of_->resampled && !of_->swings && !of_->kicks && !of_->dither) settle(last);
    }

    /// Whether gains have stopped changing. Each gain is compared, since those of slow rates converge long after the
    /// variance.
    void settle(const Line& last) {
        constexpr int rows = 50;
        const V little = A::set(1e-9);
        bool same = true;
        for (int i = 0; i < D && same; ++i) {
            const V most = A::mul(little, A::abs(gain_[i]));
            same = A::none_above(A::abs(A::sub(gain_[i], last[i])), most);
        }
        settled_rows_ = same ? settled_rows_ + 1 : 0;
        settled_ = settled_rows_ > rows;
    }

    struct Swing {
        double by_row, cosine, sine;
    };
    const SampleStates* of_ = nullptr;  ///< the first filter; all have its structure
    std::array<Line, D> p_, q_, f_;
    Line h_, x_, gain_;
    V floor_, kick_, ratio_, place_;
    V memory_, kept_, by_last_, by_next_, renewed_;
    V variance_;
    std::array<double, most_lanes> ticks_{};
    std::array<Swing, most_lanes> swing_{};
    int settled_rows_ = 0;
    bool settled_ = false;
};

template <int D>
void lanes_with(std::span<const SampleStates> filters, std::span<const double> increments, const TakeLanes& take) {
    const Beside::Tag d;
    // On the stack, since memory from the heap is not aligned for the longest vectors.
    Lanes<Beside, D> vectors[most_lanes / hn::MaxLanes(d)];
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

void lanes(std::span<const SampleStates> filters, std::span<const double> increments, const TakeLanes& take) {
    for_states(filters.front().count,
               [&](auto states) { lanes_with<decltype(states)::value>(filters, increments, take); });
}

void gains(const SampleStates& filter, std::size_t rows, const std::function<void(const SampleGains&)>& take) {
    for_states(filter.count, [&](auto states) {
        constexpr int D = decltype(states)::value;
        Lanes<Alone, D> one;
        one.begin({&filter, 1}, 0);
        double innovation = 0.0;
        double variance = 0.0;
        for (std::size_t row = 0; row < rows && !one.settled(); ++row) {
            one.row(row, 0.0, &innovation, &variance);
            take({one.ticks(), one.share(), variance, one.gain()});
        }
    });
}

}  // namespace ringlock::closure::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::closure {

HWY_EXPORT(lanes);
HWY_EXPORT(gains);

void filter_gains(const SampleStates& filter, std::size_t rows, const std::function<void(const SampleGains&)>& take) {
    HWY_DYNAMIC_DISPATCH(gains)(filter, rows, take);
}

void filter_lanes(std::span<const SampleStates> filters, std::span<const double> increments, const TakeLanes& take) {
    if (filters.empty()) return;
    const bool alike =
        std::all_of(filters.begin(), filters.end(), [&](const SampleStates& s) { return s.is_like(filters.front()); });
    if (filters.size() > most_lanes || !alike) throw std::logic_error("filter_lanes: filters that are not alike");
    HWY_DYNAMIC_DISPATCH(lanes)(filters, increments, take);
}

}  // namespace ringlock::closure
#endif
