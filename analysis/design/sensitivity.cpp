#include "analysis/design/sensitivity.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <boost/random/uniform_int_distribution.hpp>
#include <cmath>
#include <limits>
#include <numeric>

#include "engine/core/error.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::design {
namespace {

constexpr std::size_t fewest_rounds = 100;
constexpr double most_rounds_without_variance = 0.01;
/// Differences of this many last digits of the largest value are rounding.
constexpr double rounding = 8.0 * std::numeric_limits<double>::epsilon();

/// Terms from which the indices are computed, one row a base point: mean of f_A and f_B, mean of their squares, and for
/// each factor f_B d, d and d^2/2 with d = f_AB_i - f_A. One number is subtracted from f in all terms, and they are
/// scaled.
struct Terms {
    std::size_t rows = 0;
    std::size_t columns = 0;
    std::vector<double> values;

    const double* row(std::size_t i) const { return values.data() + i * columns; }
};

constexpr std::size_t common_columns = 2;
constexpr std::size_t factor_columns = 3;

std::size_t factors_of(std::size_t columns) { return (columns - common_columns) / factor_columns; }

double variance_of(const double* sums, double n) {
    const double mean = sums[0] / n;
    return sums[1] / n - mean * mean;
}

/// Indices from the terms' sums over n base points: of first order, then total.
void indices_of(const double* sums, std::size_t columns, double n, double* indices) {
    const double variance = variance_of(sums, n);
    const double mean = sums[0] / n;
    const std::size_t k = factors_of(columns);
    for (std::size_t i = 0; i < k; ++i) {
        const double* of_factor = sums + common_columns + i * factor_columns;
        indices[i] = (of_factor[0] - mean * of_factor[1]) / (n * variance);
        indices[k + i] = of_factor[2] / (n * variance);
    }
}

/// Quantile of type 6 (Hyndman, Fan, Am. Stat. 50, 361, 1996): n replicates cut their distribution into n + 1 parts of
/// equal probability.
double quantile_of_replicates(const std::vector<double>& sorted, double p) {
    const auto n = static_cast<double>(sorted.size());
    const double position = std::clamp(p * (n + 1.0) - 1.0, 0.0, n - 1.0);
    const auto below = static_cast<std::size_t>(position);
    if (below + 1 >= sorted.size()) return sorted.back();
    return std::lerp(sorted[below], sorted[below + 1], position - static_cast<double>(below));
}

/// A third of the skewness of the influences, which are those of leaving one base point out (Efron 1987, eq. 6.6).
std::vector<double> accelerations(const Terms& terms, const std::vector<double>& sums) {
    const std::size_t count = 2 * factors_of(terms.columns);
    std::vector<double> without(terms.columns);
    std::vector<double> indices(count);
    std::vector<double> mean(count, 0.0);
    std::vector<double> squares(count, 0.0);
    std::vector<double> cubes(count, 0.0);
    const auto n = static_cast<double>(terms.rows);
    const auto leave_out = [&](std::size_t row) {
        for (std::size_t c = 0; c < terms.columns; ++c) without[c] = sums[c] - terms.row(row)[c];
        indices_of(without.data(), terms.columns, n - 1.0, indices.data());
    };
    for (std::size_t row = 0; row < terms.rows; ++row) {
        leave_out(row);
        for (std::size_t i = 0; i < count; ++i) mean[i] += indices[i] / n;
    }
    for (std::size_t row = 0; row < terms.rows; ++row) {
        leave_out(row);
        for (std::size_t i = 0; i < count; ++i) {
            const double influence = mean[i] - indices[i];
            squares[i] += influence * influence;
            cubes[i] += influence * influence * influence;
        }
    }
    std::vector<double> a(count, 0.0);
    for (std::size_t i = 0; i < count; ++i) {
        if (squares[i] > 0.0) a[i] = cubes[i] / (6.0 * std::pow(squares[i], 1.5));
    }
    return a;
}

/// Ends of a BCa interval as levels of the replicates' distribution (Efron 1987, eq. 2.3).
std::pair<double, double> corrected_levels(const std::vector<double>& sorted, double estimate, double acceleration,
                                           double confidence) {
    const auto n = static_cast<double>(sorted.size());
    const auto below = std::ranges::lower_bound(sorted, estimate) - sorted.begin();
    const auto not_above = std::ranges::upper_bound(sorted, estimate) - sorted.begin();
    const double share = 0.5 * static_cast<double>(below + not_above) / n;
    const boost::math::normal standard;
    const double bias = boost::math::quantile(standard, std::clamp(share, 0.5 / n, 1.0 - 0.5 / n));
    const auto level = [&](double p) {
        const double z = bias + boost::math::quantile(standard, p);
        return boost::math::cdf(standard, bias + z / std::max(1.0 - acceleration * z, 1e-3));
    };
    return {level(0.5 * (1.0 - confidence)), level(0.5 * (1.0 + confidence))};
}

/// Column after column, round by round; rounds whose base points do not vary are marked by NaN.
std::vector<std::vector<double>> replicates_of(const Terms& terms, double least_variance,
                                               const SensitivityOptions& options) {
    const std::size_t count = 2 * factors_of(terms.columns);
    const auto n = static_cast<double>(terms.rows);
    std::vector<std::vector<double>> replicates(count, std::vector<double>(options.rounds));
    tbb::parallel_for(tbb::blocked_range<std::size_t>(0, options.rounds), [&](const auto& range) {
        std::vector<double> drawn(terms.rows);
        std::vector<double> sums(terms.columns);
        std::vector<double> indices(count);
        for (std::size_t round = range.begin(); round < range.end(); ++round) {
            random::Engine engine = random::make_engine({options.seed, round}, random::Purpose::sensitivity_bootstrap);
            boost::random::uniform_int_distribution<std::uint64_t> pick(0, terms.rows - 1);
            std::ranges::fill(drawn, 0.0);
            for (std::size_t i = 0; i < terms.rows; ++i) drawn[pick(engine)] += 1.0;
            std::ranges::fill(sums, 0.0);
            for (std::size_t row = 0; row < terms.rows; ++row) {
                if (drawn[row] == 0.0) continue;
                const double* values = terms.row(row);
                for (std::size_t c = 0; c < terms.columns; ++c) sums[c] += drawn[row] * values[c];
            }
            if (variance_of(sums.data(), n) > least_variance) {
                indices_of(sums.data(), terms.columns, n, indices.data());
            } else {
                std::ranges::fill(indices, std::numeric_limits<double>::quiet_NaN());
            }
            for (std::size_t i = 0; i < count; ++i) replicates[i][round] = indices[i];
        }
    });
    return replicates;
}

/// The values of one output, base point by base point.
class Output {
   public:
    Output(const Evaluations& e, std::size_t output) : e_(e), output_(output) {
        for (std::size_t base = 0; base < e.base_points; ++base) {
            bool finite = true;
            for (std::size_t i = 0; i < e.factors + 2; ++i) finite = finite && std::isfinite(value(base, i));
            if (finite) kept_.push_back(base);
        }
    }

    const std::vector<std::size_t>& kept() const { return kept_; }
    double value(std::size_t base, std::size_t i) const { return e_.values[index(base, i)]; }
    double noise_variance(std::size_t base, std::size_t i) const { return e_.noise_variance[index(base, i)]; }

   private:
    std::size_t index(std::size_t base, std::size_t i) const {
        return (base * (e_.factors + 2) + i) * e_.outputs + output_;
    }

    const Evaluations& e_;
    std::size_t output_;
    std::vector<std::size_t> kept_;
};

double mean_of_a_and_b(const Output& output) {
    // Halved before they are added: the largest doubles have a mean, too.
    const auto n = static_cast<double>(output.kept().size());
    double mean = 0.0;
    for (const std::size_t base : output.kept()) {
        mean += 0.5 * output.value(base, 0) / n + 0.5 * output.value(base, 1) / n;
    }
    return mean;
}

Terms terms_of(const Output& output, std::size_t factors, double offset, double scale) {
    Terms terms;
    terms.rows = output.kept().size();
    terms.columns = common_columns + factors * factor_columns;
    terms.values.reserve(terms.rows * terms.columns);
    for (const std::size_t base : output.kept()) {
        const auto f = [&](std::size_t i) { return (output.value(base, i) - offset) / scale; };
        const double a = f(0);
        const double b = f(1);
        terms.values.push_back(0.5 * (a + b));
        terms.values.push_back(0.5 * (a * a + b * b));
        for (std::size_t i = 0; i < factors; ++i) {
            const double d = f(2 + i) - a;
            terms.values.push_back(b * d);
            terms.values.push_back(d);
            terms.values.push_back(0.5 * d * d);
        }
    }
    return terms;
}

std::vector<double> column_sums(const Terms& terms) {
    std::vector<double> sums(terms.columns, 0.0);
    for (std::size_t row = 0; row < terms.rows; ++row) {
        for (std::size_t c = 0; c < terms.columns; ++c) sums[c] += terms.row(row)[c];
    }
    return sums;
}

OutputIndices of_output(const Evaluations& e, std::size_t number, const SensitivityOptions& options) {
    const Output output(e, number);
    const std::vector<std::size_t>& kept = output.kept();
    OutputIndices result;
    result.base_points = kept.size();
    result.left_out = e.base_points - kept.size();
    if (!kept.empty()) result.mean = mean_of_a_and_b(output);
    double scale = 0.0;
    double largest = 0.0;
    for (const std::size_t base : kept) {
        for (std::size_t i = 0; i < e.factors + 2; ++i) {
            largest = std::max(largest, std::abs(output.value(base, i)));
            scale = std::max(scale, std::abs(output.value(base, i) - *result.mean));
        }
    }
    if (!(scale < std::sqrt(std::numeric_limits<double>::max()))) {
        result.absent = fmt::format("values up to {:.3g} are too large to be squared", largest);
        return result;
    }
    const bool constant = scale <= rounding * largest || scale < std::sqrt(std::numeric_limits<double>::min());
    const Terms terms = terms_of(output, e.factors, result.mean.value_or(0.0), constant ? 1.0 : scale);
    const std::vector<double> sums = column_sums(terms);
    const auto n = static_cast<double>(terms.rows);
    const double variance = constant || kept.empty() ? 0.0 : variance_of(sums.data(), n);
    if (!kept.empty()) result.variance = variance * scale * scale;
    if (kept.size() < fewest_base_points) {
        result.absent = fmt::format("only {} of {} base points have finite values throughout, but at least {} must",
                                    kept.size(), e.base_points, fewest_base_points);
        return result;
    }
    const double least_variance = std::pow(rounding * largest / (constant ? 1.0 : scale), 2);
    if (constant || !(variance > least_variance)) {
        result.variance = 0.0;
        result.absent = "the output does not vary with the factors";
        return result;
    }
    const auto replicates = replicates_of(terms, least_variance, options);
    const auto lost = std::ranges::count_if(replicates.front(), [](double r) { return std::isnan(r); });
    if (static_cast<double>(lost) > most_rounds_without_variance * static_cast<double>(options.rounds)) {
        result.absent = fmt::format("the output varies at so few base points that {} of {} resamplings do not vary",
                                    lost, options.rounds);
        return result;
    }
    std::vector<double> estimates(2 * e.factors);
    indices_of(sums.data(), terms.columns, n, estimates.data());
    const std::vector<double> acceleration =
        options.bootstrap == Bootstrap::bca ? accelerations(terms, sums) : std::vector<double>();
    const auto index = [&](std::size_t i) {
        std::vector<double> sorted;
        std::ranges::copy_if(replicates[i], std::back_inserter(sorted), [](double r) { return !std::isnan(r); });
        std::ranges::sort(sorted);
        std::pair<double, double> levels = {0.5 * (1.0 - options.confidence), 0.5 * (1.0 + options.confidence)};
        if (options.bootstrap == Bootstrap::bca) {
            levels = corrected_levels(sorted, estimates[i], acceleration[i], options.confidence);
        }
        return Index{estimates[i], quantile_of_replicates(sorted, levels.first),
                     quantile_of_replicates(sorted, levels.second)};
    };
    for (std::size_t i = 0; i < e.factors; ++i) result.factors.push_back({index(i), index(e.factors + i)});
    if (!e.noise_variance.empty()) {
        double noise = 0.0;
        for (const std::size_t base : kept) {
            noise += 0.5 * (output.noise_variance(base, 0) + output.noise_variance(base, 1)) / n;
        }
        result.noise_share = noise / *result.variance;
    }
    return result;
}

void check_sizes(const Evaluations& e) {
    if (e.base_points == 0 || e.factors == 0 || e.outputs == 0) {
        throw InputError(
            fmt::format("sensitivity indices of {} base points, {} factors and {} outputs: "
                        "there must be one of each at least",
                        e.base_points, e.factors, e.outputs));
    }
    // By division: products of sizes that are wrong may overflow.
    const std::size_t size = e.values.size();
    if (size % e.outputs != 0 || (size / e.outputs) % e.base_points != 0 || size / e.outputs / e.base_points < 2 ||
        size / e.outputs / e.base_points - 2 != e.factors) {
        throw InputError(
            fmt::format("{} values of {} outputs at {} base points of {} factors: "
                        "there must be outputs x base points x (factors + 2)",
                        size, e.outputs, e.base_points, e.factors));
    }
    if (e.noise_variance.empty()) return;
    if (e.noise_variance.size() != size) {
        throw InputError(
            fmt::format("{} noise variances for {} values: give one a value, or none", e.noise_variance.size(), size));
    }
    for (std::size_t i = 0; i < size; ++i) {
        if (std::isfinite(e.values[i]) && !(e.noise_variance[i] >= 0.0 && std::isfinite(e.noise_variance[i]))) {
            throw InputError(
                fmt::format("noise variance {} of output {} at evaluation {}: must be finite and not below 0",
                            e.noise_variance[i], i % e.outputs, i / e.outputs));
        }
    }
}

void check_sensitivity_options(const SensitivityOptions& o) {
    if (!(o.confidence > 0.0 && o.confidence < 1.0)) {
        throw InputError(fmt::format("confidence {} of sensitivity indices: must lie between 0 and 1", o.confidence));
    }
    if (o.rounds < fewest_rounds) {
        throw InputError(fmt::format("{} resamplings for the intervals of sensitivity indices: {} at least", o.rounds,
                                     fewest_rounds));
    }
}

}  // namespace

Points sensitivity_points(std::uint64_t base_points, std::uint64_t factors, std::uint64_t seed, std::uint64_t limit) {
    if (factors == 0) throw InputError("sensitivity indices of no factors: name one or more");
    if (base_points == 0) throw InputError("sensitivity indices of no base points: ask for one or more");
    if (factors > most_sobol_dimensions() / 2) {
        throw InputError(
            fmt::format("sensitivity indices of {} factors: {} is the most", factors, most_sobol_dimensions() / 2));
    }
    if (base_points > limit / (factors + 2)) {
        throw InputError(
            fmt::format("sensitivity indices of {} factors at {} base points take {} evaluations each: "
                        "{} evaluations is the limit; ask for {} base points or fewer",
                        factors, base_points, factors + 2, limit, limit / (factors + 2)));
    }
    const Points both = sobol(base_points, 2 * factors, seed, limit);
    Points points = room_for(base_points * (factors + 2), factors, limit);
    for (std::uint64_t base = 0; base < base_points; ++base) {
        const auto a = both[base].first(factors);
        const auto b = both[base].last(factors);
        for (std::uint64_t i = 0; i < factors + 2; ++i) {
            const std::span<double> point = points[base * (factors + 2) + i];
            std::ranges::copy(i == 1 ? b : a, point.begin());
            if (i >= 2) point[i - 2] = b[i - 2];
        }
    }
    return points;
}

std::vector<OutputIndices> sensitivity_indices(const Evaluations& evaluations, const SensitivityOptions& options) {
    check_sizes(evaluations);
    check_sensitivity_options(options);
    std::vector<OutputIndices> indices;
    for (std::size_t output = 0; output < evaluations.outputs; ++output) {
        indices.push_back(of_output(evaluations, output, options));
    }
    return indices;
}

}  // namespace ringlock::design
