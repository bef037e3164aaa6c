#include "analysis/noise/losses/filling.hpp"

#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>

#include "engine/random/stream.hpp"

namespace ringlock::noise {
namespace {

double real_product(const Pair& a, const Pair& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].real() * b[i].real();
    return sum;
}
double imaginary_product(const Pair& a, const Pair& b) {
    double sum = 0.0;
    for (std::size_t i = 0; i < a.size(); ++i) sum += a[i].imag() * b[i].imag();
    return sum;
}

}  // namespace

Filling::Filling(LossyRates rates, std::size_t pairs)
    : rates_(std::move(rates)), bridged_(cosine_spectrum(rates_.rate)) {
    for (std::size_t k = 0; k < pairs; ++k) {
        conditional_.emplace_back(rates_.rate.size(), rates_.gaps);
        missing_.emplace_back(conditional_.back().unknowns());
        coefficients_.emplace_back();
    }
}

double Filling::share_present() const {
    return 1.0 - static_cast<double>(rates_.unknowns()) / static_cast<double>(rates_.rate.size());
}

bool Filling::too_hard() const {
    constexpr double most = 3e8;  // rates times steps of conjugate gradients
    double steps = 0.0;
    for (const Conditional& c : conditional_) steps += static_cast<double>(c.steps());
    return steps * static_cast<double>(rates_.rate.size()) > most;
}

void Filling::solve(std::size_t pair, const CoefficientNoise& noise, const std::vector<double>& means) {
    const std::size_t n = noise.samples();
    Conditional& conditional = conditional_[pair];
    random::NormalStream normal({n, pair}, random::Purpose::missing_rates);
    Pair z(n);
    for (std::size_t j = 1; j < n; ++j) {
        const double real = normal();
        z[j] = {real, normal()};
    }
    noise.colour(z, normal);
    if (pair == 0) {
        for (std::size_t j = 1; j < n; ++j) z[j].real(means[j - 1] - bridged_.z[j - 1]);
    }
    noise.weigh(z);
    const Pair b = conditional.missing_of(std::move(z));
    Pair& x = missing_[pair];
    conditional.solve(noise, b, x);
    coefficients_[pair] = conditional.coefficients_of(x);
    const auto unknowns = static_cast<double>(rates_.unknowns());
    const double real = pair == 0 ? 1.0 : std::sqrt(unknowns / real_product(x, b));
    const double imaginary = std::sqrt(unknowns / imaginary_product(x, b));
    if (pair == 0) scale_of_sample_ = imaginary;
    for (auto& c : coefficients_[pair]) c = {real * c.real(), imaginary * c.imag()};
}

std::vector<double> Filling::completed() const {
    std::vector<double> out = rates_.rate;
    std::size_t k = 0;
    for (const Gap& gap : rates_.gaps) {
        for (std::size_t i = gap.begin; i < gap.end; ++i, ++k) {
            out[i] += missing_[0][k].real() + scale_of_sample_ * missing_[0][k].imag();
        }
    }
    return out;
}

Filled Filling::fill(const CoefficientNoise& noise, const std::vector<double>& means) {
    oneapi::tbb::parallel_for(std::size_t{0}, conditional_.size(),
                              [&](std::size_t pair) { solve(pair, noise, means); });
    Filled out{bridged_, bridged_};
    const std::size_t n = bridged_.samples;
    out.expected.spread.assign(n - 1, 0.0);
    for (std::size_t pair = 0; pair < conditional_.size(); ++pair) {
        for (std::size_t j = 1; j < n; ++j) {
            const std::complex<double> c = coefficients_[pair][j];
            const double square = c.imag() * c.imag() + (pair == 0 ? 0.0 : c.real() * c.real());
            out.expected.spread[j - 1] += square / draws();
        }
    }
    for (std::size_t j = 1; j < n; ++j) {
        out.expected.z[j - 1] += coefficients_[0][j].real();
        out.sample.z[j - 1] = out.expected.z[j - 1] + coefficients_[0][j].imag();
    }
    out.expected.sum_bins();
    out.sample.sum_bins();
    return out;
}

}  // namespace ringlock::noise
