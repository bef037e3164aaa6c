#include "analysis/closure/report/predictive.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <mutex>
#include <optional>

#include "analysis/closure/options.hpp"
#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/report/predictive_statistics.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "analysis/instrument/simulate.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/effects/effect.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::closure {

namespace {

// Seeds that no study uses: the record itself may be simulated, and its random numbers must not be used again.
constexpr std::uint64_t first_seed = 0x7072656469637400;
constexpr double undefined = std::numeric_limits<double>::quiet_NaN();

bool changes(const record::Track& track) {
    return std::any_of(track.value.begin(), track.value.end(), [&](double v) { return v != track.value.front(); });
}

/// Temperature over the record, less that at its start.
record::Track temperature_change(const record::Record& record, const SampleStatistics* samples) {
    record::Track track = record.temperature_c;
    if (samples != nullptr && !samples->measured().temperature_change_k.empty()) {
        const SampleSeries& series = samples->measured();
        track = {};
        const std::size_t every = std::max<std::size_t>(1, series.size() / 2000);
        for (std::size_t i = 0; i < series.size(); i += every) {
            track.time_s.push_back(series.time_s[i]);
            track.value.push_back(series.temperature_change_k[i]);
        }
    }
    if (track.empty()) return track;
    const double start = track.at(start_of(record));
    for (double& value : track.value) value -= start;
    return track;
}

/// Rate [deg/h] of an effect that follows the temperature, at that time.
double rate_at(const effects::ChangeOver& change, const record::Track& temperature, double time_s) {
    constexpr double moment_s = 1e-3;
    const double before_s = time_s - 0.5 * moment_s;
    const double after_s = time_s + 0.5 * moment_s;
    return change({before_s, moment_s, {temperature.at(before_s), temperature.at(after_s)}}).angle_arcsec / moment_s;
}

/// The closed scenario over the record's own length, input and temperature.
scenario::Scenario replica(const record::Record& record, const Closure& closure, const SampleStatistics* samples) {
    scenario::Scenario s = closed_scenario(record, closure).scenario;
    s.ensemble.gyros = 1;
    if (record.turns) {
        s.ensemble.duration_s = 0.5 * static_cast<double>(record.turns->size() - 1) / s.dither.frequency_hz;
    }
    const double start_s = start_of(record);
    const double rest_deg_h = s.input.rate_deg_h - closure.mean_input_rate_deg_h;
    const record::Track& input = record.input_rate_deg_h;
    // A scenario's temperature is a ramp and a sine; rates that follow any other temperature are part of the profile.
    const record::Track temperature = temperature_change(record, samples);
    std::vector<effects::ChangeOver> rates;
    for (auto& [name, values] : s.effects) {
        const effects::Effect& effect = *effects::find(name);
        if (temperature.empty() || effect.follows() != effects::Follows::temperature || !effect.adds_angle() ||
            !effect.active(values)) {
            continue;
        }
        rates.push_back(effect.change(values));
        for (const effects::Parameter& parameter : effect.parameters()) {
            values.at(std::string(parameter.name)) = parameter.default_value;
        }
    }
    const bool by_temperature = !rates.empty();
    if (changes(input) || by_temperature) {
        std::vector<double> times = input.time_s;
        if (by_temperature) times.insert(times.end(), temperature.time_s.begin(), temperature.time_s.end());
        std::sort(times.begin(), times.end());
        times.erase(std::unique(times.begin(), times.end()), times.end());
        for (const double time_s : times) {
            double rate = rest_deg_h + (input.empty() ? closure.mean_input_rate_deg_h : input.at(time_s));
            for (const effects::ChangeOver& change : rates) rate += rate_at(change, temperature, time_s);
            s.input.profile_time_s.push_back(time_s - start_s);
            s.input.profile_rate_deg_h.push_back(rate);
        }
    }
    return s;
}

/// Notes on parts of the model that the simulations do not contain.
std::vector<std::string> left_out(const Closure& closure) {
    std::vector<std::string> notes;
    const scenario::EffectSettings known = scenario::default_effect_settings();
    for (const Step& step : closure.steps) {
        const auto effect = known.find(step.name());
        for (const Estimate& estimate : step.parameters) {
            if (effect != known.end() && effect->second.contains(estimate.name)) continue;
            notes.push_back(fmt::format("{} of {} is not a parameter of a scenario and is not simulated", estimate.name,
                                        step.effect->name()));
        }
        if (step.effect->changes().threshold && step.effect->follows() == effects::Follows::temperature) {
            notes.emplace_back("the threshold follows a steady ramp of the temperature in the simulations");
        }
    }
    return notes;
}

/// The closed model with all parameters drawn about their estimates, by their standard errors, independently.
///
/// Positive parameters are drawn by their logarithm, with a standard error of half the value at most: those of
/// variances near zero are not meaningful.
Closure drawn(const Closure& closure, std::uint64_t seed) {
    Closure out = closure;
    random::NormalStream normal({seed, 0}, random::Purpose::fitted_parameters);
    const auto positive = [](double value, double sd, double z) {
        return value == 0.0 ? 0.0 : value * std::exp(z * std::min(sd / std::abs(value), 0.5));
    };
    for (Estimate& e : out.base) {
        const double z = normal();
        if (!std::isfinite(e.sd)) continue;
        const bool of_either_sign = e.name == "bias_deg_h" || e.name == "mean_rate_deg_h";
        e.value = of_either_sign ? e.value + z * e.sd : positive(e.value, e.sd, z);
    }
    for (Step& step : out.steps) {
        for (Estimate& e : step.parameters) {
            const double z = normal();
            if (!std::isfinite(e.sd)) continue;
            for (const effects::Parameter& parameter : step.effect->parameters()) {
                if (parameter.name != e.name || parameter.role == effects::Role::setting) continue;
                const bool spread =
                    parameter.role == effects::Role::deviation || parameter.role == effects::Role::probability;
                e.value =
                    std::clamp(spread ? positive(e.value, e.sd, z) : e.value + z * e.sd, parameter.min, parameter.max);
            }
        }
    }
    return out;
}

/// Peak rate of the dither [deg/s] with which simulations have the amplitude of the record.
///
/// The measured amplitude contains the mean of the kicks. Over a half cycle of thousands of radians that is negligible;
/// but without noise of the dither the phases of minima and maxima are correlated, and it shifts one against the other.
double swinging_deg_s(const record::Record& record, Closure closure, const TurnStatistics& statistics,
                      int simulations) {
    const auto peak = std::find_if(closure.base.begin(), closure.base.end(),
                                   [](const Estimate& e) { return e.name == "dither_peak_rate_deg_s"; });
    if (peak == closure.base.end()) return undefined;
    const double measured = statistics.peak_rate_deg_s(record);
    for (int pass = 0; pass < 2; ++pass) {
        std::vector<double> swung(static_cast<std::size_t>(simulations));
        scenario::Scenario mine = replica(record, closure, nullptr);
        tbb::parallel_for(std::size_t{0}, swung.size(), [&](std::size_t k) {
            scenario::Scenario one = mine;
            one.ensemble.seed = first_seed + options.report.most_simulations + k;
            swung[k] = statistics.peak_rate_deg_s(instrument::simulate_record(one));
        });
        double mean = 0.0;
        for (const double swing : swung) mean += swing / static_cast<double>(simulations);
        peak->value *= measured / mean;
    }
    return peak->value;
}

std::vector<Curves> simulate(const record::Record& record, const Closure& closure, int simulations,
                             const TurnStatistics* turns, const SampleStatistics* samples,
                             const std::function<void()>& done) {
    std::vector<Curves> all(static_cast<std::size_t>(simulations));
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t k) {
        check_interrupt();
        const std::uint64_t seed = first_seed + k;
        scenario::Scenario mine = replica(record, drawn(closure, seed), samples);
        mine.ensemble.seed = seed;
        record::Record simulated = instrument::simulate_record(mine);
        all[k] = turns != nullptr ? turns->curves_of(*simulated.turns)
                                  : samples->curves_of(std::move(simulated.samples->values));
        done();
    });
    return all;
}

Predictive simulated_check(const record::Record& record, const Closure& closure, const Monitor& monitor,
                           int simulations) {
    Predictive out;
    try {
        std::optional<TurnStatistics> turns;
        std::optional<SampleStatistics> samples;
        std::vector<Curves> all;
        if (record.turns) {
            turns.emplace(record, closure);
            all.push_back(turns->curves_of(*record.turns));
        } else {
            samples.emplace(record, closure);
            all.push_back(samples->curves_of(samples->measured().increment));
        }
        const TurnStatistics* turn_statistics = turns ? &*turns : nullptr;
        const SampleStatistics* sample_statistics = samples ? &*samples : nullptr;
        const scenario::Scenario closed = replica(record, closure, sample_statistics);
        out.notes = left_out(closure);
        const double each = std::max(1.0, 2.0 * closed.ensemble.duration_s * closed.dither.frequency_hz);
        const int affordable = static_cast<int>(std::min(1e6, static_cast<double>(options.report.most_turns) / each));
        const int wanted =
            std::clamp(affordable, std::min(options.report.fewest_simulations, simulations), simulations);
        Closure swinging = closure;
        if (turns && closed.record.trajectory == scenario::parse_arm("uncompensated")) {
            const double peak_deg_s = swinging_deg_s(record, closure, *turns, std::clamp(affordable / 20, 1, 4));
            for (Estimate& e : swinging.base) {
                if (e.name == "dither_peak_rate_deg_s") e.value = peak_deg_s;
            }
        }
        const bool of_base = !closure.base_alone.empty();
        const int of_base_alone = of_base ? std::min(wanted, options.report.base_simulations) : 0;
        std::mutex counting;
        int done = 0;
        const auto one_more = [&] {
            const std::lock_guard lock(counting);
            monitor.tell_share(static_cast<double>(++done) / static_cast<double>(wanted + of_base_alone));
        };
        const std::vector<Curves> simulated =
            simulate(record, swinging, wanted, turn_statistics, sample_statistics, one_more);
        all.insert(all.end(), simulated.begin(), simulated.end());
        out.simulations = wanted;
        out.turns = std::llround(each) * wanted;
        if (wanted < simulations) {
            out.notes.push_back(
                fmt::format("{} simulations instead of {}, because the record is long: "
                            "p cannot be below {:.2g}",
                            wanted, simulations, 1.0 / (wanted + 1.0)));
        }
        Curves whole;
        if (samples && !closure.disturbed.empty()) whole = samples->curves_of_whole(samples->measured().increment);
        std::vector<Curves> base;
        if (of_base) {
            Closure alone = closure;
            alone.base = closure.base_alone;
            alone.steps.clear();
            base = simulate(record, alone, of_base_alone, turn_statistics, sample_statistics, one_more);
        }
        std::vector<PredictiveStatistic> statistics = blank_statistics(record.turns.has_value());
        for (std::size_t k = 0; k < statistics.size(); ++k) {
            PredictiveStatistic& statistic = statistics[k];
            std::size_t points = all[0][k].y.size();
            for (const Curves& curves : all) points = std::min(points, curves[k].y.size());
            std::vector<std::vector<double>> values;
            for (const Curves& curves : all) {
                values.emplace_back(curves[k].y.begin(), curves[k].y.begin() + static_cast<std::ptrdiff_t>(points));
            }
            statistic.x.assign(all[0][k].x.begin(), all[0][k].x.begin() + static_cast<std::ptrdiff_t>(points));
            statistic.measured = values.front();
            rank(values, statistic);
            if (!whole.empty()) {
                const std::vector<double>& y = whole[k].y;
                statistic.measured_whole.assign(y.begin(), y.begin() + static_cast<std::ptrdiff_t>(points));
            }
            if (!base.empty()) statistic.base = mean_of(base, k, points, statistic.positive);
        }
        out.statistics = std::move(statistics);
    } catch (const InputError& error) {
        out.notes.push_back(
            fmt::format("no predictive check, because the closed model cannot be simulated: {}", error.what()));
    } catch (const RunError& error) {
        out.notes.push_back(
            fmt::format("no predictive check, because the closed model cannot be simulated: {}", error.what()));
    }
    return out;
}

}  // namespace

Predictive check_predictive(const record::Record& record, const Closure& closure, int simulations,
                            const Monitor& monitor) {
    const auto check = [&] { return simulated_check(record, closure, monitor, simulations); };
    // Each thread holds a simulated record and its statistics.
    return record.turns ? on_threads_for(record.turns->size(), check) : check();
}

}  // namespace ringlock::closure
