#include "analysis/closure/turns/model/model.hpp"

#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/closure/decide/evidence.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/gyro/device.hpp"

namespace ringlock::closure {

const ActiveEffect* TurnParameters::find(std::string_view effect) const {
    const auto found =
        std::find_if(effects.begin(), effects.end(), [&](const ActiveEffect& a) { return a.effect->name() == effect; });
    return found == effects.end() ? nullptr : &*found;
}

ActiveEffect* TurnParameters::find(std::string_view effect) {
    return const_cast<ActiveEffect*>(std::as_const(*this).find(effect));
}

namespace {

/// A gyro's constants with the effect at small values: what the effect changes can be seen in them.
gyro::Setup probed(const effects::Effect& effect) {
    gyro::Setup setup;
    effects::Values values;
    for (const effects::Parameter& parameter : effect.parameters()) {
        const bool counts = parameter.role == effects::Role::size || parameter.role == effects::Role::probability;
        values[std::string(parameter.name)] = counts ? 1e-3 : 0.0;
    }
    effect.configure(values, setup);
    return setup;
}

}  // namespace

bool told_by_other_columns(const effects::Effect& effect) {
    const gyro::Setup plain;
    const gyro::Setup setup = probed(effect);
    return setup.dither_asymmetry_ratio != plain.dither_asymmetry_ratio ||
           setup.dither_harmonic_ratio != plain.dither_harmonic_ratio || setup.ellipse.gain != plain.ellipse.gain ||
           setup.missed_count_probability != plain.missed_count_probability;
}

bool changes_reading(const effects::Effect& effect) {
    const gyro::Setup plain;
    const gyro::Setup setup = probed(effect);
    return setup.ellipse != plain.ellipse || setup.missed_count_probability != plain.missed_count_probability;
}

bool is_of_coupling(const effects::Effect& effect) {
    return !effect.adds_angle() && !is_random_rate(effect) && !told_by_other_columns(effect);
}

TurnModel::TurnModel(const TurnSeries& series, const std::vector<double>& phase_rad, ReadingErrors known)
    : series_(series), phase_rad_(phase_rad), known_(std::move(known)) {
    if (known_.mean_rad.empty()) {
        known_.mean_rad.assign(phase_rad.size(), 0.0);
        known_.variance_rad2.assign(phase_rad.size(), std::pow(series.radius_sd_rad, 2));
        for (std::size_t i = 0; i < series.readout.size(); ++i) known_.variance_rad2[i] *= series.readout[i];
    }
    for (std::size_t i = 0; i < phase_rad.size(); ++i) {
        turned_.push_back(std::polar(1.0, phase_rad[i] - known_.mean_rad[i]));
    }
}

gyro::Setup TurnModel::setup(const TurnParameters& parameters) const {
    gyro::Setup setup = series_.setup;
    setup.lockin_threshold_deg_h = parameters.threshold_deg_h;
    setup.input_rate_deg_h = parameters.bias_deg_h;
    for (const ActiveEffect& active : parameters.effects) active.effect->configure(active.values, setup);
    return setup;
}

TurnKicks TurnModel::mean_kicks(const TurnParameters& parameters) const {
    gyro::Setup at = setup(parameters);
    for (const double rate_deg_h : series_.input_rate_deg_h) {
        at.input_rate_deg_h += rate_deg_h / static_cast<double>(series_.size());
    }
    return TurnKicks(at);
}

std::vector<double> TurnModel::dither_swings(const Kicks& kicks, const std::vector<double>& rate_deg_h) const {
    const std::size_t n = series_.size();
    std::vector<double> swing(n, 1.0);
    double sums[2] = {};
    double counts[2] = {};
    const auto over = [&](std::size_t i) {
        return swing_over_dither(series_.relative_rate(series_.mean_rate_deg_h + rate_deg_h[i]));
    };
    for (std::size_t i = 0; i + 1 < n; ++i) {
        // Were the lock-in left in it, kicks would depend on their own size.
        const double lockin = kicks[i].after_rad + kicks[i + 1].before_rad;
        const double rotation = units::two_pi / series_.setup.scale_factor_arcsec * series_.interval_s * rate_deg_h[i];
        swing[i] = series_.direction[i] * (phase_rad_[i + 1] - phase_rad_[i] - lockin - rotation) / over(i);
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

double TurnModel::temperature_change_k(std::size_t turn) const {
    return series_.temperature_change_k.empty() ? 0.0 : series_.temperature_change_k[turn];
}

std::vector<double> TurnModel::smooth(const std::vector<double>& turn_s) const {
    // A resonator keeps its time far better than a zero-rate point can be told from pulses that the lock-in moves.
    constexpr std::ptrdiff_t reach = 64;  // turns to either side, of one parity each
    const auto n = static_cast<std::ptrdiff_t>(turn_s.size());
    std::vector<double> smoothed(turn_s.size());
    const double start = turn_s.front();
    const auto off = [&](std::ptrdiff_t i) {
        return turn_s[static_cast<std::size_t>(i)] - start - series_.interval_s * static_cast<double>(i);
    };
    for (std::ptrdiff_t parity = 0; parity < 2; ++parity) {
        double sum = 0.0;
        double count = 0.0;
        std::ptrdiff_t first = parity;
        std::ptrdiff_t next = parity;
        for (std::ptrdiff_t i = parity; i < n; i += 2) {
            // As far to one side as to the other, that slopes do not matter.
            const std::ptrdiff_t room = std::min({reach, i - parity, (n - 1 - i) / 2 * 2});
            for (; next <= i + room; next += 2, count += 1.0) sum += off(next);
            for (; first < i - room; first += 2, count -= 1.0) sum -= off(first);
            while (next > i + room + 2) {
                next -= 2;
                sum -= off(next);
                count -= 1.0;
            }
            smoothed[static_cast<std::size_t>(i)] = start + series_.interval_s * static_cast<double>(i) + sum / count;
        }
    }
    return smoothed;
}

std::shared_ptr<const TurnModel::Kicks> TurnModel::kicks(gyro::Setup setup, const Shape& shape) const {
    constexpr std::size_t kept = 8;
    setup.ellipse = {};
    setup.missed_count_probability = 0.0;
    {
        const std::lock_guard lock(meeting_);
        const auto found = std::find_if(met_.begin(), met_.end(),
                                        [&](const Met& met) { return met.setup == setup && met.shape == shape; });
        if (found != met_.end()) return found->kicks;
    }
    const auto shared = std::make_shared<const Kicks>(
        kicks_at(setup, series_.input_rate_deg_h, std::vector<double>(series_.size(), 1.0), shape));
    const std::lock_guard lock(meeting_);
    met_.push_front({setup, shape, shared});
    if (met_.size() > kept) met_.pop_back();
    return shared;
}

TurnModel::Kicks TurnModel::kicks_at(const gyro::Setup& setup, const std::vector<double>& rate_deg_h,
                                     const std::vector<double>& threshold_factors, const Shape& shape) const {
    const auto [slowest, fastest] = std::minmax_element(rate_deg_h.begin(), rate_deg_h.end());
    const auto [least, most] = std::minmax_element(threshold_factors.begin(), threshold_factors.end());
    const KicksOverRange of(setup, {setup.input_rate_deg_h + *slowest, setup.input_rate_deg_h + *fastest},
                            {*least, *most});
    Kicks kicks(series_.size());
    constexpr std::size_t worth_a_task = 2048;
    const oneapi::tbb::blocked_range<std::size_t> turns(0, kicks.size(), worth_a_task);
    oneapi::tbb::parallel_for(turns, [&](const auto& some) {
        for (std::size_t i = some.begin(); i < some.end(); ++i) {
            kicks[i] = of.at(series_.direction[i], turned_[i], setup.input_rate_deg_h + rate_deg_h[i],
                             threshold_factors[i], shape ? &shape->at(i) : nullptr);
        }
    });
    return kicks;
}

std::vector<double> TurnModel::added_rad(const Prediction& prediction, const effects::Effect& effect,
                                         const effects::Values& values) const {
    const double c = units::two_pi / series_.setup.scale_factor_arcsec;
    std::vector<double> phase(series_.size());
    double angle_arcsec = 0.0;
    const effects::ChangeOver change = effect.change(values);
    for (std::size_t i = 0; i < phase.size(); ++i) {
        angle_arcsec += change(prediction.intervals[i]).angle_arcsec;
        phase[i] = c * angle_arcsec;
    }
    return phase;
}

std::vector<double> TurnModel::dither_turns(const std::vector<double>& rate_deg_h,
                                            const std::vector<double>& threshold_factors,
                                            const std::vector<double>& swing, const gyro::Device& device) const {
    const double c = units::two_pi / series_.setup.scale_factor_arcsec;
    const double w = units::pi / series_.interval_s;
    const double peak_rad_s = series_.amplitude_rad * w;
    const std::complex<double> coupling_turn = std::polar(device.coupling.b_rad_s, device.coupling.phase_rad);
    // Accelerations of the half cycle that ends at the turn and of the one that begins, over those of a plain dither.
    double relative[2][2];
    for (const int direction : {1, -1}) {
        for (const int after : {0, 1}) {
            const gyro::HalfCycle half = device.half_cycle(after ? direction : -direction, series_.amplitude_rad);
            relative[direction > 0][after] = half.end_acceleration_rad_s2(after ? 0 : 1) / (peak_rad_s * w);
        }
    }
    std::vector<double> turn_s(series_.size());
    for (std::size_t i = 0; i < turn_s.size(); ++i) {
        const double sine = turned_[i].real() * coupling_turn.imag() + turned_[i].imag() * coupling_turn.real();
        const double rate_rad_s = c * rate_deg_h[i] + threshold_factors[i] * sine;
        const bool before = series_.direction[i] * rate_rad_s > 0.0;
        const double share = rate_rad_s / (peak_rad_s * swing[before && i > 0 ? i - 1 : i] *
                                           relative[series_.direction[i] > 0][before ? 0 : 1]);
        turn_s[i] = series_.time_s[i] + series_.direction[i] * std::asin(std::clamp(share, -1.0, 1.0)) / w;
    }
    return turn_s;
}

std::vector<effects::Interval> TurnModel::intervals(const std::vector<double>& turn_s) const {
    std::vector<effects::Interval> all(turn_s.size());
    for (std::size_t i = 0; i < turn_s.size(); ++i) {
        const std::size_t last = i > 0 ? i - 1 : 0;
        all[i] = {turn_s[last],
                  turn_s[i] - turn_s[last],
                  {temperature_change_k(last), temperature_change_k(i)},
                  {series_.input_rate_deg_h[last], series_.input_rate_deg_h[i]}};
    }
    return all;
}

std::vector<double> TurnModel::added_rates_deg_h(const TurnParameters& parameters,
                                                 const std::vector<double>& turn_s) const {
    std::vector<double> added_deg_h;
    const double moment_s = 0.05 * series_.interval_s;
    for (const ActiveEffect& active : parameters.effects) {
        if (!active.effect->adds_angle()) continue;
        added_deg_h.resize(turn_s.size());
        const effects::ChangeOver change = active.effect->change(active.values);
        for (std::size_t i = 0; i < turn_s.size(); ++i) {
            const double change_k = temperature_change_k(i);
            const double input_deg_h = series_.input_rate_deg_h[i];
            const effects::Interval about{
                turn_s[i] - 0.5 * moment_s, moment_s, {change_k, change_k}, {input_deg_h, input_deg_h}};
            added_deg_h[i] += change(about).angle_arcsec / moment_s;
        }
    }
    return added_deg_h;
}

TurnModel::Prediction TurnModel::predict(const TurnParameters& parameters) const {
    const std::size_t n = series_.size();
    const gyro::Setup device_setup = setup(parameters);
    const gyro::Device device(device_setup);
    Prediction prediction;
    TurnFrame& frame = prediction.frame;
    frame.interval_s = series_.interval_s;
    frame.sign.resize(n);
    frame.before_slope.resize(n);
    frame.kick_slope.resize(n);
    frame.shape_left.resize(n);
    frame.readout = series_.readout;
    prediction.phase_rad.resize(n);
    const double c = device.phase_per_arcsec;
    std::vector<double> factors(n, 1.0);
    for (const ActiveEffect& active : parameters.effects) {
        if (!active.effect->changes().threshold) continue;
        const effects::ChangeOver change = active.effect->change(active.values);
        for (std::size_t i = 0; i < n; ++i) {
            const double change_k = temperature_change_k(i);
            const double input_deg_h = series_.input_rate_deg_h[i];
            const effects::Interval at{series_.time_s[i], 0.0, {change_k, change_k}, {input_deg_h, input_deg_h}};
            factors[i] *= change(at).threshold_factor;
        }
    }
    const bool one_threshold = std::all_of(factors.begin(), factors.end(), [](double factor) { return factor == 1.0; });
    std::shared_ptr<const Kicks> kick_of =
        one_threshold ? kicks(device_setup, parameters.shape)
                      : std::make_shared<const Kicks>(
                            kicks_at(device_setup, series_.input_rate_deg_h, factors, parameters.shape));
    std::vector<double> swing = dither_swings(*kick_of, series_.input_rate_deg_h);
    std::vector<double> rate_deg_h(n);
    for (std::size_t i = 0; i < n; ++i) rate_deg_h[i] = parameters.bias_deg_h + series_.input_rate_deg_h[i];
    prediction.turn_s = dither_turns(rate_deg_h, factors, swing, device);
    std::vector<double> turn_s = smooth(prediction.turn_s);
    prediction.intervals = intervals(turn_s);
    if (const auto added_deg_h = added_rates_deg_h(parameters, turn_s); !added_deg_h.empty()) {
        double most_deg_h = 0.0;
        std::vector<double> beside_bias_deg_h = series_.input_rate_deg_h;
        for (std::size_t i = 0; i < n; ++i) {
            rate_deg_h[i] += added_deg_h[i];
            beside_bias_deg_h[i] += added_deg_h[i];
            most_deg_h = std::max(most_deg_h, std::abs(added_deg_h[i]));
        }
        // How far zero-rate points move in the time within which the phase turns: what of a kick that changes.
        constexpr double felt = 1e-3;
        const double acceleration_rad_s2 = device.half_cycle(1, series_.amplitude_rad).end_acceleration_rad_s2();
        if (c * most_deg_h > felt * std::sqrt(acceleration_rad_s2)) {
            kick_of =
                std::make_shared<const Kicks>(kicks_at(device_setup, beside_bias_deg_h, factors, parameters.shape));
            swing = dither_swings(*kick_of, beside_bias_deg_h);
        }
        prediction.turn_s = dither_turns(rate_deg_h, factors, swing, device);
        turn_s = smooth(prediction.turn_s);
        prediction.intervals = intervals(turn_s);
    }
    const std::vector<double> input_arcsec = series_.input_angles_arcsec(turn_s);
    std::vector<effects::ChangeOver> changes;
    for (const ActiveEffect& active : parameters.effects) {
        if (active.effect->adds_angle()) changes.push_back(active.effect->change(active.values));
    }
    double lockin = 0.0;
    double angle_arcsec = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        // Kicks go with the root of one over the acceleration, which goes with the swing of that half cycle.
        const TurnKicks::Kick& kick = (*kick_of)[i];
        const double before = 1.0 / std::sqrt(swing[i > 0 ? i - 1 : i]);
        const double after = 1.0 / std::sqrt(swing[i]);
        // Straight lines to what was read, of which the filter knows, and the mean over what is not known.
        const double error_rad = known_.mean_rad[i];
        const double half_rad2 = 0.5 * known_.variance_rad2[i];
        double before_rad = kick.before_rad + error_rad * kick.before_slope + half_rad2 * kick.before_curvature;
        double after_rad = kick.after_rad + error_rad * kick.after_slope + half_rad2 * kick.after_curvature;
        before_rad *= before;
        after_rad *= after;
        const std::size_t last = i > 0 ? i - 1 : 0;
        const effects::Interval& interval = prediction.intervals[i];
        angle_arcsec += interval.duration_s * parameters.bias_deg_h + (input_arcsec[i] - input_arcsec[last]);
        for (const effects::ChangeOver& change : changes) angle_arcsec += change(interval).angle_arcsec;

        prediction.phase_rad[i] = lockin + before_rad + c * angle_arcsec;
        lockin += before_rad + after_rad;
        frame.sign[i] = -series_.direction[i];
        frame.before_slope[i] = before * kick.before_slope;
        frame.shape_left[i] = before * kick.before_weighted;
        if (!(std::abs(frame.before_slope[i]) < 1.0)) {
            throw RunError("lock-in so strong that a turn's phase does not tell the phase without it");
        }
        frame.kick_slope[i] = before * kick.before_slope + after * kick.after_slope;
    }
    return prediction;
}

double TurnModel::beat_hz() const {
    const std::size_t last = (series_.size() - 1) / 2 * 2;  // of the first one's kind
    return (phase_rad_[last] - phase_rad_.front()) / (units::two_pi * series_.time_s[last]);
}

TurnNoise TurnModel::noise(const TurnParameters& parameters) const {
    TurnNoise noise;
    noise.injected_rad2 = parameters.injected_sd_rad * parameters.injected_sd_rad;
    noise.readout_rad2 = parameters.readout_sd_rad * parameters.readout_sd_rad;
    noise.wander_rad2 = parameters.wander_sd_rad * parameters.wander_sd_rad;
    noise.wander_forgets = parameters.wander_forgets;
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
