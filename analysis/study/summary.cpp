#include "analysis/study/summary.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>

#include "analysis/noise/ensemble.hpp"
#include "engine/core/units.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/gyro/theory.hpp"

namespace ringlock::study {

namespace {

constexpr double median_level = 0.95;
constexpr double confidence = 0.682689492137;

/// 95 % limit of an angle random walk [deg/sqrt(h)] that a record does not show.
///
/// The fit gives one; where it cannot (a record too short or without noise), any term is at most the whole Allan
/// deviation: N^2/tau <= sigma^2(tau), and the upper chi-squared limit of the smallest of these holds.
double upper_limit(const GyroStatistics& gyro) {
    if (gyro.noise.arw_deg_rt_h.hi) return *gyro.noise.arw_deg_rt_h.hi;
    double limit = std::numeric_limits<double>::infinity();
    for (const allan::Point& point : gyro.allan) {
        if (!(point.edf > 0.0)) continue;
        const double hi = point.dev * std::sqrt(point.edf / quantile(boost::math::chi_squared(point.edf), 0.05));
        limit = std::min(limit, hi * std::sqrt(point.tau_s) * units::deg_rt_h_per_arcsec_rt_s);
    }
    return limit;
}

/// A noise coefficient over the gyros of an arm. It is the ensemble's where most records resolve it; a record that does
/// not counts as zero among the others.
Figure figure(const ArmStatistics& arm, noise::Coefficient noise::NoiseFit::*which, std::uint64_t seed) {
    std::vector<double> values;
    Figure result;
    for (const GyroStatistics& gyro : arm.gyros) {
        const noise::Coefficient& coefficient = gyro.noise.*which;
        const bool shown = coefficient.resolved && gyro.noise.described;
        values.push_back(shown ? *coefficient.value : 0.0);
        if (shown) ++result.resolved;
    }
    if (2 * result.resolved > static_cast<std::int64_t>(arm.gyros.size())) {
        const noise::Range range = noise::central_range(values);
        const noise::Range median = noise::bootstrap_median_interval(values, median_level, seed);
        result.median = range.median;
        result.lo = range.lo;
        result.hi = range.hi;
        result.median_lo = median.lo;
        result.median_hi = median.hi;
    }
    return result;
}

/// The angle random walk of an arm: never without an upper end.
Figure angle_random_walk(const ArmStatistics& arm, std::uint64_t seed) {
    Figure result = figure(arm, &noise::NoiseFit::arw_deg_rt_h, seed);
    if (!result.median) {
        std::vector<double> limits;
        for (const GyroStatistics& gyro : arm.gyros) limits.push_back(upper_limit(gyro));
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
    std::vector<EnsemblePoint> points;
    for (std::size_t i = 0; i < arm.gyros.front().allan.size(); ++i) {
        EnsemblePoint point;
        point.tau_s = arm.gyros.front().allan[i].tau_s;
        double variance = 0.0;
        for (const GyroStatistics& gyro : arm.gyros) {
            variance += gyro.allan[i].dev * gyro.allan[i].dev;
            point.edf += gyro.allan[i].edf;
        }
        point.dev_deg_h = std::sqrt(variance / static_cast<double>(arm.gyros.size()));
        const boost::math::chi_squared chi2(std::max(point.edf, 1e-3));
        point.lo = point.dev_deg_h * std::sqrt(point.edf / quantile(chi2, 0.5 * (1.0 + confidence)));
        point.hi = point.dev_deg_h * std::sqrt(point.edf / quantile(chi2, 0.5 * (1.0 - confidence)));
        points.push_back(point);
    }
    return points;
}

std::vector<SweepPoint> sweep(const Study& study, const ArmStatistics& arm) {
    std::vector<SweepPoint> points;
    if (study.scenario.input.sweep_points == 1) return points;
    const double duration_s = study.schedule.sample_interval_s * static_cast<double>(study.schedule.samples - 1);
    const double fringe_rate_deg_h = study.scenario.gyro.scale_factor_arcsec / duration_s;
    const auto members = static_cast<std::size_t>(study.scenario.ensemble.gyros);
    for (std::size_t first = 0; first < arm.gyros.size(); first += members) {
        SweepPoint point;
        point.input_rate_deg_h = ensemble::input_rate_deg_h(study.scenario, static_cast<std::int64_t>(first));
        point.gyros = study.scenario.ensemble.gyros;
        point.can_tell = std::abs(point.input_rate_deg_h) > fringe_rate_deg_h;
        std::vector<double> rates;
        for (std::size_t i = first; i < first + members; ++i) {
            rates.push_back(point.input_rate_deg_h + arm.gyros[i].rate_error_deg_h);
            if (std::abs(rates.back()) < fringe_rate_deg_h) ++point.locked;
        }
        point.output_rate_deg_h = mean_figure(rates);
        points.push_back(point);
    }
    return points;
}

}  // namespace

std::optional<double> locked_up_to_deg_h(const ArmSummary& arm) {
    std::optional<double> edge;
    for (const SweepPoint& point : arm.sweep) {
        if (!point.can_tell) continue;
        if (point.locked < point.gyros) break;
        edge = point.input_rate_deg_h;
    }
    return edge;
}

Summary summarise(const Study& study) {
    Summary summary;
    summary.seed = study.scenario.ensemble.seed;
    summary.turns = study.turns;
    const gyro::Setup nominal = ensemble::nominal_setup(study.scenario);
    summary.theory = {gyro::angle_random_walk_deg_rt_h(nominal), gyro::band_half_width_deg_h(nominal, 0)};
    for (const ArmStatistics& arm : study.arms) {
        ArmSummary out;
        out.name = arm.arm.name;
        out.gyros = static_cast<std::int64_t>(arm.gyros.size());
        out.noise_injected = arm.arm.noise_injected;
        if (out.noise_injected) out.arw_deg_rt_h = angle_random_walk(arm, summary.seed);
        if (arm.arm.ideal || arm.arm.noise_injected) {
            const Figure floor = figure(arm, &noise::NoiseFit::bias_instability_deg_h, summary.seed);
            if (floor.median) out.bias_instability_deg_h = floor;
        }
        std::vector<double> errors;
        for (const GyroStatistics& gyro : arm.gyros) errors.push_back(gyro.rate_error_deg_h);
        out.rate_error_deg_h = mean_figure(errors);
        out.allan = ensemble_allan(arm);
        out.sweep = sweep(study, arm);
        summary.arms.push_back(std::move(out));
    }
    return summary;
}

}  // namespace ringlock::study
