#include "analysis/closure/noise_shape.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/closure/normality.hpp"
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

/// Over the phases that may be foretold.
class Table {
   public:
    Table(const TurnKicks& kicks, int direction, std::span<const double> sizes_rad) {
        double variance = 0.0;
        for (const double size : sizes_rad) variance += size * size / static_cast<double>(sizes_rad.size());
        const double weight = 0.5 / static_cast<double>(sizes_rad.size());
        for (std::size_t j = 0; j < phases; ++j) {
            NoiseShape::Left& left = left_[j];
            left.fill(0.0);
            const double foretold_rad = units::two_pi * static_cast<double>(j) / phases;
            for (const double size : sizes_rad) {
                for (const double v : {size, -size}) {
                    const double psi = kicks.phase_after(direction, foretold_rad + v);
                    const Complex turned = std::polar(1.0, psi);
                    const double through = 1.0 - kicks.at(direction, turned).before_slope;
                    Complex harmonic = 1.0;
                    for (std::size_t k = 1; k <= left.size(); ++k) {
                        harmonic *= turned;
                        left[k - 1] += weight * harmonic * Complex(v / variance, -static_cast<double>(k) / through);
                    }
                }
            }
        }
    }
    NoiseShape::Left at(double foretold_rad) const {
        const double fringes = foretold_rad / units::two_pi;
        const double x = (fringes - std::floor(fringes)) * phases;
        const auto j = static_cast<std::size_t>(x);
        const double share = x - static_cast<double>(j);
        NoiseShape::Left left;
        for (std::size_t k = 0; k < left.size(); ++k) {
            left[k] = (1.0 - share) * left_[j % phases][k] + share * left_[(j + 1) % phases][k];
        }
        return left;
    }

   private:
    static constexpr std::size_t phases = 256;
    std::array<NoiseShape::Left, phases> left_;
};

}  // namespace

std::shared_ptr<const NoiseShape> NoiseShape::of(std::span<const double> counted_rad, const TurnKicks& kicks,
                                                 std::span<const int> direction,
                                                 std::span<const double> foretold_rad) {
    if (!is_of_even_density(counted_rad)) return nullptr;
    const std::vector<double> sizes = sizes_of(counted_rad);
    const Table at_minima(kicks, 1, sizes);
    const Table at_maxima(kicks, -1, sizes);
    auto shape = std::make_shared<NoiseShape>();
    for (std::size_t i = 0; i < foretold_rad.size(); ++i) {
        shape->left_.push_back((direction[i] > 0 ? at_minima : at_maxima).at(foretold_rad[i]));
    }
    return shape;
}

}  // namespace ringlock::closure
