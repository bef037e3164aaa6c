#include "analysis/allan/factor_stream.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "analysis/allan/octave_deviation.hpp"
#include "engine/core/error.hpp"

namespace ringlock::allan {

FactorStream::FactorStream(std::int64_t m)
    : m_(m), stride_(std::max<std::int64_t>(1, m / OctaveStream::starts_per_tau)) {
    if (m < 1) throw std::invalid_argument("factor stream: averaging factors are 1 and more");
    // Kept as long as a second difference lasts: two averaging times from its start, one from its middle.
    starts_.rows.resize(static_cast<std::size_t>(2 * m_ / stride_ + 1));
    middles_.rows.resize(static_cast<std::size_t>(m_ / stride_ + 1));
    middles_.first = m_;
    sums_.resize(simd::lanes);
}

void FactorStream::Ring::take(std::int64_t sample, std::int64_t stride, const simd::LaneCounts& row) {
    if (sample < first || (sample - first) % stride != 0) return;
    rows[static_cast<std::size_t>((sample - first) / stride) % rows.size()] = row;
}

const simd::LaneCounts& FactorStream::Ring::at(std::int64_t sample, std::int64_t stride) const {
    return rows[static_cast<std::size_t>((sample - first) / stride) % rows.size()];
}

void FactorStream::add(std::span<const simd::LaneCounts> counts, std::size_t lanes) {
    for (const simd::LaneCounts& row : counts) {
        const std::int64_t sample = samples_++;
        starts_.take(sample, stride_, row);
        middles_.take(sample, stride_, row);
        const std::int64_t start = sample - 2 * m_;
        if (start < 0 || start % stride_ != 0) continue;
        const simd::LaneCounts& first = starts_.at(start, stride_);
        const simd::LaneCounts& middle = middles_.at(start + m_, stride_);
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const auto x = static_cast<std::uint64_t>(middle[lane]);
            const std::uint64_t difference =
                (static_cast<std::uint64_t>(row[lane]) - x) - (x - static_cast<std::uint64_t>(first[lane]));
            sums_[lane].add_square(static_cast<std::int64_t>(difference));
        }
        ++terms_;
    }
}

Octave FactorStream::sum(std::size_t lane) const { return {m_, sums_.at(lane), terms_}; }

Point deviation(const FactorStream& stream, std::size_t lane, const std::vector<Point>& octaves, double unit_per_count,
                double tau0_s, double confidence) {
    const Octave sum = stream.sum(lane);
    if (sum.terms < 1 || octaves.empty()) {
        throw InputError(fmt::format("averaging factor {}: a record of {} samples has no second difference of it",
                                     sum.m, stream.samples()));
    }
    const auto distance = [&](const Point& octave) {
        return std::abs(std::log(static_cast<double>(octave.m) / static_cast<double>(sum.m)));
    };
    const auto nearest = std::min_element(octaves.begin(), octaves.end(),
                                          [&](const Point& a, const Point& b) { return distance(a) < distance(b); });
    const double mean_square = sum.sum.rounded() / static_cast<double>(sum.terms) * unit_per_count * unit_per_count;
    return stream_point({sum.m, mean_square, sum.terms}, nearest->alpha, 2, stream.samples(), tau0_s, confidence);
}

}  // namespace ringlock::allan
