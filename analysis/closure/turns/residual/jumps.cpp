#include "analysis/closure/turns/residual/jumps.hpp"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numeric>
#include <span>
#include <utility>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"
#include "analysis/closure/turns/model/side_by_side.hpp"

namespace ringlock::closure {

namespace {

/// The angle of a rate that is one or zero and changes at each of the jumps; its first value is `on`.
std::vector<double> two_level_angle(const std::vector<double>& time, const std::vector<double>& jumps, double on) {
    std::vector<double> sum(time.size(), 0.0);
    std::size_t next = 0;
    for (std::size_t i = 1; i < time.size(); ++i) {
        double from = time[i - 1];
        sum[i] = sum[i - 1];
        for (; next < jumps.size() && jumps[next] < time[i]; ++next) {
            sum[i] += on * (std::max(jumps[next], from) - from);
            from = std::max(jumps[next], from);
            on = 1.0 - on;
        }
        sum[i] += on * (time[i] - from);
    }
    return sum;
}

/// A rate that jumps between two levels.
struct Jumping {
    std::vector<double> jumps;  ///< [s], in order
    double on = 0.0;            ///< the first level: one or zero
    double evidence = -std::numeric_limits<double>::infinity();
    TurnParameters noise = {};  ///< noise with the jumps in the model

    std::vector<double> angle(const TurnFit& fit) const {
        return two_level_angle(fit.model().series().time_s, jumps, on);
    }
};

/// The jumps at the ends of stretches, moved to the times at which they explain most under the noise of the fit.
Jumping placed(const TurnFit& fit, const TwoLevels& levels) {
    const double stretch_s = fit.model().series().time_s.back() / static_cast<double>(levels.shape.size());
    Jumping found{.jumps = {}, .on = levels.shape(0)};
    for (Eigen::Index k = 1; k < levels.shape.size(); ++k) {
        if (levels.shape(k) != levels.shape(k - 1)) found.jumps.push_back(stretch_s * static_cast<double>(k));
    }
    const auto explained = [&fit](const Jumping& by) {
        return std::is_sorted(by.jumps.begin(), by.jumps.end()) ? fit.score({by.angle(fit)}).chi2 : 0.0;
    };
    double best = explained(found);
    for (double step_s = 0.5 * stretch_s; step_s > options.turns.jumps.place_precision * stretch_s; step_s *= 0.5) {
        for (std::size_t k = 0; k < found.jumps.size(); ++k) {
            std::array moved{found, found};
            std::array<double, 2> chi2{};
            moved[0].jumps[k] -= step_s;
            moved[1].jumps[k] += step_s;
            side_by_side(moved.size(), [&](std::size_t i) { chi2[i] = explained(moved[i]); });
            const std::size_t better = chi2[1] > chi2[0] ? 1 : 0;
            if (!(chi2[better] > best)) continue;
            best = chi2[better];
            found = std::move(moved[better]);
        }
    }
    return found;
}

/// Sets the evidence of jumps with the noise fitted again, starting from parameters nearby.
void judge(const TurnFit& fit, Jumping& jumping, const TurnParameters& near) {
    const double of_levels = options.stats.two_levels.cost_of_levels;
    const double place =
        std::log(static_cast<double>(options.turns.jumps.stretches - 1)) + options.turns.jumps.cost_of_place;
    TurnFit::Regression regression = fit.regress({jumping.angle(fit)}, near);
    jumping.evidence = regression.gain - cost_of_amplitudes(regression.gain, 1) - of_levels -
                       place * static_cast<double>(jumping.jumps.size());
    jumping.noise = std::move(regression.noise);
}

/// Moves all jumps to the times at which they explain most, under the noise that remains with them. A jump at a wrong
/// time leaves a step of the angle, so that one regression (Gauss-Newton) moves all of them.
void move_jumps(const TurnFit& fit, Jumping& found) {
    const TurnOptions::Jumps& of = options.turns.jumps;
    const auto& time = fit.model().series().time_s;
    for (int pass = 0; pass < of.most_moves && !found.jumps.empty(); ++pass) {
        const std::vector<double> angle = found.angle(fit);
        const bool begins_on = found.on > 0.5;
        const auto piece = [&](std::size_t k, std::size_t first, std::span<double> values) {
            if (k == 0) {
                std::copy_n(angle.begin() + static_cast<std::ptrdiff_t>(first), values.size(), values.begin());
                return;
            }
            // A later jump keeps the level before it for longer.
            const double late = begins_on == (k % 2 == 1) ? 1.0 : -1.0;
            for (std::size_t i = 0; i < values.size(); ++i)
                values[i] = time[first + i] > found.jumps[k - 1] ? late : 0.0;
        };
        const Eigen::VectorXd value = fit.with_noise(found.noise)->score_pieces(found.jumps.size() + 1, piece).value;
        const double before = found.evidence;
        // A full step is too long where jumps are near each other.
        for (double share = 1.0; share > of.least_share_of_move && !(found.evidence > before); share *= 0.5) {
            Jumping moved{.jumps = found.jumps, .on = found.on};
            for (std::size_t k = 0; k < moved.jumps.size(); ++k) {
                moved.jumps[k] += share * value(static_cast<Eigen::Index>(k) + 1) / value(0);
            }
            if (!std::is_sorted(moved.jumps.begin(), moved.jumps.end())) continue;
            if (!(moved.jumps.front() > 0.0 && moved.jumps.back() < time.back())) continue;
            judge(fit, moved, found.noise);
            if (moved.evidence > found.evidence) found = std::move(moved);
        }
        if (found.evidence < before + std::max(of.gained, of.gained_of_evidence * before)) break;
    }
}

Jumping without_stay(const Jumping& all, std::size_t k) {
    Jumping without{.jumps = all.jumps, .on = all.on};
    const auto first = without.jumps.begin() + static_cast<std::ptrdiff_t>(k);
    without.jumps.erase(first, first + 2);
    return without;
}

/// Stays by how much they explain under the present noise, the least first.
std::vector<std::size_t> stays_by_use(const TurnFit& fit, const Jumping& all) {
    const auto with_their = fit.with_noise(all.noise);
    std::vector<double> left(all.jumps.size() - 1);
    side_by_side(left.size(),
                 [&](std::size_t k) { left[k] = with_their->score({without_stay(all, k).angle(fit)}).chi2; });
    std::vector<std::size_t> order(left.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return left[a] > left[b]; });
    return order;
}

/// Removes short stays that only compensated for stretches that do not end at jumps: half of all stays at once, or a
/// quarter and so on, then single ones of those that explain least.
/// \return whether any was removed
bool drop_some(const TurnFit& fit, Jumping& found) {
    if (found.jumps.size() < 3) return false;
    const std::vector<std::size_t> order = stays_by_use(fit, found);
    const auto better = [&](Jumping without) {
        judge(fit, without, found.noise);
        if (!(without.evidence > found.evidence)) return false;
        found = std::move(without);
        return true;
    };
    for (std::size_t most = found.jumps.size() / 2 - 1; most > 1; most /= 2) {
        std::vector<std::size_t> dropped;  // stays that share no jump
        for (const std::size_t k : order) {
            const auto is_adjacent = [&](std::size_t other) { return other + 1 >= k && other <= k + 1; };
            if (dropped.size() < most && std::none_of(dropped.begin(), dropped.end(), is_adjacent))
                dropped.push_back(k);
        }
        std::sort(dropped.rbegin(), dropped.rend());
        Jumping without{.jumps = found.jumps, .on = found.on};
        for (const std::size_t k : dropped) without = without_stay(without, k);
        if (better(std::move(without))) return true;
    }
    for (std::size_t i = 0; i < std::min(options.turns.jumps.most_single_stays, order.size()); ++i) {
        if (better(without_stay(found, order[i]))) return true;
    }
    return false;
}

bool drop_stays(const TurnFit& fit, Jumping& found) {
    bool dropped = false;
    while (drop_some(fit, found)) dropped = true;
    return dropped;
}

Jumping with_their_noise(const TurnFit& fit, Jumping found, const TurnParameters& near) {
    judge(fit, found, near);
    move_jumps(fit, found);
    while (drop_stays(fit, found)) move_jumps(fit, found);
    return found;
}

}  // namespace

TwoLevels levels_of_stretches(const TurnFit& fit, std::size_t stretches) {
    const auto& time = fit.model().series().time_s;
    const double length = time.back() / static_cast<double>(stretches);
    const auto [squares, right] =
        fit.products(stretches, [&](std::size_t k, std::size_t first, std::span<double> ramp) {
            const double start = length * static_cast<double>(k);
            for (std::size_t i = 0; i < ramp.size(); ++i) ramp[i] = std::clamp(time[first + i] - start, 0.0, length);
        });
    return two_levels(squares, right);
}

std::vector<double> placed_jumps(const TurnFit& fit, const TwoLevels& levels) { return placed(fit, levels).angle(fit); }

double evidence_of_jumps(const TurnFit& fit, const TwoLevels& levels, double competing) {
    const TurnOptions::Jumps& of = options.turns.jumps;
    Jumping best = placed(fit, levels);
    judge(fit, best, fit.parameters());
    if (best.evidence < of.near_competing * competing) return best.evidence;
    const TurnParameters noise = best.noise;
    best = with_their_noise(fit, std::move(best), noise);
    for (int pass = 0; pass < of.most_searches; ++pass) {
        const auto with_their = fit.with_noise(best.noise);
        const TwoLevels again = levels_of_stretches(*with_their, of.finer * of.stretches);
        if (again.changes == 0) break;
        Jumping other = with_their_noise(fit, placed(*with_their, again), best.noise);
        if (!(other.evidence > best.evidence)) break;
        best = std::move(other);
    }
    return best.evidence;
}

}  // namespace ringlock::closure
