#include "analysis/closure/report/rate_series.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numeric>
#include <optional>

#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/closure/turns/model/series.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

namespace {

RateSeries rates_of_samples(const record::Record& record) {
    const SampleSeries series = prepare_samples(record);
    RateSeries rates;
    rates.interval_s = series.interval_s;
    for (std::size_t i = 0; i < series.size(); ++i) {
        rates.time_s.push_back(series.time_s[i] - 0.5 * series.interval_s);
        rates.rate_deg_h.push_back(series.increment[i] / series.interval_s);
    }
    return rates;
}

RateSeries rates_of_turns(const record::Record& record) {
    const record::Turns& turns = *record.turns;
    const JoinedPhase joined = join(turns, {}, false);
    const TurnSeries series = prepare(record, joined);
    const double arcsec_per_rad = series.setup.scale_factor_arcsec / units::two_pi;
    RateSeries rates;
    rates.interval_s = 2.0 * series.interval_s;
    const std::size_t first = turns.direction[0] > 0 ? 0 : 1;
    for (std::size_t i = first; i + 2 < turns.size(); i += 2) {
        rates.time_s.push_back(0.5 * (turns.time_s[i] + turns.time_s[i + 2]));
        rates.rate_deg_h.push_back(arcsec_per_rad * (joined.phase_rad[i + 2] - joined.phase_rad[i]) / rates.interval_s);
    }
    return rates;
}

}  // namespace

RateSeries rates_of(const record::Record& record) {
    return record.turns ? rates_of_turns(record) : rates_of_samples(record);
}

RateSeries averaged(const RateSeries& rates, std::size_t points) {
    const std::size_t n = rates.rate_deg_h.size();
    const std::size_t each = (n + points - 1) / points;
    if (each <= 1) return rates;
    RateSeries means;
    means.interval_s = rates.interval_s * static_cast<double>(each);
    for (std::size_t i = 0; i + each <= n; i += each) {
        double time_s = 0.0;
        double rate = 0.0;
        for (std::size_t k = i; k < i + each; ++k) {
            time_s += rates.time_s[k] / static_cast<double>(each);
            rate += rates.rate_deg_h[k] / static_cast<double>(each);
        }
        means.time_s.push_back(time_s);
        means.rate_deg_h.push_back(rate);
    }
    return means;
}

std::vector<double> determined_rates(const record::Record& record, const Closure& closure, const RateSeries& rates) {
    double constant = record.turns ? 0.0 : -closure.mean_input_rate_deg_h;
    for (const Estimate& estimate : closure.base) {
        if (estimate.name == "mean_rate_deg_h" || estimate.name == "bias_deg_h") constant += estimate.value;
    }
    const record::Track& input = record.input_rate_deg_h;
    const double start_s = start_of(record);
    std::vector<effects::ChangeOver> changes;
    for (const Step& step : closure.steps) {
        if (!step.effect->adds_angle()) continue;
        effects::Values values;
        for (const effects::Parameter& p : step.effect->parameters()) values[std::string(p.name)] = p.default_value;
        for (const Estimate& estimate : step.parameters) {
            if (std::isfinite(estimate.value)) values[estimate.name] = estimate.value;
        }
        set_back_clock(*step.effect, values, start_s);
        changes.push_back(step.effect->change(values));
    }
    const record::Track& temperature = record.temperature_c;
    const double start_c = temperature.empty() ? 0.0 : temperature.at(start_s);
    std::vector<double> determined;
    for (const double time_s : rates.time_s) {
        const double from_s = time_s - 0.5 * rates.interval_s;
        const double to_s = from_s + rates.interval_s;
        const auto input_at = [&](double t) { return input.empty() ? closure.mean_input_rate_deg_h : input.at(t); };
        const auto warmer_at = [&](double t) { return temperature.empty() ? 0.0 : temperature.at(t) - start_c; };
        effects::Interval interval;
        interval.start_s = from_s - start_s;
        interval.duration_s = rates.interval_s;
        interval.temperature_change_k[0] = warmer_at(from_s);
        interval.temperature_change_k[1] = warmer_at(to_s);
        interval.input_rate_deg_h[0] = input_at(from_s);
        interval.input_rate_deg_h[1] = input_at(to_s);
        double rate = constant + 0.5 * (input_at(from_s) + input_at(to_s));
        for (const effects::ChangeOver& change : changes) rate += change(interval).angle_arcsec / rates.interval_s;
        determined.push_back(rate);
    }
    return determined;
}

NearLine spectrum_near(const RateSeries& rates, double hz) {
    constexpr int resolutions = options.report.resolutions_around_line;
    constexpr int points_each = options.report.points_a_resolution;
    NearLine near;
    const std::size_t n = rates.rate_deg_h.size();
    const double length_s = rates.interval_s * static_cast<double>(n);
    near.resolution_hz = 1.0 / length_s;
    const double mean = std::accumulate(rates.rate_deg_h.begin(), rates.rate_deg_h.end(), 0.0) / static_cast<double>(n);
    for (int k = -resolutions * points_each; k <= resolutions * points_each; ++k) {
        const double at_hz = hz + near.resolution_hz * k / points_each;
        if (at_hz <= 0.0 || 2.0 * at_hz * rates.interval_s > 1.0) continue;
        const std::complex<double> turn = std::polar(1.0, -units::two_pi * at_hz * rates.interval_s);
        std::complex<double> phase = 1.0;
        std::complex<double> sum = 0.0;
        for (std::size_t i = 0; i < n; ++i) {
            sum += (rates.rate_deg_h[i] - mean) * phase;
            phase *= turn;
        }
        near.hz.push_back(at_hz);
        near.amplitude_deg_h.push_back(2.0 * std::abs(sum) / static_cast<double>(n));
    }
    return near;
}

}  // namespace ringlock::closure
