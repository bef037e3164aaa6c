#include "analysis/closure/turns/model/model.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
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

const ActiveEffect* TurnParameters::find(const effects::Effect* effect) const {
    const auto found =
        std::find_if(effects.begin(), effects.end(), [&](const ActiveEffect& a) { return a.effect == effect; });
    return found == effects.end() ? nullptr : &*found;
}

ActiveEffect* TurnParameters::find(const effects::Effect* effect) {
    return const_cast<ActiveEffect*>(std::as_const(*this).find(effect));
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
        // With the lock-in included, kicks would depend on their own size.
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

effects::Interval TurnModel::exposure(std::size_t turn, double start_s, double duration_s) const {
    const double change_k = temperature_change_k(turn);
    const double input_deg_h = series_.input_rate_deg_h[turn];
    return {start_s, duration_s, {change_k, change_k}, {input_deg_h, input_deg_h}};
}

std::vector<double> TurnModel::smooth(const std::vector<double>& turn_s) const {
    // A resonator keeps its time far better than zero-rate points are determined by pulses that the lock-in moves.
    constexpr std::ptrdiff_t reach = options.turns.model.smoothing_turns;  // turns of the same kind
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
            // As far to one side as to the other, so that slopes do not matter.
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

namespace {

/// Puts an element at the front of the cache and removes the oldest one if the cache is full.
template <typename Met>
void meet(std::deque<Met>& met, std::size_t kept, Met one) {
    met.push_front(std::move(one));
    if (met.size() > kept) met.pop_back();
}

}  // namespace

std::shared_ptr<const KicksOverRange> TurnModel::kicks_over_input(const gyro::Setup& setup) const {
    constexpr std::size_t kept = 16;
    {
        const std::lock_guard lock(meeting_);
        const auto found =
            std::find_if(gyros_met_.begin(), gyros_met_.end(), [&](const MetGyro& met) { return met.setup == setup; });
        if (found != gyros_met_.end()) return found->kicks;
    }
    const auto [slowest, fastest] =
        std::minmax_element(series_.input_rate_deg_h.begin(), series_.input_rate_deg_h.end());
    const KicksOverRange::Range rate{setup.input_rate_deg_h + *slowest, setup.input_rate_deg_h + *fastest};
    const auto shared = std::make_shared<const KicksOverRange>(setup, rate);
    const std::lock_guard lock(meeting_);
    meet(gyros_met_, kept, {setup, shared});
    return shared;
}

std::shared_ptr<const TurnModel::Kicks> TurnModel::kicks(gyro::Setup setup, const Shape& shape) const {
    constexpr std::size_t kept = 2;
    setup.ellipse = {};
    setup.missed_count_probability = 0.0;
    {
        const std::lock_guard lock(meeting_);
        const auto found = std::find_if(kicks_met_.begin(), kicks_met_.end(),
                                        [&](const MetKicks& met) { return met.setup == setup && met.shape == shape; });
        if (found != kicks_met_.end()) return found->kicks;
    }
    const auto shared = std::make_shared<const Kicks>(
        kicks_at(*kicks_over_input(setup), setup.input_rate_deg_h, series_.input_rate_deg_h, {}, shape));
    const std::lock_guard lock(meeting_);
    meet(kicks_met_, kept, {setup, shape, shared});
    return shared;
}

void TurnModel::forget() const {
    const std::lock_guard lock(meeting_);
    kicks_met_.clear();
}

TurnModel::Couplings TurnModel::couplings(const TurnParameters& parameters) const {
    Couplings couplings;
    for (const ActiveEffect& active : parameters.effects) {
        const effects::Changes changes = active.effect->changes();
        if (!changes.threshold && !changes.coupling_phase) continue;
        couplings.before.resize(series_.size());
        couplings.after.resize(series_.size());
        const effects::ChangeOver change = active.effect->change(active.values);
        // Constant over each half cycle, with the value in its middle. Temperature and input rate are those at the
        // turn, since they hardly change from there to the middle.
        const double to_middle_s = 0.5 * series_.interval_s;
        for (std::size_t i = 0; i < series_.size(); ++i) {
            const auto add = [&](Coupling& to, double time_s) {
                const effects::Change at = change(exposure(i, time_s, 0.0));
                to.threshold *= at.threshold_factor;
                if (at.coupling_phase_rad != 0.0) to.turn *= std::polar(1.0, at.coupling_phase_rad);
            };
            add(couplings.before[i], series_.time_s[i] - to_middle_s);
            add(couplings.after[i], series_.time_s[i] + to_middle_s);
        }
    }
    const auto plain = [](const Coupling& of) { return of == Coupling{}; };
    if (std::all_of(couplings.before.begin(), couplings.before.end(), plain) &&
        std::all_of(couplings.after.begin(), couplings.after.end(), plain)) {
        return {};
    }
    return couplings;
}

TurnModel::Kicks TurnModel::kicks_at(const gyro::Setup& setup, const std::vector<double>& rate_deg_h,
                                     const Couplings& couplings, const Shape& shape) const {
    const auto [slowest, fastest] = std::minmax_element(rate_deg_h.begin(), rate_deg_h.end());
    const double first = couplings.before_turn(0).threshold;
    KicksOverRange::Range threshold{first, first};
    for (const auto* side : {&couplings.before, &couplings.after}) {
        for (const Coupling& coupling : *side) {
            threshold.lowest = std::min(threshold.lowest, coupling.threshold);
            threshold.highest = std::max(threshold.highest, coupling.threshold);
        }
    }
    const KicksOverRange of(setup, {setup.input_rate_deg_h + *slowest, setup.input_rate_deg_h + *fastest}, threshold);
    return kicks_at(of, setup.input_rate_deg_h, rate_deg_h, couplings, shape);
}

TurnModel::Kicks TurnModel::kicks_at(const KicksOverRange& of, double setup_rate_deg_h,
                                     const std::vector<double>& rate_deg_h, const Couplings& couplings,
                                     const Shape& shape) const {
    const auto kick_at = [&](std::size_t i, const Coupling& coupling) {
        TurnKicks::Weights weights{};
        if (shape) weights = shape->at(i);
        std::complex<double> turned = turned_[i];
        if (coupling.turn != 1.0) {
            turned *= coupling.turn;
            // The weights refer to harmonics of the phase that was read, not of the phase that the coupling has.
            std::complex<double> by = 1.0;
            for (std::size_t k = 0; shape && k < weights.size(); ++k) {
                by *= coupling.turn;
                weights[k] *= by;
            }
        }
        return of.at(series_.direction[i], turned, setup_rate_deg_h + rate_deg_h[i], coupling.threshold,
                     shape ? &weights : nullptr);
    };
    Kicks kicks(series_.size());
    constexpr std::size_t worth_a_task = 2048;
    side_by_side((kicks.size() + worth_a_task - 1) / worth_a_task, [&](std::size_t part) {
        const std::size_t end = std::min((part + 1) * worth_a_task, kicks.size());
        for (std::size_t i = part * worth_a_task; i < end; ++i) {
            kicks[i] = kick_at(i, couplings.after_turn(i));
            if (couplings.before_turn(i) == couplings.after_turn(i)) continue;
            const TurnKicks::Kick before = kick_at(i, couplings.before_turn(i));
            kicks[i].before_rad = before.before_rad;
            kicks[i].before_slope = before.before_slope;
            kicks[i].before_curvature = before.before_curvature;
            kicks[i].before_weighted = before.before_weighted;
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
        angle_arcsec += change(interval(prediction, i)).angle_arcsec;
        phase[i] = c * angle_arcsec;
    }
    return phase;
}

std::vector<double> TurnModel::dither_turns(const std::vector<double>& rate_deg_h, const Couplings& couplings,
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
        const Coupling coupling = couplings.after_turn(i);
        const std::complex<double> psi = coupling.turn == 1.0 ? turned_[i] : turned_[i] * coupling.turn;
        const double sine = psi.real() * coupling_turn.imag() + psi.imag() * coupling_turn.real();
        const double rate_rad_s = c * rate_deg_h[i] + coupling.threshold * sine;
        const bool before = series_.direction[i] * rate_rad_s > 0.0;
        const double share = rate_rad_s / (peak_rad_s * swing[before && i > 0 ? i - 1 : i] *
                                           relative[series_.direction[i] > 0][before ? 0 : 1]);
        turn_s[i] = series_.time_s[i] + series_.direction[i] * std::asin(std::clamp(share, -1.0, 1.0)) / w;
    }
    return turn_s;
}

effects::Interval TurnModel::interval(const Prediction& prediction, std::size_t turn) const {
    const std::size_t last = turn > 0 ? turn - 1 : 0;
    return {prediction.dither_s[last],
            prediction.dither_s[turn] - prediction.dither_s[last],
            {temperature_change_k(last), temperature_change_k(turn)},
            {series_.input_rate_deg_h[last], series_.input_rate_deg_h[turn]}};
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
            added_deg_h[i] += change(exposure(i, turn_s[i] - 0.5 * moment_s, moment_s)).angle_arcsec / moment_s;
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
    if (parameters.shape) frame.shape_left.resize(n);
    frame.readout = series_.readout;
    prediction.phase_rad.resize(n);
    const double c = device.phase_per_arcsec;
    const Couplings coupling = couplings(parameters);
    std::shared_ptr<const Kicks> kick_of =
        coupling.stay() ? kicks(device_setup, parameters.shape)
                        : std::make_shared<const Kicks>(
                              kicks_at(device_setup, series_.input_rate_deg_h, coupling, parameters.shape));
    std::vector<double> swing = dither_swings(*kick_of, series_.input_rate_deg_h);
    std::vector<double> rate_deg_h(n);
    for (std::size_t i = 0; i < n; ++i) rate_deg_h[i] = parameters.bias_deg_h + series_.input_rate_deg_h[i];
    prediction.turn_s = dither_turns(rate_deg_h, coupling, swing, device);
    prediction.dither_s = smooth(prediction.turn_s);
    if (const auto added_deg_h = added_rates_deg_h(parameters, prediction.dither_s); !added_deg_h.empty()) {
        double most_deg_h = 0.0;
        std::vector<double> with_bias_deg_h = series_.input_rate_deg_h;
        for (std::size_t i = 0; i < n; ++i) {
            rate_deg_h[i] += added_deg_h[i];
            with_bias_deg_h[i] += added_deg_h[i];
            most_deg_h = std::max(most_deg_h, std::abs(added_deg_h[i]));
        }
        // Shift of the zero-rate points over the time within which the phase turns: the relative change of a kick.
        const double acceleration_rad_s2 = device.half_cycle(1, series_.amplitude_rad).end_acceleration_rad_s2();
        if (c * most_deg_h > options.turns.model.rate_felt_by_kicks * std::sqrt(acceleration_rad_s2)) {
            kick_of =
                std::make_shared<const Kicks>(kicks_at(device_setup, with_bias_deg_h, coupling, parameters.shape));
            swing = dither_swings(*kick_of, with_bias_deg_h);
        }
        prediction.turn_s = dither_turns(rate_deg_h, coupling, swing, device);
        prediction.dither_s = smooth(prediction.turn_s);
    }
    const std::vector<double> input_arcsec = series_.input_angles_arcsec(prediction.dither_s);
    std::vector<effects::ChangeOver> changes;
    for (const ActiveEffect& active : parameters.effects) {
        if (active.effect->adds_angle()) changes.push_back(active.effect->change(active.values));
    }
    double lockin = 0.0;
    double angle_arcsec = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        // Kicks are proportional to the root of one over the acceleration, which is proportional to the swing of the
        // half cycle.
        const TurnKicks::Kick& kick = (*kick_of)[i];
        const double before = 1.0 / std::sqrt(swing[i > 0 ? i - 1 : i]);
        const double after = 1.0 / std::sqrt(swing[i]);
        // Linearised about the phase that was read, as in the filter, with the mean of the second-order term.
        const double error_rad = known_.mean_rad[i];
        const double half_rad2 = 0.5 * known_.variance_rad2[i];
        double before_rad = kick.before_rad + error_rad * kick.before_slope + half_rad2 * kick.before_curvature;
        double after_rad = kick.after_rad + error_rad * kick.after_slope + half_rad2 * kick.after_curvature;
        before_rad *= before;
        after_rad *= after;
        const std::size_t last = i > 0 ? i - 1 : 0;
        const effects::Interval half_cycle = interval(prediction, i);
        angle_arcsec += half_cycle.duration_s * parameters.bias_deg_h + (input_arcsec[i] - input_arcsec[last]);
        for (const effects::ChangeOver& change : changes) angle_arcsec += change(half_cycle).angle_arcsec;

        prediction.phase_rad[i] = lockin + before_rad + c * angle_arcsec;
        lockin += before_rad + after_rad;
        frame.sign[i] = -series_.direction[i];
        frame.before_slope[i] = before * kick.before_slope;
        if (parameters.shape) frame.shape_left[i] = before * kick.before_weighted;
        if (!(std::abs(frame.before_slope[i]) < 1.0)) {
            throw RunError(
                "the lock-in is so strong that the phase without it cannot be computed from the phase at a turn");
        }
        frame.kick_slope[i] = before * kick.before_slope + after * kick.after_slope;
    }
    return prediction;
}

double TurnModel::beat_hz() const {
    const std::size_t last = (series_.size() - 1) / 2 * 2;  // the last turn of the kind of the first one
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
            // A rate that hardly changes within the record is part of the bias.
            if (term.time_s > options.turns.model.longest_correlation * series_.time_s.back()) continue;
            noise.rates.push_back({term.time_s, c * c * term.variance_deg2_h2});
        }
    }
    return noise;
}

}  // namespace ringlock::closure
