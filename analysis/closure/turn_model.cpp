#include "analysis/closure/turn_model.hpp"

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"
#include "engine/gyro/device.hpp"

namespace ringlock::closure {

ActiveEffect* TurnParameters::find(std::string_view effect) {
    const auto found =
        std::find_if(effects.begin(), effects.end(), [&](const ActiveEffect& a) { return a.effect->name() == effect; });
    return found == effects.end() ? nullptr : &*found;
}

gyro::Setup TurnModel::setup(const TurnParameters& parameters) const {
    gyro::Setup setup = series_.setup;
    setup.lockin_threshold_deg_h = parameters.threshold_deg_h;
    setup.input_rate_deg_h = parameters.bias_deg_h;
    for (const ActiveEffect& active : parameters.effects) active.effect->configure(active.values, setup);
    return setup;
}

std::vector<double> TurnModel::dither_swings(const std::vector<TurnKicks::Kick>& kicks) const {
    const std::size_t n = series_.size();
    std::vector<double> swing(n, 1.0);
    double sums[2] = {};
    double counts[2] = {};
    for (std::size_t i = 0; i + 1 < n; ++i) {
        // Were the lock-in left in it, kicks would depend on their own size.
        const double lockin = kicks[i].after_rad + kicks[i + 1].before_rad;
        const double rotation =
            units::two_pi / series_.setup.scale_factor_arcsec * series_.interval_s * series_.input_rate_deg_h[i];
        swing[i] = series_.direction[i] * (phase_rad_[i + 1] - phase_rad_[i] - lockin - rotation);
        const std::size_t side = series_.direction[i] > 0 ? 0 : 1;
        sums[side] += swing[i];
        counts[side] += 1.0;
    }
    // A constant rotation lengthens swings of one sign and shortens those of the other.
    for (std::size_t i = 0; i + 1 < n; ++i) {
        const std::size_t side = series_.direction[i] > 0 ? 0 : 1;
        swing[i] *= counts[side] / sums[side];
    }
    return swing;
}

TurnModel::Prediction TurnModel::predict(const TurnParameters& parameters) const {
    const std::size_t n = series_.size();
    const gyro::Setup device_setup = setup(parameters);
    const gyro::Device device(device_setup);
    const TurnKicks kicks(device_setup);
    Prediction prediction;
    TurnFrame& frame = prediction.frame;
    frame.interval_s = series_.interval_s;
    frame.sign.resize(n);
    frame.before_slope.resize(n);
    frame.kick_slope.resize(n);
    prediction.phase_rad.resize(n);
    prediction.turn_s.resize(n);
    const double c = device.phase_per_arcsec;
    std::vector<TurnKicks::Kick> kick_of(n);
    for (std::size_t i = 0; i < n; ++i) kick_of[i] = kicks.at(series_.direction[i], phase_rad_[i]);
    const std::vector<double> swing = dither_swings(kick_of);
    double lockin = 0.0;
    double angle_arcsec = 0.0;
    double last_s = 0.0;
    double last_change_k = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        const int direction = series_.direction[i];
        const double psi = phase_rad_[i];
        const double change_k = series_.temperature_change_k.empty() ? 0.0 : series_.temperature_change_k[i];
        double factor = 1.0;
        for (const ActiveEffect& active : parameters.effects) {
            factor *= active.effect->threshold_factor(active.values, change_k);
        }
        // Kicks go with the root of one over the acceleration, which goes with the swing of that half cycle.
        const TurnKicks::Kick& kick = kick_of[i];
        const double before = factor / std::sqrt(swing[i > 0 ? i - 1 : i]);
        const double after = factor / std::sqrt(swing[i]);

        // From the zero-rate point to the dither's own turn.
        const double rate_deg_h = parameters.bias_deg_h + series_.input_rate_deg_h[i];
        const double coupling = factor * device.coupling.b_rad_s * std::sin(psi + device.coupling.phase_rad);
        const double turn_s = series_.time_s[i] + direction * (c * rate_deg_h + coupling) / series_.acceleration_rad_s2;
        prediction.turn_s[i] = turn_s;
        if (i == 0) last_s = turn_s;
        const double duration_s = turn_s - last_s;
        const std::size_t before_i = i > 0 ? i - 1 : 0;
        const effects::Interval interval{last_s,
                                         duration_s,
                                         {last_change_k, change_k},
                                         {series_.input_rate_deg_h[before_i], series_.input_rate_deg_h[i]}};
        angle_arcsec +=
            duration_s * (parameters.bias_deg_h + 0.5 * (interval.input_rate_deg_h[0] + interval.input_rate_deg_h[1]));
        for (const ActiveEffect& active : parameters.effects) {
            if (active.effect->adds_angle()) {
                angle_arcsec += active.effect->added_angle_arcsec(active.values, interval);
            }
        }
        last_s = turn_s;
        last_change_k = change_k;

        prediction.phase_rad[i] = lockin + before * kick.before_rad + c * angle_arcsec;
        lockin += before * kick.before_rad + after * kick.after_rad;
        frame.sign[i] = -direction;
        frame.before_slope[i] = before * kick.before_slope;
        frame.kick_slope[i] = before * kick.before_slope + after * kick.after_slope;
    }
    return prediction;
}

TurnNoise TurnModel::noise(const TurnParameters& parameters) const {
    TurnNoise noise;
    noise.injected_rad2 = parameters.injected_sd_rad * parameters.injected_sd_rad;
    noise.readout_rad2 = parameters.readout_sd_rad * parameters.readout_sd_rad;
    noise.wander_rad2 = parameters.wander_sd_rad * parameters.wander_sd_rad;
    noise.wander_memory_turns = parameters.wander_memory_turns;
    const double c = units::two_pi / series_.setup.scale_factor_arcsec;
    for (const ActiveEffect& active : parameters.effects) {
        const effects::RateNoise rate = active.effect->rate_noise(active.values);
        noise.white_rad2_per_s += c * c * rate.white_deg2_h2_s;
        noise.walk_rad2_per_s3 += c * c * rate.walk_deg2_h2_per_s;
        for (const effects::GaussMarkov& term : rate.terms) {
            // What hardly changes within the record is bias.
            if (term.time_s > 30.0 * series_.time_s.back()) continue;
            noise.rates.push_back({term.time_s, c * c * term.variance_deg2_h2});
        }
    }
    return noise;
}

}  // namespace ringlock::closure
