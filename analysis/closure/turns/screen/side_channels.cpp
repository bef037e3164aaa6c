#include "analysis/closure/turns/screen/side_channels.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/turns/screen/miscounts.hpp"
#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using effects::Effect;

/// Chi-squared of a mean whose standard error is estimated: the square of the normal deviate that is as rare as its t.
double chi2_of(const BlockMean& mean, double expected) {
    if (!std::isfinite(mean.sd) || mean.sd == 0.0) return 0.0;
    const double t = std::abs(mean.value - expected) / mean.sd;
    const auto counted = static_cast<double>(std::count(mean.counts.begin(), mean.counts.end(), 1));
    // Wallace (1959): the normal deviate that is as rare as t.
    const double freedom = counted - 1.0;
    return freedom * std::log1p(t * t / freedom) * (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0) *
           (8.0 * freedom + 1.0) / (8.0 * freedom + 3.0);
}

/// Asymmetry r and second harmonic (s and c: its ratio times the sine and cosine of its phase), fitted to the columns,
/// with l = w late:
///
///     l = (pi/2) r - s,     sides = j r - k s,     turns = c,     j = sides_by_ratio, k = sides_by_sine.
struct ShapeFit {
    double ratio = 0.0, ratio_sd = 0.0;
    double sine = 0.0, sine_sd = 0.0;
    double cosine = 0.0, cosine_sd = 0.0;
    double left = 0.0;  ///< residual chi-squared of the columns

    ShapeFit(const DitherShape& shape, double w, bool asymmetry, bool harmonic) {
        const Eigen::Vector2d of_ratio{0.5 * units::pi, shape.sides_by_ratio};
        const Eigen::Vector2d of_sine{-1.0, -shape.sides_by_sine};
        const bool sides = shape.sides && std::isfinite(shape.sides->sd);
        const Eigen::Vector2d fitted{w * shape.late_s.value, sides ? shape.sides->value : 0.0};
        const Eigen::Vector2d weight{std::pow(w * shape.late_s.sd, -2), sides ? std::pow(shape.sides->sd, -2) : 0.0};
        if (asymmetry && harmonic && sides) {
            Eigen::Matrix2d model;
            model << of_ratio, of_sine;
            const Eigen::Matrix2d back = model.inverse();
            const Eigen::Vector2d found = back * fitted;
            const Eigen::Matrix2d covariance = back * weight.cwiseInverse().asDiagonal() * back.transpose();
            ratio = found(0);
            ratio_sd = std::sqrt(covariance(0, 0));
            sine = found(1);
            sine_sd = std::sqrt(covariance(1, 1));
        } else if (asymmetry || harmonic) {
            const Eigen::Vector2d& model = asymmetry ? of_ratio : of_sine;
            const double information = model.cwiseAbs2().dot(weight);
            (asymmetry ? ratio_sd : sine_sd) = std::sqrt(1.0 / information);
            if (information > 0.0) {
                (asymmetry ? ratio : sine) = model.cwiseProduct(fitted).dot(weight) / information;
            }
        }
        if (harmonic && shape.turns && std::isfinite(shape.turns->sd)) {
            cosine = shape.turns->value;
            cosine_sd = shape.turns->sd;
        }
        const Eigen::Vector2d expected = ratio * of_ratio + sine * of_sine;
        left = chi2_of(shape.late_s, expected(0) / w);
        if (shape.sides) left += chi2_of(*shape.sides, expected(1));
        if (shape.turns) left += chi2_of(*shape.turns, cosine);
    }

    double harmonic_ratio() const { return std::hypot(sine, cosine); }
    double harmonic_phase_rad() const { return std::atan2(sine, cosine); }

    void tell(const EffectRoles::Asymmetry& names, Candidate& candidate) const {
        candidate.values.at(names.ratio) = ratio;
        candidate.sd[names.ratio] = ratio_sd;
    }
    void tell(const EffectRoles::Harmonic& names, Candidate& candidate) const {
        const double f = harmonic_phase_rad();
        candidate.values.at(names.ratio) = harmonic_ratio();
        candidate.values.at(names.phase_rad) = f;
        candidate.sd[names.ratio] = std::hypot(std::sin(f) * sine_sd, std::cos(f) * cosine_sd);
        candidate.sd[names.phase_rad] = std::hypot(std::cos(f) * sine_sd, std::sin(f) * cosine_sd) / harmonic_ratio();
    }
};

}  // namespace

std::optional<TurnParameters> shape_read_again(const record::Turns& turns, const TurnFit& fit) {
    const double same = options.turns.side_channels.same_shape;
    TurnParameters parameters = fit.parameters();
    const EffectRoles& roles = effect_roles();
    ActiveEffect* asymmetry = parameters.find(roles.asymmetry.effect);
    ActiveEffect* harmonic = parameters.find(roles.harmonic.effect);
    if (asymmetry == nullptr && harmonic == nullptr) return std::nullopt;
    const ShapeFit fitted(dither_shape(turns, fit), units::pi / fit.model().series().interval_s, asymmetry != nullptr,
                          harmonic != nullptr);
    bool moved = false;
    if (asymmetry != nullptr) {
        double& ratio = asymmetry->values.at(roles.asymmetry.ratio);
        moved = std::abs(fitted.ratio - ratio) > same * fitted.ratio_sd;
        ratio = fitted.ratio;
    }
    if (harmonic != nullptr) {
        double& ratio = harmonic->values.at(roles.harmonic.ratio);
        double& phase_rad = harmonic->values.at(roles.harmonic.phase_rad);
        moved = moved || std::abs(fitted.sine - ratio * std::sin(phase_rad)) > same * fitted.sine_sd ||
                std::abs(fitted.cosine - ratio * std::cos(phase_rad)) > same * fitted.cosine_sd;
        ratio = fitted.harmonic_ratio();
        phase_rad = fitted.harmonic_phase_rad();
    }
    return moved ? std::optional(parameters) : std::nullopt;
}

RadiusFold radius_fold(const record::Turns& turns, const Rows& rows) {
    RadiusFold fold;
    double amplitude = 0.0;  // of the cosine; offsets are relative to it
    for (std::size_t i = 0; i < turns.size(); ++i) amplitude += std::hypot(turns.sine[i], turns.cosine[i]);
    amplitude /= static_cast<double>(turns.size());
    // Gauss-Newton: radius - 1 = gain sin^2 + offset_sin sin + offset_cos cos - orthogonality sin cos + (scale).
    for (int pass = 0; pass < 8; ++pass) {
        Eigen::Matrix<double, 5, 5> normal = Eigen::Matrix<double, 5, 5>::Zero();
        Eigen::Matrix<double, 5, 1> right = Eigen::Matrix<double, 5, 1>::Zero();
        double squares = 0.0;
        double count = 0.0;
        double scale = 0.0;
        std::vector<double> radius(turns.size());
        std::vector<double> angle(turns.size());
        const gyro::Ellipse& e = fold.ellipse;
        for (std::size_t i = 0; i < turns.size(); ++i) {
            const double s = (turns.sine[i] / amplitude - e.offset_sin) / (1.0 + e.gain);
            double c = turns.cosine[i] / amplitude - e.offset_cos;
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
        const Eigen::Matrix<double, 5, 5> inverse = dense::inverse(normal);
        const Eigen::Matrix<double, 5, 1> step = inverse * right;
        const double variance = std::max((squares - step.dot(right)) / (count - 5.0), 1e-24);
        if (pass == 0) {
            const double without = squares - right(4) * right(4) / normal(4, 4);
            const double with = squares - step.dot(right);
            fold.chi2 = (without - with) / variance;
        }
        amplitude *= scale;
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
    const TurnParameters& p = fit.parameters();
    const EffectRoles& roles = effect_roles();
    const auto wanted = [&](const Effect* effect) { return effect != nullptr && (again || p.find(effect) == nullptr); };
    if (const EffectRoles::Ellipse& of = roles.ellipse; wanted(of.effect)) {
        const RadiusFold fold = radius_fold(turns, fit.rows());
        Candidate candidate{of.effect, values_at_rest(*of.effect), fold.chi2, chi2_tail(fold.chi2, 4), 1.0};
        candidate.values.at(of.gain) = fold.ellipse.gain;
        candidate.values.at(of.offset_sin) = fold.ellipse.offset_sin;
        candidate.values.at(of.offset_cos) = fold.ellipse.offset_cos;
        candidate.values.at(of.orthogonality_rad) = fold.ellipse.orthogonality_rad;
        Eigen::Index k = 0;
        for (const std::string& name : {of.gain, of.offset_sin, of.offset_cos, of.orthogonality_rad}) {
            candidate.sd[name] = std::sqrt(fold.covariance(k, k));
            ++k;
        }
        candidates.push_back(candidate);
    }
    if (const EffectRoles::MissedCounts& of = roles.missed_counts; wanted(of.effect)) {
        double missed = 0.0;
        for (const std::size_t i : joined.miscounted) missed += fit.rows()[i];
        const auto n = static_cast<double>(std::count(fit.rows().begin(), fit.rows().end(), 1));
        const double by_chance = options.turns.side_channels.miscount_by_chance;
        const double surprise = missed > 0.0 ? missed * std::log(missed / (n * by_chance)) - missed : 0.0;
        Candidate candidate{of.effect, values_at_rest(*of.effect), 2.0 * surprise, chi2_tail(2.0 * surprise, 1), 1.0};
        if (missed > 0.0) {
            const MissedShare share = share_of_missed_counts(turns, joined, fit.rows());
            candidate.values.at(of.probability) = share.probability_per_turn;
            candidate.sd[of.probability] = share.sd;
        }
        candidates.push_back(candidate);
    }
    if (!fit.model().series().all_phases_come) return candidates;
    const Effect* asymmetry = wanted(roles.asymmetry.effect) ? roles.asymmetry.effect : nullptr;
    const Effect* harmonic = wanted(roles.harmonic.effect) ? roles.harmonic.effect : nullptr;
    if (asymmetry == nullptr && harmonic == nullptr) return candidates;
    const DitherShape shape = dither_shape(turns, fit);
    const double w = units::pi / fit.model().series().interval_s;
    const bool has_asymmetry = p.find(roles.asymmetry.effect) != nullptr;
    const bool has_harmonic = p.find(roles.harmonic.effect) != nullptr;
    if (asymmetry != nullptr) {
        const ShapeFit with(shape, w, true, has_harmonic);
        const double chi2 = std::max(0.0, ShapeFit(shape, w, false, has_harmonic).left - with.left);
        candidates.push_back({asymmetry, values_at_rest(*asymmetry), chi2, chi2_tail(chi2, 1), 1.0});
        with.tell(roles.asymmetry, candidates.back());
    }
    if (harmonic != nullptr) {
        const ShapeFit with(shape, w, has_asymmetry, true);
        const double chi2 = std::max(0.0, ShapeFit(shape, w, has_asymmetry, false).left - with.left);
        candidates.push_back({harmonic, values_at_rest(*harmonic), chi2, chi2_tail(chi2, 2), 1.0});
        with.tell(roles.harmonic, candidates.back());
    }
    return candidates;
}

}  // namespace ringlock::closure
