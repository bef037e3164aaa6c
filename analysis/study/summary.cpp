#include "analysis/study/summary.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "analysis/allan/interval.hpp"
#include "analysis/noise/ensemble.hpp"
#include "engine/core/units.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/gyro/theory.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::study {

namespace {

constexpr double median_level = 0.95;
constexpr double confidence = 0.682689492137;

/// Share of N^2/tau of a white rate that the Allan variance of the outputs shows at least.
///
/// At turns half a kick is still to come: the difference of two intervals of m cycles has 2 (2 m - 1) whole kicks, a
/// half at either end and none between, not 4 m. A reader's filter of length L = 2 delay blurs both ends of the two
/// intervals and the middle between them: of their 2 tau that is the variance of L/2 at either end and of L in the
/// middle, at most.
double share_seen(const Study& study, const allan::Point& point) {
    if (!scenario::reads_arms(study.scenario)) return 1.0 - 0.375 / static_cast<double>(point.m);
    return 1.0 - 2.0 * study.schedule.delay_s / point.tau_s;
}

/// 95 % limit of an angle random walk [deg/sqrt(h)] that a record does not show.
///
/// The fit gives one; where it cannot (a record too short or without noise), any term is at most the whole Allan
/// deviation, and the smallest upper chi-squared limit of these holds: N^2/tau <= sigma^2(tau)/share_seen().
double upper_limit(const Study& study, const GyroStatistics& gyro) {
    if (gyro.noise.arw_deg_rt_h.hi) return *gyro.noise.arw_deg_rt_h.hi;
    constexpr double least_seen = 0.5;
    const auto known = [&](const allan::Point& point) {
        return point.edf > 0.0 && share_seen(study, point) >= least_seen;
    };
    // The least of several limits is one only where each holds with as much less doubt.
    const auto several = std::count_if(gyro.allan.begin(), gyro.allan.end(), known);
    const double doubt = 0.05 / static_cast<double>(std::max<std::int64_t>(several, 1));
    double limit = std::numeric_limits<double>::infinity();
    for (const allan::Point& point : gyro.allan) {
        if (!known(point)) continue;
        const double seen = share_seen(study, point);
        const double hi = point.dev / std::sqrt(allan::relative_chi_squared_quantile(point.edf, doubt) * seen);
        limit = std::min(limit, hi * std::sqrt(point.tau_s) * units::deg_rt_h_per_arcsec_rt_s);
    }
    return limit;
}

/// Fills in median, range and bootstrap interval.
void describe(Figure& figure, const std::vector<double>& values, std::uint64_t seed) {
    const noise::Range range = noise::central_range(values);
    const noise::Range median = noise::bootstrap_median_interval(values, median_level, seed);
    figure.median = range.median;
    figure.lo = range.lo;
    figure.hi = range.hi;
    figure.median_lo = median.lo;
    figure.median_hi = median.hi;
}

bool most(std::int64_t count, const ArmStatistics& arm) {
    return 2 * count > static_cast<std::int64_t>(arm.gyros.size());
}

/// Bias instability is the ensemble's where most records by themselves resolve it; one that does not counts as zero.
Figure bias_instability(const ArmStatistics& arm, std::uint64_t seed) {
    std::vector<double> values;
    Figure result;
    for (const GyroStatistics& gyro : arm.gyros) {
        const noise::Coefficient& coefficient = gyro.noise.bias_instability_deg_h;
        const bool shown = coefficient.resolved && gyro.noise.described;
        values.push_back(shown ? *coefficient.value : 0.0);
        if (shown) ++result.resolved;
    }
    if (most(result.resolved, arm)) describe(result, values, seed);
    return result;
}

/// Whether the summed evidence of a term is beyond chance: four standard deviations above the mean of half
/// chi-squareds, and no less than a single record has to show.
bool beyond_chance(double evidence, std::size_t records) {
    constexpr double price_of_one = 9.55;  // half chi-squared, p = 1e-3
    const auto n = static_cast<double>(records);
    return evidence > std::max(price_of_one, 0.5 * n + 4.0 * std::sqrt(1.25 * n));
}

struct Models {
    bool red = false;          ///< most records have flicker, rate random walk or a ramp
    bool angle_noise = false;  ///< there is white angle noise in addition to the random walk
};

/// The model that all records together select. If each record selected its own, those that miss angle noise would give
/// too high an N.
Models models_of(const ArmStatistics& arm) {
    double angle_noise_evidence = 0.0;
    std::int64_t red = 0;
    for (const GyroStatistics& gyro : arm.gyros) {
        angle_noise_evidence += gyro.noise.pooling.angle_noise_evidence;
        if (gyro.noise.pooling.red) ++red;
    }
    return {most(red, arm), beyond_chance(angle_noise_evidence, arm.gyros.size())};
}

/// The angle random walk is estimated for the ensemble where all records together resolve it. Gyros of an arm are
/// alike: records that are too short to distinguish white noise from flicker one by one can do so together.
Figure angle_random_walk(const Study& study, const ArmStatistics& arm, std::uint64_t seed) {
    Figure result;
    double evidence = 0.0;
    std::int64_t described = 0;
    for (const GyroStatistics& gyro : arm.gyros) {
        evidence += gyro.noise.pooling.arw_evidence;
        if (gyro.noise.described) ++described;
        if (gyro.noise.described && gyro.noise.arw_deg_rt_h.resolved) ++result.resolved;
    }
    if (most(described, arm) && beyond_chance(evidence, arm.gyros.size())) {
        describe(result, random_walks_deg_rt_h(arm), seed);
    } else {
        std::vector<double> limits;
        for (const GyroStatistics& gyro : arm.gyros) limits.push_back(upper_limit(study, gyro));
        result.hi = noise::quantile(limits, 0.5);
    }
    return result;
}

MeanFigure mean_figure(const std::vector<double>& values) {
    double sum = 0.0;
    for (const double value : values) sum += value;
    const noise::Range range = noise::central_range(values);
    return {sum / static_cast<double>(values.size()), range.lo, range.hi};
}

std::vector<EnsemblePoint> ensemble_allan(const ArmStatistics& arm) {
    std::vector<std::vector<allan::Point>> curves;
    for (const GyroStatistics& gyro : arm.gyros) curves.push_back(gyro.allan);
    return ensemble_points(curves);
}

/// Upper limit of the motion of a locked gyro's output over a record [arcsec]: a fringe, and through a reader the
/// dither that it leaves, and six standard deviations of its reference's noise.
double still_arcsec(const scenario::Scenario& s) {
    if (!scenario::reads_arms(s)) return s.gyro.scale_factor_arcsec;
    constexpr double sigmas_of_difference = 6.0 * std::numbers::sqrt2;
    const double dither_arcsec =
        s.dither.peak_rate_deg_s * units::arcsec_per_deg / (units::two_pi * s.dither.frequency_hz);
    return s.gyro.scale_factor_arcsec + 2.0 * dither_arcsec * scenario::reader_residue_relative(s) +
           sigmas_of_difference * s.reader.reference_noise_arcsec;
}

std::vector<SweepPoint> sweep(const Study& study, const ArmStatistics& arm) {
    std::vector<SweepPoint> points;
    if (study.scenario.input.sweep_points == 1) return points;
    const double duration_s = study.schedule.sample_interval_s * static_cast<double>(study.schedule.samples - 1);
    const double locked_below_deg_h = still_arcsec(study.scenario) / duration_s;
    const auto members = static_cast<std::size_t>(study.scenario.ensemble.gyros);
    for (std::size_t first = 0; first < arm.gyros.size(); first += members) {
        SweepPoint point;
        point.input_rate_deg_h = ensemble::input_rate_deg_h(study.scenario, static_cast<std::int64_t>(first));
        point.gyros = study.scenario.ensemble.gyros;
        point.can_tell = std::abs(point.input_rate_deg_h) > locked_below_deg_h;
        std::vector<double> rates;
        std::vector<double> closed_form;
        for (std::size_t i = first; i < first + members; ++i) {
            if (const auto error = arm.gyros[i].rate_error_closed_form_deg_h) {
                closed_form.push_back(point.input_rate_deg_h + *error);
            }
            rates.push_back(point.input_rate_deg_h + arm.gyros[i].rate_error_deg_h);
            if (std::abs(rates.back()) < locked_below_deg_h) ++point.locked;
        }
        point.output_rate_deg_h = mean_figure(rates);
        if (closed_form.size() == members) point.closed_form_rate_deg_h = mean_figure(closed_form).mean;
        points.push_back(point);
    }
    return points;
}

/// The step to which all gyros [first, last) of a rate are locked, by the closed form.
std::optional<std::int64_t> step_of(const Study& study, const ArmStatistics& arm, std::size_t first, std::size_t last) {
    // A locked rate is whole fringes a cycle to rounding; one that is free by so little does not occur.
    constexpr double rounding_fringes = 1e-9;
    std::optional<std::int64_t> step;
    for (std::size_t i = first; i < last; ++i) {
        const auto error = arm.gyros[i].rate_error_closed_form_deg_h;
        if (!error) return std::nullopt;
        const gyro::Setup& setup = study.gyros[i];
        const double fringes = (setup.input_rate_deg_h + *error) / gyro::band_centre_deg_h(setup, 1);
        const std::int64_t whole = std::llround(fringes);
        if (std::abs(fringes - static_cast<double>(whole)) > rounding_fringes) return std::nullopt;
        if (step && *step != whole) return std::nullopt;
        step = whole;
    }
    return step;
}

std::vector<Step> steps(const Study& study, const ArmStatistics& arm) {
    std::vector<Step> out;
    if (study.scenario.input.sweep_points == 1) return out;
    const auto members = static_cast<std::size_t>(study.scenario.ensemble.gyros);
    std::optional<std::int64_t> before;
    for (std::size_t first = 0; first < arm.gyros.size(); first += members) {
        const auto order = step_of(study, arm, first, first + members);
        const double rate = ensemble::input_rate_deg_h(study.scenario, static_cast<std::int64_t>(first));
        if (order && order == before) {
            out.back().last_deg_h = rate;
        } else if (order) {
            const double output = static_cast<double>(*order) * gyro::band_centre_deg_h(study.gyros[first], 1);
            out.push_back({*order, output, rate, rate});
        }
        before = order;
    }
    return out;
}

std::optional<ScaleFactor> line_of(const Study& study, const ArmStatistics& arm) {
    const auto members = static_cast<std::size_t>(study.scenario.ensemble.gyros);
    std::vector<double> rates;
    std::vector<double> errors;
    for (std::size_t g = 0; g < arm.gyros.size(); ++g) {
        if (g % members == 0) {
            rates.push_back(ensemble::input_rate_deg_h(study.scenario, static_cast<std::int64_t>(g)));
        }
        errors.push_back(arm.gyros[g].rate_error_deg_h);
    }
    return scale_factor(rates, errors);
}

ArwTheory arw_theory(const Study& study, const scenario::Arm& arm) {
    ArwTheory theory;
    if (arm.noise_injected) {
        theory.lockin_deg_rt_h = gyro::randomised_arw_deg_rt_h(ensemble::nominal_setup(study.scenario));
    }
    double squares = theory.lockin_deg_rt_h * theory.lockin_deg_rt_h;
    for (const auto& [effect, values] : scenario::active_effects(study.scenario)) {
        const double white = effect->rate_noise(*values).white_deg2_h2_s;
        if (!(white > 0.0)) continue;
        const double deg_rt_h = std::sqrt(white) * units::deg_rt_h_per_arcsec_rt_s;
        theory.effects_deg_rt_h.emplace_back(effect->name(), deg_rt_h);
        squares += deg_rt_h * deg_rt_h;
    }
    theory.total_deg_rt_h = std::sqrt(squares);
    return theory;
}

/// Describes the random walk of an arm, or the reason why it has no random walk.
void describe_random_walk(ArmSummary& out, const Study& study, const ArmStatistics& arm, std::uint64_t seed) {
    out.arw_theory = arw_theory(study, arm.arm);
    const bool corrected = arm.arm.compensator != scenario::Compensator::none;
    if (!arm.arm.noise_injected && out.arw_theory.total_deg_rt_h == 0.0 && !corrected) {
        out.arw_reason = "nothing random acts on it";
        if (!arm.arm.ideal) out.arw_reason += " (dead band and staircase are no noise)";
        return;
    }
    out.arw_deg_rt_h = angle_random_walk(study, arm, seed);
    if (!out.arw_deg_rt_h.median) out.arw_reason = "its records show no white rate noise";
}

std::optional<Reduction> reduction(const Figure& raw, const Figure& left) {
    if (!raw.median) return std::nullopt;
    const std::optional<double> most = left.median ? left.median_hi : left.hi;
    if (!most || !(*most > 0.0)) return std::nullopt;
    Reduction result{std::nullopt, *raw.median_lo / *most, std::nullopt};
    if (left.median && *left.median > 0.0) result.ratio = *raw.median / *left.median;
    if (left.median && *left.median_lo > 0.0) result.hi = *raw.median_hi / *left.median_lo;
    return result;
}

/// Mean and its standard error.
std::pair<double, double> mean_and_error(const std::vector<double>& values) {
    const auto count = static_cast<double>(values.size());
    double sum = 0.0;
    for (const double value : values) sum += value;
    double squares = 0.0;
    for (const double value : values) squares += (value - sum / count) * (value - sum / count);
    const bool several = values.size() > 1;
    return {sum / count, several ? std::sqrt(squares / (count - 1.0) / count) : std::nan("")};
}

std::string why_not_randomised(const dither::NoiseEffectiveness& predicted, double arw_deg_rt_h) {
    constexpr double tenth = 0.1;
    std::string why;
    if (predicted.arw_over_theory && std::abs(*predicted.arw_over_theory - 1.0) > tenth) {
        why = fmt::format("the random walk is {:.2f} of that of random phases", *predicted.arw_over_theory);
    }
    // The mean rate over one hour has a standard deviation of N deg/h for a random walk of N deg/sqrt(h).
    if (predicted.bias_deg_h && std::abs(*predicted.bias_deg_h) > arw_deg_rt_h && arw_deg_rt_h > 0.0) {
        why += fmt::format("{}a bias of {:.2g} deg/h stays", why.empty() ? "" : ", ", *predicted.bias_deg_h);
    }
    return why;
}

NoiseFigures noise_figures(const Study& study, const ArmStatistics& arm, const ArwTheory& theory, const Figure& arw) {
    NoiseFigures figures;
    figures.predicted = *study.predicted_noise;
    const double depth_rad = gyro::modulation_depth_rad(ensemble::nominal_setup(study.scenario));
    figures.change_per_cycle_percent = 100.0 * figures.predicted.change_per_cycle_rad / depth_rad;
    const auto ideal =
        std::find_if(study.arms.begin(), study.arms.end(), [](const ArmStatistics& a) { return a.arm.ideal; });
    const auto beyond_ideal = [&](std::size_t gyro, const auto& what) {
        return what(arm.gyros[gyro]) - (ideal != study.arms.end() ? what(ideal->gyros[gyro]) : 0.0);
    };
    double squares = 0.0;
    std::vector<double> errors;
    for (std::size_t gyro = 0; gyro < arm.gyros.size(); ++gyro) {
        squares += arm.gyros[gyro].change_per_cycle_rad * arm.gyros[gyro].change_per_cycle_rad;
        errors.push_back(beyond_ideal(gyro, [](const GyroStatistics& g) { return g.rate_error_deg_h; }));
    }
    NoiseFigures::Measured& measured = figures.measured;
    measured.change_per_cycle_rad = std::sqrt(squares / static_cast<double>(arm.gyros.size()));
    const bool steady = has_steady_input(study.scenario);
    if (steady) {
        const auto [bias, error] = mean_and_error(errors);
        measured.bias_deg_h = bias;
        measured.bias_error_deg_h = error;
    }
    figures.not_randomised = why_not_randomised(figures.predicted, theory.lockin_deg_rt_h);
    const bool random = study.scenario.noise_injection.model == scenario::NoiseModel::turns ||
                        study.scenario.noise_injection.form != gyro::NoiseForm::sinusoidal;
    if (random && steady && arw.median && theory.lockin_deg_rt_h > 0.0) {
        double square = *arw.median * *arw.median;
        for (const auto& [effect, deg_rt_h] : theory.effects_deg_rt_h) square -= deg_rt_h * deg_rt_h;
        measured.arw_over_theory = std::sqrt(std::max(0.0, square)) / theory.lockin_deg_rt_h;
    }
    if (random || !steady) return figures;
    for (std::size_t i = 0; i < std::size(dither::spread_times_s); ++i) {
        std::vector<double> angles;
        for (std::size_t gyro = 0; gyro < arm.gyros.size(); ++gyro) {
            angles.push_back(beyond_ideal(gyro, [i](const GyroStatistics& g) { return g.angle_error_arcsec[i]; }));
        }
        const double spread = mean_and_error(angles).second * std::sqrt(static_cast<double>(angles.size()));
        measured.angle_spread.push_back({dither::spread_times_s[i], spread});
    }
    return figures;
}

}  // namespace

std::vector<double> random_walks_deg_rt_h(const ArmStatistics& arm) {
    const Models models = models_of(arm);
    std::vector<double> values;
    for (const GyroStatistics& gyro : arm.gyros) {
        const noise::Pooling& pooling = gyro.noise.pooling;
        values.push_back(models.red           ? pooling.arw_best_deg_rt_h
                         : models.angle_noise ? pooling.arw_beside_angle_noise_deg_rt_h
                                              : pooling.arw_alone_deg_rt_h);
    }
    return values;
}

bool has_arw(const ArmSummary& arm) { return arm.arw_deg_rt_h.median || arm.arw_deg_rt_h.hi; }

bool has_closed_form(const ArmSummary& arm) {
    return std::any_of(arm.sweep.begin(), arm.sweep.end(),
                       [](const SweepPoint& point) { return point.closed_form_rate_deg_h.has_value(); });
}

std::optional<double> locked_up_to_deg_h(const ArmSummary& arm) {
    std::optional<double> edge;
    for (const SweepPoint& point : arm.sweep) {
        if (!point.can_tell) continue;
        if (point.locked < point.gyros) break;
        edge = point.input_rate_deg_h;
    }
    return edge;
}

std::vector<EnsemblePoint> ensemble_points(const std::vector<std::vector<allan::Point>>& curves) {
    std::vector<EnsemblePoint> points;
    for (std::size_t i = 0; i < curves.front().size(); ++i) {
        EnsemblePoint point;
        point.tau_s = curves.front()[i].tau_s;
        double variance = 0.0;
        for (const std::vector<allan::Point>& curve : curves) {
            variance += curve[i].dev * curve[i].dev;
            point.edf += curve[i].edf;
        }
        point.dev_deg_h = std::sqrt(variance / static_cast<double>(curves.size()));
        if (std::isnan(point.edf)) {
            point.lo = point.hi = point.edf;
        } else {
            const auto end = [&](double p) {
                const double edf = std::max(point.edf, 1e-3);
                return point.dev_deg_h / std::sqrt(allan::relative_chi_squared_quantile(edf, p));
            };
            point.lo = end(0.5 * (1.0 + confidence));
            point.hi = end(0.5 * (1.0 - confidence));
        }
        points.push_back(point);
    }
    return points;
}

Summary summarise(const Study& study) {
    Summary summary;
    summary.seed = study.scenario.ensemble.seed;
    summary.turns = study.turns;
    const gyro::Setup nominal = ensemble::nominal_setup(study.scenario);
    summary.theory = {gyro::randomised_arw_deg_rt_h(nominal), gyro::angle_random_walk_deg_rt_h(nominal),
                      gyro::band_half_width_deg_h(nominal, 0)};
    for (const ArmStatistics& arm : study.arms) {
        ArmSummary out;
        out.name = arm.arm.name;
        out.gyros = static_cast<std::int64_t>(arm.gyros.size());
        out.noise_injected = arm.arm.noise_injected;
        describe_random_walk(out, study, arm, summary.seed);
        if (shows_noise(arm.arm) && study.predicted_noise) {
            out.noise_effectiveness = noise_figures(study, arm, out.arw_theory, out.arw_deg_rt_h);
        }
        if (arm.arm.ideal || arm.arm.noise_injected) {
            const Figure floor = bias_instability(arm, summary.seed);
            if (floor.median) out.bias_instability_deg_h = floor;
        }
        std::vector<double> errors;
        for (const GyroStatistics& gyro : arm.gyros) errors.push_back(gyro.rate_error_deg_h);
        out.rate_error_deg_h = mean_figure(errors);
        out.allan = ensemble_allan(arm);
        out.sweep = sweep(study, arm);
        out.steps = steps(study, arm);
        out.scale_factor = line_of(study, arm);
        if (study.scenario.input.sweep_points == 1) out.lot = lot_figures(study, arm);
        out.scatter = scatter_of_averages(study, arm);
        out.turn_on_repeatability = turn_on_repeatability(study, arm);
        if (out.arw_deg_rt_h.median) {
            out.arw_mean_deg_rt_h = lot::geometric_mean(random_walks_deg_rt_h(arm), confidence_of(study.scenario));
        }
        if (scenario::asks(study.scenario.specification)) out.yield = yield_of(study, arm);
        summary.arms.push_back(std::move(out));
    }
    for (std::size_t a = 0; a < study.arms.size(); ++a) {
        for (std::size_t b = a + 1; b < study.arms.size(); ++b) {
            if (!summary.arms[a].arw_deg_rt_h.median || !summary.arms[b].arw_deg_rt_h.median) continue;
            const auto first = random_walks_deg_rt_h(study.arms[a]);
            const auto second = random_walks_deg_rt_h(study.arms[b]);
            summary.pairs.push_back({summary.arms[a].name, summary.arms[b].name,
                                     lot::compare(first, second, confidence_of(study.scenario))});
        }
    }
    const auto raw = std::find_if(summary.arms.begin(), summary.arms.end(),
                                  [](const ArmSummary& arm) { return arm.name == "noise_injected"; });
    if (raw == summary.arms.end()) return summary;
    for (ArmSummary& arm : summary.arms) {
        if (!arm.noise_injected || arm.name == raw->name) continue;
        arm.arw_reduction = reduction(raw->arw_deg_rt_h, arm.arw_deg_rt_h);
    }
    return summary;
}

}  // namespace ringlock::study
