#include "analysis/closure/predictive.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <span>

#include "analysis/allan/allan.hpp"
#include "analysis/closure/closed_scenario.hpp"
#include "analysis/closure/sample_series.hpp"
#include "analysis/closure/turn_series.hpp"
#include "analysis/instrument/simulate.hpp"
#include "analysis/noise/spectrum.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"
#include "engine/gyro/setup.hpp"

namespace ringlock::closure {

namespace {

constexpr std::int64_t most_turns = 4'000'000;
constexpr int fewest_simulations = 9;
// Seeds of nobody's study: the record itself may be of a simulation, whose chance must not come again.
constexpr std::uint64_t first_seed = 0x7072656469637400;
constexpr std::size_t fold_bins = 12;
constexpr int bands = 30;
constexpr double nothing = std::numeric_limits<double>::quiet_NaN();

/// One statistic of one record.
struct Curve {
    std::vector<double> x, y;
};
/// All of them: in the order of `blank()`.
using Curves = std::vector<Curve>;

/// What the curves are called.
std::vector<PredictiveStatistic> blank(bool turns) {
    std::vector<PredictiveStatistic> all;
    all.push_back({.name = "allan_deviation",
                   .description = "overlapping Allan deviation of the output angle less the known input",
                   .x_name = "averaging time",
                   .x_unit = "s",
                   .unit = "deg/h",
                   .positive = true});
    all.push_back({.name = "spectrum",
                   .description = "root of the one-sided power density of the output rate less the known input, in bands",
                   .x_name = "frequency",
                   .x_unit = "Hz",
                   .unit = "deg/h/sqrt(Hz)",
                   .positive = true});
    for (const char* kind : {"minima", "maxima"}) {
        if (!turns) break;
        all.push_back({.name = fmt::format("folded_{}", kind),
                       .description = fmt::format("rotation from the turn before to the turn after, of {} by their "
                                                  "phase, less the mean of all turns",
                                                  kind),
                       .x_name = "phase at the turn",
                       .x_unit = "rad",
                       .unit = "rad"});
    }
    return all;
}

/// Allan deviation at octaves and spectrum in bands of a rate: consecutive increments [arcsec] of intervals [s].
///
/// 1 arcsec/s is 1 deg/h.
void add_rate_curves(const std::vector<double>& increment_arcsec, double interval_s, Curves& curves) {
    const auto phase = allan::centred_phase(increment_arcsec, allan::Kind::increment, interval_s);
    const auto largest =
        allan::largest_factor(allan::Estimator::oadev, static_cast<std::int64_t>(phase.size()));
    Curve& deviation = curves.emplace_back();
    for (const allan::Point& point :
         allan::deviation(allan::Estimator::oadev, phase, interval_s, allan::octave_factors(largest))) {
        deviation.x.push_back(point.tau_s);
        deviation.y.push_back(point.dev);
    }
    std::vector<double> rate_deg_h = increment_arcsec;
    for (double& rate : rate_deg_h) rate /= interval_s;
    const noise::Spectrum spectrum = noise::cosine_spectrum(rate_deg_h);
    // Bands of equal ratio, but of four coefficients at least.
    Curve& density = curves.emplace_back();
    const std::size_t last = spectrum.z.size();
    const double ratio = std::pow(static_cast<double>(last), 1.0 / bands);
    double edge = 1.0;
    for (std::size_t j = 0; j < last;) {
        edge = std::max(edge * ratio, static_cast<double>(j + 4));
        std::size_t end = std::min(last, static_cast<std::size_t>(std::llround(edge)));
        if (last - end < 4) end = last;
        double power = 0.0;
        double log_x = 0.0;
        for (std::size_t k = j; k < end; ++k) {
            power += spectrum.z[k] * spectrum.z[k];
            log_x += std::log(spectrum.x(k + 1));
        }
        const auto count = static_cast<double>(end - j);
        density.x.push_back(std::exp(log_x / count) / interval_s);
        density.y.push_back(std::sqrt(2.0 * interval_s * power / count));
        j = end;
    }
}

/// Looks at records of turns in the way that the measured one is looked at.
class TurnSight {
   public:
    TurnSight(const record::Record& record, const Closure& closure) {
        for (const Step& step : closure.steps) {
            if (step.effect == "missed_counts") count_again_ = true;
            if (step.effect != "readout_ellipse") continue;
            const effects::Effect& effect = *effects::find(step.effect);
            gyro::Setup setup;
            effects::Values values;
            for (const effects::Parameter& p : effect.parameters()) values[std::string(p.name)] = p.default_value;
            for (const Estimate& estimate : step.parameters) values[estimate.name] = estimate.value;
            effect.configure(values, setup);
            ellipse_ = setup.ellipse;
        }
        measured_ = prepare(record, join(*record.turns, ellipse_, count_again_));
    }

    Curves look(const record::Turns& turns) const {
        const JoinedPhase joined = join(turns, ellipse_, count_again_);
        const std::size_t n = std::min(turns.size(), measured_.size());
        const double arcsec_per_rad = measured_.setup.scale_factor_arcsec / units::two_pi;
        std::vector<double> angle_arcsec(n);
        for (std::size_t i = 0; i < n; ++i) {
            angle_arcsec[i] = arcsec_per_rad * joined.phase_rad[i] -
                              measured_.input_angle_arcsec(turns.time_s[i] - turns.time_s[0]);
        }
        // A minimum with half of the maximum on either side: the dither is not in it, whatever its amplitude does.
        std::vector<double> increment_arcsec;
        std::optional<double> before;
        for (std::size_t i = 1; i + 1 < n; ++i) {
            if (turns.direction[i] < 0) continue;
            const double angle = 0.25 * (angle_arcsec[i - 1] + 2.0 * angle_arcsec[i] + angle_arcsec[i + 1]);
            if (before) increment_arcsec.push_back(angle - *before);
            before = angle;
        }
        // As many of every record, whichever kind of turn it begins with.
        increment_arcsec.resize(std::min(increment_arcsec.size(), (measured_.size() - 2) / 2 - 1));
        Curves curves;
        add_rate_curves(increment_arcsec, 2.0 * measured_.interval_s, curves);
        fold(turns, joined.phase_rad, angle_arcsec, arcsec_per_rad, curves);
        return curves;
    }

   private:
    static void fold(const record::Turns& turns, const std::vector<double>& phase_rad,
                     const std::vector<double>& angle_arcsec, double arcsec_per_rad, Curves& curves) {
        std::array<std::array<double, fold_bins>, 2> sum{};
        std::array<std::array<double, fold_bins>, 2> count{};
        double mean = 0.0;
        const std::size_t n = angle_arcsec.size();
        for (std::size_t i = 1; i + 1 < n; ++i) {
            const double fringes = phase_rad[i] / units::two_pi;
            const auto bin =
                static_cast<std::size_t>((fringes - std::floor(fringes)) * static_cast<double>(fold_bins)) % fold_bins;
            const std::size_t kind = turns.direction[i] > 0 ? 0 : 1;
            const double across = (angle_arcsec[i + 1] - angle_arcsec[i - 1]) / arcsec_per_rad;
            sum[kind][bin] += across;
            count[kind][bin] += 1.0;
            mean += across / static_cast<double>(n - 2);
        }
        for (std::size_t kind = 0; kind < 2; ++kind) {
            Curve& curve = curves.emplace_back();
            for (std::size_t bin = 0; bin < fold_bins; ++bin) {
                curve.x.push_back((static_cast<double>(bin) + 0.5) * units::two_pi / static_cast<double>(fold_bins));
                // Fewer than four are no mean.
                curve.y.push_back(count[kind][bin] < 4.0 ? nothing : sum[kind][bin] / count[kind][bin] - mean);
            }
        }
    }

    gyro::Ellipse ellipse_;
    bool count_again_ = false;
    TurnSeries measured_;
};

/// The same for samples.
class SampleSight {
   public:
    explicit SampleSight(const record::Record& record) : measured_(prepare_samples(record)) {}

    Curves look(std::vector<double> increment_arcsec) const {
        increment_arcsec.resize(std::min(increment_arcsec.size(), measured_.size()));
        const auto& input = measured_.input_rate_deg_h;
        for (std::size_t i = 0; i < increment_arcsec.size() && !input.empty(); ++i) {
            increment_arcsec[i] -= input[i] * measured_.interval_s;
        }
        Curves curves;
        add_rate_curves(increment_arcsec, measured_.interval_s, curves);
        return curves;
    }
    const SampleSeries& measured() const { return measured_; }

   private:
    SampleSeries measured_;
};

bool changes(const record::Track& track) {
    return std::any_of(track.value.begin(), track.value.end(), [&](double v) { return v != track.value.front(); });
}

/// Temperature over the record, less that at its start.
record::Track temperature_change(const record::Record& record, const SampleSight* samples) {
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

/// The closed scenario over the record's own length, input and temperature.
scenario::Scenario replica(const record::Record& record, const Closure& closure, const SampleSight* samples,
                           std::vector<std::string>& notes) {
    scenario::Scenario s = closed_scenario(record, closure);
    s.ensemble.gyros = 1;
    if (record.turns) {
        s.ensemble.duration_s = 0.5 * static_cast<double>(record.turns->size() - 1) / s.dither.frequency_hz;
    }
    const double start_s = start_of(record);
    const double rest_deg_h = s.input.rate_deg_h - closure.mean_input_rate_deg_h;
    const record::Track& input = record.input_rate_deg_h;
    // A scenario's temperature is a ramp and a sine; what a rate makes of any other is part of the profile.
    double& of_temperature = s.effects.at("bias_temperature").at("deg_h_per_k");
    const record::Track temperature = temperature_change(record, samples);
    const bool by_temperature = of_temperature != 0.0 && !temperature.empty();
    if (changes(input) || by_temperature) {
        std::vector<double> times = input.time_s;
        if (by_temperature) times.insert(times.end(), temperature.time_s.begin(), temperature.time_s.end());
        std::sort(times.begin(), times.end());
        times.erase(std::unique(times.begin(), times.end()), times.end());
        for (const double time_s : times) {
            double rate = rest_deg_h + (input.empty() ? closure.mean_input_rate_deg_h : input.at(time_s));
            if (by_temperature) rate += of_temperature * temperature.at(time_s);
            s.input.profile_time_s.push_back(time_s - start_s);
            s.input.profile_rate_deg_h.push_back(rate);
        }
        if (by_temperature) of_temperature = 0.0;
    }
    for (const Step& step : closure.steps) {
        const effects::Effect* effect = effects::find(step.effect);
        for (const Estimate& estimate : step.parameters) {
            if (effect != nullptr && s.effects.at(step.effect).contains(estimate.name)) continue;
            notes.push_back(fmt::format("{} of {} is no parameter of a scenario: it is not simulated", estimate.name,
                                        step.effect));
        }
        if (step.effect == "lockin_temperature") {
            notes.emplace_back("the threshold follows a steady ramp of the temperature in the simulations");
        }
    }
    return s;
}

/// Ranks the first of the curves, the measured one, among them all.
///
/// Each is held against the mean and the standard deviation of the others, at every point; its largest deviation is
/// ranked. Curves that come of one law are exchangeable, and the rank is then as probable as any other, whatever the
/// law and however the points depend on each other.
void rank(const std::vector<std::vector<double>>& curves, PredictiveStatistic& statistic) {
    const std::size_t records = curves.size();
    const std::size_t points = curves.front().size();
    std::vector<double> largest(records, 0.0);
    statistic.p_value.assign(points, nothing);
    statistic.lowest.assign(points, nothing);
    statistic.highest.assign(points, nothing);
    for (std::size_t j = 0; j < points; ++j) {
        std::vector<double> value;
        for (const auto& curve : curves) value.push_back(statistic.positive ? std::log(curve[j]) : curve[j]);
        // A point that some record does not have is left out for all.
        if (!std::all_of(value.begin(), value.end(), [](double v) { return std::isfinite(v); })) continue;
        std::size_t above = 0;
        std::size_t below = 0;
        statistic.lowest[j] = statistic.highest[j] = curves[1][j];
        for (std::size_t k = 1; k < records; ++k) {
            above += value[k] >= value[0] ? 1 : 0;
            below += value[k] <= value[0] ? 1 : 0;
            statistic.lowest[j] = std::min(statistic.lowest[j], curves[k][j]);
            statistic.highest[j] = std::max(statistic.highest[j], curves[k][j]);
        }
        statistic.p_value[j] =
            std::min(1.0, 2.0 * static_cast<double>(1 + std::min(above, below)) / static_cast<double>(records));
        for (std::size_t k = 0; k < records; ++k) {
            const auto others = static_cast<double>(records - 1);
            double mean = 0.0;
            for (std::size_t i = 0; i < records; ++i) mean += i == k ? 0.0 : value[i] / others;
            double squares = 0.0;
            for (std::size_t i = 0; i < records; ++i) squares += i == k ? 0.0 : (value[i] - mean) * (value[i] - mean);
            if (squares == 0.0) continue;
            const double deviation = std::abs(value[k] - mean) / std::sqrt(squares / (others - 1.0));
            if (deviation <= largest[k]) continue;
            largest[k] = deviation;
            if (k == 0) statistic.at = j;
        }
    }
    statistic.largest = largest[0];
    const auto as_large =
        std::count_if(largest.begin() + 1, largest.end(), [&](double other) { return other >= largest[0]; });
    statistic.p_value_all = static_cast<double>(1 + as_large) / static_cast<double>(records);
}

std::vector<Curves> simulate(const scenario::Scenario& closed, int simulations, const TurnSight* turns,
                             const SampleSight* samples) {
    std::vector<Curves> all(static_cast<std::size_t>(simulations));
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t k) {
        scenario::Scenario mine = closed;
        mine.ensemble.seed = first_seed + k;
        record::Record simulated = instrument::simulate_record(mine);
        all[k] = turns != nullptr ? turns->look(*simulated.turns) : samples->look(std::move(simulated.samples->values));
    });
    return all;
}

}  // namespace

Predictive check_predictive(const record::Record& record, const Closure& closure, int simulations) {
    Predictive out;
    try {
        std::optional<TurnSight> turns;
        std::optional<SampleSight> samples;
        std::vector<Curves> all;
        if (record.turns) {
            turns.emplace(record, closure);
            all.push_back(turns->look(*record.turns));
        } else {
            samples.emplace(record);
            all.push_back(samples->look(samples->measured().increment));
        }
        const TurnSight* turn_sight = turns ? &*turns : nullptr;
        const SampleSight* sample_sight = samples ? &*samples : nullptr;
        const scenario::Scenario closed = replica(record, closure, sample_sight, out.notes);
        const double each = std::max(1.0, 2.0 * closed.ensemble.duration_s * closed.dither.frequency_hz);
        const int affordable = static_cast<int>(std::min(1e6, static_cast<double>(most_turns) / each));
        const int wanted = std::clamp(affordable, std::min(fewest_simulations, simulations), simulations);
        const std::vector<Curves> simulated = simulate(closed, wanted, turn_sight, sample_sight);
        all.insert(all.end(), simulated.begin(), simulated.end());
        out.simulations = wanted;
        out.turns = std::llround(each) * wanted;
        if (wanted < simulations) {
            out.notes.push_back(fmt::format("{} simulations and not {}, as the record is long: no p below {:.2g}",
                                            wanted, simulations, 1.0 / (wanted + 1.0)));
        }
        std::vector<PredictiveStatistic> statistics = blank(record.turns.has_value());
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
        }
        out.statistics = std::move(statistics);
    } catch (const InputError& error) {
        out.notes.push_back(fmt::format("no predictive check, the closed model cannot be simulated: {}", error.what()));
    } catch (const RunError& error) {
        out.notes.push_back(fmt::format("no predictive check, the closed model cannot be simulated: {}", error.what()));
    }
    return out;
}

}  // namespace ringlock::closure
