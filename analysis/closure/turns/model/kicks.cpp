#include "analysis/closure/turns/model/kicks.hpp"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <span>
#include <vector>

#include "engine/core/dense.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/gyro/device.hpp"
#include "engine/gyro/fast_motion.hpp"
#include "engine/gyro/motion.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/fast_frame.hpp"
#include "engine/propagate/half_turn.hpp"

namespace ringlock::closure {

namespace {

using Complex = std::complex<double>;

/// The phase that the lock-in adds between the turn at one end of a half cycle and its middle, in the frame in which
/// fast motion is plain rotation, as a function of the angle at that turn (psi and the coupling phase): exact
/// (docs/dev/turn-map.md).
class HalfKick {
   public:
    /// \param end  0: the turn at which the half cycle begins, 1: the turn at which it ends
    HalfKick(const gyro::Device& device, int sign, int end)
        : sign_(sign), end_(end), second_ratio_(device.coupling.second_ratio) {
        const gyro::HalfCycle cycle = device.half_cycle(sign, device.dither_amplitude_rad);
        problem_ = end == 0 ? propagate::beginning(cycle, device.coupling) : propagate::ending(cycle, device.coupling);
        second_phase_rad_ = sign * device.coupling.second_from_first_rad();
        if (end == 1) second_phase_rad_ = units::pi - second_phase_rad_;
    }

    bool is_moebius() const { return second_ratio_ == 0.0; }
    const propagate::HalfTurnProblem& problem() const { return problem_; }

    double value_rad(double theta_rad, const propagate::HalfTurn& map) const {
        return finished(map.shift_rad + 2.0 * std::arg(1.0 + map.z * std::polar(1.0, -upright_rad(theta_rad))));
    }

    /// With a second harmonic of the coupling the flow is no Moebius map. Every phase is integrated to the beginning of
    /// fast motion, and the first one also to the middle: in between all phases rotate alike in the fast frame.
    propagate::Stretch to_fast_motion(double theta_rad) const { return stretch(theta_rad, fast_from_s()); }
    propagate::Stretch to_middle(double theta_rad) const { return stretch(theta_rad, middle_s()); }
    std::vector<double> values_rad(const std::vector<double>& theta_rad,
                                   std::span<const propagate::StretchResult> to_fast_motion,
                                   const propagate::StretchResult& first_to_middle) const {
        const gyro::Coupling coupling = upright_coupling();
        const auto in_frame = [&](const propagate::FastFrame& frame, double theta, double time_s, double lockin_rad) {
            const double plain = problem_.half.plain_phase_rad(time_s);
            return lockin_rad + frame.correction_rad(upright_rad(theta) + plain + lockin_rad);
        };
        const double fast_s = fast_from_s();
        const propagate::FastFrame fast(problem_.half, coupling, fast_s);
        const propagate::FastFrame middle(problem_.half, coupling, middle_s());
        const double rotation = in_frame(middle, theta_rad[0], middle_s(), first_to_middle.lockin_rad) -
                                in_frame(fast, theta_rad[0], fast_s, to_fast_motion[0].lockin_rad);
        std::vector<double> values;
        for (std::size_t j = 0; j < theta_rad.size(); ++j) {
            values.push_back(finished(in_frame(fast, theta_rad[j], fast_s, to_fast_motion[j].lockin_rad) + rotation));
        }
        return values;
    }

   private:
    /// Angle in the mirrored half cycle, which begins at its turn and has sign +1.
    double upright_rad(double theta_rad) const { return end_ == 0 ? sign_ * theta_rad : units::pi - sign_ * theta_rad; }
    double finished(double upright_value_rad) const {
        // With a harmonic of the dither the plain phases of the two halves are unequal.
        const gyro::HalfCycle& half = problem_.half;
        return sign_ *
               (upright_value_rad + half.amplitude_rad * half.harmonic_ratio * std::cos(half.harmonic_phase_rad));
    }
    gyro::Coupling upright_coupling() const {
        return {problem_.b_rad_s, 0.0, problem_.turn_asymmetry, second_ratio_, second_phase_rad_};
    }
    double middle_s() const { return 0.5 * problem_.half.duration_s; }
    double fast_from_s() const {
        const gyro::HalfCycle& half = problem_.half;
        const double time_s = gyro::fast_motion_from_s(half, gyro::strength_with_harmonics_rad_s(upright_coupling()));
        if (!std::isnan(time_s)) return time_s;
        throw RunError(
            fmt::format("a half cycle of {:.1f} fringes at an input of {:.4g} rad/s "
                        "and a coupling of {:.4g} rad/s has no fast middle",
                        half.amplitude_rad / units::pi, half.rate_rad_s, problem_.b_rad_s));
    }
    propagate::Stretch stretch(double theta_rad, double end_s) const {
        return {problem_.half, upright_coupling(), upright_rad(theta_rad) / units::two_pi, end_s};
    }

    int sign_, end_;
    propagate::HalfTurnProblem problem_;
    double second_ratio_, second_phase_rad_;
};

/// Values of several half kicks at these angles. They are computed together to fill the lanes of the integrator.
std::vector<std::vector<double>> values_of(const std::vector<HalfKick>& kicks, const std::vector<double>& theta_rad) {
    std::vector<std::vector<double>> values(kicks.size());
    if (kicks.front().is_moebius()) {
        std::vector<propagate::HalfTurnProblem> problems;
        for (const HalfKick& kick : kicks) problems.push_back(kick.problem());
        std::vector<propagate::HalfTurn> maps(kicks.size());
        propagate::exact_half_turns(problems, maps);
        for (std::size_t k = 0; k < kicks.size(); ++k) {
            for (const double theta : theta_rad) values[k].push_back(kicks[k].value_rad(theta, maps[k]));
        }
        return values;
    }
    constexpr double tolerance_rad = 1e-11;
    std::vector<propagate::Stretch> stretches;
    for (const HalfKick& kick : kicks) {
        for (const double theta : theta_rad) stretches.push_back(kick.to_fast_motion(theta));
    }
    for (const HalfKick& kick : kicks) stretches.push_back(kick.to_middle(theta_rad[0]));
    std::vector<propagate::StretchResult> results(stretches.size());
    propagate::integrate(stretches, tolerance_rad, results);
    const std::span<const propagate::StretchResult> all(results);
    for (std::size_t k = 0; k < kicks.size(); ++k) {
        values[k] = kicks[k].values_rad(theta_rad, all.subspan(k * theta_rad.size(), theta_rad.size()),
                                        all[kicks.size() * theta_rad.size() + k]);
    }
    return values;
}

/// Phase gained from the dither's turn to the zero-rate point next to it: if `late`, on the half cycle that begins at
/// the turn; else, with time reversed, on the one that ends there.
double to_zero_rate(const gyro::Device& device, int direction, bool late, double psi_rad) {
    const gyro::HalfCycle half = device.half_cycle(late ? direction : -direction, device.dither_amplitude_rad);
    const double scale_s = 1.0 / std::sqrt(half.end_acceleration_rad_s2(late ? 0 : 1));
    // At high input rates the point is farther away than one series reaches.
    constexpr double tolerance_rad = 1e-15;
    constexpr int most_steps = 10000;
    double time_s = late ? 0.0 : half.duration_s;
    double gain_rad = 0.0;
    for (int step = 0; step < most_steps; ++step) {
        const gyro::PhaseSeries<16> series(half, device.coupling, time_s, psi_rad + gain_rad, scale_s);
        const double most_s = std::min(0.5 * scale_s, series.step_s(tolerance_rad));
        double t = -direction * series.rate_rad_s(0.0) * scale_s * scale_s;
        const bool far = std::abs(t) > most_s;
        t = std::clamp(t, -most_s, most_s);
        for (int i = 0; i < 8 && !far; ++i) {
            t = std::clamp(t - series.rate_rad_s(t) / series.acceleration_rad_s2(t), -most_s, most_s);
        }
        gain_rad += series.gain_rad(t);
        time_s += t;
        if (!far && std::abs(t) < most_s) return gain_rad;
    }
    throw RunError(fmt::format("an input of {:.4g} rad/s leaves the phase without a turn", device.input_rate_rad_s));
}

}  // namespace

TurnKicks::TurnKicks(const gyro::Setup& setup) {
    const gyro::Device device(setup);
    if (device.coupling.b_rad_s == 0.0) return;
    constexpr std::size_t phases = 31;  // full lanes, together with the integration to the middle
    std::vector<double> theta_rad(phases);
    for (std::size_t j = 0; j < phases; ++j) {
        theta_rad[j] = units::two_pi * static_cast<double>(j) / static_cast<double>(phases) + device.coupling.phase_rad;
    }
    // Minima, then maxima; before, then after.
    const auto halves = values_of(
        {HalfKick(device, -1, 1), HalfKick(device, 1, 0), HalfKick(device, 1, 1), HalfKick(device, -1, 0)}, theta_rad);
    // Half cycles of different lengths have different accelerations: the gain to the zero-rate point has a kink where
    // that point is the dither's turn.
    kinked_ = device.positive_duration_s != device.negative_duration_s;
    Eigen::Matrix<double, Eigen::Dynamic, 2 * harmonics + 1> basis(phases, 2 * harmonics + 1);
    for (std::size_t parity = 0; parity < 2; ++parity) {
        const int direction = parity == 0 ? 1 : -1;
        for (const bool late : {false, true}) {
            Sides& sides = series_[parity][late ? 1 : 0];
            if (late && !kinked_) {
                sides = series_[parity][0];
                continue;
            }
            Eigen::Matrix<double, Eigen::Dynamic, 2> values(phases, 2);
            for (std::size_t j = 0; j < phases; ++j) {
                const double psi = theta_rad[j] - device.coupling.phase_rad;
                const double gain = to_zero_rate(device, direction, late, psi);
                for (std::size_t k = 0; k <= harmonics; ++k) {
                    const double angle = static_cast<double>(k) * (psi + gain);
                    basis(j, k) = std::cos(angle);
                    if (k > 0) basis(j, harmonics + k) = std::sin(angle);
                }
                values(j, 0) = halves[2 * parity][j] + gain;
                values(j, 1) = halves[2 * parity + 1][j] - gain;
            }
            const Eigen::MatrixXd c = dense::least_squares(basis, values);
            for (std::size_t side = 0; side < 2; ++side) {
                for (std::size_t k = 0; k <= harmonics; ++k) {
                    sides[side][k] = Complex(c(k, side), k > 0 ? -c(harmonics + k, side) : 0.0);
                }
            }
        }
        const gyro::Coupling& coupling = device.coupling;
        const double b = coupling.b_rad_s * (1.0 + direction * coupling.turn_asymmetry);
        const gyro::HalfCycle half = device.half_cycle(direction, device.dither_amplitude_rad);
        turn_rate_[parity] = {half.drive_rate_rad_s(0.0), Complex(0.0, -b) * std::polar(1.0, coupling.phase_rad),
                              Complex(0.0, -b * coupling.second_ratio) * std::polar(1.0, coupling.second_phase_rad)};
    }
    count_terms();
}

void TurnKicks::count_terms() {
    constexpr double matters_rad = 1e-12;
    terms_ = harmonics;
    const auto matters = [&](std::size_t k) {
        for (const auto& sides : {series_[0][0], series_[0][1], series_[1][0], series_[1][1]}) {
            for (const Series& c : sides) {
                if (static_cast<double>(k) * std::abs(c[k]) > matters_rad) return true;
            }
        }
        return false;
    };
    while (terms_ > 0 && !matters(terms_)) --terms_;
}

void TurnKicks::add(double weight, const TurnKicks& other) {
    kinked_ = kinked_ || other.kinked_;
    for (std::size_t parity = 0; parity < 2; ++parity) {
        for (std::size_t k = 0; k < turn_rate_[parity].size(); ++k) {
            turn_rate_[parity][k] += weight * other.turn_rate_[parity][k];
        }
        for (std::size_t late = 0; late < 2; ++late) {
            for (std::size_t side = 0; side < 2; ++side) {
                for (std::size_t k = 0; k <= harmonics; ++k) {
                    series_[parity][late][side][k] += weight * other.series_[parity][late][side][k];
                }
            }
        }
    }
    count_terms();
}

double TurnKicks::turn_rate_rad_s(int direction, Complex turned) const {
    const auto& c = turn_rate_[direction > 0 ? 0 : 1];
    return c[0].real() + (c[1] * turned).real() + (c[2] * turned * turned).real();
}

TurnKicks::Kick TurnKicks::at(int direction, Complex turned, const Weights* weights) const {
    return at(direction, turned, kinked_ && direction * turn_rate_rad_s(direction, turned) < 0.0, weights);
}

double TurnKicks::phase_after(int direction, double plain_rad) const {
    double psi = plain_rad;
    for (int k = 0; k < 8; ++k) {
        const Kick kick = at(direction, psi);
        psi -= (psi - kick.before_rad - plain_rad) / (1.0 - kick.before_slope);
    }
    return psi;
}

TurnKicks::Kick TurnKicks::at(int direction, Complex turned, bool late, const Weights* weights) const {
    const Sides& sides = series_[direction > 0 ? 0 : 1][late ? 1 : 0];
    const auto sum = [&](const Series& c, double& value, double& slope, double& curvature) {
        // Real and imaginary parts, since the product of std::complex checks for infinities.
        const double re = turned.real();
        const double im = turned.imag();
        double v_re = 0.0;
        double v_im = 0.0;
        double s_re = 0.0;
        double s_im = 0.0;
        double t_re = 0.0;
        double t_im = 0.0;
        for (std::size_t k = terms_; k >= 1; --k) {
            const auto order = static_cast<double>(k);
            const double v = v_re * re - v_im * im + c[k].real();
            v_im = v_re * im + v_im * re + c[k].imag();
            v_re = v;
            const double s = s_re * re - s_im * im + order * c[k].real();
            s_im = s_re * im + s_im * re + order * c[k].imag();
            s_re = s;
            const double t = t_re * re - t_im * im + order * order * c[k].real();
            t_im = t_re * im + t_im * re + order * order * c[k].imag();
            t_re = t;
        }
        value = c[0].real() + v_re * re - v_im * im;
        slope = -(s_re * im + s_im * re);
        curvature = -(t_re * re - t_im * im);
    };
    Kick kick{};
    sum(sides[0], kick.before_rad, kick.before_slope, kick.before_curvature);
    sum(sides[1], kick.after_rad, kick.after_slope, kick.after_curvature);
    for (std::size_t k = 1; k <= terms_ && weights != nullptr; ++k) {
        const Complex weight = (*weights)[k - 1];
        kick.before_weighted += sides[0][k].real() * weight.real() - sides[0][k].imag() * weight.imag();
    }
    return kick;
}

namespace {

/// Chebyshev nodes on [-1, 1] for the exact values, and the weight of each node in each power.
struct Nodes {
    explicit Nodes(int count) : at(static_cast<std::size_t>(count)) {
        Eigen::MatrixXd powers(count, count);
        for (Eigen::Index j = 0; j < count; ++j) {
            const double x =
                count == 1 ? 0.0 : -std::cos(units::pi * static_cast<double>(j) / static_cast<double>(count - 1));
            at[static_cast<std::size_t>(j)] = x;
            for (Eigen::Index k = 0; k < count; ++k) powers(j, k) = std::pow(x, static_cast<double>(k));
        }
        weights = dense::inverse(powers);
    }
    double weight(std::size_t power, std::size_t node) const {
        return weights(static_cast<Eigen::Index>(power), static_cast<Eigen::Index>(node));
    }
    std::vector<double> at;
    Eigen::MatrixXd weights;
};

}  // namespace

KicksOverRange::KicksOverRange(const gyro::Setup& setup, Range rate_deg_h, Range threshold)
    : rate_deg_h_(rate_deg_h), threshold_(threshold) {
    const gyro::Device device(setup);
    // Shift of the zero-rate points over the time within which the phase turns.
    const double moves = device.phase_per_arcsec * rate_deg_h_.reach /
                         std::sqrt(device.half_cycle(1, device.dither_amplitude_rad).end_acceleration_rad_s2());
    const Nodes rates(rate_deg_h_.reach == 0.0 ? 1 : moves < 0.03 ? 3 : moves < 0.3 ? 5 : moves < 1.0 ? 9 : 17);
    const double changes = threshold_.reach / threshold_.middle;
    const Nodes thresholds(changes == 0.0 ? 1 : changes < 0.003 ? 2 : changes < 0.05 ? 3 : 5);
    by_power_.assign(thresholds.at.size(), std::vector<TurnKicks>(rates.at.size()));
    for (std::size_t t = 0; t < thresholds.at.size(); ++t) {
        for (std::size_t r = 0; r < rates.at.size(); ++r) {
            gyro::Setup at = setup;
            at.input_rate_deg_h = rate_deg_h_.middle + rates.at[r] * rate_deg_h_.reach;
            at.lockin_threshold_deg_h *= threshold_.middle + thresholds.at[t] * threshold_.reach;
            const TurnKicks exact(at);
            for (std::size_t p = 0; p < by_power_.size(); ++p) {
                for (std::size_t q = 0; q < by_power_[p].size(); ++q) {
                    by_power_[p][q].add(thresholds.weight(p, t) * rates.weight(q, r), exact);
                }
            }
        }
    }
}

TurnKicks::Kick KicksOverRange::at(int direction, Complex turned, double rate_deg_h, double threshold,
                                   const TurnKicks::Weights* weights) const {
    const double x = rate_deg_h_.of(rate_deg_h);
    const double y = threshold_.of(threshold);
    bool late = false;
    if (by_power_.front().front().kinked_) {
        // Linear in both; there is no product of the two.
        double rate_rad_s = by_power_[0][0].turn_rate_rad_s(direction, turned);
        if (by_power_[0].size() > 1) rate_rad_s += x * by_power_[0][1].turn_rate_rad_s(direction, turned);
        if (by_power_.size() > 1) rate_rad_s += y * by_power_[1][0].turn_rate_rad_s(direction, turned);
        late = direction * rate_rad_s < 0.0;
    }
    TurnKicks::Kick sum{};
    for (std::size_t p = by_power_.size(); p-- > 0;) {
        TurnKicks::Kick over_rates{};
        for (std::size_t q = by_power_[p].size(); q-- > 0;) {
            over_rates = by_power_[p][q].at(direction, turned, late, weights).plus(x, over_rates);
        }
        sum = over_rates.plus(y, sum);
    }
    return sum;
}

}  // namespace ringlock::closure
