#include "analysis/closure/side_channels.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/closure/chance.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using effects::Effect;

/// Mean and standard error of a series over the turns that count, from its means over stretches. Negative weights mark
/// turns without a value.
BlockMean block_mean(const std::vector<double>& series, const std::vector<std::uint8_t>& valid, const Rows& rows,
                     double floor) {
    constexpr std::size_t stretches = 120;
    const std::size_t n = series.size();
    BlockMean mean;
    std::size_t begin = 0;
    double sum = 0.0;
    double squares = 0.0;
    double k = 0.0;
    for (std::size_t s = 1; s <= stretches; ++s) {
        // Whole cycles, so that parities weigh alike.
        const std::size_t end = s == stretches ? n : (n * s / stretches) & ~std::size_t{1};
        double total = 0.0;
        std::size_t count = 0;
        bool counts = true;
        for (std::size_t i = begin; i < end; ++i) {
            counts = counts && rows[i];
            if (!valid[i]) continue;
            total += series[i];
            ++count;
        }
        begin = end;
        if (count < 4) continue;
        const double value = total / static_cast<double>(count);
        mean.of_stretch.push_back(value);
        mean.counts.push_back(counts);
        if (!counts) continue;
        sum += value;
        squares += value * value;
        k += 1.0;
    }
    if (k < 8.0) {
        mean.sd = std::numeric_limits<double>::infinity();
        return mean;
    }
    mean.value = sum / k;
    const double variance = std::max(0.0, (squares - k * mean.value * mean.value) / (k - 1.0)) / k;
    mean.sd = std::sqrt(variance + floor * floor);
    return mean;
}

/// Takes away what follows the phase at the turn, minima and maxima each by themselves, but for the means.
/// Gives the rms of it.
double free_of_phase(std::vector<double>& series, const std::vector<std::uint8_t>& valid, const TurnFit& fit) {
    constexpr int harmonics = 4;
    constexpr int columns = 2 + 4 * harmonics;
    const auto& turns = fit.model().series();
    const std::size_t n = series.size();
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(columns, columns);
    Eigen::VectorXd right = Eigen::VectorXd::Zero(columns);
    Eigen::VectorXd row(columns);
    const auto fill = [&](std::size_t i) {
        row.setZero();
        const int parity = turns.direction[i] > 0 ? 0 : 1;
        row(parity) = 1.0;
        for (int k = 1; k <= harmonics; ++k) {
            const double angle = k * fit.model().phase_rad()[i];
            row(2 + 4 * (k - 1) + 2 * parity) = std::cos(angle);
            row(2 + 4 * (k - 1) + 2 * parity + 1) = std::sin(angle);
        }
    };
    for (std::size_t i = 0; i < n; ++i) {
        if (!valid[i] || !fit.rows()[i]) continue;
        fill(i);
        normal += row * row.transpose();
        right += row * series[i];
    }
    normal.diagonal().array() += 1e-9 * normal.trace();
    const Eigen::VectorXd c = normal.ldlt().solve(right);
    double squares = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        if (!valid[i]) continue;
        fill(i);
        row(0) = row(1) = 0.0;
        const double taken = c.dot(row);
        series[i] -= taken;
        squares += taken * taken;
    }
    return std::sqrt(squares / static_cast<double>(n));
}

/// What a rotation adds to `sides` at a turn. The phase stands still asin(share)/w off the dither's turn, where the
/// acceleration changes by w share/sqrt(1 - share^2) of itself a second; by two pulses t_1 and t_2 after that
/// (sqrt(a) = sqrt(2) (sqrt(d_2) - sqrt(d_1))/(t_2 - t_1)) it comes out too large by (t_1 + t_2)/3 of it, before it too
/// small.
double sides_by_jerk(int direction, double phase_rad, double share, const TurnSeries& series) {
    constexpr double quarter_rad = 0.5 * units::pi;
    const double quarters = phase_rad / quarter_rad;
    const double first_rad =
        quarter_rad * (direction > 0 ? std::ceil(quarters) - quarters : quarters - std::floor(quarters));
    const double root = std::sqrt(1.0 - share * share);
    const double angles = (std::sqrt(2.0 * first_rad) + std::sqrt(2.0 * (first_rad + quarter_rad))) /
                          std::sqrt(series.amplitude_rad * root);  // w (t_1 + t_2)
    return share / root * angles / 6.0;
}

/// Chi-squared of a mean, with the doubt of its standard error in it: what a normal deviate of the same rarity has.
double chi2_of(const BlockMean& mean, double expected) {
    if (!std::isfinite(mean.sd) || mean.sd == 0.0) return 0.0;
    const double t = std::abs(mean.value - expected) / mean.sd;
    const auto counted = static_cast<double>(std::count(mean.counts.begin(), mean.counts.end(), 1));
    // Wallace (1959): a normal deviate as rare as t.
    const double freedom = counted - 1.0;
    return freedom * std::log1p(t * t / freedom) * (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) *
           (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0);
}

}  // namespace

DitherShape dither_shape(const record::Turns& turns, const TurnFit& fit) {
    const auto& series = fit.model().series();
    const std::size_t n = series.size();
    const auto prediction = fit.model().predict(fit.parameters());
    std::vector<double> late(n, 0.0);
    std::vector<std::uint8_t> valid(n, 0);
    for (std::size_t i = 1; i + 1 < n; ++i) {
        const double second = prediction.turn_s[i - 1] - 2.0 * prediction.turn_s[i] + prediction.turn_s[i + 1];
        late[i] = -0.25 * series.direction[i] * second;
        valid[i] = 1;
    }
    // Clocks that find the zero-rate point from pulses do not follow the lock-in's shift of it all the way.
    const double followed_s = free_of_phase(late, valid, fit);
    // Beneath: what the approximations of turn times leave, 1e-7 of an asymmetry, a twentieth of what they do not
    // follow, and what they would not of a rotation: middles between pulses lie off by w^2 t^2/6 of the shift.
    double mean_share = 0.0;
    const auto share_at = [&](std::size_t i) {
        return series.relative_rate(fit.parameters().bias_deg_h + series.input_rate_deg_h[i]);
    };
    for (std::size_t i = 0; i < n; ++i) mean_share += share_at(i) / static_cast<double>(n);
    const double w = units::pi / series.interval_s;
    const double least_s =
        std::hypot(5e-8 * series.interval_s, 0.05 * followed_s, mean_share / (series.amplitude_rad * w));
    DitherShape shape{block_mean(late, valid, fit.rows(), least_s), {}, {}};
    std::vector<double> sides(n, 0.0);
    std::vector<double> minima(n, 0.0);
    std::fill(valid.begin(), valid.end(), std::uint8_t{0});
    std::size_t seen = 0;
    double jerks = 0.0;
    for (std::size_t i = 0; i < n; ++i) {
        if (!(turns.accel_before_rad_s2[i] > 0.0) || !(turns.accel_after_rad_s2[i] > 0.0)) continue;
        const double before = std::log(turns.accel_before_rad_s2[i] / series.acceleration_rad_s2);
        const double after = std::log(turns.accel_after_rad_s2[i] / series.acceleration_rad_s2);
        if (std::abs(before) > 1.0 || std::abs(after) > 1.0) continue;
        const double jerk = sides_by_jerk(series.direction[i], fit.model().phase_rad()[i], share_at(i), series);
        jerks += jerk;
        sides[i] = 0.25 * series.direction[i] * (after - before) - jerk;
        minima[i] = 0.25 * series.direction[i] * (after + before);
        valid[i] = 1;
        ++seen;
    }
    if (seen > n / 4) {
        // Accelerations are computed from distances that the detectors have read: their ellipse is in them.
        const gyro::Ellipse ellipse = fit.model().setup(fit.parameters()).ellipse;
        constexpr double of_jerk = 0.2;  // pulses may be made accelerations of in other ways
        const double least_sides = of_jerk * std::abs(jerks) / static_cast<double>(seen);
        const double least_ratio = 1e-5 + std::max({std::abs(ellipse.gain), std::abs(ellipse.offset_sin),
                                                    std::abs(ellipse.offset_cos), std::abs(ellipse.orthogonality_rad)});
        free_of_phase(sides, valid, fit);
        free_of_phase(minima, valid, fit);
        shape.sides = block_mean(sides, valid, fit.rows(), std::hypot(least_ratio, least_sides));
        shape.turns = block_mean(minima, valid, fit.rows(), least_ratio);
    }
    return shape;
}

RadiusFold radius_fold(const record::Turns& turns, const Rows& rows) {
    RadiusFold fold;
    // Gauss and Newton: radius - 1 = gain sin^2 + offset_sin sin + offset_cos cos - orthogonality sin cos + (scale).
    for (int pass = 0; pass < 8; ++pass) {
        Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
        Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
        double squares = 0.0;
        double count = 0.0;
        double scale = 0.0;
        std::vector<double> radius(turns.size());
        std::vector<double> angle(turns.size());
        const gyro::Ellipse& e = fold.ellipse;
        double mean = 0.0;
        for (std::size_t i = 0; i < turns.size(); ++i) mean += std::hypot(turns.sine[i], turns.cosine[i]);
        mean /= static_cast<double>(turns.size());
        for (std::size_t i = 0; i < turns.size(); ++i) {
            const double s = (turns.sine[i] / mean - e.offset_sin) / (1.0 + e.gain);
            double c = turns.cosine[i] / mean - e.offset_cos;
            c = (c + s * std::sin(e.orthogonality_rad)) / std::cos(e.orthogonality_rad);
            radius[i] = std::hypot(s, c);
            angle[i] = std::atan2(s, c);
            if (rows[i]) {
                scale += radius[i];
                count += 1.0;
            }
        }
        scale /= count;
        for (std::size_t i = 0; i < turns.size(); ++i) {
            if (!rows[i]) continue;
            const double s = std::sin(angle[i]);
            const double c = std::cos(angle[i]);
            const double y = radius[i] / scale - 1.0;
            const Eigen::Matrix<double, 5, 1> x{s * s - 0.5, s, c, -s * c, 1.0};
            normal += x * x.transpose();
            right += x * y;
            squares += y * y;
        }
        const Eigen::Matrix<double, 5, 5> inverse = normal.inverse();
        const Eigen::Matrix<double, 5, 1> step = inverse * right;
        const double variance = std::max((squares - step.dot(right)) / (count - 5.0), 1e-24);
        if (pass == 0) {
            const double without = squares - right(4) * right(4) / normal(4, 4);
            const double with = squares - step.dot(right);
            fold.chi2 = (without - with) / variance;
        }
        fold.ellipse.gain += step(0);
        fold.ellipse.offset_sin += step(1);
        fold.ellipse.offset_cos += step(2);
        fold.ellipse.orthogonality_rad += step(3);
        fold.covariance = variance * inverse.topLeftCorner<4, 4>();
    }
    return fold;
}

std::vector<Candidate> screen_side_channels(const record::Turns& turns, const TurnFit& fit, const JoinedPhase& joined,
                                            bool again) {
    std::vector<Candidate> candidates;
    TurnParameters p = fit.parameters();
    const auto wanted = [&](std::string_view name) -> const Effect* {
        return again || p.find(name) == nullptr ? effects::find(name) : nullptr;
    };
    if (const Effect* effect = wanted("readout_ellipse")) {
        const RadiusFold fold = radius_fold(turns, fit.rows());
        Candidate candidate{effect, values_at_rest(*effect), fold.chi2, chi2_tail(fold.chi2, 4), 1.0};
        candidate.values.at("gain") = fold.ellipse.gain;
        candidate.values.at("offset_sin") = fold.ellipse.offset_sin;
        candidate.values.at("offset_cos") = fold.ellipse.offset_cos;
        candidate.values.at("orthogonality_rad") = fold.ellipse.orthogonality_rad;
        const char* const names[] = {"gain", "offset_sin", "offset_cos", "orthogonality_rad"};
        for (Eigen::Index k = 0; k < 4; ++k) candidate.sd[names[k]] = std::sqrt(fold.covariance(k, k));
        candidates.push_back(candidate);
    }
    if (const Effect* effect = wanted("missed_counts")) {
        // The margin by which a miscount is told is six standard deviations of the phase: none comes by chance.
        double missed = 0.0;
        for (const std::size_t i : joined.miscounted) missed += fit.rows()[i];
        const auto n = static_cast<double>(std::count(fit.rows().begin(), fit.rows().end(), 1));
        constexpr double by_chance = 1e-9;
        const double surprise = missed > 0.0 ? missed * std::log(missed / (n * by_chance)) - missed : 0.0;
        Candidate candidate{effect, values_at_rest(*effect), 2.0 * surprise, chi2_tail(2.0 * surprise, 1), 1.0};
        candidate.values.at("probability_per_turn") = missed / n;
        candidate.sd["probability_per_turn"] = std::sqrt(missed) / n;
        candidates.push_back(candidate);
    }
    if (!fit.model().series().all_phases_come) return candidates;
    const Effect* asymmetry = wanted("dither_asymmetry");
    const Effect* harmonic = wanted("dither_second_harmonic");
    if (asymmetry == nullptr && harmonic == nullptr) return candidates;
    const DitherShape shape = dither_shape(turns, fit);
    const double period_s = 2.0 * fit.model().series().interval_s;
    const double w = units::two_pi / period_s;
    // What the other one, where it is in the model, foretells.
    double late = 0.0;
    double sides = 0.0;
    double minima = 0.0;
    if (const ActiveEffect* active = p.find("dither_asymmetry"); active != nullptr && !again) {
        late += 0.25 * period_s * active->values.at("ratio");
        sides += active->values.at("ratio");
    }
    if (const ActiveEffect* active = p.find("dither_second_harmonic"); active != nullptr && !again) {
        late -= active->values.at("ratio") * std::sin(active->values.at("phase_rad")) / w;
        minima += active->values.at("ratio") * std::cos(active->values.at("phase_rad"));
    }
    const double from_late = chi2_of(shape.late_s, late);
    const double from_sides = shape.sides ? chi2_of(*shape.sides, sides) : 0.0;
    const double from_turns = shape.turns ? chi2_of(*shape.turns, minima) : 0.0;
    if (asymmetry != nullptr) {
        // One ratio for both: weighted mean, and what is left of their difference.
        const double by_late = (shape.late_s.value - late) / (0.25 * period_s);
        const double late_sd = shape.late_s.sd / (0.25 * period_s);
        double ratio = by_late;
        double sd = late_sd;
        double left = 0.0;
        if (shape.sides && std::isfinite(shape.sides->sd)) {
            const double by_sides = shape.sides->value - sides;
            const double weights = 1.0 / (late_sd * late_sd) + 1.0 / (shape.sides->sd * shape.sides->sd);
            ratio = (by_late / (late_sd * late_sd) + by_sides / (shape.sides->sd * shape.sides->sd)) / weights;
            sd = 1.0 / std::sqrt(weights);
            left = chi2_of(*shape.sides, sides + ratio);
        }
        const double chi2 = std::max(0.0, from_late + from_sides - left);
        Candidate candidate{asymmetry, values_at_rest(*asymmetry), chi2, chi2_tail(chi2, 1), 1.0};
        candidate.values.at("ratio") = ratio;
        candidate.sd["ratio"] = sd;
        candidates.push_back(candidate);
    }
    if (harmonic != nullptr) {
        const double chi2 = from_late + from_turns;
        Candidate candidate{harmonic, values_at_rest(*harmonic), chi2, chi2_tail(chi2, 2), 1.0};
        const double sine = -w * (shape.late_s.value - late);
        const double cosine = shape.turns ? shape.turns->value - minima : 0.0;
        candidate.values.at("ratio") = std::hypot(sine, cosine);
        candidate.values.at("phase_rad") = std::atan2(sine, cosine);
        const double sine_sd = w * shape.late_s.sd;
        const double cosine_sd = shape.turns ? shape.turns->sd : 0.0;
        const double f = candidate.values.at("phase_rad");
        candidate.sd["ratio"] = std::hypot(std::sin(f) * sine_sd, std::cos(f) * cosine_sd);
        candidate.sd["phase_rad"] =
            std::hypot(std::cos(f) * sine_sd, std::sin(f) * cosine_sd) / candidate.values.at("ratio");
        candidates.push_back(candidate);
    }
    return candidates;
}

}  // namespace ringlock::closure
