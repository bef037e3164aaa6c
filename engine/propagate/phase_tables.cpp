#include "engine/propagate/phase_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "engine/core/error.hpp"
#include "engine/gyro/fast_motion.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/fast_frame.hpp"
#include "engine/propagate/half_turn.hpp"

namespace ringlock::propagate {

namespace {

using Complex = std::complex<double>;

/// A half turn upright: from the turn at the beginning of a half cycle of sign +1 to its middle, in theta = psi +
/// coupling phase. psi -> -psi turns negative half cycles upright, theta(t) -> pi - theta(T - t) second halves.
struct Upright {
    gyro::HalfCycle half;
    gyro::Coupling coupling;  ///< coupling phase 0
    double fast_from_s = 0.0;
};

Upright upright(const gyro::HalfCycle& half, const gyro::Coupling& coupling, int end) {
    const HalfTurnProblem problem = end == 0 ? beginning(half, coupling) : ending(half, coupling);
    const double second = half.sign * coupling.second_from_first_rad();
    Upright turn{
        problem.half,
        {coupling.b_rad_s, 0.0, problem.turn_asymmetry, coupling.second_ratio, end == 0 ? second : units::pi - second}};
    // The frame is a series in the coupling over the rate.
    turn.fast_from_s = gyro::fast_motion_from_s(turn.half, gyro::strength_with_harmonics_rad_s(coupling));
    if (std::isnan(turn.fast_from_s)) {
        throw RunError(
            fmt::format("turn map: a half cycle of {:.1f} fringes at an input of {:.4g} rad/s "
                        "and a coupling of {:.4g} rad/s has no fast middle; use propagation.method = \"direct\"",
                        half.amplitude_rad / units::pi, half.rate_rad_s, coupling.b_rad_s));
    }
    return turn;
}

/// Re sum_k c_k exp(i k angle) and its derivative. The imaginary part of c_0 is the shift of a way back from the
/// middle.
struct Value {
    double value;
    double slope;
};
Value fourier(std::span<const Complex> c, double angle_rad) {
    const Complex w = std::polar(1.0, angle_rad);
    Complex sum;
    Complex slope;
    for (std::size_t k = c.size() - 1; k >= 1; --k) {
        sum = sum * w + c[k];
        slope = slope * w + static_cast<double>(k) * c[k];
    }
    return {c[0].real() + (sum * w).real(), -(slope * w).imag()};
}

/// Coefficients k < `count` of the function with these values at equidistant angles from 0 on.
std::vector<Complex> coefficients_of(std::span<const double> values, std::size_t count) {
    const std::size_t n = values.size();
    std::vector<Complex> c(count);
    for (std::size_t k = 0; k < count; ++k) {
        for (std::size_t j = 0; j < n; ++j) {
            const auto turned = static_cast<double>(k * j % n) / static_cast<double>(n);
            c[k] += values[j] * std::polar((k == 0 ? 1.0 : 2.0) / static_cast<double>(n), -units::two_pi * turned);
        }
    }
    c[0] = c[0].real();
    return c;
}

/// Half turns of one end of half cycles of one sign, at points of the ranges.
class PhaseSource {
   public:
    PhaseSource(const gyro::Device& device, double sign, int end, const std::array<Range, 3>& ranges,
                double tolerance_rad)
        : device_(device), sign_(sign), end_(end), ranges_(ranges), tolerance_rad_(tolerance_rad) {}

    /// Fourier coefficients [rad] at each point up to `harmonics`, [point][k], from `phases` equidistant phases each.
    /// Where `waves_only`, the part that all phases share is left out of k = 0.
    std::vector<Complex> at(const std::vector<Point>& points, std::size_t harmonics, std::size_t phases,
                            bool waves_only = false) const {
        // Every phase is integrated to where motion becomes fast, and one of them on to the middle: in between all
        // turn alike in the fast frame.
        std::vector<Upright> turns;
        std::vector<Stretch> stretches;
        std::vector<Stretch> to_middle;
        for (const Point& point : points) {
            turns.push_back(turn(point));
            const Upright& t = turns.back();
            for (std::size_t j = 0; j < phases; ++j) {
                const double fringes = static_cast<double>(j) / static_cast<double>(phases);
                stretches.push_back({t.half, t.coupling, fringes, t.fast_from_s});
            }
            to_middle.push_back({t.half, t.coupling, 0.0, 0.5 * t.half.duration_s});
        }
        const auto results = solve(stretches);
        if (waves_only) to_middle.clear();
        const auto middles = solve(to_middle);
        std::vector<Complex> all;
        std::vector<double> values(phases);
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Upright& t = turns[i];
            const FastFrame frame(t.half, t.coupling, t.fast_from_s);
            const double plain = t.half.plain_phase_rad(t.fast_from_s);
            for (std::size_t j = 0; j < phases; ++j) {
                const double start = units::two_pi * static_cast<double>(j) / static_cast<double>(phases);
                const double lockin = results[i * phases + j].lockin_rad;
                values[j] = lockin + frame.correction_rad(start + plain + lockin);
            }
            const double rotation = waves_only ? 0.0 : to_middle_rad(t, 0.0, middles[i].lockin_rad) - values[0];
            for (double& value : values) value += rotation;
            const auto c = end_ == 0 ? coefficients_of(values, harmonics + 1) : inverse(values, harmonics);
            all.insert(all.end(), c.begin(), c.end());
        }
        return all;
    }

    /// Half turns at the points, integrated all the way: the start, as an angle that the series takes, and the value
    /// that the series should give.
    struct Probe {
        std::size_t point;
        double angle_rad;
        double value_rad;
    };
    std::vector<Probe> probe(const std::vector<Point>& points) const {
        constexpr std::size_t phases = 2;
        std::vector<Upright> turns;
        std::vector<Stretch> stretches;
        for (std::size_t i = 0; i < points.size() * phases; ++i) {
            turns.push_back(turn(points[i / phases]));
            const double golden = 0.618034 * static_cast<double>(i);
            stretches.push_back(
                {turns[i].half, turns[i].coupling, golden - std::floor(golden), 0.5 * turns[i].half.duration_s});
        }
        const auto results = solve(stretches);
        std::vector<Probe> probes;
        for (std::size_t i = 0; i < turns.size(); ++i) {
            const double start = units::two_pi * stretches[i].start_fringes;
            const double value = to_middle_rad(turns[i], start, results[i].lockin_rad);
            probes.push_back({i / phases, end_ == 0 ? start : units::pi - start - value, value});
        }
        return probes;
    }

   private:
    Upright turn(const Point& point) const {
        gyro::HalfCycle half = device_.half_cycle(sign_, scaled(0, point));
        half.rate_rad_s = scaled(1, point);
        gyro::Coupling coupling = device_.coupling;
        coupling.b_rad_s = scaled(2, point);
        return upright(half, coupling, end_);
    }

    double scaled(std::size_t variable, const Point& point) const {
        const Range& range = ranges_[variable];
        return 0.5 * ((range.highest + range.lowest) + point[variable] * (range.highest - range.lowest));
    }

    std::vector<StretchResult> solve(const std::vector<Stretch>& stretches) const {
        std::vector<StretchResult> results(stretches.size());
        integrate(stretches, tolerance_rad_, results);
        return results;
    }

    /// phi at the middle less theta at the turn less half the plain phase.
    static double to_middle_rad(const Upright& t, double start_rad, double lockin_rad) {
        const double middle = 0.5 * t.half.duration_s;
        const double plain = t.half.plain_phase_rad(middle);
        const FastFrame frame(t.half, t.coupling, middle);
        // A harmonic of the dither makes the halves' plain phases unequal.
        const double unequal = t.half.amplitude_rad * t.half.harmonic_ratio * std::cos(t.half.harmonic_phase_rad);
        return lockin_rad + frame.correction_rad(start_rad + plain + lockin_rad) + unequal;
    }

    /// The way from the middle to the turn is that from the turn to the middle, reversed: with x = pi - theta and
    /// G the values at equidistant x, u = pi - x - G(x) and theta = u + G(x). Less the mean of G, the shift.
    static std::vector<Complex> inverse(std::span<const double> values, std::size_t harmonics) {
        const std::size_t n = values.size();
        auto forward = coefficients_of(values, n / 2);
        const double shift = forward[0].real();
        forward[0] = 0.0;
        std::vector<double> backward(n);
        for (std::size_t j = 0; j < n; ++j) {
            const double u = units::two_pi * static_cast<double>(j) / static_cast<double>(n);
            double x = units::pi - u;
            for (int i = 0; i < 12; ++i) {
                const Value g = fourier(forward, x);
                x += (units::pi - u - x - g.value) / (1.0 + g.slope);
            }
            backward[j] = units::pi - u - x;
        }
        auto c = coefficients_of(backward, harmonics + 1);
        c[0] = Complex(c[0].real(), shift);
        return c;
    }

    const gyro::Device& device_;
    double sign_;
    int end_;
    const std::array<Range, 3>& ranges_;
    double tolerance_rad_;
};

/// Fourier coefficients of the polynomials at a point.
std::vector<Complex> evaluate(const PhaseTables::LanePart& part, const Point& point) {
    std::vector<Complex> sum(part.harmonics + 1);
    std::size_t i = 0;
    double third = 1.0;
    for (std::size_t c = 0; c < part.terms[2]; ++c, third *= point[2]) {
        double second = third;
        for (std::size_t b = 0; b < part.terms[1]; ++b, second *= point[1]) {
            double first = second;
            for (std::size_t a = 0; a < part.terms[0]; ++a, first *= point[0]) {
                for (Complex& value : sum) value += first * part.coefficients[i++];
            }
        }
    }
    return sum;
}

PhaseTables::LanePart interpolate(const PhaseSource& source, const Terms& terms, std::size_t harmonics,
                                  std::size_t phases) {
    PhaseTables::LanePart part{terms, harmonics, source.at(chebyshev_nodes(terms), harmonics, phases)};
    // Complex numbers are pairs of doubles, one after the other.
    nodes_to_powers(terms, 2 * (harmonics + 1),
                    {reinterpret_cast<double*>(part.coefficients.data()), 2 * part.coefficients.size()});
    return part;
}

/// Largest error of a turn, two half turns, where the half turns were probed [rad].
double error_rad(const PhaseTables::LanePart& part, const std::vector<Point>& points,
                 const std::vector<PhaseSource::Probe>& probes) {
    double worst = 0.0;
    for (const PhaseSource::Probe& probe : probes) {
        const auto c = evaluate(part, points[probe.point]);
        const double shift = c[0].imag();
        worst = std::max(worst, std::abs(shift + fourier(c, probe.angle_rad + shift).value - probe.value_rad));
    }
    return 2.0 * worst;
}

/// Harmonics of the middle of the ranges that matter at this tolerance, and some.
std::size_t harmonics_needed(const PhaseSource& source, double tolerance_rad) {
    constexpr std::size_t most = PhaseTables::most_harmonics;
    const auto c = source.at({Point{}}, most, 2 * most + 8, true);
    double rest = 0.0;
    std::size_t k = most;
    while (k > 0 && rest + std::abs(c[k]) <= 0.01 * tolerance_rad) rest += std::abs(c[k--]);
    return std::min(k + 1, most);
}

/// Terms that one variable takes by itself, the others in the middle of their ranges: those of a Chebyshev series of
/// more.
std::size_t terms_needed(const PhaseSource& source, std::size_t variable, std::size_t harmonics, double tolerance_rad) {
    for (const std::size_t n : {8U, 16U, 24U}) {
        Terms terms = one_term;
        terms[variable] = n;
        const auto values = source.at(chebyshev_nodes(terms), harmonics, 2 * harmonics + 4);
        double rest = 0.0;
        std::size_t needed = n;
        while (needed > 1) {
            double largest = 0.0;  // over the harmonics
            for (std::size_t k = 0; k <= harmonics; ++k) {
                Complex term;
                for (std::size_t i = 0; i < n; ++i) {
                    const double angle = units::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(n);
                    term += values[i * (harmonics + 1) + k] * 2.0 / static_cast<double>(n) *
                            std::cos(static_cast<double>(needed - 1) * angle);
                }
                largest = std::max(largest, std::abs(term));
            }
            if (rest + largest > 0.05 * tolerance_rad) break;
            rest += largest;
            --needed;
        }
        if (needed + 1 < n) return std::max<std::size_t>(needed, 2);
    }
    return PhaseTables::most_nodes;
}

/// From the upright half turn to that of the half cycle itself: psi -> -psi, and fringes for radians.
void finish(PhaseTables::LanePart& part, double sign) {
    for (std::size_t i = 0; i < part.coefficients.size(); ++i) {
        Complex& c = part.coefficients[i];
        const double imaginary_sign = i % (part.harmonics + 1) == 0 ? sign : 1.0;
        c = Complex(sign * c.real(), imaginary_sign * c.imag()) / units::two_pi;
    }
}

}  // namespace

void PhaseTables::make(std::size_t lane, const gyro::Device& device, const HalfCycleRanges& wanted) {
    if (wanted.amplitude_change_rad.highest > wanted.amplitude_change_rad.lowest) {
        throw RunError(
            "turn map: series in the phase, for a coupling with a second harmonic, "
            "have no amplitude that changes over a half cycle");
    }
    ++made_;
    ranges_[lane] = wanted;
    const std::array<Range, variables> ranges{wanted.amplitude_rad, wanted.rate_rad_s, wanted.b_rad_s};
    for (std::size_t v = 0; v < variables; ++v) {
        const double width = ranges[v].highest - ranges[v].lowest;
        centre_[v][lane] = 0.5 * (ranges[v].highest + ranges[v].lowest);
        inverse_[v][lane] = width > 0.0 ? 2.0 / width : 0.0;
    }
    // Nodes well below the tolerance; rounding is some 1e-12 rad.
    const double node_tolerance_rad = std::max(0.01 * tolerance_rad_, 1e-13);
    for (const double sign : {1.0, -1.0}) {
        for (int end = 0; end < 2; ++end) {
            const PhaseSource source(device, sign, end, ranges, node_tolerance_rad);
            std::size_t harmonics = harmonics_needed(source, tolerance_rad_);
            Terms terms = one_term;
            for (std::size_t v = 0; v < variables; ++v) {
                if (inverse_[v][lane] > 0.0) terms[v] = terms_needed(source, v, harmonics, tolerance_rad_);
            }
            // Each point costs two ways through every fringe. Half of the points, corners and others in turn, will do.
            auto points = points_between_nodes(terms);
            points.resize(points.size() / 2);
            const auto probes = source.probe(points);
            LanePart part;
            double error = 0.0;
            for (;;) {
                part = interpolate(source, terms, harmonics, 2 * harmonics + 4);
                error = error_rad(part, points, probes);
                if (error <= tolerance_rad_) break;
                const std::size_t largest = *std::max_element(terms.begin(), terms.end());
                if (largest >= most_nodes || harmonics >= most_harmonics) {
                    throw RunError(fmt::format(
                        "turn map: {} harmonics and {} nodes over amplitudes {:.6g} to {:.6g} rad "
                        "and rates {:.6g} to {:.6g} rad/s leave an error of {:.3g} rad, above {:.3g}; "
                        "raise propagation.turn_map_tolerance_rad or narrow the spread of amplitudes and rates",
                        harmonics, largest, ranges[0].lowest, ranges[0].highest, ranges[1].lowest, ranges[1].highest,
                        error, tolerance_rad_));
                }
                for (std::size_t v = 0; v < variables; ++v) terms[v] += terms[v] > 1 ? 1 : 0;
                harmonics += 2;
            }
            error_rad_[lane] = std::max(error_rad_[lane], error);
            finish(part, sign);
            const std::size_t at = index(sign, end);
            lane_parts_[at][lane] = std::move(part);
            lay_out(at);
        }
    }
}

void PhaseTables::lay_out(std::size_t at) {
    // Powers below this are left out, together less than a tenth of the tolerance.
    const double least = 1e-4 * tolerance_rad_ / units::two_pi;
    Part part;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const LanePart& from = lane_parts_[at][lane];
        if (from.coefficients.empty()) continue;
        part.resize(std::max(part.size(), from.harmonics + 1));
        std::size_t i = 0;
        for (std::size_t c = 0; c < from.terms[2]; ++c) {
            for (std::size_t b = 0; b < from.terms[1]; ++b) {
                for (std::size_t a = 0; a < from.terms[0]; ++a) {
                    for (std::size_t k = 0; k <= from.harmonics; ++k, ++i) {
                        if (std::abs(from.coefficients[i]) < least) continue;
                        Terms& terms = part[k].terms;
                        terms = {std::max(terms[0], a + 1), std::max(terms[1], b + 1), std::max(terms[2], c + 1), 1};
                    }
                }
            }
        }
    }
    for (std::size_t k = 0; k < part.size(); ++k) {
        Harmonic& harmonic = part[k];
        const Terms& n = harmonic.terms;
        harmonic.coefficients.resize(2 * n[0] * n[1] * n[2]);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const LanePart& from = lane_parts_[at][lane];
            if (from.coefficients.empty() || k > from.harmonics) continue;
            for (std::size_t c = 0; c < std::min(n[2], from.terms[2]); ++c) {
                for (std::size_t b = 0; b < std::min(n[1], from.terms[1]); ++b) {
                    for (std::size_t a = 0; a < std::min(n[0], from.terms[0]); ++a) {
                        const Complex value =
                            from.coefficients[((c * from.terms[1] + b) * from.terms[0] + a) * (from.harmonics + 1) + k];
                        // Left out for all lanes or none would make a lane's bits depend on its mates.
                        if (std::abs(value) < least) continue;
                        const std::size_t to = 2 * ((c * n[1] + b) * n[0] + a);
                        harmonic.coefficients[to][lane] = value.real();
                        harmonic.coefficients[to + 1][lane] = value.imag();
                    }
                }
            }
        }
    }
    parts_[at] = std::move(part);
}

std::size_t PhaseTables::nodes() const {
    std::size_t most = 1;
    for (const Part& part : parts_) {
        for (const Harmonic& harmonic : part)
            most = std::max(most, *std::max_element(harmonic.terms.begin(), harmonic.terms.end()));
    }
    return most;
}

std::size_t PhaseTables::harmonics() const {
    std::size_t most = 0;
    for (const Part& part : parts_) most = std::max(most, part.empty() ? 0 : part.size() - 1);
    return most;
}

}  // namespace ringlock::propagate
