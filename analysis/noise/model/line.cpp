#include "analysis/noise/model/line.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::noise {
namespace {

using units::pi;
constexpr double fewest_half_periods = 8.0;
constexpr double apart = 4.0;  // coefficients between two lines
constexpr std::ptrdiff_t reach = 8;

/// Sine and cosine of pi index/2, each to the last digit near its zeros.
struct HalfTurns {
    double sine, cosine;
};
HalfTurns half_turns(double index) {
    const double whole = std::round(0.5 * index);
    const double rest = index - 2.0 * whole;  // -1 to 1
    const double sign = std::fmod(whole, 2.0) == 0.0 ? 1.0 : -1.0;
    return {sign * std::sin(0.5 * pi * rest), sign * std::sin(0.5 * pi * (1.0 - std::abs(rest)))};
}

}  // namespace

std::vector<double> coefficient_variances(const Spectrum& spectrum, const Maximum& model) {
    const CorrelatedShape shape(model.theta[log_time], spectrum.samples);
    std::vector<double> at_bin;
    for (const Bin& b : spectrum.bins) {
        double v = model.theta[correlated] > 0.0 ? model.theta[correlated] * shape(b.sin2).shape : 0.0;
        for (std::size_t i = 0; i < b.shape.size(); ++i) v += model.theta[i] * b.shape[i];
        at_bin.push_back(std::log(v));
    }
    std::vector<double> out(spectrum.z.size());
    std::size_t right = 0;
    for (std::size_t j = 1; j <= out.size(); ++j) {
        const double x = spectrum.x(j);
        while (right + 1 < spectrum.bins.size() && spectrum.bins[right].x < x) ++right;
        double v = at_bin[right];
        if (right > 0) {
            const double x0 = spectrum.bins[right - 1].x;
            const double x1 = spectrum.bins[right].x;
            v = at_bin[right - 1] + (at_bin[right] - at_bin[right - 1]) * (x - x0) / (x1 - x0);
        }
        out[j - 1] = std::exp(v);
    }
    return out;
}

std::vector<double> residual(const Spectrum& spectrum, const Maximum& model) {
    std::vector<double> out = spectrum.z;
    for (std::size_t j = 1; j <= out.size(); ++j) {
        out[j - 1] -= model.ramp * spectrum.ramp(j) + model.corner[j % 2] * spectrum.corner(j);
    }
    return out;
}

double Line::amplitude() const { return std::hypot(cosine, sine); }

double Line::amplitude_variance() const {
    return (cosine * cosine * covariance[0][0] + 2.0 * cosine * sine * covariance[0][1] +
            sine * sine * covariance[1][1]) /
           (cosine * cosine + sine * sine);
}

LineFinder::LineFinder(std::size_t samples) : samples_(samples), cos_half_(samples - 1), sin_half2_(samples - 1) {
    for (std::size_t j = 1; j < samples; ++j) {
        const double half = 0.5 * pi * static_cast<double>(j) / static_cast<double>(samples);
        const double s = std::sin(half);
        cos_half_[j - 1] = std::cos(half);
        sin_half2_[j - 1] = s * s;
    }
}

/// Calls visit(j, column, its derivative by the index).
template <class Visit>
void LineFinder::columns(double index, const Visit& visit) const {
    // At a whole index the column of like parity is a limit of 0/0.
    constexpr double off = 1e-7;
    const double nearest = std::round(index);
    if (std::abs(index - nearest) < off) index = nearest + (index < nearest ? -off : off);
    const auto n = static_cast<double>(samples_);
    const double turn = pi / n;  // theta and phi are this times index and j
    const double sin_theta_half = std::sin(0.5 * turn * index);
    const double sin_theta = std::sin(turn * index);
    const double rising = 0.5 / std::tan(0.5 * turn * index);
    const HalfTurns beta = half_turns(index);
    const double scale = 2.0 * std::sqrt(2.0 / n) * sin_theta_half;
    for (std::size_t j = 1; j < samples_; ++j) {
        const double from = index - static_cast<double>(j);
        const double difference = std::abs(from) < 32.0 ? 2.0 * std::sin(0.5 * turn * from) *
                                                              std::sin(0.5 * turn * (index + static_cast<double>(j)))
                                                        : 2.0 * (sin_theta_half * sin_theta_half - sin_half2_[j - 1]);
        const double g = scale * cos_half_[j - 1] / difference;
        const double slope = turn * (rising - sin_theta / difference);
        if (j % 2 == 0) {
            visit(j, g * beta.sine, g * (0.5 * pi * beta.cosine + beta.sine * slope));
        } else {
            visit(j, g * beta.cosine, g * (-0.5 * pi * beta.sine + beta.cosine * slope));
        }
    }
}

std::optional<Line> LineFinder::strongest(std::span<const double> residual, std::span<const double> variance,
                                          std::span<const Line> taken) const {
    // Near its place the column of a line goes as 1/(index - j) among the coefficients of each parity.
    const auto first = static_cast<std::ptrdiff_t>(2.0 * fewest_half_periods);
    const auto last = 2 * (static_cast<std::ptrdiff_t>(samples_) - reach);
    std::optional<Line> best;
    for (std::ptrdiff_t halves = first; halves <= last; ++halves) {
        const double index = 0.5 * static_cast<double>(halves);
        if (std::any_of(taken.begin(), taken.end(),
                        [&](const Line& line) { return std::abs(line.index - index) < apart; })) {
            continue;
        }
        std::array<double, 2> data{};
        std::array<double, 2> norm{};
        const std::ptrdiff_t middle = halves / 2;
        for (std::ptrdiff_t j = middle - reach + 1; j <= middle + reach; ++j) {
            const auto parity = static_cast<std::size_t>(j % 2);
            const double from = index - static_cast<double>(j);
            double column = 0.0;
            if (from != 0.0) {
                // at a whole index the coefficient there is all that its parity has
                if (halves % 2 == 0 && j % 2 == middle % 2) continue;
                column = 1.0 / from;
            } else {
                column = 1.0;
            }
            const auto at = static_cast<std::size_t>(j - 1);
            if (at >= residual.size()) continue;
            data[parity] += column * residual[at] / variance[at];
            norm[parity] += column * column / variance[at];
        }
        double gain = 0.0;
        for (std::size_t p = 0; p < 2; ++p) gain += norm[p] > 0.0 ? data[p] * data[p] / norm[p] : 0.0;
        if (!best || gain > best->gain) best = Line{.index = index, .gain = gain};
    }
    return best;
}

void LineFinder::refine(Line& line, std::span<const double> residual, std::span<const double> variance) const {
    constexpr int most_steps = 30;
    for (int step = 0; step < most_steps; ++step) {
        std::array<double, 2> cc{}, cr{}, dc{}, dr{}, dd{};  // column c, its derivative d, residual r; by parity
        columns(line.index, [&](std::size_t j, double c, double d) {
            const std::size_t p = j % 2;
            const double w = 1.0 / variance[j - 1];
            const double r = residual[j - 1];
            cc[p] += c * c * w;
            cr[p] += c * r * w;
            dc[p] += d * c * w;
            dr[p] += d * r * w;
            dd[p] += d * d * w;
        });
        line.cosine = cr[0] / cc[0];
        line.sine = cr[1] / cc[1];
        line.gain = cr[0] * line.cosine + cr[1] * line.sine;
        const std::array<double, 2> size = {line.cosine, line.sine};
        Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
        double slope = 0.0;
        for (Eigen::Index p = 0; p < 2; ++p) {
            const auto at = static_cast<std::size_t>(p);
            information(p, p) = cc[at];
            information(p, 2) = information(2, p) = size[at] * dc[at];
            information(2, 2) += size[at] * size[at] * dd[at];
            slope += size[at] * (dr[at] - size[at] * dc[at]);
        }
        const Eigen::Matrix3d inverse = information.inverse();
        for (Eigen::Index a = 0; a < 3; ++a) {
            for (Eigen::Index b = 0; b < 3; ++b) {
                line.covariance[static_cast<std::size_t>(a)][static_cast<std::size_t>(b)] = inverse(a, b);
            }
        }
        // The amplitudes are at their best, so only the index is off.
        const double change = std::clamp(inverse(2, 2) * slope, -0.25, 0.25);
        if (!std::isfinite(change) || std::abs(change) < 1e-3 * std::sqrt(inverse(2, 2)) || std::abs(change) < 1e-9) {
            return;
        }
        line.index = std::clamp(line.index + change, 1.0, static_cast<double>(samples_) - 1.0);
    }
}

void LineFinder::add(const Line& line, double times, std::span<double> z) const {
    columns(line.index, [&](std::size_t j, double column, double) {
        z[j - 1] += times * (j % 2 == 0 ? line.cosine : line.sine) * column;
    });
}

double line_price(std::size_t samples, double significance) {
    const double trials = static_cast<double>(samples) * std::sqrt(pi / 12.0);
    double z = 1.0;
    for (int i = 0; i < 50; ++i) z = std::max(1.0, std::log(trials * std::sqrt(z) / significance));
    return 2.0 * z;
}

}  // namespace ringlock::noise
