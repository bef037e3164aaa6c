#include "engine/reader/fir.hpp"

#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::reader {

Fir::Fir(std::size_t order, double cutoff_hz, double latch_hz, double dither_hz)
    : order_(order), cutoff_hz_(cutoff_hz), latch_hz_(latch_hz), dither_hz_(dither_hz) {}

std::vector<double> Fir::make_taps() const {
    std::vector<double> taps(order_ + 1);
    double sum = 0.0;
    for (std::size_t i = 0; i <= order_; ++i) {
        const double from_middle = static_cast<double>(i) - 0.5 * static_cast<double>(order_);
        const double x = units::two_pi * cutoff_hz_ / latch_hz_ * from_middle;
        const double ideal = x == 0.0 ? 1.0 : std::sin(x) / x;
        const double window =
            order_ == 0 ? 1.0
                        : 0.54 - 0.46 * std::cos(units::two_pi * static_cast<double>(i) / static_cast<double>(order_));
        taps[i] = ideal * window;
        sum += taps[i];
    }
    for (double& tap : taps) tap /= sum;
    return taps;
}

void Fir::take_angle(double angle_arcsec) {
    if (taps_.empty()) {
        taps_ = make_taps();
        angles_.assign(taps_.size(), 0.0);
    }
    angles_[next_] = angle_arcsec;
    next_ = (next_ + 1) % angles_.size();
}

double Fir::angle_arcsec() const {
    // The middle angle is taken out of the sum, which keeps its digits where angles have become large.
    const std::size_t size = taps_.size();
    if (size == 0) return 0.0;
    const double middle = angles_[(next_ + size / 2) % size];
    double sum = 0.0;
    for (std::size_t i = 0; i < size; ++i) sum += taps_[i] * (angles_[(next_ + i) % size] - middle);
    return middle + sum;
}

double Fir::residue_relative() const {
    const std::vector<double> taps = make_taps();
    double sum = 0.0;
    for (std::size_t i = 0; i < taps.size(); ++i) {
        const double from_middle = static_cast<double>(i) - 0.5 * static_cast<double>(order_);
        sum += taps[i] * std::cos(units::two_pi * dither_hz_ / latch_hz_ * from_middle);
    }
    return std::abs(sum);
}

}  // namespace ringlock::reader
