#include "analysis/closure/turns/model/noise_shape.hpp"

#include <algorithm>
#include <cmath>

#include "analysis/closure/stats/normality.hpp"
#include "engine/core/units.hpp"

namespace ringlock::closure {

namespace {

using Complex = std::complex<double>;

/// Absolute innovations, as the rms in each of 64 parts of equal numbers.
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

}  // namespace

/// Tabulates the correction over the predicted phase.
NoiseShape::Table NoiseShape::by_phase(const TurnKicks& kicks, int direction, std::span<const double> sizes_rad) {
    double variance = 0.0;
    for (const double size : sizes_rad) variance += size * size / static_cast<double>(sizes_rad.size());
    const double weight = 0.5 / static_cast<double>(sizes_rad.size());
    return Table([&](double predicted_rad) {
        Lefts left = Lefts::Zero();
        for (const double size : sizes_rad) {
            for (const double v : {size, -size}) {
                const Complex turned = std::polar(1.0, kicks.phase_after(direction, predicted_rad + v));
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

NoiseShape::Left NoiseShape::at(std::size_t turn) const {
    const Lefts lefts = (is_minimum_[turn] != 0 ? at_minima_ : at_maxima_)->at(predicted_rad_[turn]);
    Left left;
    std::copy(lefts.begin(), lefts.end(), left.begin());
    return left;
}

std::shared_ptr<const NoiseShape> NoiseShape::of(std::span<const double> counted_rad, const TurnKicks& kicks,
                                                 std::span<const int> direction,
                                                 std::span<const double> predicted_rad) {
    if (!is_of_even_density(counted_rad)) return nullptr;
    const std::vector<double> sizes = sizes_of(counted_rad);
    auto shape = std::make_shared<NoiseShape>();
    shape->at_minima_ = std::make_unique<const Table>(by_phase(kicks, 1, sizes));
    shape->at_maxima_ = std::make_unique<const Table>(by_phase(kicks, -1, sizes));
    for (const int way : direction) shape->is_minimum_.push_back(way > 0 ? 1 : 0);
    shape->predicted_rad_.assign(predicted_rad.begin(), predicted_rad.end());
    return shape;
}

}  // namespace ringlock::closure
