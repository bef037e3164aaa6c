#include "engine/readout/ellipse_correction.hpp"

#include <algorithm>
#include <array>
#include <cmath>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "engine/readout/ellipse_correction.cpp"
#include "engine/core/dense.hpp"
#include "engine/core/units.hpp"
#include "engine/readout/readout_constants.hpp"
#include "engine/simd/targets.hpp"
// The above must come first.
#include "engine/simd/math-inl.hpp"

HWY_BEFORE_NAMESPACE();
namespace ringlock::readout::HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;
namespace sm = simd::HWY_NAMESPACE;

using D = hn::CappedTag<double, simd::lanes>;
using V = hn::Vec<D>;

void correct_lanes(std::size_t lanes, double keep, std::size_t first_row, std::size_t last_row,
                   EllipseCorrection::State& state, LaneReadings& readings, LaneAngles* angles) {
    const D d;
    const V per_rad = hn::Set(d, 0.15915494309189535);
    const V kept = hn::Set(d, keep);
    for (std::size_t lane = 0; lane < lanes; lane += hn::Lanes(d)) {
        const auto load = [&](const simd::Lanes& values) HWY_ATTR { return hn::Load(d, values.data() + lane); };
        const auto store = [&](V value, simd::Lanes& to) HWY_ATTR { hn::Store(value, d, to.data() + lane); };
        const V inverse_gain = hn::Set(d, 1.0) / load(state.gain);
        const V offset_sin = load(state.offset_sin);
        const V offset_cos = load(state.offset_cos);
        const V tilt = load(state.orthogonality_sine);
        const V inverse_tilt = hn::Set(d, 1.0) / load(state.orthogonality_cosine);
        V sums[20];
        for (std::size_t k = 0; k < 20; ++k) sums[k] = load(state.sums[k]);
        for (std::size_t i = first_row; i < last_row; ++i) {
            const V s = load(readings.sine[i]);
            const V c = load(readings.cosine[i]);
            const V powers[5] = {s * s, s * c, c * c, s, c};
            std::size_t k = 0;
            for (std::size_t row = 0; row < 5; ++row) {
                for (std::size_t column = row; column < 5; ++column, ++k) {
                    sums[k] = sm::fma(d, sums[k], kept, powers[row] * powers[column]);
                }
            }
            for (const V power : powers) {
                sums[k] = sm::fma(d, sums[k], kept, power);
                ++k;
            }
            const V sine = (s - offset_sin) * inverse_gain;
            const V cosine = sm::fma(d, sine, tilt, c - offset_cos) * inverse_tilt;
            const V change = sm::arg(d, sm::fma(d, cosine, c, sine * s), sm::fnma(d, cosine, s, sine * c)) * per_rad;
            store(sine, readings.sine[i]);
            store(cosine, readings.cosine[i]);
            store(load(readings.phase_fringes[i]) + change, readings.phase_fringes[i]);
            if (angles != nullptr) store(load(angles->angle_fringes[i]) + change, angles->angle_fringes[i]);
        }
        for (std::size_t k = 0; k < 20; ++k) store(sums[k], state.sums[k]);
    }
}

}  // namespace ringlock::readout::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace ringlock::readout {

HWY_EXPORT(correct_lanes);

namespace {

constexpr double memory_turns = 65536.0;
constexpr std::int64_t first_fit = 128;
constexpr std::int64_t most_turns_between_fits = 8192;
// Where phases do not move, noise bends the fit by its variance times the readings: keep ahead of it.
constexpr int made_up_readings = 8;
constexpr double made_up_share = 1e-3;
constexpr double least_eigenvalue = 1e-3;  // of the quadratic form, relative to 1; a form below it is no ellipse

constexpr int unknowns = 5;

std::array<double, unknowns> powers_of(double s, double c) { return {s * s, s * c, c * c, s, c}; }

/// Smaller eigenvalue of the form a x^2 + b x y + c y^2.
double smaller_eigenvalue(double a, double b, double c) { return 0.5 * (a + c - std::hypot(a - c, b)); }

}  // namespace

EllipseCorrection::EllipseCorrection(std::size_t lanes) : lanes_(lanes), next_fit_(first_fit) {
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) state_.gain[lane] = state_.orthogonality_cosine[lane] = 1.0;
}

void EllipseCorrection::fit() {
    const double readings = memory_turns * -std::expm1(-static_cast<double>(turns_) / memory_turns);
    const double weight = 1.0 + made_up_share * readings / made_up_readings;
    for (std::size_t lane = 0; lane < lanes_; ++lane) {
        Eigen::MatrixXd normal(unknowns, unknowns);
        Eigen::VectorXd right(unknowns);
        std::size_t k = 0;
        for (int row = 0; row < unknowns; ++row) {
            for (int column = row; column < unknowns; ++column)
                normal(row, column) = normal(column, row) = state_.sums[k++][lane];
        }
        for (int row = 0; row < unknowns; ++row) right[row] = state_.sums[k++][lane];
        for (int i = 0; i < made_up_readings; ++i) {
            const double psi = units::two_pi * i / made_up_readings;
            const auto powers = powers_of(std::sin(psi), std::cos(psi));
            for (int row = 0; row < unknowns; ++row) {
                const double weighted = weight * powers[row];
                for (int column = 0; column < unknowns; ++column) normal(row, column) += weighted * powers[column];
                right[row] += weighted;
            }
        }
        const Eigen::VectorXd conic = dense::solve_symmetric(normal, right);
        // A hyperbola, or no solution (which makes the comparison false): the previous correction is kept.
        if (!(smaller_eigenvalue(conic[0], conic[1], conic[2]) >= least_eigenvalue) || !std::isfinite(conic[3]) ||
            !std::isfinite(conic[4])) {
            continue;
        }
        // Where the gradient of the quadratic form is minus the linear part.
        const double determinant = 4.0 * conic[0] * conic[2] - conic[1] * conic[1];
        gyro::Ellipse& ellipse = known_[lane];
        ellipse.offset_sin = (conic[1] * conic[4] - 2.0 * conic[2] * conic[3]) / determinant;
        ellipse.offset_cos = (conic[1] * conic[3] - 2.0 * conic[0] * conic[4]) / determinant;
        ellipse.gain = std::sqrt(conic[2] / conic[0]) - 1.0;
        ellipse.orthogonality_rad = std::asin(0.5 * conic[1] / std::sqrt(conic[0] * conic[2]));
        const ComparatorPoints points = comparator_points(ellipse);
        for (std::size_t number = 0; number < 4; ++number) {
            known_shift_rad_[number][lane] = points.shift_rad[number];
        }
        state_.gain[lane] = 1.0 + ellipse.gain;
        state_.offset_sin[lane] = ellipse.offset_sin;
        state_.offset_cos[lane] = ellipse.offset_cos;
        state_.orthogonality_sine[lane] = std::sin(ellipse.orthogonality_rad);
        state_.orthogonality_cosine[lane] = std::cos(ellipse.orthogonality_rad);
    }
}

void EllipseCorrection::correct(LaneReadings& readings, LaneAngles& angles, bool interpolated) {
    for (std::size_t row = 0; row < readings.turns;) {
        const std::size_t rows = std::min(readings.turns - row, static_cast<std::size_t>(next_fit_ - turns_));
        HWY_DYNAMIC_DISPATCH(correct_lanes)
        (lanes_, 1.0 - 1.0 / memory_turns, row, row + rows, state_, readings, interpolated ? &angles : nullptr);
        for (std::size_t number = 0; number < 4 && !readings.pulses.empty(); ++number) {
            auto& column = readings.pulses.known_shift_rad[number];
            column.resize(readings.turns);
            std::fill_n(column.begin() + static_cast<std::ptrdiff_t>(row), rows, known_shift_rad_[number]);
        }
        row += rows;
        turns_ += static_cast<std::int64_t>(rows);
        if (turns_ < next_fit_) continue;
        fit();
        next_fit_ = turns_ + std::min(turns_, most_turns_between_fits);
    }
}

}  // namespace ringlock::readout
#endif
