#include "engine/propagate/turn_tables.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <initializer_list>

#include "engine/core/error.hpp"
#include "engine/propagate/chebyshev.hpp"
#include "engine/propagate/half_turn.hpp"

namespace ringlock::propagate {

namespace {

constexpr std::size_t variables = TurnTables::variables;
using Values = std::array<double, 3>;  // shift in fringes, Re z, Im z

/// Results of exact_half_turns at points of the ranges.
class KickSource {
   public:
    KickSource(const gyro::Device& device, double sign, int end, const std::array<Range, variables>& ranges)
        : device_(device), sign_(sign), end_(end), ranges_(ranges) {}

    std::vector<Values> at(const std::vector<Point>& points) const {
        std::vector<HalfTurnProblem> problems;
        for (const Point& point : points) {
            // Amplitude and change as seen from the turn: the half cycle's own amplitude is that in its middle.
            const double change_rad = value(3, point);
            gyro::HalfCycle half = device_.half_cycle(sign_, value(0, point) + 0.5 * change_rad);
            half.amplitude_change_rad = end_ == 0 ? change_rad : -change_rad;
            half.rate_rad_s = value(1, point);
            gyro::Coupling coupling = device_.coupling;
            coupling.b_rad_s = value(2, point);
            problems.push_back(end_ == 0 ? beginning(half, coupling) : ending(half, coupling));
        }
        std::vector<HalfTurn> turns(problems.size());
        exact_half_turns(problems, turns);
        std::vector<Values> values;
        for (std::size_t i = 0; i < turns.size(); ++i) {
            // Half of the half cycle's plain phase is taken out by the user; a harmonic and a change of the amplitude
            // make the two halves unequal.
            const gyro::HalfCycle& half = problems[i].half;
            const double unequal = half.amplitude_rad * half.harmonic_ratio * std::cos(half.harmonic_phase_rad) +
                                   half.amplitude_change_rad * (1.0 / units::pi - 0.5);
            values.push_back({(turns[i].shift_rad + unequal) / units::two_pi, turns[i].z.real(), turns[i].z.imag()});
        }
        return values;
    }

   private:
    double value(std::size_t variable, const Point& point) const {
        const Range& range = ranges_[variable];
        return 0.5 * ((range.highest + range.lowest) + point[variable] * (range.highest - range.lowest));
    }

    const gyro::Device& device_;
    double sign_;
    int end_;
    const std::array<Range, variables>& ranges_;
};

/// Polynomial of a part for one gyro: [change][coupling][rate][amplitude].
struct Polynomial {
    Terms terms = one_term;
    std::vector<Values> coefficients;

    Values at(const Point& point) const {
        Values sum{};
        std::size_t i = 0;
        double fourth = 1.0;
        for (std::size_t e = 0; e < terms[3]; ++e, fourth *= point[3]) {
            double third = fourth;
            for (std::size_t c = 0; c < terms[2]; ++c, third *= point[2]) {
                double second = third;
                for (std::size_t b = 0; b < terms[1]; ++b, second *= point[1]) {
                    double first = second;
                    for (std::size_t a = 0; a < terms[0]; ++a, first *= point[0], ++i) {
                        for (std::size_t k = 0; k < 3; ++k) sum[k] += first * coefficients[i][k];
                    }
                }
            }
        }
        return sum;
    }
};

/// Leaves out Chebyshev terms of high orders in both amplitude and change, as long as all of them together change a
/// half turn by no more than `negligible_rad`. The higher the order in the change, the fewer in the amplitude are kept.
void leave_out_negligible(Polynomial& polynomial, double negligible_rad) {
    const std::size_t amplitudes = polynomial.terms[0];
    const std::size_t changes = polynomial.terms[3];
    const std::size_t others = polynomial.terms[1] * polynomial.terms[2];
    const auto size_rad = [&](std::size_t change, std::size_t amplitude) {
        double rad = 0.0;
        for (std::size_t other = 0; other < others; ++other) {
            const Values& c = polynomial.coefficients[(change * others + other) * amplitudes + amplitude];
            rad += std::max(units::two_pi * std::abs(c[0]), 2.0 * std::hypot(c[1], c[2]));
        }
        return rad;
    };
    std::vector<std::size_t> kept(changes, amplitudes);
    double left_out_rad = 0.0;
    for (;;) {
        // The smallest of the highest terms that are still kept.
        std::size_t smallest = changes;
        double smallest_rad = negligible_rad - left_out_rad;
        for (std::size_t e = 0; e < changes; ++e) {
            if (kept[e] < 2 || (e + 1 < changes && kept[e] == kept[e + 1])) continue;
            const double rad = size_rad(e, kept[e] - 1);
            if (rad < smallest_rad) {
                smallest_rad = rad;
                smallest = e;
            }
        }
        if (smallest == changes) break;
        left_out_rad += smallest_rad;
        --kept[smallest];
    }
    for (std::size_t i = 0; i < polynomial.coefficients.size(); ++i) {
        if (i % amplitudes >= kept[i / amplitudes / others]) polynomial.coefficients[i] = {};
    }
}

/// `negligible_rad`: by how much a half turn may differ from the interpolation where its amplitude changes.
Polynomial interpolate(const KickSource& source, const Terms& terms, double negligible_rad) {
    Polynomial polynomial{terms, source.at(chebyshev_nodes(terms))};
    const std::span<double> values(polynomial.coefficients.data()->data(), 3 * polynomial.coefficients.size());
    if (terms[3] == 1) {
        nodes_to_powers(terms, 3, values);
        return polynomial;
    }
    nodes_to_chebyshev(terms, 3, values);
    leave_out_negligible(polynomial, negligible_rad);
    chebyshev_to_powers(terms, 3, values);
    return polynomial;
}

/// Largest error of a turn, two half turns, at the points [rad].
double error_rad(const KickSource& source, const Polynomial& polynomial, const std::vector<Point>& points) {
    const std::vector<Values> exact = source.at(points);
    double worst = 0.0;
    for (std::size_t i = 0; i < points.size(); ++i) {
        const Values table = polynomial.at(points[i]);
        // A half turn's phase depends on shift directly and on z through 2 arg(1 + z ...).
        worst = std::max({worst, units::two_pi * std::abs(exact[i][0] - table[0]),
                          2.0 * std::hypot(exact[i][1] - table[1], exact[i][2] - table[2])});
    }
    return 2.0 * worst;
}

/// Terms that one variable takes by itself, the others in the middle of their ranges.
std::size_t terms_needed(const KickSource& source, std::size_t variable, double tolerance_rad) {
    for (const std::size_t n : {2U, 3U, 4U, 5U, 6U, 8U, 10U, 12U, 14U, 17U, 20U, 24U, 28U}) {
        Terms terms = one_term;
        terms[variable] = n;
        const Polynomial polynomial = interpolate(source, terms, 0.0);
        std::vector<Point> points;
        for (int i = 0; i <= 4; ++i) {  // between the nodes and at the ends
            Point point{};
            point[variable] = -std::cos(units::pi * static_cast<double>(i) / 4.0 * 0.998 + 0.003);
            points.push_back(point);
        }
        if (error_rad(source, polynomial, points) <= 0.5 * tolerance_rad) return n;
    }
    return TurnTables::most_nodes;
}

/// The two halves of a turn bend the phase by an argument of up to asin |z| each: together by more than pi/4, where the
/// two ways to the arctangent begin to differ, from |z| = sin(pi/8) = 0.3827 on, anywhere in the ranges.
bool is_strong(const Polynomial& polynomial) {
    double re = 0.0;
    double im = 0.0;
    for (const Values& values : polynomial.coefficients) {
        re += std::abs(values[1]);
        im += std::abs(values[2]);
    }
    return std::hypot(re, im) > 0.38;
}

}  // namespace

void TurnTables::make(std::size_t lane, const gyro::Device& device, const HalfCycleRanges& wanted) {
    if (device.coupling.second_ratio != 0.0) {
        throw RunError(
            fmt::format("turn map: a coupling with a second harmonic, {:.3g} of the first, is no Moebius map",
                        device.coupling.second_ratio));
    }
    ++made_;
    ranges_[lane] = wanted;
    const std::array<Range, variables> ranges{wanted.amplitude_rad, wanted.rate_rad_s, wanted.b_rad_s,
                                              wanted.amplitude_change_rad};
    for (std::size_t v = 0; v < variables; ++v) {
        const double width = ranges[v].highest - ranges[v].lowest;
        centre_[v][lane] = 0.5 * (ranges[v].highest + ranges[v].lowest);
        inverse_[v][lane] = width > 0.0 ? 2.0 / width : 0.0;
    }
    changing_ = changing_ || inverse_[3][lane] > 0.0;
    const bool alike = device.harmonic_ratio == 0.0 && device.coupling.turn_asymmetry == 0.0;
    if (!alike && symmetric_) {  // the gyros before have only one end so far, which is both
        for (std::size_t i = 0; i < 4; i += 2) parts_[i + 1] = parts_[i];
        symmetric_ = false;
    }
    for (const double sign : {1.0, -1.0}) {
        for (int end = 0; end < (symmetric_ ? 1 : 2); ++end) {
            const KickSource source(device, sign, end, ranges);
            Terms terms = one_term;
            for (std::size_t v = 0; v < variables; ++v) {
                if (inverse_[v][lane] > 0.0) terms[v] = terms_needed(source, v, tolerance_rad_);
            }
            Polynomial polynomial;
            double error = 0.0;
            for (;;) {
                const std::size_t largest = *std::max_element(terms.begin(), terms.end());
                polynomial = interpolate(source, terms, 0.25 * tolerance_rad_);
                error = error_rad(source, polynomial, points_between_nodes(terms));
                if (error <= tolerance_rad_) break;
                if (largest >= most_nodes) {
                    throw RunError(fmt::format(
                        "turn map: {} nodes over amplitudes {:.6g} to {:.6g} rad "
                        "and rates {:.6g} to {:.6g} rad/s leave an error of {:.3g} rad, above {:.3g}; "
                        "raise propagation.turn_map_tolerance_rad or narrow the spread of amplitudes and rates",
                        largest, ranges[0].lowest, ranges[0].highest, ranges[1].lowest, ranges[1].highest, error,
                        tolerance_rad_));
                }
                for (std::size_t v = 0; v < variables; ++v) terms[v] += terms[v] > 1 ? 1 : 0;
            }
            strong_ = strong_ || is_strong(polynomial);
            error_rad_[lane] = std::max(error_rad_[lane], error);
            put(parts_[index(sign, end)], lane, terms, polynomial.coefficients);
        }
    }
}

void TurnTables::put(Part& part, std::size_t lane, const Terms& terms,
                     const std::vector<std::array<double, 3>>& coefficients) {
    Terms grown{};
    for (std::size_t v = 0; v < variables; ++v) grown[v] = std::max(part.terms[v], terms[v]);
    // Calls with the number of a coefficient among `n` terms and among those that have grown, for all of the former.
    const auto for_each_of = [&grown](const Terms& n, const auto& action) {
        std::size_t i = 0;
        for (std::size_t e = 0; e < n[3]; ++e) {
            for (std::size_t c = 0; c < n[2]; ++c) {
                for (std::size_t b = 0; b < n[1]; ++b) {
                    for (std::size_t a = 0; a < n[0]; ++a, ++i) {
                        action(i, ((e * grown[2] + c) * grown[1] + b) * grown[0] + a);
                    }
                }
            }
        }
    };
    if (grown != part.terms || part.coefficients.empty()) {
        std::vector<simd::Lanes> moved(3 * grown[0] * grown[1] * grown[2] * grown[3]);
        if (!part.coefficients.empty()) {
            for_each_of(part.terms, [&](std::size_t from, std::size_t to) {
                for (std::size_t k = 0; k < 3; ++k) moved[3 * to + k] = part.coefficients[3 * from + k];
            });
        }
        part.terms = grown;
        part.coefficients = std::move(moved);
    }
    for (simd::Lanes& row : part.coefficients) row[lane] = 0.0;
    for_each_of(terms, [&](std::size_t from, std::size_t to) {
        for (std::size_t k = 0; k < 3; ++k) part.coefficients[3 * to + k][lane] = coefficients[from][k];
    });
    part.amplitude_terms.assign(grown[1] * grown[2] * grown[3], 1);
    for (std::size_t i = 0; i < part.coefficients.size(); ++i) {
        const double* row = part.coefficients[i].data();
        if (std::all_of(row, row + simd::lanes, [](double value) { return value == 0.0; })) continue;
        std::size_t& used = part.amplitude_terms[i / 3 / grown[0]];
        used = std::max(used, i / 3 % grown[0] + 1);
    }
}

std::size_t TurnTables::nodes() const {
    std::size_t most = 1;
    for (const Part& part : parts_) most = std::max(most, *std::max_element(part.terms.begin(), part.terms.end()));
    return most;
}

}  // namespace ringlock::propagate
