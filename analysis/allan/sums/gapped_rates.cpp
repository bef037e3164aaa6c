#include "analysis/allan/sums/gapped_rates.hpp"

#include <algorithm>
#include <cmath>

namespace ringlock::allan {

GappedRates::GappedRates(const Phase& phase) : sums_(phase.x.size()), counts_(phase.x.size()) {
    double sum = 0.0;
    std::int64_t count = 0;
    std::size_t point = 0;
    for (const Stretch& s : phase.stretches) {
        for (; point < s.begin; ++point) {
            sums_[point] = sum;
            counts_[point] = count;
        }
        for (; point < s.end; ++point) {
            const auto in_stretch = static_cast<std::int64_t>(point - s.begin);
            sums_[point] = sum + (phase.x[point] - phase.x[s.begin]);
            counts_[point] = count + in_stretch;
        }
        sum = sums_[s.end - 1];
        count = counts_[s.end - 1];
    }
}

SquareMean GappedRates::sum(int order, std::size_t m, std::size_t stride) const {
    const std::size_t reach = static_cast<std::size_t>(order) * m;
    if (sums_.size() <= reach) return {};
    const std::size_t starts = (sums_.size() - reach - 1) / stride + 1;
    const auto wanted = static_cast<std::int64_t>(m);
    constexpr std::size_t batch = piece_starts;
    std::vector<SquareMean> parts((starts + batch - 1) / batch);
    for_pieces(parts.size(), [&](std::size_t part) {
        SquareMean& out = parts[part];
        for (std::size_t k = part * batch; k < std::min(starts, (part + 1) * batch); ++k) {
            const std::size_t i = k * stride;
            double y[3] = {};
            bool enough = true;
            for (std::size_t j = 0; j < static_cast<std::size_t>(order); ++j) {
                const std::int64_t there = counts_[i + (j + 1) * m] - counts_[i + j * m];
                enough = enough && 10 * there >= 9 * wanted;
                y[j] = (sums_[i + (j + 1) * m] - sums_[i + j * m]) / static_cast<double>(there);
            }
            if (!enough) continue;
            const double z = static_cast<double>(m) * (order == 2 ? y[1] - y[0] : (y[2] - y[1]) - (y[1] - y[0]));
            out += {z * z, 1};
        }
    });
    return pairwise(std::move(parts));
}

}  // namespace ringlock::allan
