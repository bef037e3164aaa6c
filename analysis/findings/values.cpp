#include "analysis/findings/values.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "analysis/findings/median.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::findings {
namespace {

/// Probability by chance below which a run or a pile is reported.
constexpr double level = 1e-4;

struct Run {
    std::size_t from = 0;
    std::size_t length = 0;
};

/// Calls `visit` with every run of equal values, of one value as well; missing values are in none.
template <class Visit>
void for_each_run(std::span<const double> values, const Visit& visit) {
    for (std::size_t i = 0; i < values.size();) {
        std::size_t to = i + 1;
        while (to < values.size() && values[to] == values[i]) ++to;
        if (!std::isnan(values[i])) visit(Run{i, to - i});
        i = to;
    }
}

/// How often a value is followed by itself.
struct Followers {
    double equal = 0.0;
    double all = 0.0;

    void add(const Run& run) {
        equal += static_cast<double>(run.length - 1);
        all += static_cast<double>(run.length);
    }
};

/// Runs that are longer than so many neighbours would be equal by chance. How often a value is followed by itself is
/// taken from the rest of the record, so that a run does not excuse itself. Where a third of all neighbours are equal
/// the steps are coarser than the noise, and long runs say nothing.
void find_repeated(std::span<const double> values, std::vector<Finding>& found) {
    constexpr std::size_t shortest = 8;
    std::vector<Run> longer;
    Followers shorter;
    for_each_run(values, [&](const Run& run) {
        if (run.length < shortest) return shorter.add(run);
        longer.push_back(run);
    });
    if (longer.empty() || 3.0 * shorter.equal > shorter.all) return;
    const double usual = (shorter.equal + 1.0) / (shorter.all + 2.0);
    std::map<double, Followers> followers;
    for (const Run& run : longer) followers[values[run.from]];
    for_each_run(values, [&](const Run& run) {
        const auto of = followers.find(values[run.from]);
        if (of != followers.end()) of->second.add(run);
    });
    const double log_level = std::log(level / static_cast<double>(values.size()));
    for (const Run& run : longer) {
        const Followers& of = followers[values[run.from]];
        const auto length = static_cast<double>(run.length);
        // Of a value that hardly occurs elsewhere the share is that of all others.
        constexpr double weight = 4.0;
        const double share = (of.equal - (length - 1.0) + weight * usual) / (of.all - length + weight);
        const double log_p = (length - 1.0) * std::log(share);
        if (log_p > log_level) continue;
        found.push_back({Kind::repeated, run.from, run.length, values[run.from], std::sqrt(-2.0 * log_p)});
    }
}

/// The smallest value above a limit, and how many there are of it.
struct Level {
    double value = std::numeric_limits<double>::infinity();
    std::size_t count = 0;
};

/// With a sign of -1 values are turned round.
Level next_above(std::span<const double> values, double sign, double limit) {
    Level next;
    for (const double v : values) {
        const double x = sign * v;
        if (!(x > limit) || x > next.value) continue;
        next.count = x == next.value ? next.count + 1 : 1;
        next.value = x;
    }
    return next;
}

/// At one end of the range: more values there than just inside of it, where noise has the more the nearer to its mean.
void find_clipped(std::span<const double> values, bool upper, std::vector<Finding>& found) {
    constexpr std::size_t fewest = 8;
    const double sign = upper ? -1.0 : 1.0;
    const Level limit = next_above(values, sign, -std::numeric_limits<double>::infinity());
    if (limit.count < fewest) return;
    const Level next = next_above(values, sign, limit.value);
    // Coarse steps have many at every level, the outermost ones less than those inside.
    constexpr double by_more = 3.0;
    if (next.count == 0 || static_cast<double>(limit.count) < by_more * static_cast<double>(next.count + 1)) return;
    const double end = sign * limit.value;
    const auto first = std::find(values.begin(), values.end(), end);
    found.push_back({Kind::clipped, static_cast<std::size_t>(first - values.begin()), limit.count, end,
                     std::sqrt(static_cast<double>(limit.count))});
}

/// All gaps, or where a record has very many those that are longer than losses at random explain. How often a missing
/// datum is followed by another is taken from the short gaps.
void find_gaps(std::span<const double> values, std::vector<Finding>& found) {
    constexpr std::size_t most = 100;
    constexpr std::size_t shortest = 8;
    std::vector<Run> gaps;
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (!std::isnan(values[i])) continue;
        if (gaps.empty() || gaps.back().from + gaps.back().length != i) gaps.push_back({i, 0});
        ++gaps.back().length;
    }
    double log_share = 0.0;
    if (gaps.size() > most) {
        Followers shorter;
        for (const Run& gap : gaps) {
            if (gap.length < shortest) shorter.add(gap);
        }
        log_share = std::log((shorter.equal + 1.0) / (shorter.all + 2.0));
    }
    const double log_level = std::log(level / static_cast<double>(std::max<std::size_t>(1, gaps.size())));
    for (const Run& gap : gaps) {
        if (gaps.size() > most && static_cast<double>(gap.length - 1) * log_share > log_level) continue;
        const auto length = static_cast<double>(gap.length);
        found.push_back({Kind::gap, gap.from, gap.length, length, std::numeric_limits<double>::quiet_NaN()});
    }
}

std::vector<double> moduli() {
    std::vector<double> all;
    for (int power = 8; power <= 63; ++power) all.push_back(std::ldexp(1.0, power));
    for (const double turn : {360.0, 360.0 * units::arcsec_per_deg, 360e3, units::two_pi}) {
        all.push_back(turn);
        all.push_back(0.5 * turn);
    }
    std::sort(all.begin(), all.end());
    return all;
}

}  // namespace

std::vector<Finding> search_values(std::span<const double> values) {
    std::vector<Finding> found;
    find_repeated(values, found);
    find_clipped(values, false, found);
    find_clipped(values, true, found);
    find_gaps(values, found);
    return found;
}

namespace {

/// Range of the values and their usual step from one datum to the next.
struct Steps {
    double low = std::numeric_limits<double>::infinity();
    double high = -std::numeric_limits<double>::infinity();
    double usual = 0.0;   ///< median
    double spread = 0.0;  ///< standard deviation of normal steps of the same median size
    std::size_t count = 0;
};

Steps steps_of(std::span<const double> values) {
    Steps out;
    std::vector<double> steps;
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (std::isnan(values[i])) continue;
        out.low = std::min(out.low, values[i]);
        out.high = std::max(out.high, values[i]);
        if (i > 0 && !std::isnan(values[i - 1])) steps.push_back(values[i] - values[i - 1]);
    }
    out.count = steps.size();
    if (steps.empty()) return out;
    out.usual = median_of(steps);
    out.spread = std::max(normal_deviation(std::move(steps), out.usual), 1e-12 * (out.high - out.low));
    return out;
}

/// Calls `visit` with every datum that has one before it and by how much its step exceeds the usual ones; across
/// missing data, those of as many steps.
template <class Visit>
void for_each_excess(std::span<const double> values, double usual, const Visit& visit) {
    std::size_t last = values.size();
    for (std::size_t i = 0; i < values.size(); ++i) {
        if (std::isnan(values[i])) continue;
        if (last < i) visit(i, values[i] - values[last] - usual * static_cast<double>(i - last));
        last = i;
    }
}

}  // namespace

std::optional<Wraps> find_wraps(std::span<const double> values) {
    constexpr std::size_t fewest = 16;
    constexpr double deviations = 20.0;  // of usual steps: no noise goes so far
    const Steps steps = steps_of(values);
    if (steps.count < fewest) return std::nullopt;
    const double range = steps.high - steps.low;
    const double reach = deviations * steps.spread;
    // A range that is hardly larger than the steps wraps all the time, and nobody can undo that.
    for (const double modulus : moduli()) {
        if (range > modulus || range < 0.9 * modulus || 2.0 * reach > modulus) continue;
        Wraps wraps{modulus, {}};
        bool clean = true;
        for_each_excess(values, steps.usual, [&](std::size_t i, double step) {
            if (std::abs(step) <= 0.5 * modulus) return;
            if (std::abs(step + (step < 0.0 ? modulus : -modulus)) <= reach) {
                wraps.at.push_back(i);
            } else {
                clean = false;
            }
        });
        if (!wraps.at.empty() && clean) return wraps;
    }
    return std::nullopt;
}

Wraps wraps_of(double modulus, std::span<const double> values) {
    const Steps steps = steps_of(values);
    if (!(steps.high - steps.low <= modulus)) {
        throw InputError(fmt::format("values from {} to {} are not within a range of {}: they do not wrap there",
                                     steps.low, steps.high, modulus));
    }
    Wraps wraps{modulus, {}};
    for_each_excess(values, steps.usual, [&](std::size_t i, double step) {
        if (std::abs(step) > 0.5 * modulus) wraps.at.push_back(i);
    });
    return wraps;
}

void unwrap(const Wraps& wraps, std::span<double> values) {
    double offset = 0.0;
    auto next = wraps.at.begin();
    double before = values.empty() ? 0.0 : values[0];
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double given = values[i];
        if (next != wraps.at.end() && i == *next) {
            offset += given < before ? wraps.modulus : -wraps.modulus;
            ++next;
        }
        values[i] = given + offset;
        if (!std::isnan(given)) before = given;
    }
}

}  // namespace ringlock::findings
