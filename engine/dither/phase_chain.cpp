#include "engine/dither/phase_chain.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>

#include "engine/core/dense.hpp"

namespace ringlock::dither {

namespace {

using gyro::NoiseDistribution;

constexpr double gaussian_end = 5.5;  // standard deviations beyond which amplitudes and levels are left out

/// Gauss quadrature with the recursion coefficients of its orthonormal polynomials (Golub and Welsch 1969).
template <class Recursion>
std::vector<DriveLevel> gauss(int count, const Recursion& recursion) {
    Eigen::MatrixXd jacobi = Eigen::MatrixXd::Zero(count, count);
    for (int i = 1; i < count; ++i) jacobi(i, i - 1) = jacobi(i - 1, i) = recursion(static_cast<double>(i));
    const dense::SymmetricEigen jacobi_eigen = dense::symmetric_eigen(jacobi);
    std::vector<DriveLevel> levels;
    for (int i = 0; i < count; ++i) {
        levels.push_back({jacobi_eigen.values(i), jacobi_eigen.vectors(0, i) * jacobi_eigen.vectors(0, i)});
    }
    return levels;
}

/// Levels on either side of zero.
double half_of(double reach_rad) { return 6.0 + std::floor(3.5 * reach_rad); }

}  // namespace

double PhaseChain::reach_rad() const {
    return (1.0 - std::pow(decay, static_cast<double>(hold_half_cycles))) * level_rad;
}

double PhaseChain::largest_rad() const {
    const double gaussian = gaussian_end * rms_rad;
    if (distribution == NoiseDistribution::gaussian) return gaussian;
    const double level = distribution == NoiseDistribution::binary ? 1.0 : std::numbers::sqrt3;
    return std::min(gaussian, level * level_rad);
}

bool PhaseChain::is_independent() const {
    return hold_half_cycles == 1 && distribution == NoiseDistribution::gaussian && reach_rad() > 8.0;
}

double drive_level_count(const PhaseChain& chain) {
    switch (chain.distribution) {
        case NoiseDistribution::binary:
            return 2.0;
        case NoiseDistribution::uniform:
            return 8.0 + std::floor(4.0 * chain.reach_rad());
        case NoiseDistribution::gaussian:
            break;
    }
    return 2.0 * half_of(chain.reach_rad()) + 1.0;
}

std::vector<DriveLevel> drive_levels(const PhaseChain& chain) {
    if (chain.distribution == NoiseDistribution::binary) return {{-1.0, 0.5}, {1.0, 0.5}};
    if (chain.distribution == NoiseDistribution::uniform) {
        std::vector<DriveLevel> levels = gauss(static_cast<int>(drive_level_count(chain)),
                                               [](double i) { return i / std::sqrt(4.0 * i * i - 1.0); });
        for (DriveLevel& level : levels) level.value *= std::numbers::sqrt3;
        return levels;
    }
    // Equidistant sums of a Gaussian converge faster than any power.
    const int half = static_cast<int>(half_of(chain.reach_rad()));
    std::vector<DriveLevel> levels;
    double sum = 0.0;
    for (int i = -half; i <= half; ++i) {
        const double value = gaussian_end * i / half;
        levels.push_back({value, std::exp(-0.5 * value * value)});
        sum += levels.back().weight;
    }
    for (DriveLevel& level : levels) level.weight /= sum;
    return levels;
}

}  // namespace ringlock::dither
