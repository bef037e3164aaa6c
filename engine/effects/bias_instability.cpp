#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "engine/effects/effect.hpp"

namespace ringlock::effects {
namespace {

constexpr std::array bias_instability_parameters = {
    Parameter{"deg_h", 0.0, 0.0, 1000.0, Role::deviation, "bias instability B; the Allan deviation is flat at 0.664 B"},
};

/// Correlation times: one a decade from 0.01 s to 1e7 s. The Allan deviation is then within 3 % of its flat value for
/// averaging times of 0.1 s to 1e6 s.
constexpr std::size_t flicker_terms = 10;
constexpr std::array<double, flicker_terms> correlation_times_s = {1e-2, 1e-1, 1e0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6, 1e7};

/// Standard deviation s of each term: with one a decade the sum of 2 s^2 T / (1 + (2 pi f T)^2) is s^2 / (2 ln(10) f).
double term_sd(double deg_h) { return deg_h * std::sqrt(std::numbers::ln10 / std::numbers::pi); }

/// Exact transition of the sum over one interval. With x = dt/T and h = tanh(x/2), a term of unit variance goes from
/// r to (1-h)/(1+h) r + 2 sqrt(h)/(1+h) z; given both ends its integral has the mean T h (r0 + r1) and the variance
/// T^2 (2 x - 4 h). Only the sum of the integrals is needed, so their remainders share one deviate.
struct Transition {
    double duration_s = -1.0;
    std::array<double, flicker_terms> decay{};
    std::array<double, flicker_terms> kick{};
    std::array<double, flicker_terms> mean_s{};
    double remainder_s = 0.0;

    explicit Transition(double duration) : duration_s(duration) {
        double variance = 0.0;
        for (std::size_t i = 0; i < flicker_terms; ++i) {
            const double time = correlation_times_s[i];
            const double x = duration / time;
            const double x2 = x * x;
            const bool small = x < 0.05;  // the closed form of the variance loses its digits
            const double h = small ? 0.5 * x * (1.0 - x2 * (1.0 / 12.0 - x2 * (1.0 / 120.0 - x2 * (17.0 / 20160.0))))
                                   : std::tanh(0.5 * x);
            decay[i] = (1.0 - h) / (1.0 + h);
            kick[i] = 2.0 * std::sqrt(h) / (1.0 + h);
            mean_s[i] = time * h;
            variance += time * time *
                        (small ? x * x2 * (1.0 / 6.0 - x2 * (1.0 / 60.0 - x2 * (17.0 / 10080.0))) : 2.0 * x - 4.0 * h);
        }
        remainder_s = std::sqrt(variance);
    }
};

class BiasInstabilityProcess final : public RateProcess {
   public:
    BiasInstabilityProcess(double deg_h, const random::Identity& who)
        : sd_arcsec_s_(term_sd(deg_h)), normal_(who, random::Purpose::bias_instability) {
        for (double& rate : rates_) rate = normal_();
    }

    double angle_arcsec(double /*start_s*/, double duration_s) override {
        const Transition& step = transition(duration_s);
        double angle = step.remainder_s * normal_();
        for (std::size_t i = 0; i < flicker_terms; ++i) {
            const double next = step.decay[i] * rates_[i] + step.kick[i] * normal_();
            angle += step.mean_s[i] * (rates_[i] + next);
            rates_[i] = next;
        }
        return sd_arcsec_s_ * angle;
    }

   private:
    /// Half cycles of an asymmetric dither alternate between two durations: both are kept.
    const Transition& transition(double duration_s) {
        if (recent_.duration_s == duration_s) return recent_;
        std::swap(recent_, older_);
        if (recent_.duration_s != duration_s) recent_ = Transition(duration_s);
        return recent_;
    }

    double sd_arcsec_s_;
    std::array<double, flicker_terms> rates_{};
    Transition recent_{0.0};
    Transition older_{0.0};
    random::NormalStream normal_;
};

class BiasInstability final : public Effect {
   public:
    std::string_view name() const override { return "bias_instability"; }
    std::string_view summary() const override {
        return "Flicker (1/f) rate noise for averaging times of 0.1 s to 1e6 s, stationary from the start.";
    }
    std::string_view advice() const override {
        return "Record for ten times the longest averaging time that matters, at constant temperature; "
               "compensation of the lock-in does not lower this noise.";
    }
    std::string_view equation() const override {
        return "Two-sided power spectral density B^2/(2 pi f), Allan deviation sqrt(2 ln 2/pi) "
               "B = 0.664 B (IEEE Std 952-1997, annex C, bias instability), "
               "as a sum of first-order Gauss-Markov rates with correlation times of 0.01 s, 0.1 s, ... "
               "1e7 s, each of variance B^2 ln(10)/pi.";
    }
    std::span<const Parameter> parameters() const override { return bias_instability_parameters; }
    bool active(const Values& values) const override { return values.at("deg_h") != 0.0; }
    RateNoise rate_noise(const Values& values) const override {
        const double deg_h = term_sd(values.at("deg_h"));
        RateNoise noise;
        for (const double time_s : correlation_times_s) noise.terms.push_back({time_s, deg_h * deg_h});
        return noise;
    }
    std::unique_ptr<RateProcess> rate_process(const Values& values, const random::Identity& who) const override {
        return std::make_unique<BiasInstabilityProcess>(values.at("deg_h"), who);
    }
};

}  // namespace

const Effect& bias_instability() {
    static const BiasInstability effect;
    return effect;
}

}  // namespace ringlock::effects
