#include "analysis/study/summary.hpp"

#include <algorithm>
#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>

#include "analysis/noise/ensemble.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/gyro/theory.hpp"

namespace ringlock::study {

namespace {

constexpr double median_level = 0.95;
constexpr double confidence = 0.682689492137;

/// A noise coefficient over the gyros of an arm. It is the ensemble's where most records resolve it; a record that does
/// not counts as zero among the others.
Figure figure(const ArmStatistics& arm, noise::Coefficient noise::NoiseFit::* which, std::uint64_t seed) {
    std::vector<double> values;
    std::vector<double> limits;
    Figure result;
    for (const GyroStatistics& gyro : arm.gyros) {
        const noise::Coefficient& coefficient = gyro.noise.*which;
        const bool shown = coefficient.resolved && gyro.noise.described;
        values.push_back(shown ? *coefficient.value : 0.0);
        if (shown) ++result.resolved;
        if (coefficient.hi) limits.push_back(*coefficient.hi);
    }
    if (2 * result.resolved > static_cast<std::int64_t>(arm.gyros.size())) {
        const noise::Range range = noise::central_range(values);
        const noise::Range median = noise::bootstrap_median_interval(values, median_level, seed);
        result.median = range.median;
        result.lo = range.lo;
        result.hi = range.hi;
        result.median_lo = median.lo;
        result.median_hi = median.hi;
    } else if (!limits.empty()) {
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
        if (out.noise_injected) out.arw_deg_rt_h = figure(arm, &noise::NoiseFit::arw_deg_rt_h, summary.seed);
        const Figure floor = figure(arm, &noise::NoiseFit::bias_instability_deg_h, summary.seed);
        if (floor.median) out.bias_instability_deg_h = floor;
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
