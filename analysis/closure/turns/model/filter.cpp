#include "analysis/closure/turns/model/filter.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "analysis/closure/turns/model/filter.cpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "analysis/closure/turns/model/whitening.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::closure::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using Several = hn::CappedTag<double, 8>;
/// Replaces the vector tag if there is only one noise.
struct One {};

HWY_INLINE double set(One, double x) { return x; }
HWY_INLINE double load(One, const double* x) { return *x; }
HWY_INLINE void store(One, double x, double* to) { *to = x; }
HWY_INLINE double larger(One, double a, double b) { return std::max(a, b); }
HWY_INLINE hn::Vec<Several> set(Several d, double x) { return hn::Set(d, x); }
HWY_INLINE hn::Vec<Several> load(Several d, const double* x) { return hn::LoadU(d, x); }
HWY_INLINE void store(Several d, hn::Vec<Several> x, double* to) { hn::StoreU(x, d, to); }
HWY_INLINE hn::Vec<Several> larger(Several, hn::Vec<Several> a, hn::Vec<Several> b) { return hn::Max(a, b); }

constexpr std::size_t width(One) { return 1; }
HWY_INLINE std::size_t width(Several d) { return hn::Lanes(d); }

/// Filter state driven by a series, for the noises from `first` on.
template <std::size_t states, class Tag>
class Follower {
   public:
    using V = decltype(set(Tag{}, 0.0));
    using Row = std::array<V, states>;

    Follower(const FilterNoises& of, std::size_t first) {
        for (std::size_t s = 0; s < states; ++s) {
            decay_[s] = load(Tag{}, &of.decay[s * of.row + first]);
            gain_s_[s] = load(Tag{}, &of.gain_s[s * of.row + first]);
            x_[s] = set(Tag{}, 0.0);
        }
    }

    HWY_INLINE V innovation(double value, double sign) const {
        return set(Tag{}, value) - x_[0] - set(Tag{}, sign) * x_[1];
    }
    /// Advances to the next turn, with the gain of this innovation.
    HWY_INLINE void step(const Row& gain, V innovation) {
        x_[0] = x_[0] + gain[0] * innovation;
        x_[1] = decay_[1] * x_[1] + gain[1] * innovation;
        for (std::size_t s = 2; s < states; ++s) {
            x_[0] = x_[0] + gain_s_[s] * x_[s];
            x_[s] = decay_[s] * x_[s] + gain[s] * innovation;
        }
    }

    void get_state(double* state) const {
        for (std::size_t s = 0; s < states; ++s) store(Tag{}, x_[s], &state[s]);
    }
    void set_state(const double* state) {
        for (std::size_t s = 0; s < states; ++s) x_[s] = load(Tag{}, &state[s]);
    }

   private:
    Row decay_, gain_s_, x_;
};

/// Covariance of the filter's state, turn by turn. Since all states except the angle are independent, a step takes
/// states^2 operations.
template <std::size_t states, class Tag>
class Prior {
   public:
    using V = decltype(set(Tag{}, 0.0));
    using Row = std::array<V, states>;

    Prior(const FilterNoises& of, std::size_t first)
        : injected_(load(d_, &of.injected_rad2[first])), readout_(load(d_, &of.readout_rad2[first])) {
        for (std::size_t s = 0; s < states; ++s) {
            const std::size_t at = s * of.row + first;
            decay_[s] = load(d_, &of.decay[at]);
            gain_s_[s] = load(d_, &of.gain_s[at]);
            added_[s] = load(d_, &of.noise[at]);
            with_angle_[s] = load(d_, &of.with_angle[at]);
            for (V& p : p_[s]) p = set(d_, 0.0);
            p_[s][s] = load(d_, &of.start[at]);
        }
    }

    /// Advances to the next turn: the variance of the innovation, its inverse, and the gain of the states for an
    /// innovation in units of that variance.
    HWY_INLINE void step(const TurnFrame& frame, std::size_t turn, Row& gain, V& f, V& over) {
        const V sign = set(d_, frame.sign[turn]);
        const V through = set(d_, 1.0 - frame.before_slope[turn]);
        const V kick = set(d_, frame.kick_slope[turn]);
        const V readout = readout_ * set(d_, frame.readout_at(turn));
        for (std::size_t s = 0; s < states; ++s) gain[s] = p_[0][s] + sign * p_[1][s];
        f = larger(d_, gain[0] + sign * gain[1] + injected_ + through * through * readout, set(d_, 1e-30));
        gain[1] = gain[1] * decay_[1];
        for (std::size_t s = 2; s < states; ++s) {
            gain[0] = gain[0] + gain_s_[s] * gain[s];
            gain[s] = gain[s] * decay_[s];
        }
        gain[0] = gain[0] - kick * through * readout;
        // P <- T P T' + Q - gain gain'/f
        Row angle = p_[0];
        for (std::size_t s = 2; s < states; ++s) {
            for (std::size_t j = 0; j < states; ++j) angle[j] = angle[j] + gain_s_[s] * p_[s][j];
        }
        for (std::size_t s = 2; s < states; ++s) angle[0] = angle[0] + gain_s_[s] * angle[s];
        over = set(d_, 1.0) / f;
        for (std::size_t s = 1; s < states; ++s) {
            const V share = gain[s] * over;
            for (std::size_t j = 1; j < states; ++j) {
                p_[s][j] = p_[s][j] * (decay_[s] * decay_[j]) - share * gain[j];
            }
            p_[s][s] = p_[s][s] + added_[s];
        }
        const V share = gain[0] * over;
        for (std::size_t j = 1; j < states; ++j) {
            p_[0][j] = p_[j][0] = angle[j] * decay_[j] + with_angle_[j] - share * gain[j];
        }
        p_[0][0] = angle[0] + added_[0] + kick * kick * readout - share * gain[0];
    }

   private:
    Tag d_;
    V injected_, readout_;
    Row decay_, gain_s_, added_, with_angle_;
    std::array<Row, states> p_;
};

template <std::size_t states>
void gains_with(const TurnFrame& frame, const FilterNoises& noises, double* gains, double* sd) {
    Prior<states, One> prior(noises, 0);
    typename Prior<states, One>::Row gain;
    for (std::size_t i = 0; i < frame.sign.size(); ++i) {
        double f = 0.0;
        double over = 0.0;
        prior.step(frame, i, gain, f, over);
        for (std::size_t s = 0; s < states; ++s) gains[i * states + s] = gain[s] * over;
        sd[i] = std::sqrt(f);
    }
}

template <std::size_t states>
void innovations_with(const TurnFrame& frame, const FilterNoises& noises, const double* gains, const double* sd,
                      std::size_t first, std::size_t count, double* state, const double* series, double* innovations) {
    Follower<states, One> follower(noises, 0);
    follower.set_state(state);
    typename Follower<states, One>::Row gain;
    for (std::size_t k = 0; k < count; ++k) {
        const std::size_t i = first + k;
        for (std::size_t s = 0; s < states; ++s) gain[s] = gains[i * states + s];
        const double innovation = follower.innovation(series[k], frame.sign[i]);
        innovations[k] = innovation / sd[i];
        follower.step(gain, innovation);
    }
    follower.get_state(state);
}

template <std::size_t states>
void innovations_once_with(const TurnFrame& frame, const FilterNoises& noises, const double* series,
                           double* innovations, double* sd) {
    Prior<states, One> prior(noises, 0);
    Follower<states, One> follower(noises, 0);
    typename Prior<states, One>::Row gain;
    for (std::size_t i = 0; i < frame.sign.size(); ++i) {
        double f = 0.0;
        double over = 0.0;
        prior.step(frame, i, gain, f, over);
        for (std::size_t s = 0; s < states; ++s) gain[s] = gain[s] * over;
        sd[i] = std::sqrt(f);
        const double innovation = follower.innovation(series[i], frame.sign[i]);
        innovations[i] = innovation / sd[i];
        follower.step(gain, innovation);
    }
}

template <std::size_t states, class Tag>
void likelihoods_with(Tag d, const TurnFrame& frame, const FilterNoises& noises, std::size_t first,
                      const double* series, const std::uint8_t* counts, double* sums) {
    using V = typename Prior<states, Tag>::V;
    // Logarithms take most of the time. They are taken of products of a few variances, which stay within the range of
    // doubles.
    constexpr int at_once = 8;
    double of_products[8] = {};
    const auto take_logarithms = [&](V product) {
        double products[8];
        store(d, product, products);
        for (std::size_t k = 0; k < width(d); ++k) of_products[k] += 0.5 * std::log(products[k]);
    };
    Prior<states, Tag> prior(noises, first);
    Follower<states, Tag> follower(noises, first);
    typename Prior<states, Tag>::Row gain;
    V sum = set(d, 0.0);
    V product = set(d, 1.0);
    int multiplied = 0;
    for (std::size_t i = 0; i < frame.sign.size(); ++i) {
        V f, over;
        const V innovation = follower.innovation(series[i], frame.sign[i]);
        prior.step(frame, i, gain, f, over);
        const V scaled = innovation * over;
        if (counts[i] != 0) {
            sum = sum + innovation * scaled;
            const double through = 1.0 - frame.before_slope[i];
            product = product * f * set(d, 1.0 / (through * through));
            if (++multiplied == at_once) {
                take_logarithms(product);
                product = set(d, 1.0);
                multiplied = 0;
            }
        }
        follower.step(gain, scaled);
    }
    take_logarithms(product);
    double squares[8];
    store(d, sum, squares);
    for (std::size_t k = 0; k < width(d); ++k) sums[k] = 0.5 * squares[k] + of_products[k];
}

/// Calls `with` with the number of states as a constant.
template <std::size_t states = 2, class With>
void for_states(std::size_t wanted, With&& with) {
    if constexpr (states <= FilterNoises::most_states) {
        if (wanted == states) return with(std::integral_constant<std::size_t, states>{});
        for_states<states + 1>(wanted, with);
    }
}

void gains(const TurnFrame& frame, const FilterNoises& noises, double* to, double* sd) {
    for_states(noises.states, [&](auto states) { gains_with<states>(frame, noises, to, sd); });
}

void innovations(const TurnFrame& frame, const FilterNoises& noises, const double* gains_of, const double* sd,
                 std::size_t first, std::size_t count, double* state, const double* series, double* to) {
    for_states(noises.states, [&](auto states) {
        innovations_with<states>(frame, noises, gains_of, sd, first, count, state, series, to);
    });
}

void innovations_once(const TurnFrame& frame, const FilterNoises& noises, const double* series, double* to,
                      double* sd) {
    for_states(noises.states, [&](auto states) { innovations_once_with<states>(frame, noises, series, to, sd); });
}

void likelihoods(const TurnFrame& frame, const FilterNoises& noises, const double* series, const std::uint8_t* counts,
                 double* sums) {
    for_states(noises.states, [&](auto states) {
        if (noises.noises == 1) return likelihoods_with<states>(One{}, frame, noises, 0, series, counts, sums);
        const Several d;
        for (std::size_t first = 0; first < noises.noises; first += hn::Lanes(d)) {
            likelihoods_with<states>(d, frame, noises, first, series, counts, sums + first);
        }
    });
}

}  // namespace ringlock::closure::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::closure {

HWY_EXPORT(gains);
HWY_EXPORT(innovations);
HWY_EXPORT(innovations_once);
HWY_EXPORT(likelihoods);

FilterNoises::FilterNoises(std::size_t noises_given, std::size_t states_given)
    : noises(noises_given), states(states_given), row((noises + 7) / 8 * 8) {
    for (auto* of_noise : {&injected_rad2, &readout_rad2}) of_noise->resize(row);
    for (auto* of_state : {&decay, &gain_s, &noise, &with_angle, &start}) of_state->resize(row * states);
}

void filter_gains(const TurnFrame& frame, const FilterNoises& noises, std::span<double> to, std::span<double> sd) {
    HWY_DYNAMIC_DISPATCH(gains)(frame, noises, to.data(), sd.data());
}

void filter_innovations(const TurnFrame& frame, const FilterNoises& noises, std::span<const double> gains_of,
                        std::span<const double> sd, std::size_t first, FilterState& state,
                        std::span<const double> series, std::span<double> to) {
    HWY_DYNAMIC_DISPATCH(innovations)
    (frame, noises, gains_of.data(), sd.data(), first, series.size(), state.data(), series.data(), to.data());
}

void filter_innovations_once(const TurnFrame& frame, const FilterNoises& noises, std::span<const double> series,
                             std::span<double> to, std::span<double> sd) {
    HWY_DYNAMIC_DISPATCH(innovations_once)(frame, noises, series.data(), to.data(), sd.data());
}

std::vector<double> filter_likelihoods(const TurnFrame& frame, const FilterNoises& noises,
                                       std::span<const double> series, std::span<const std::uint8_t> counts) {
    std::vector<double> sums(noises.row);
    HWY_DYNAMIC_DISPATCH(likelihoods)(frame, noises, series.data(), counts.data(), sums.data());
    sums.resize(noises.noises);
    return sums;
}

}  // namespace ringlock::closure
#endif
