#include "engine/readout/missed_counts.hpp"

#include <algorithm>
#include <boost/random/uniform_real_distribution.hpp>
#include <cmath>
#include <limits>

namespace ringlock::readout {

namespace {

/// The turn of the next miss after `turn`. Turns from one miss to the next are geometrically distributed, which spares
/// the turns in between a random number each.
std::int64_t miss_after(std::int64_t turn, double probability, random::Engine& engine) {
    const double uniform = 1.0 - boost::random::uniform_real_distribution<double>(0.0, 1.0)(engine);  // in (0, 1]
    const double skipped = std::floor(std::log(uniform) / std::log1p(-probability));
    constexpr std::int64_t never = std::numeric_limits<std::int64_t>::max();
    if (!(skipped < 0x1p62)) return never;
    return turn + 1 + static_cast<std::int64_t>(skipped);
}

}  // namespace

MissedCounts::MissedCounts(std::span<const gyro::Setup> setups, const random::LaneIdentities& who) {
    const auto misses = [](const gyro::Setup& setup) { return setup.missed_count_probability > 0.0; };
    if (std::none_of(setups.begin(), setups.end(), misses)) return;
    for (std::size_t lane = 0; lane < setups.size(); ++lane) {
        const random::Identity gyro{who.seed, who.gyro[lane]};
        Counter counter{setups[lane].missed_count_probability,
                        random::make_engine(gyro, random::Purpose::missed_counts), 0};
        counter.next_miss = miss_after(0, counter.probability, counter.engine);
        counters_.push_back(counter);
    }
}

std::span<const simd::Lanes> MissedCounts::next(std::size_t turns) {
    if (counters_.empty()) return {};
    quarters_.assign(turns, simd::Lanes{});
    for (std::size_t lane = 0; lane < counters_.size(); ++lane) {
        Counter& counter = counters_[lane];
        for (std::size_t i = 0; i < turns; ++i) {
            const std::int64_t turn = turn_ + static_cast<std::int64_t>(i);
            if (turn == counter.next_miss) {
                // Even turns are minima: the phase came down to them.
                counter.quarters += turn % 2 == 0 ? 1.0 : -1.0;
                counter.next_miss = miss_after(turn, counter.probability, counter.engine);
            }
            quarters_[i][lane] = counter.quarters;
        }
    }
    turn_ += static_cast<std::int64_t>(turns);
    return quarters_;
}

}  // namespace ringlock::readout
