#include "analysis/allan/uncertainty.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <mutex>
#include <numbers>
#include <tuple>

#include "analysis/allan/interval.hpp"
#include "analysis/allan/quadratic_form.hpp"
#include "analysis/allan/statistics/degrees_of_freedom.hpp"

namespace ringlock::allan {
namespace {

/// Samples of a tau in the short records that stand for others, and the most taus that those have.
constexpr std::int64_t finest = 8;
constexpr std::int64_t most_taus = 16;
/// Degrees of freedom from which an estimate is chi-squared for all purposes.
constexpr double many_degrees = 16.0;

/// Degrees of an estimator without reflections.
double degrees_of(Estimator estimator, int alpha, std::int64_t m, std::int64_t points) {
    const Traits& t = traits(estimator);
    const bool modified = t.family == Family::modified || t.family == Family::modified_total;
    return degrees_of_freedom({.differences = t.differences, .modified = modified, .overlapping = t.overlapping}, alpha,
                              m, points);
}

/// The estimator without reflections that is like it.
Estimator plain(Estimator estimator) {
    switch (traits(estimator).family) {
        case Family::total:
            return Estimator::oadev;
        case Family::modified_total:
            return Estimator::mdev;
        case Family::hadamard_total:
            return Estimator::ohdev;
        default:
            return estimator;
    }
}

/// A record of as many tau as that of `points`, with at most `fine` samples to each.
struct Short {
    std::int64_t m;
    std::int64_t points;
};

Short short_record(Estimator estimator, std::int64_t m, std::int64_t points, std::int64_t fine) {
    const Traits& t = traits(estimator);
    const std::int64_t few = t.overlapping ? std::min(m, fine) : 1;
    const double taus = static_cast<double>(points - 1) / static_cast<double>(m);
    const std::int64_t steps =
        t.overlapping ? std::llround(taus * static_cast<double>(few)) : static_cast<std::int64_t>(taus);
    return {few, std::max(span_of(estimator, few), steps + 1)};
}

/// Figures of an estimate on a short record.
struct Known {
    double degrees;
    double mean;
    double low;
    double high;
};

/// Worked out once; a record of a study differs from the next in nothing that matters here.
Known known(Estimator estimator, int alpha, const Short& record, double confidence) {
    static std::mutex guard;
    static std::map<std::tuple<Estimator, int, std::int64_t, std::int64_t, double>, Known> kept;
    const std::tuple key{estimator, alpha, record.m, record.points, confidence};
    {
        const std::lock_guard lock(guard);
        if (const auto found = kept.find(key); found != kept.end()) return found->second;
    }
    const WeightedSquares squares = distribution_of(estimator, alpha, record.m, record.points);
    const Known out{squares.degrees(), squares.mean(), squares.quantile(0.5 * (1.0 - confidence)),
                    squares.quantile(0.5 * (1.0 + confidence))};
    const std::lock_guard lock(guard);
    kept.emplace(key, out);
    return out;
}

/// Whether the distribution of an estimate depends on the length of the record in tau alone. That of sampled phase
/// noise does not: every sample is new.
bool scale_free(Estimator estimator, int alpha) {
    const Traits& t = traits(estimator);
    if (alpha <= 0) return true;
    if (t.family == Family::modified || t.family == Family::modified_total) return true;
    return !t.overlapping && alpha == 2;
}

void set_chi_squared(Uncertainty& u, double confidence) {
    u.low = relative_chi_squared_quantile(u.edf, 0.5 * (1.0 - confidence));
    u.high = relative_chi_squared_quantile(u.edf, 0.5 * (1.0 + confidence));
}

Uncertainty uncertainty_of_plain(Estimator estimator, int alpha, std::int64_t m, std::int64_t points,
                                 double confidence) {
    Uncertainty out;
    out.edf = degrees_of(estimator, alpha, m, points);
    if (out.edf >= many_degrees || !scale_free(estimator, alpha)) {
        set_chi_squared(out, confidence);
        return out;
    }
    const Known there = known(estimator, alpha, short_record(estimator, m, points, finest), confidence);
    out.low = there.low;
    out.high = there.high;
    return out;
}

/// Degrees of the plain counterpart, on a record that is long enough for it.
double plain_degrees(Estimator estimator, int alpha, std::int64_t m, std::int64_t points) {
    const Estimator like = plain(estimator);
    return degrees_of(like, alpha, m, std::max(points, span_of(like, m)));
}

/// Degrees of the total deviation with so many samples to a tau.
struct Sampled {
    std::int64_t m;
    double degrees;
};

/// Phase noise in the total deviation: the images of an end all carry the error of its one phase, a part of the
/// variance that more samples do not lessen, and a square of its own for each end. 1/edf = a/m + b on both short
/// records; a longer one has more terms, of which fewer see the ends.
void set_by_ends(Uncertainty& u, const Sampled& less, const Sampled& more, std::int64_t m, double beyond,
                 double confidence) {
    const auto part = [](const Sampled& s) { return 1.0 / static_cast<double>(s.m); };
    const double a = (1.0 / less.degrees - 1.0 / more.degrees) / (part(less) - part(more));
    const double ends = std::max(0.0, 1.0 / more.degrees - a * part(more)) * beyond * beyond;
    const double rest = a / static_cast<double>(m) * beyond;
    const double end = std::sqrt(0.5 * ends);
    const double others = 1.0 - 2.0 * end;
    if (!(rest > 0.0 && others > 0.0)) return set_chi_squared(u, confidence);
    u.edf = 1.0 / (rest + ends);
    const double count = others * others / rest;
    const WeightedSquares squares({{end, 2.0}, {others / count, count}});
    u.low = squares.quantile(0.5 * (1.0 - confidence));
    u.high = squares.quantile(0.5 * (1.0 + confidence));
}

Uncertainty uncertainty_of_total(Estimator estimator, int alpha, std::int64_t m, std::int64_t points,
                                 double confidence) {
    const bool reflected = traits(estimator).family == Family::total;
    // The effect of the record's ends on the total deviation decreases in proportion to tau/T, and is computed down to
    // tau/T = 1/16.
    const std::int64_t longest = std::min(points, most_taus * m + 1);
    const double beyond = static_cast<double>(longest - 1) / static_cast<double>(points - 1);
    const Short little = short_record(estimator, m, longest, finest);
    const Known there = known(estimator, alpha, little, confidence);
    const double like = plain_degrees(estimator, alpha, m, points);
    const double like_there = plain_degrees(estimator, alpha, little.m, little.points);
    const double over_plain = there.degrees / like_there;
    Uncertainty out;
    out.edf = like * (reflected ? 1.0 + (over_plain - 1.0) * beyond : over_plain);
    out.bias = there.mean;
    if (m > finest) {
        // Extrapolation from half of `finest` and `finest` samples in a tau to m: the error is proportional to 1/m for
        // phase noise, and to 1/m^2 for smoother noise.
        const Short less = short_record(estimator, m, longest, finest / 2);
        const Known before = known(estimator, alpha, less, confidence);
        const double power = alpha > 0 ? 1.0 : 2.0;
        const double share = (1.0 - std::pow(static_cast<double>(finest) / static_cast<double>(m), power)) /
                             (std::pow(2.0, power) - 1.0);
        out.bias += share * (there.mean - before.mean);
        if (reflected && alpha > 0) {
            out.bias = 1.0 + (out.bias - 1.0) * beyond;
            set_by_ends(out, {less.m, before.degrees}, {little.m, there.degrees}, m, beyond, confidence);
            return out;
        }
    }
    if (reflected) out.bias = 1.0 + (out.bias - 1.0) * beyond;
    if (out.edf < many_degrees && scale_free(estimator, alpha)) {
        out.low = there.low;
        out.high = there.high;
    } else {
        set_chi_squared(out, confidence);
    }
    return out;
}

}  // namespace

double published_bias(Estimator estimator, int alpha, std::int64_t m, std::int64_t points) {
    switch (traits(estimator).family) {
        case Family::total: {
            const double share = static_cast<double>(m) / static_cast<double>(points - 1);
            if (alpha == -1) return 1.0 - share / (3.0 * std::numbers::ln2);
            return alpha <= -2 ? 1.0 - 0.75 * share : 1.0;
        }
        case Family::modified_total: {
            constexpr std::array<double, 5> factors = {0.94, 0.83, 0.73, 0.70, 0.69};
            return factors[static_cast<std::size_t>(std::clamp(2 - alpha, 0, 4))];
        }
        case Family::hadamard_total: {
            constexpr std::array<double, 5> excess = {-0.005, -0.149, -0.229, -0.283, -0.321};
            if (m == 1 || alpha > 0) return 1.0;
            return 1.0 + excess[static_cast<std::size_t>(std::clamp(-alpha, 0, 4))];
        }
        default:
            return 1.0;
    }
}

Uncertainty uncertainty_of(Estimator estimator, int alpha, std::int64_t m, std::int64_t points, double confidence) {
    const bool total = plain(estimator) != estimator;
    return total ? uncertainty_of_total(estimator, alpha, m, points, confidence)
                 : uncertainty_of_plain(estimator, alpha, m, points, confidence);
}

}  // namespace ringlock::allan
