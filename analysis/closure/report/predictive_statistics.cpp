#include "analysis/closure/report/predictive_statistics.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <utility>

#include "analysis/allan/allan.hpp"
#include "analysis/closure/options.hpp"
#include "analysis/closure/turns/model/effect_roles.hpp"
#include "analysis/noise/model/spectrum.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"

namespace ringlock::closure {

namespace {

constexpr std::size_t fold_points = options.report.phase_points;
constexpr Eigen::Index harmonics = options.report.kick_harmonics;
constexpr double undefined = std::numeric_limits<double>::quiet_NaN();

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

/// Gain of the angle across a turn by direction and phase [rad], less the mean of that direction, as three
/// harmonics of the phase. `steady_rad` is the angle at the turns without the dither, from turn 1 on.
///
/// Noise of the dither at every turn hides the kick of a turn, but not the sum of many kicks: the angle is fitted
/// by cumulative sums of the functions of phase. Each stretch has a straight line of its own, so that slow rates do
/// not matter.
void fold(const record::Turns& turns, const std::vector<double>& phase_rad, const std::vector<double>& steady_rad,
          Curves& curves) {
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
    const Row size = scale.cwiseProduct(Row(dense::solve_symmetric(scaled, scale.cwiseProduct(right))));
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

}  // namespace

std::vector<PredictiveStatistic> blank_statistics(bool turns) {
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

TurnStatistics::TurnStatistics(const record::Record& record, const Closure& closure) {
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

double TurnStatistics::peak_rate_deg_s(const record::Record& record) const {
    return prepare(record, join(*record.turns, ellipse_, count_again_)).setup.dither_peak_rate_deg_s;
}

Curves TurnStatistics::curves_of(const record::Turns& turns) const {
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

SampleStatistics::SampleStatistics(const record::Record& record, const Closure& closure)
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

Curves SampleStatistics::curves_of(std::vector<double> increment_arcsec) const {
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

Curves SampleStatistics::curves_of_whole(std::vector<double> increment_arcsec) const {
    Curves curves;
    add_rate_curves(less_input(std::move(increment_arcsec)), measured_.interval_s, curves);
    return curves;
}

std::vector<double> SampleStatistics::less_input(std::vector<double> increment_arcsec) const {
    increment_arcsec.resize(std::min(increment_arcsec.size(), measured_.size()));
    const auto& input = measured_.input_rate_deg_h;
    for (std::size_t i = 0; i < increment_arcsec.size() && !input.empty(); ++i) {
        increment_arcsec[i] -= input[i] * measured_.interval_s;
    }
    return increment_arcsec;
}

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

}  // namespace ringlock::closure
