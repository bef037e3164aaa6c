#include "analysis/findings/events.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <unsupported/Eigen/FFT>

#include "engine/core/units.hpp"

namespace ringlock::findings {
namespace {

using Complex = std::complex<double>;
using units::pi;

/// Sums over j = 1...n-1 of a_j exp(i pi j t/n) for t = 0...n. a_0 is not used.
std::vector<Complex> sums_over_half_turns(const std::vector<Complex>& a) {
    const std::size_t n = a.size();
    std::vector<Complex> padded(2 * n, 0.0);
    std::copy(a.begin() + 1, a.end(), padded.begin() + 1);
    std::vector<Complex> out(2 * n);
    Eigen::FFT<double> fft;
    fft.SetFlag(Eigen::FFT<double>::Unscaled);
    fft.inv(out.data(), padded.data(), static_cast<Eigen::Index>(2 * n));
    out.resize(n + 1);
    return out;
}

/// Sums over j = 1...n-1 of a_j cos(2 pi j (t + shift)/n) for t = 0...n-1.
std::vector<double> sums_of_cosines(const std::vector<double>& a, double shift) {
    const std::size_t n = a.size();
    std::vector<Complex> in(n, 0.0);
    const double turn = 2.0 * pi * shift / static_cast<double>(n);
    for (std::size_t j = 1; j < n; ++j) in[j] = a[j] * std::polar(1.0, turn * static_cast<double>(j));
    std::vector<Complex> sums(n);
    Eigen::FFT<double> fft;
    fft.SetFlag(Eigen::FFT<double>::Unscaled);
    fft.inv(sums.data(), in.data(), static_cast<Eigen::Index>(n));
    std::vector<double> out(n);
    for (std::size_t t = 0; t < n; ++t) out[t] = sums[t].real();
    return out;
}

/// Numerators of pulses: sums over j of (2/n)^(1/2) cos(pi j (t + 1/2)/n) r_j/v_j, t = 0...n-1.
std::vector<double> pulse_numerators(const std::vector<double>& residual, const std::vector<double>& variance) {
    const std::size_t n = residual.size() + 1;
    const auto count = static_cast<double>(n);
    std::vector<Complex> a(n, 0.0);
    for (std::size_t j = 1; j < n; ++j) {
        a[j] = residual[j - 1] / variance[j - 1] * std::polar(1.0, 0.5 * pi * static_cast<double>(j) / count);
    }
    const std::vector<Complex> sums = sums_over_half_turns(a);
    std::vector<double> out(n);
    for (std::size_t t = 0; t < n; ++t) out[t] = std::sqrt(2.0 / count) * sums[t].real();
    return out;
}

Scan scan_pulses(const std::vector<double>& residual, const std::vector<double>& variance, bool doublets) {
    const std::size_t n = residual.size() + 1;
    const auto count = static_cast<double>(n);
    const std::vector<double> numerators = pulse_numerators(residual, variance);
    std::vector<double> weight(n, 0.0);
    double total = 0.0;
    double neighbours = 0.0;
    for (std::size_t j = 1; j < n; ++j) {
        weight[j] = 1.0 / variance[j - 1];
        total += weight[j];
        neighbours += weight[j] * std::cos(pi * static_cast<double>(j) / count);
    }
    // 2 cos^2 x = 1 + cos 2x, and 2 cos x cos y = cos(x - y) + cos(x + y).
    const std::vector<double> own = sums_of_cosines(weight, 0.5);
    const std::vector<double> next = doublets ? sums_of_cosines(weight, 0.0) : std::vector<double>();
    Scan out;
    const std::size_t positions = doublets ? n - 1 : n;
    for (std::size_t t = 0; t < positions; ++t) {
        double numerator = numerators[t];
        double denominator = (total + own[t]) / count;
        if (doublets) {
            numerator -= numerators[t + 1];
            denominator += (total + own[t + 1]) / count - 2.0 * (neighbours + next[t + 1]) / count;
        }
        const bool known = denominator > 0.0;
        out.size.push_back(known ? numerator / denominator : 0.0);
        out.sigma.push_back(known ? numerator / std::sqrt(denominator) : 0.0);
    }
    return out;
}

Scan scan_steps(const std::vector<double>& residual, const std::vector<double>& variance) {
    const std::size_t n = residual.size() + 1;
    const auto count = static_cast<double>(n);
    std::vector<Complex> a(n, 0.0);
    std::vector<double> weight(n, 0.0);
    double total = 0.0;
    for (std::size_t j = 1; j < n; ++j) {
        const double slope = 2.0 * std::sin(0.5 * pi * static_cast<double>(j) / count);
        a[j] = residual[j - 1] / (slope * variance[j - 1]);
        weight[j] = 1.0 / (slope * slope * variance[j - 1]);
        total += weight[j];
    }
    const std::vector<Complex> sums = sums_over_half_turns(a);
    const std::vector<double> cosines = sums_of_cosines(weight, 0.0);
    Scan out;
    out.size.assign(n, 0.0);
    out.sigma.assign(n, 0.0);
    for (std::size_t t = 1; t < n; ++t) {
        const double numerator = -std::sqrt(2.0 / count) * sums[t].imag();
        const double denominator = (total - cosines[t]) / count;
        if (!(denominator > 0.0)) continue;
        out.size[t] = numerator / denominator;
        out.sigma[t] = numerator / std::sqrt(denominator);
    }
    return out;
}

}  // namespace

Scan scan(Event event, const std::vector<double>& residual, const std::vector<double>& variance) {
    if (event == Event::step) return scan_steps(residual, variance);
    return scan_pulses(residual, variance, event == Event::doublet);
}

void take_off(Event event, std::size_t at, double size, std::vector<double>& rate) {
    switch (event) {
        case Event::pulse:
            rate[at] -= size;
            return;
        case Event::doublet:
            rate[at] -= size;
            rate[at + 1] += size;
            return;
        case Event::step:
            for (std::size_t i = at; i < rate.size(); ++i) rate[i] -= size;
            return;
    }
}

std::vector<double> whitened(const std::vector<double>& residual, const std::vector<double>& variance) {
    std::vector<double> weighted(residual.size());
    const std::vector<double> one(residual.size(), 1.0);
    for (std::size_t j = 0; j < residual.size(); ++j) weighted[j] = residual[j] / std::sqrt(variance[j]);
    return pulse_numerators(weighted, one);
}

}  // namespace ringlock::findings
