#include "analysis/noise/ensemble.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/random/uniform_int_distribution.hpp>
#include <cmath>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::noise {
namespace {

constexpr double one_sigma = 0.682689492137086;

void check(std::span<const double> values) {
    if (values.empty()) throw InputError("no values to take a median of");
    for (const double v : values) {
        if (!std::isfinite(v)) throw InputError(fmt::format("value {} in an ensemble: must be finite", v));
    }
}

double quantile_of_sorted(const std::vector<double>& sorted, double p) {
    const double position = p * static_cast<double>(sorted.size() - 1);
    const auto below = static_cast<std::size_t>(position);
    if (below + 1 >= sorted.size()) return sorted.back();
    const double share = position - static_cast<double>(below);
    return sorted[below] + share * (sorted[below + 1] - sorted[below]);
}

double median_in_place(std::vector<double>& v) {
    const auto middle = v.begin() + static_cast<std::ptrdiff_t>(v.size() / 2);
    std::nth_element(v.begin(), middle, v.end());
    if (v.size() % 2 == 1) return *middle;
    return 0.5 * (*middle + *std::max_element(v.begin(), middle));
}

}  // namespace

double quantile(std::span<const double> values, double p) {
    check(values);
    if (!(p >= 0.0 && p <= 1.0)) throw InputError(fmt::format("quantile {}: must lie between 0 and 1", p));
    std::vector<double> sorted(values.begin(), values.end());
    std::sort(sorted.begin(), sorted.end());
    return quantile_of_sorted(sorted, p);
}

Range central_range(std::span<const double> values) {
    check(values);
    std::vector<double> sorted(values.begin(), values.end());
    std::sort(sorted.begin(), sorted.end());
    return {quantile_of_sorted(sorted, 0.5), quantile_of_sorted(sorted, 0.5 * (1.0 - one_sigma)),
            quantile_of_sorted(sorted, 0.5 * (1.0 + one_sigma))};
}

Range bootstrap_median_interval(std::span<const double> values, double level, std::uint64_t seed, int rounds) {
    check(values);
    if (!(level > 0.0 && level < 1.0)) {
        throw InputError(fmt::format("confidence {} of a median: must lie between 0 and 1", level));
    }
    if (rounds < 2) throw InputError(fmt::format("{} bootstrap rounds: at least 2", rounds));
    random::Engine engine = random::make_engine({.seed = seed, .gyro = 0}, random::Purpose::bootstrap);
    boost::random::uniform_int_distribution<std::size_t> pick(0, values.size() - 1);
    std::vector<double> sample(values.begin(), values.end());
    const double median = median_in_place(sample);
    std::vector<double> medians(static_cast<std::size_t>(rounds));
    for (double& m : medians) {
        for (double& s : sample) s = values[pick(engine)];
        m = median_in_place(sample);
    }
    std::sort(medians.begin(), medians.end());
    return {median, quantile_of_sorted(medians, 0.5 * (1.0 - level)), quantile_of_sorted(medians, 0.5 * (1.0 + level))};
}

}  // namespace ringlock::noise
