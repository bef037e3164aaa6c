#include "analysis/closure/report/predictive.hpp"

#include <fmt/format.h>
#include <tbb/parallel_for.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <mutex>
#include <numeric>
#include <optional>
#include <span>

#include "analysis/allan/allan.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/samples/model/series.hpp"
#include "analysis/closure/turns/model/effect_roles.hpp"
#include "analysis/closure/turns/model/model.hpp"
#include "analysis/closure/turns/model/series.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"
#include "analysis/instrument/simulate.hpp"
#include "analysis/noise/model/spectrum.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"
#include "engine/gyro/setup.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::closure {

namespace {

// Seeds that no study uses: the record itself may be simulated, and its random numbers must not be used again.
constexpr std::uint64_t first_seed = 0x7072656469637400;
constexpr std::size_t fold_points = options.report.phase_points;
constexpr Eigen::Index harmonics = options.report.kick_harmonics;
constexpr double undefined = std::numeric_limits<double>::quiet_NaN();

/// One statistic of one record.
struct Curve {
    std::vector<double> x, y;
};
/// All statistics of one record, in the order of `blank()`.
using Curves = std::vector<Curve>;

/// Names and units of the curves.
std::vector<PredictiveStatistic> blank(bool turns) {
    std::vector<PredictiveStatistic> all;
    all.push_back({.name = "allan_deviation",
                   .description = "overlapping Allan deviation of the output angle less the known input",
                   .x_name = "averaging time",
                   .x_unit = "s",
                   .unit = "deg/h",
                   .positive = true});
    all.push_back(
        {.name = "spectrum",
         .description = "root of the one-sided power density of the output rate less the known input, in bands",
         .x_name = "frequency",
         .x_unit = "Hz",
         .unit = "deg/h/sqrt(Hz)",
         .positive = true});
    for (const char* kind : {"minima", "maxima"}) {
        if (!turns) break;
        all.push_back(
            {.name = fmt::format("folded_{}", kind),
             .description = fmt::format("change of the angle across {} by the phase there, three harmonics", kind),
             .x_name = "phase at the turn",
             .x_unit = "rad",
             .unit = "rad"});
    }
    return all;
}

/// Allan deviation at octaves and spectrum in bands of a rate, from consecutive increments [arcsec] of intervals [s].
///
/// 1 arcsec/s is 1 deg/h.
void add_rate_curves(const std::vector<double>& increment_arcsec, double interval_s, Curves& curves) {
    const auto phase = allan::centred_phase(increment_arcsec, allan::Kind::increment, interval_s);
    const auto largest = allan::largest_factor(allan::Estimator::oadev, static_cast<std::int64_t>(phase.size()));
    Curve& deviation = curves.emplace_back();
    for (const allan::Point& point :
         allan::deviation(allan::Estimator::oadev, phase, interval_s, allan::octave_factors(largest))) {
        deviation.x.push_back(point.tau_s);
        deviation.y.push_back(point.dev);
    }
    // Tapered (Hann): otherwise the ends of a strong line leak into all bands, depending on its phase there.
    std::vector<double> rate_deg_h = increment_arcsec;
    const auto n = static_cast<double>(rate_deg_h.size());
    const double mean = std::accumulate(rate_deg_h.begin(), rate_deg_h.end(), 0.0) / n;
    const double unit = std::sqrt(8.0 / 3.0) / interval_s;
    for (std::size_t i = 0; i < rate_deg_h.size(); ++i) {
        const double bell = std::sin(units::pi * (static_cast<double>(i) + 0.5) / n);
        rate_deg_h[i] = unit * bell * bell * (rate_deg_h[i] - mean);
    }
    const noise::Spectrum spectrum = noise::cosine_spectrum(rate_deg_h);
    // Bands of equal ratio, where these have enough coefficients.
    Curve& density = curves.emplace_back();
    const std::size_t last = spectrum.z.size();
    const double ratio = std::pow(static_cast<double>(last), 1.0 / options.report.spectrum_bands);
    double edge = 1.0;
    for (std::size_t j = 0; j < last;) {
        edge = std::max(edge * ratio, static_cast<double>(j + options.report.fewest_in_band));
        std::size_t end = std::min(last, static_cast<std::size_t>(std::llround(edge)));
        if (last - end < options.report.fewest_in_band) end = last;
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

/// Statistics of records of turns, computed as for the measured one.
class TurnSight {
   public:
    TurnSight(const record::Record& record, const Closure& closure) {
        for (const Step& step : closure.steps) {
            const effects::Effect& effect = *step.effect;
            if (!changes_reading(effect)) continue;
            count_again_ |= effects::first_of(effect, effects::Role::probability) != nullptr;
            gyro::Setup setup;
            effects::Values values;
            for (const effects::Parameter& p : effect.parameters()) values[std::string(p.name)] = p.default_value;
            for (const Estimate& estimate : step.parameters) values[estimate.name] = estimate.value;
            effect.configure(values, setup);
            if (setup.ellipse != gyro::Ellipse{}) ellipse_ = setup.ellipse;
        }
        measured_ = prepare(record, join(*record.turns, ellipse_, count_again_));
    }

    /// Peak rate of the dither, from the mean amplitude [deg/s].
    double peak_rate_deg_s(const record::Record& record) const {
        return prepare(record, join(*record.turns, ellipse_, count_again_)).setup.dither_peak_rate_deg_s;
    }

    Curves look(const record::Turns& turns) const {
        const JoinedPhase joined = join(turns, ellipse_, count_again_);
        const std::size_t n = std::min(turns.size(), measured_.size());
        const double arcsec_per_rad = measured_.setup.scale_factor_arcsec / units::two_pi;
        std::vector<double> time_s(n);
        for (std::size_t i = 0; i < n; ++i) time_s[i] = turns.time_s[i] - turns.time_s[0];
        std::vector<double> angle_arcsec = measured_.input_angles_arcsec(time_s);
        for (std::size_t i = 0; i < n; ++i) angle_arcsec[i] = arcsec_per_rad * joined.phase_rad[i] - angle_arcsec[i];
        // A turn and half of the turns on either side: the dither is not in this sum, even if its amplitude varies.
        std::vector<double> steady_rad;
        for (std::size_t i = 1; i + 1 < n; ++i) {
            steady_rad.push_back(0.25 * (angle_arcsec[i - 1] + 2.0 * angle_arcsec[i] + angle_arcsec[i + 1]) /
                                 arcsec_per_rad);
        }
        // Rates between minima: the same number for every record, with either kind of turn at its start.
        std::vector<double> increment_arcsec;
        const std::size_t first = turns.direction[1] > 0 ? 0 : 1;
        for (std::size_t k = first; k + 2 < steady_rad.size(); k += 2) {
            increment_arcsec.push_back(arcsec_per_rad * (steady_rad[k + 2] - steady_rad[k]));
        }
        increment_arcsec.resize(std::min(increment_arcsec.size(), (measured_.size() - 2) / 2 - 1));
        Curves curves;
        add_rate_curves(increment_arcsec, 2.0 * measured_.interval_s, curves);
        fold(turns, joined.phase_rad, steady_rad, curves);
        return curves;
    }

   private:
    /// Gain of the angle across a turn by direction and phase [rad], less the mean of that direction, as three
    /// harmonics of the phase. `steady_rad` is the angle at the turns without the dither, from turn 1 on.
    ///
    /// Noise of the dither at every turn hides the kick of a turn, but not the sum of many kicks: the angle is fitted
    /// by cumulative sums of the functions of phase. Each stretch has a straight line of its own, so that slow rates do
    /// not matter.
    static void fold(const record::Turns& turns, const std::vector<double>& phase_rad,
                     const std::vector<double>& steady_rad, Curves& curves) {
        constexpr Eigen::Index each = 2 * harmonics;
        constexpr Eigen::Index columns = 2 * each;
        constexpr std::size_t stretch = options.report.turns_in_stretch;
        using Row = Eigen::Matrix<double, columns, 1>;
        const std::size_t n = steady_rad.size();
        std::array<std::array<double, fold_points>, 2> seen{};
        const auto shape_of = [&](std::size_t i) {
            Row shape = Row::Zero();
            const Eigen::Index first = turns.direction[i] > 0 ? 0 : each;
            for (Eigen::Index h = 0; h < harmonics; ++h) {
                shape(first + 2 * h) = std::cos(static_cast<double>(h + 1) * phase_rad[i]);
                shape(first + 2 * h + 1) = std::sin(static_cast<double>(h + 1) * phase_rad[i]);
            }
            return shape;
        };
        for (std::size_t i = 0; i < n + 2; ++i) {
            const Eigen::Index first = turns.direction[i] > 0 ? 0 : each;
            const double fringes = phase_rad[i] / units::two_pi;
            const double place = (fringes - std::floor(fringes)) * static_cast<double>(fold_points);
            seen[first == 0 ? 0 : 1][static_cast<std::size_t>(place) % fold_points] += 1.0;
        }
        // The last column is the angle.
        using Products = Eigen::Matrix<double, columns + 1, columns + 1>;
        Products products = Products::Zero();
        Row sums = Row::Zero();
        Row last = shape_of(0);
        Row now = shape_of(1);
        for (std::size_t begin = 0; begin < n; begin += stretch) {
            const std::size_t rows = std::min(stretch, n - begin);
            if (rows < 3) break;
            Eigen::Matrix<double, Eigen::Dynamic, columns + 1> block(rows, columns + 1);
            Eigen::VectorXd time(rows);
            for (std::size_t r = 0; r < rows; ++r) {
                const std::size_t k = begin + r;
                // Half of a kick comes before its turn, half after it. With the weights 1 : 2 : 1 of the angle, an
                // eighth of it is there one turn before, a half at the turn, and seven eighths one turn later.
                const Row next = shape_of(k + 2);
                const Row row = sums - 0.125 * last + 0.5 * now + 0.125 * next;
                sums += now;
                last = now;
                now = next;
                const auto at = static_cast<Eigen::Index>(r);
                block.row(at) << row.transpose(), steady_rad[k];
                time(at) = static_cast<double>(r) - 0.5 * static_cast<double>(rows - 1);
            }
            block.rowwise() -= block.colwise().mean().eval();
            block -= time * (time.transpose() * block).eval() / time.squaredNorm();
            products += block.transpose() * block;
        }
        const Eigen::Matrix<double, columns, columns> normal = products.topLeftCorner<columns, columns>();
        const Row right = products.topRightCorner<columns, 1>();
        const Row scale = normal.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseInverse();
        Eigen::Matrix<double, columns, columns> scaled = scale.asDiagonal() * normal * scale.asDiagonal();
        // Phases without noise may make several columns collinear: the solution is then a compromise between them.
        scaled.diagonal().array() += 1e-10;
        const Row size = scale.asDiagonal() * scaled.ldlt().solve(scale.asDiagonal() * right);
        for (std::size_t direction = 0; direction < 2; ++direction) {
            Curve& curve = curves.emplace_back();
            const Eigen::Index first = direction == 0 ? 0 : each;
            for (std::size_t point = 0; point < fold_points; ++point) {
                const double phase = (static_cast<double>(point) + 0.5) * units::two_pi / fold_points;
                double kick = 0.0;
                for (Eigen::Index h = 0; h < harmonics; ++h) {
                    kick += size(first + 2 * h) * std::cos(static_cast<double>(h + 1) * phase) +
                            size(first + 2 * h + 1) * std::sin(static_cast<double>(h + 1) * phase);
                }
                curve.x.push_back(phase);
                curve.y.push_back(seen[direction][point] < options.report.fewest_at_phase ? undefined : kick);
            }
        }
    }

    gyro::Ellipse ellipse_;
    bool count_again_ = false;
    TurnSeries measured_;
};

/// Statistics of records of samples, computed as for the measured one.
class SampleSight {
   public:
    SampleSight(const record::Record& record, const Closure& closure)
        : measured_(prepare_samples(record)), left_out_(measured_.size(), 0) {
        // A row is in a stretch if its middle is.
        for (std::size_t i = 0; i < left_out_.size(); ++i) {
            const double middle_s = measured_.time_s[i] - 0.5 * measured_.interval_s;
            for (const std::vector<TimeSpan>* spans : {&closure.disturbed, &closure.gaps}) {
                for (const TimeSpan& span : *spans) {
                    if (middle_s > span.from_s && middle_s < span.to_s) left_out_[i] = 1;
                }
            }
        }
    }

    /// Disturbed stretches and gaps are excluded from simulations as from the record: their rows get the mean of the
    /// others.
    Curves look(std::vector<double> increment_arcsec) const {
        std::vector<double> increment = less_input(std::move(increment_arcsec));
        double sum = 0.0;
        double count = 0.0;
        for (std::size_t i = 0; i < increment.size(); ++i) {
            if (left_out_[i]) continue;
            sum += increment[i];
            count += 1.0;
        }
        for (std::size_t i = 0; i < increment.size(); ++i) {
            if (left_out_[i]) increment[i] = sum / std::max(count, 1.0);
        }
        Curves curves;
        add_rate_curves(increment, measured_.interval_s, curves);
        return curves;
    }
    Curves look_at_whole(std::vector<double> increment_arcsec) const {
        Curves curves;
        add_rate_curves(less_input(std::move(increment_arcsec)), measured_.interval_s, curves);
        return curves;
    }
    const SampleSeries& measured() const { return measured_; }

   private:
    std::vector<double> less_input(std::vector<double> increment_arcsec) const {
        increment_arcsec.resize(std::min(increment_arcsec.size(), measured_.size()));
        const auto& input = measured_.input_rate_deg_h;
        for (std::size_t i = 0; i < increment_arcsec.size() && !input.empty(); ++i) {
            increment_arcsec[i] -= input[i] * measured_.interval_s;
        }
        return increment_arcsec;
    }

    SampleSeries measured_;
    Rows left_out_;
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

/// Rate [deg/h] of an effect that follows the temperature, at that time.
double rate_at(const effects::ChangeOver& change, const record::Track& temperature, double time_s) {
    constexpr double moment_s = 1e-3;
    const double before_s = time_s - 0.5 * moment_s;
    const double after_s = time_s + 0.5 * moment_s;
    return change({before_s, moment_s, {temperature.at(before_s), temperature.at(after_s)}}).angle_arcsec / moment_s;
}

/// The closed scenario over the record's own length, input and temperature.
scenario::Scenario replica(const record::Record& record, const Closure& closure, const SampleSight* samples) {
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

/// Ranks the first of the curves, the measured one, among all of them.
///
/// Each curve is compared with the mean and the standard deviation of the others, at every point, and its largest
/// deviation is ranked. Curves of one distribution are exchangeable, so that all ranks are equally probable, whatever
/// the distribution and the correlation of the points.
void rank(const std::vector<std::vector<double>>& curves, PredictiveStatistic& statistic) {
    const std::size_t records = curves.size();
    const std::size_t points = curves.front().size();
    std::vector<double> largest(records, 0.0);
    statistic.p_value.assign(points, undefined);
    statistic.lowest.assign(points, undefined);
    statistic.highest.assign(points, undefined);
    for (std::size_t j = 0; j < points; ++j) {
        std::vector<double> value;
        for (const auto& curve : curves) value.push_back(statistic.positive ? std::log(curve[j]) : curve[j]);
        // A point that is not defined for some record is excluded for all.
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

/// Mean over simulations of statistic k, point by point; of its logarithm where it is positive.
std::vector<double> mean_of(const std::vector<Curves>& all, std::size_t k, std::size_t points, bool positive) {
    std::vector<double> mean(points, undefined);
    for (std::size_t j = 0; j < points; ++j) {
        double sum = 0.0;
        for (const Curves& curves : all) {
            const double y = j < curves[k].y.size() ? curves[k].y[j] : undefined;
            sum += positive ? std::log(y) : y;
        }
        sum /= static_cast<double>(all.size());
        mean[j] = positive ? std::exp(sum) : sum;
    }
    return mean;
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
double swinging_deg_s(const record::Record& record, Closure closure, const TurnSight& sight, int simulations) {
    const auto peak = std::find_if(closure.base.begin(), closure.base.end(),
                                   [](const Estimate& e) { return e.name == "dither_peak_rate_deg_s"; });
    if (peak == closure.base.end()) return undefined;
    const double measured = sight.peak_rate_deg_s(record);
    for (int pass = 0; pass < 2; ++pass) {
        std::vector<double> swung(static_cast<std::size_t>(simulations));
        scenario::Scenario mine = replica(record, closure, nullptr);
        tbb::parallel_for(std::size_t{0}, swung.size(), [&](std::size_t k) {
            scenario::Scenario one = mine;
            one.ensemble.seed = first_seed + options.report.most_simulations + k;
            swung[k] = sight.peak_rate_deg_s(instrument::simulate_record(one));
        });
        double mean = 0.0;
        for (const double swing : swung) mean += swing / static_cast<double>(simulations);
        peak->value *= measured / mean;
    }
    return peak->value;
}

std::vector<Curves> simulate(const record::Record& record, const Closure& closure, int simulations,
                             const TurnSight* turns, const SampleSight* samples, const std::function<void()>& done) {
    std::vector<Curves> all(static_cast<std::size_t>(simulations));
    tbb::parallel_for(std::size_t{0}, all.size(), [&](std::size_t k) {
        check_interrupt();
        const std::uint64_t seed = first_seed + k;
        scenario::Scenario mine = replica(record, drawn(closure, seed), samples);
        mine.ensemble.seed = seed;
        record::Record simulated = instrument::simulate_record(mine);
        all[k] = turns != nullptr ? turns->look(*simulated.turns) : samples->look(std::move(simulated.samples->values));
        done();
    });
    return all;
}

}  // namespace

namespace {

Predictive simulated_check(const record::Record& record, const Closure& closure, const Monitor& monitor,
                           int simulations) {
    Predictive out;
    try {
        std::optional<TurnSight> turns;
        std::optional<SampleSight> samples;
        std::vector<Curves> all;
        if (record.turns) {
            turns.emplace(record, closure);
            all.push_back(turns->look(*record.turns));
        } else {
            samples.emplace(record, closure);
            all.push_back(samples->look(samples->measured().increment));
        }
        const TurnSight* turn_sight = turns ? &*turns : nullptr;
        const SampleSight* sample_sight = samples ? &*samples : nullptr;
        const scenario::Scenario closed = replica(record, closure, sample_sight);
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
        const std::vector<Curves> simulated = simulate(record, swinging, wanted, turn_sight, sample_sight, one_more);
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
        if (samples && !closure.disturbed.empty()) whole = samples->look_at_whole(samples->measured().increment);
        std::vector<Curves> base;
        if (of_base) {
            Closure alone = closure;
            alone.base = closure.base_alone;
            alone.steps.clear();
            base = simulate(record, alone, of_base_alone, turn_sight, sample_sight, one_more);
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
