#include "analysis/closure/turns/model/noise_shape.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "analysis/closure/stats/normality.hpp"
#include "analysis/closure/turns/model/phase_table.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using Complex = std::complex<double>;

/// Sizes of innovations, one for each of as many equal parts of them.
std::vector<double> sizes_of(std::span<const double> innovations_rad) {
    constexpr std::size_t parts = 64;
    std::vector<double> all;
    for (const double v : innovations_rad) all.push_back(std::abs(v));
    std::sort(all.begin(), all.end());
    std::vector<double> sizes;
    for (std::size_t part = 0; part < parts; ++part) {
        const std::size_t begin = all.size() * part / parts;
        const std::size_t end = all.size() * (part + 1) / parts;
        double squares = 0.0;
        for (std::size_t i = begin; i < end; ++i) squares += all[i] * all[i];
        sizes.push_back(std::sqrt(squares / static_cast<double>(end - begin)));
    }
    return sizes;
}

using Lefts = Eigen::Array<Complex, TurnKicks::harmonics, 1>;

/// Over the phases that may be foretold.
PhaseTable<Lefts> left_by_phase(const TurnKicks& kicks, int direction, std::span<const double> sizes_rad) {
    double variance = 0.0;
    for (const double size : sizes_rad) variance += size * size / static_cast<double>(sizes_rad.size());
    const double weight = 0.5 / static_cast<double>(sizes_rad.size());
    return PhaseTable<Lefts>([&](double foretold_rad) {
        Lefts left = Lefts::Zero();
        for (const double size : sizes_rad) {
            for (const double v : {size, -size}) {
                const Complex turned = std::polar(1.0, kicks.phase_after(direction, foretold_rad + v));
                const double through = 1.0 - kicks.at(direction, turned).before_slope;
                Complex harmonic = weight;
                for (Eigen::Index k = 0; k < left.size(); ++k) {
                    harmonic *= turned;
                    left(k) += harmonic * Complex(v / variance, -static_cast<double>(k + 1) / through);
                }
            }
        }
        return left;
    });
}

}  // namespace

std::shared_ptr<const NoiseShape> NoiseShape::of(std::span<const double> counted_rad, const TurnKicks& kicks,
                                                 std::span<const int> direction, std::span<const double> foretold_rad) {
    if (!is_of_even_density(counted_rad)) return nullptr;
    const std::vector<double> sizes = sizes_of(counted_rad);
    const PhaseTable<Lefts> at_minima = left_by_phase(kicks, 1, sizes);
    const PhaseTable<Lefts> at_maxima = left_by_phase(kicks, -1, sizes);
    auto shape = std::make_shared<NoiseShape>();
    for (std::size_t i = 0; i < foretold_rad.size(); ++i) {
        const Lefts left = (direction[i] > 0 ? at_minima : at_maxima).at(foretold_rad[i]);
        std::copy(left.begin(), left.end(), shape->left_.emplace_back().begin());
    }
    return shape;
}

}  // namespace ringlock::closure
