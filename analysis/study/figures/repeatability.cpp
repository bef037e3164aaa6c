#include "analysis/study/figures/repeatability.hpp"

#include <boost/math/distributions/chi_squared.hpp>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>

#include "analysis/study/figures/lot_figures.hpp"

namespace ringlock::study {

namespace {

double mean(std::span<const double> values) {
    return std::accumulate(values.begin(), values.end(), 0.0) / static_cast<double>(values.size());
}

double squares_about_mean(std::span<const double> values) {
    const double centre = mean(values);
    double sum = 0.0;
    for (const double value : values) sum += (value - centre) * (value - centre);
    return sum;
}

/// \param squares  sum of squared deviations that have so many degrees of freedom
Scatter scatter_of(double squares, std::int64_t degrees_of_freedom, const lot::Confidence& confidence) {
    const auto nu = static_cast<double>(degrees_of_freedom);
    Scatter result{std::sqrt(squares / nu), {}, degrees_of_freedom};
    const boost::math::chi_squared chi2(nu);
    const double tail = lot::tail_probability(confidence);
    const double least = quantile(chi2, tail);
    result.interval.lo = std::sqrt(squares / quantile(complement(chi2, tail)));
    result.interval.hi = least > 0.0 ? std::sqrt(squares / least) : std::numeric_limits<double>::infinity();
    return result;
}

}  // namespace

std::vector<AverageScatter> scatter_of_averages(const Study& study, const ArmStatistics& arm) {
    std::vector<AverageScatter> found;
    if (arm.gyros.size() < 2 || study.scenario.input.sweep_points > 1) return found;
    const lot::Confidence confidence = confidence_of(study.scenario);
    const double end_s = study.schedule.output_s * static_cast<double>(study.schedule.outputs() - 1);
    const auto add = [&](double after_s, auto&& rate_deg_h) {
        std::vector<double> rates;
        for (const GyroStatistics& gyro : arm.gyros) rates.push_back(rate_deg_h(gyro));
        for (const double rate : rates) {
            if (!std::isfinite(rate)) return;
        }
        const auto nu = static_cast<std::int64_t>(rates.size()) - 1;
        found.push_back({after_s, scatter_of(squares_about_mean(rates), nu, confidence)});
    };
    for (std::size_t i = 0; i < study.angle_times_s.size(); ++i) {
        const auto output = study.angle_output(i);
        if (!output || *output >= study.schedule.outputs() - 1) continue;  // the whole record comes below
        const double after_s = study.angle_times_s[i];
        const double true_s = study.schedule.output_s * static_cast<double>(*output);
        add(after_s, [&](const GyroStatistics& g) { return g.angle_error_arcsec[i] / true_s; });  // arcsec/s: deg/h
    }
    add(end_s, [](const GyroStatistics& g) { return g.rate_error_deg_h; });
    return found;
}

std::optional<Scatter> turn_on_repeatability(const Study& study, const ArmStatistics& arm) {
    const auto each = static_cast<std::size_t>(study.scenario.ensemble.turn_ons);
    if (each < 2 || study.scenario.input.sweep_points > 1) return std::nullopt;
    double squares = 0.0;
    std::int64_t degrees_of_freedom = 0;
    for (std::size_t first = 0; first + each <= arm.gyros.size(); first += each) {
        std::vector<double> rates;
        for (std::size_t i = first; i < first + each; ++i) rates.push_back(arm.gyros[i].rate_error_deg_h);
        squares += squares_about_mean(rates);
        degrees_of_freedom += static_cast<std::int64_t>(each) - 1;
    }
    return scatter_of(squares, degrees_of_freedom, confidence_of(study.scenario));
}

}  // namespace ringlock::study
