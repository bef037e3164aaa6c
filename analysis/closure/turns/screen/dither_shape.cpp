#include "analysis/closure/turns/screen/dither_shape.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

#include "analysis/closure/options.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

constexpr const TurnOptions::DitherShape& of_shape = options.turns.dither_shape;
constexpr std::size_t stretches = of_shape.stretches;

/// First turn of a stretch. Stretches are whole cycles, so that minima and maxima have equal weights.
std::size_t begin_of(std::size_t stretch, std::size_t turns) {
    return stretch == stretches ? turns : (turns * stretch / stretches) & ~std::size_t{1};
}

/// Slope of the residual phases in each stretch: the rate of a random process, or of an effect that is not in the model
/// yet [rad/s].
std::vector<double> rate_left(const TurnFit& fit, const TurnModel::Prediction& prediction) {
    const auto& series = fit.model().series();
    const std::size_t n = series.size();
    std::vector<double> rate(n, 0.0);
    for (std::size_t s = 0; s < stretches; ++s) {
        const std::size_t begin = begin_of(s, n);
        const std::size_t end = begin_of(s + 1, n);
        if (end < begin + of_shape.fewest_turns_for_rate) continue;
        // With an offset and a change of the dither's amplitude in the regression.
        Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
        Eigen::Vector3d right = Eigen::Vector3d::Zero();
        for (std::size_t i = begin; i < end; ++i) {
            const Eigen::Vector3d row{series.time_s[i] - series.time_s[begin], 1.0,
                                      static_cast<double>(series.direction[i])};
            normal += row * row.transpose();
            right += row * (fit.model().phase_rad()[i] - prediction.phase_rad[i]);
        }
        const Eigen::Vector3d found = dense::solve_symmetric(normal, right);
        std::fill(rate.begin() + static_cast<std::ptrdiff_t>(begin), rate.begin() + static_cast<std::ptrdiff_t>(end),
                  found(0));
    }
    return rate;
}

/// Mean and standard error of a series over the turns that count, from its means over stretches; `valid` marks
/// turns that have a value.
BlockMean block_mean(const std::vector<double>& series, const std::vector<std::uint8_t>& valid, const Rows& rows,
                     double floor) {
    const std::size_t n = series.size();
    BlockMean mean;
    double sum = 0.0;
    double squares = 0.0;
    double k = 0.0;
    for (std::size_t s = 0; s < stretches; ++s) {
        double total = 0.0;
        std::size_t count = 0;
        bool counts = true;
        for (std::size_t i = begin_of(s, n); i < begin_of(s + 1, n); ++i) {
            counts = counts && rows[i];
            if (!valid[i]) continue;
            total += series[i];
            ++count;
        }
        if (count < of_shape.fewest_turns_for_mean) continue;
        const double value = total / static_cast<double>(count);
        mean.of_stretch.push_back(value);
        mean.counts.push_back(counts);
        if (!counts) continue;
        sum += value;
        squares += value * value;
        k += 1.0;
    }
    if (k < of_shape.fewest_stretches) {
        mean.sd = std::numeric_limits<double>::infinity();
        return mean;
    }
    mean.value = sum / k;
    const double variance = std::max(0.0, (squares - k * mean.value * mean.value) / (k - 1.0)) / k;
    mean.sd = std::sqrt(variance + floor * floor);
    return mean;
}

/// Distance from a turn to the pulses next to it, on both sides, in quarters of a fringe.
double quarters_to_pulse(int direction, double phase_rad) {
    const double quarters = phase_rad / units::quarter_fringe_rad;
    return direction > 0 ? std::floor(quarters) + 1.0 - quarters : quarters - std::floor(quarters);
}

/// Functions of the phase at a turn, for minima and maxima separately and without their mean over all phases. Times and
/// accelerations are derived from pulses at quarter fringes. Between two of these, such a function is smooth in the
/// root of the distance to the next pulse, to which the time to the pulse is proportional.
class PhaseFunctions {
   public:
    static constexpr Eigen::Index cells = 4;
    static constexpr Eigen::Index powers = 5;
    static constexpr Eigen::Index columns = 2 * cells * powers;

    explicit PhaseFunctions(const TurnFit& fit) {
        const auto& series = fit.model().series();
        cell_.reserve(series.size());
        root_.reserve(series.size());
        for (std::size_t i = 0; i < series.size(); ++i) {
            const double phase_rad = fit.model().phase_rad()[i];
            const auto cell =
                static_cast<Eigen::Index>(std::fmod(std::floor(phase_rad / units::quarter_fringe_rad), 4.0) + 4.0) % 4;
            cell_.push_back((series.direction[i] > 0 ? 0 : cells * powers) + cell * powers);
            root_.push_back(std::sqrt(quarters_to_pulse(series.direction[i], phase_rad)));
        }
    }
    /// Adds the functions at a turn to a row, with a factor.
    void add(std::size_t turn, double times, Eigen::Ref<Eigen::VectorXd> row) const {
        add(cell_[turn], root_[turn], times, row);
    }
    /// Mean square over all phases of the function with these coefficients: at minima, at maxima.
    static std::array<double, 2> mean_squares(const Eigen::VectorXd& coefficients) {
        constexpr int trials = 16;  // in each cell
        std::array<double, 2> sums{};
        Eigen::VectorXd row(columns);
        for (Eigen::Index cell = 0; cell < 2 * cells; ++cell) {
            for (int k = 0; k < trials; ++k) {
                row.setZero();
                add(cell * powers, std::sqrt((k + 0.5) / trials), 1.0, row);
                const double value = coefficients.dot(row);
                sums[static_cast<std::size_t>(cell / cells)] += value * value / (cells * trials);
            }
        }
        return sums;
    }

   private:
    static void add(Eigen::Index cell, double root, double times, Eigen::Ref<Eigen::VectorXd> row) {
        const Eigen::Index of_direction = cell / (cells * powers) * (cells * powers);
        double power = 1.0;
        for (Eigen::Index k = 0; k < powers; ++k, power *= root) {
            row(cell + k) += times * power;
            // In each cell, a quarter of all phases, the mean of the root to the power k is 2/(k + 2).
            const double mean = 0.5 / static_cast<double>(k + 2);
            for (Eigen::Index other = 0; other < cells; ++other) row(of_direction + other * powers + k) -= times * mean;
        }
    }

    std::vector<Eigen::Index> cell_;  ///< index of the first function of the turn's cell
    std::vector<double> root_;
};

/// Removes the dependence on the phases of the given turns near each turn, with these weights, and returns its
/// coefficients.
using Beside = std::span<const std::pair<int, double>>;
Eigen::VectorXd take_phase(std::vector<double>& series, const std::vector<std::uint8_t>& valid, const TurnFit& fit,
                           const PhaseFunctions& functions, Beside turns) {
    constexpr Eigen::Index columns = 2 + PhaseFunctions::columns;
    const std::size_t n = series.size();
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(columns, columns);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(columns);
    Eigen::VectorXd row(columns);
    const auto fill = [&](std::size_t i) {
        row.setZero();
        for (const auto& [offset, weight] : turns) {
            functions.add(i + static_cast<std::size_t>(offset), weight, row.tail<PhaseFunctions::columns>());
        }
    };
    for (std::size_t i = 0; i < n; ++i) {
        if (!valid[i] || !fit.rows()[i]) continue;
        fill(i);
        // The means of minima and of maxima are kept.
        row(fit.model().series().direction[i] > 0 ? 0 : 1) = 1.0;
        normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
        right += row * series[i];
    }
    normal.diagonal().array() += 1e-9 * normal.trace();
    const Eigen::VectorXd c = dense::solve_symmetric(normal, right);
    for (std::size_t i = 0; i < n; ++i) {
        if (!valid[i]) continue;
        fill(i);
        series[i] -= c.dot(row);
    }
    return c.tail<PhaseFunctions::columns>();
}

/// w t of the two pulses at quarter fringes next to a turn.
///
/// If the phase stands still at an angle d from the dither's turn, |d| << 1, the acceleration changes by w d of itself
/// a second. The acceleration by two pulses, sqrt(a) = sqrt(2) (sqrt(d_2) - sqrt(d_1))/(t_2 - t_1) with the distances
/// d_1, d_2, is then too large by the share d w (t_1 + t_2)/3 on one side of the turn, and too small on the other: a
/// rotation by the share x of the dither's peak rate, d = x, adds x w (t_1 + t_2)/6 to `sides`.
struct PulseAngles {
    double first, second;

    PulseAngles(int direction, double phase_rad, double amplitude_rad) {
        const double first_rad = units::quarter_fringe_rad * quarters_to_pulse(direction, phase_rad);
        first = std::sqrt(2.0 * first_rad / amplitude_rad);
        second = std::sqrt(2.0 * (first_rad + units::quarter_fringe_rad) / amplitude_rad);
    }

    /// The acceleration of a sine by these pulses, over its acceleration at the turn. The pulses are at angles 2
    /// asin(sqrt(d/(2 A))) from it, and roots of distances are proportional to the sine of half the angle.
    double share_of_sine() const {
        const auto angle = [](double root) { return 2.0 * std::asin(std::min(0.5 * root, 1.0)); };
        return std::pow((second - first) / (angle(second) - angle(first)), 2);
    }

    /// If the dither turns at the angle `off` from the turn of the phase, and its acceleration changes there: the share
    /// of the change that the two pulses measure in the half cycle of the phase's turn, with d(t) in two pieces, to
    /// first order in the change.
    double share_of_other(double off) const {
        if (off >= second) return 1.0;
        if (off <= first) return off * off / (first * second);
        return (2.0 * off - off * off / second - first) / (second - first);
    }
};

/// Means from the accelerations, and the contributions of the pulses to them.
struct Accelerations {
    std::optional<BlockMean> sides, turns, even;  ///< none if the record has no accelerations
    double jerk = 0.0;                            ///< correction that is subtracted from `sides`
    double angle = 0.0;                           ///< w (t1 + t2)/2
    double share_of_other = 1.0;
};

Accelerations accelerations(const record::Turns& turns, const TurnFit& fit, const PhaseFunctions& functions,
                            const std::vector<double>& shares) {
    const auto& series = fit.model().series();
    const std::size_t n = series.size();
    Accelerations found;
    std::vector<double> sides(n, 0.0);
    std::vector<double> minima(n, 0.0);
    std::vector<double> even(n, 0.0);
    std::vector<std::uint8_t> valid(n, 0);
    std::size_t seen = 0;
    double of_pulses = 0.0;
    double of_rotation = 0.0;
    double of_other = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        if (!(turns.accel_before_rad_s2[i] > 0.0) || !(turns.accel_after_rad_s2[i] > 0.0)) continue;
        const double before = std::log(turns.accel_before_rad_s2[i] / series.acceleration_rad_s2);
        const double after = std::log(turns.accel_after_rad_s2[i] / series.acceleration_rad_s2);
        if (std::max(std::abs(before), std::abs(after)) > of_shape.most_log_acceleration) continue;
        const double share = shares[i];
        const PulseAngles pulses(series.direction[i], fit.model().phase_rad()[i], series.amplitude_rad);
        const double jerk = share * (pulses.first + pulses.second) / 6.0;
        const double sine = std::log(pulses.share_of_sine());
        const double slower = 0.5 * std::log1p(-std::min(share * share, 0.5));
        found.angle += pulses.first + pulses.second;
        of_other += pulses.share_of_other(std::abs(share));
        found.jerk += jerk;
        of_pulses += sine;
        of_rotation += slower;
        sides[i] = 0.25 * series.direction[i] * (after - before) - jerk;
        minima[i] = 0.25 * series.direction[i] * (after + before);
        even[i] = 0.5 * (after + before) - sine - slower;
        valid[i] = 1;
        ++seen;
    }
    if (!(static_cast<double>(seen) > of_shape.least_share * static_cast<double>(n))) return found;
    const auto count = static_cast<double>(seen);
    found.jerk /= count;
    found.angle *= 0.5 / count;
    found.share_of_other = of_other / count;
    // Accelerations are computed from distances as the detectors read them, with their ellipse.
    const gyro::Ellipse ellipse = fit.model().setup(fit.parameters()).ellipse;
    const double least =
        of_shape.least_acceleration + std::max({std::abs(ellipse.gain), std::abs(ellipse.offset_sin),
                                                std::abs(ellipse.offset_cos), std::abs(ellipse.orthogonality_rad)});
    const std::array<std::pair<int, double>, 1> itself{{{0, 1.0}}};
    const auto [at_minima, at_maxima] = PhaseFunctions::mean_squares(take_phase(sides, valid, fit, functions, itself));
    take_phase(minima, valid, fit, functions, itself);
    take_phase(even, valid, fit, functions, itself);
    // To second order in the lock-in, the mean over all phases is not zero (docs/dev/closure-turns.md): accelerations
    // are too small on both sides.
    const double smaller = of_shape.second_order * (at_minima - at_maxima);
    const double smaller_everywhere = 2.0 * of_shape.second_order * (at_minima + at_maxima);
    found.sides = block_mean(sides, valid, fit.rows(), least);
    found.turns = block_mean(minima, valid, fit.rows(), std::hypot(least, of_shape.doubt_of_second_order * smaller));
    found.turns->value += smaller;
    found.even = block_mean(even, valid, fit.rows(),
                            std::hypot(least, of_shape.doubt_of_second_order * smaller_everywhere,
                                       of_shape.doubt_of_pulses * (of_pulses + of_rotation) / count));
    found.even->value += smaller_everywhere;
    return found;
}

}  // namespace

DitherShape dither_shape(const record::Turns& turns, const TurnFit& fit) {
    const auto& series = fit.model().series();
    const std::size_t n = series.size();
    const double w = units::pi / series.interval_s;
    const auto prediction = fit.model().predict(fit.parameters());
    const std::vector<double> left_rad_s = rate_left(fit, prediction);
    std::vector<double> shares(n);
    double mean_share = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        shares[i] = series.relative_rate(fit.parameters().bias_deg_h + series.input_rate_deg_h[i]) +
                    left_rad_s[i] / (series.amplitude_rad * w);
        mean_share += shares[i] / static_cast<double>(n);
    }
    const PhaseFunctions functions(fit);
    const Accelerations seen = accelerations(turns, fit, functions, shares);
    // If the phase turns faster than a sine of that swing, a rotation moves the turn by less.
    const double less = seen.even && std::isfinite(seen.even->sd) ? std::expm1(-seen.even->value) : 0.0;
    const double less_sd = seen.even && std::isfinite(seen.even->sd) ? seen.even->sd : 0.0;
    std::vector<double> late(n, 0.0);
    std::vector<std::uint8_t> valid(n, 0);
    for (std::size_t i = 1; i + 1 < n; ++i) {
        const double second = prediction.turn_s[i - 1] - 2.0 * prediction.turn_s[i] + prediction.turn_s[i + 1];
        // The residual rate moves the points where the phase stands still as any other rate does.
        late[i] =
            -0.25 * series.direction[i] * second + left_rad_s[i] / series.acceleration_rad_s2 + less * shares[i] / w;
        valid[i] = 1;
    }
    // Clocks that find the zero-rate point from pulses do not follow all of the lock-in's shift.
    const std::array<std::pair<int, double>, 3> neighbours{{{-1, 1.0}, {0, 2.0}, {1, 1.0}}};
    const Eigen::VectorXd of_late = take_phase(late, valid, fit, functions, neighbours);
    const auto [at_minima_s2, at_maxima_s2] = PhaseFunctions::mean_squares(of_late);
    // For a turn and the two next to it.
    const double followed_s = std::sqrt(3.0 * (at_minima_s2 + at_maxima_s2));
    // Least error: that of the approximations of turn times (1e-7 of an asymmetry), a fiftieth of the dependence on the
    // phase, which the clocks do not follow, that of a rotation, since midpoints between pulses are off by w^2 t^2/6 of
    // the shift, and that of the acceleration.
    const double least_s =
        std::hypot(std::hypot(of_shape.least_late * series.interval_s, of_shape.doubt_of_followed * followed_s),
                   mean_share / (series.amplitude_rad * w), less_sd * mean_share / w);
    DitherShape shape;
    shape.late_s = block_mean(late, valid, fit.rows(), least_s);
    shape.even = seen.even;
    if (!seen.sides) return shape;
    shape.sides = seen.sides;
    shape.turns = seen.turns;
    shape.sides_by_sine = seen.angle;
    shape.sides_by_ratio = 1.0 - seen.share_of_other;
    const double moved = std::hypot(seen.jerk, (seen.angle + seen.share_of_other) * w * shape.late_s.value);
    const double least_sides =
        std::hypot(of_shape.doubt_of_jerk, of_shape.doubt_by_harmonic * seen.even->value) * moved;
    shape.sides->sd = std::hypot(shape.sides->sd, least_sides);
    return shape;
}

std::string note_on_acceleration(const record::Turns& turns, const TurnFit& fit) {
    if (!fit.model().series().all_phases_come) return {};
    const auto even = dither_shape(turns, fit).even;
    if (!even || !(std::abs(even->value) > std::max(of_shape.noted, of_shape.noted_sd * even->sd))) return {};
    return fmt::format(
        "the phase's accelerations at the turns are {:.2g} % {} than those of a sine of the counted swing, "
        "as a third harmonic of the dither's rate of {:.2g} % would make them, or counts lost in fast phase; "
        "the threshold is then {:.6g} deg/h",
        100.0 * std::abs(std::expm1(even->value)), even->value > 0.0 ? "greater" : "smaller",
        100.0 * 0.375 * even->value, fit.parameters().threshold_deg_h * std::exp(0.5 * even->value));
}

}  // namespace ringlock::closure
