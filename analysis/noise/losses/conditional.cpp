#include "analysis/noise/losses/conditional.hpp"

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::noise {
namespace {

using Complex = std::complex<double>;

/// Of the real and of the imaginary series apart.
Complex products(const Pair& a, const Pair& b) {
    double real = 0.0;
    double imaginary = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) {
        real += a[i].real() * b[i].real();
        imaginary += a[i].imag() * b[i].imag();
    }
    return {real, imaginary};
}
Complex times_apart(Complex a, Complex b) { return {a.real() * b.real(), a.imag() * b.imag()}; }
Complex ratio_apart(Complex a, Complex b) {
    return {b.real() > 0.0 ? a.real() / b.real() : 0.0, b.imag() > 0.0 ? a.imag() / b.imag() : 0.0};
}

}  // namespace

CoefficientNoise::CoefficientNoise(std::vector<double> variance, double angle_noise)
    : inverse_(variance.size() + 1), end_(variance.size() + 1), angle_noise_(angle_noise) {
    const std::size_t n = inverse_.size();
    std::array<double, 2> sum{};
    for (std::size_t j = 1; j < n; ++j) {
        inverse_[j] = 1.0 / variance[j - 1];
        end_[j] = 2.0 / std::sqrt(static_cast<double>(n)) *
                  std::cos(0.5 * units::pi * static_cast<double>(j) / static_cast<double>(n));
        sum[j % 2] += end_[j] * end_[j] * inverse_[j];
    }
    for (std::size_t p = 0; p < 2; ++p) weight_[p] = angle_noise / (1.0 + angle_noise * sum[p]);
}

void CoefficientNoise::weigh(Pair& z) const {
    std::array<Complex, 2> sum{};
    z[0] = 0.0;
    for (std::size_t j = 1; j < z.size(); ++j) {
        z[j] *= inverse_[j];
        sum[j % 2] += end_[j] * z[j];
    }
    if (!(angle_noise_ > 0.0)) return;
    for (std::size_t p = 0; p < 2; ++p) sum[p] *= weight_[p];
    for (std::size_t j = 1; j < z.size(); ++j) z[j] -= inverse_[j] * end_[j] * sum[j % 2];
}

void CoefficientNoise::spread(Pair& z, std::size_t from) const {
    for (std::size_t j = 0; j < z.size(); ++j) z[j] /= inverse_[std::max(j, from)];
}

void CoefficientNoise::colour(Pair& deviates, random::NormalStream& ends) const {
    const double size = std::sqrt(angle_noise_);
    std::array<Complex, 2> errors;
    for (Complex& e : errors) {
        const double real = ends();
        e = size * Complex(real, ends());
    }
    deviates[0] = 0.0;
    for (std::size_t j = 1; j < deviates.size(); ++j) {
        deviates[j] = deviates[j] / std::sqrt(inverse_[j]) + end_[j] * errors[j % 2];
    }
}

void CoefficientNoise::add_ends(const Pair& z, double times, Pair& to) const {
    std::array<Complex, 2> sum{};
    for (std::size_t j = 1; j < z.size(); ++j) sum[j % 2] += end_[j] * z[j];
    for (std::size_t j = 1; j < z.size(); ++j) to[j] += times * end_[j] * sum[j % 2];
}

Conditional::Conditional(std::size_t n, std::span<const Gap> gaps) : basis_(n) {
    for (const Gap& gap : gaps) {
        if (gap.mean_known) known_.push_back({index_.size(), index_.size() + gap.size(), true});
        for (std::size_t i = gap.begin; i < gap.end; ++i) index_.push_back(i);
        length_ += static_cast<double>(gap.size()) * static_cast<double>(gap.size());
    }
    length_ /= static_cast<double>(std::max<std::size_t>(1, index_.size()));
}

void Conditional::centre(Pair& missing) const {
    for (const Gap& gap : known_) {
        Complex sum = 0.0;
        for (std::size_t i = gap.begin; i < gap.end; ++i) sum += missing[i];
        sum /= static_cast<double>(gap.size());
        for (std::size_t i = gap.begin; i < gap.end; ++i) missing[i] -= sum;
    }
}

Pair Conditional::missing_of(Pair coefficients) {
    basis_.to_series(coefficients);
    Pair out(index_.size());
    for (std::size_t k = 0; k < index_.size(); ++k) out[k] = coefficients[index_[k]];
    centre(out);
    return out;
}

Pair Conditional::coefficients_of(const Pair& missing) {
    Pair out(basis_.size());
    for (std::size_t k = 0; k < index_.size(); ++k) out[index_[k]] = missing[k];
    basis_.to_coefficients(out);
    return out;
}

Pair Conditional::times_precision(const CoefficientNoise& noise, const Pair& missing) {
    Pair z = coefficients_of(missing);
    noise.weigh(z);
    return missing_of(std::move(z));
}

/// Multiplies by an approximate inverse of the conditional precision. The missing rates of a long gap have nearly the
/// covariance of a record of the length of the gap: that of the noise, without fluctuations slower than the gap. Single
/// missing rates all have the same precision and need no preconditioner.
Pair Conditional::preconditioned(const CoefficientNoise& noise, const Pair& rest) {
    constexpr double long_gap = 4.0;
    if (length_ < long_gap) return rest;
    Pair z = coefficients_of(rest);
    noise.spread(z, std::max<std::size_t>(1, static_cast<std::size_t>(static_cast<double>(z.size()) / length_)));
    return missing_of(std::move(z));
}

void Conditional::solve(const CoefficientNoise& noise, const Pair& b, Pair& x) {
    constexpr int most_steps = 400;
    constexpr double enough = 1e-3;  // of the fall of x^T P_mm x - 2 b^T x, whose scale is 1, in one step
    Pair rest = times_precision(noise, x);
    for (std::size_t i = 0; i < x.size(); ++i) rest[i] = b[i] - rest[i];
    Pair direction = preconditioned(noise, rest);
    Complex norm = products(rest, direction);
    for (int step = 0; step < most_steps; ++step) {
        ++steps_;
        const Pair image = times_precision(noise, direction);
        const Complex length = ratio_apart(norm, products(direction, image));
        const Complex fall = times_apart(length, norm);
        for (std::size_t i = 0; i < x.size(); ++i) {
            x[i] += times_apart(length, direction[i]);
            rest[i] -= times_apart(length, image[i]);
        }
        if (fall.real() + fall.imag() < enough) return;
        const Pair better = preconditioned(noise, rest);
        const Complex next = products(rest, better);
        const Complex keep = ratio_apart(next, norm);
        for (std::size_t i = 0; i < x.size(); ++i) direction[i] = better[i] + times_apart(keep, direction[i]);
        norm = next;
    }
}

void Conditional::complete(const CoefficientNoise& noise, Pair& coefficients) {
    Pair weighed = coefficients;
    noise.weigh(weighed);
    Pair b = missing_of(std::move(weighed));
    for (Complex& v : b) v = -v;
    Pair x(b.size());
    solve(noise, b, x);
    const Pair added = coefficients_of(x);
    for (std::size_t j = 0; j < coefficients.size(); ++j) coefficients[j] += added[j];
}

}  // namespace ringlock::noise
