#include "analysis/allan/allan.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "analysis/allan/interval.hpp"
#include "analysis/allan/statistics/noise_identification.hpp"
#include "analysis/allan/sums/difference_sums.hpp"
#include "analysis/allan/sums/gapped_rates.hpp"
#include "analysis/allan/sums/interval_error.hpp"
#include "analysis/allan/sums/mean_differences.hpp"
#include "analysis/allan/sums/piece_sums.hpp"
#include "analysis/allan/sums/total_sums.hpp"
#include "analysis/allan/uncertainty.hpp"
#include "engine/core/error.hpp"

namespace ringlock::allan {
namespace {

/// Identifies the noise at each factor; beyond the last factor with enough points the result of that factor is kept.
class NoisePerFactor {
   public:
    NoisePerFactor(std::span<const double> phase, int differences)
        : phase_(phase),
          differences_(differences),
          steps_(static_cast<std::int64_t>(phase.size()) - 1),
          last_(steps_ / (noise_identification_points - 1)) {}

    int operator()(std::int64_t m) {
        if (last_ < 1) return 0;
        if (m < last_) return found_at(m);
        if (!known_) kept_ = found_at(last_);
        known_ = true;
        return kept_;
    }

   private:
    int found_at(std::int64_t m) const {
        return nearest_noise(pooled_noise_exponent(phase_, m, differences_).value_or(0.0), differences_);
    }

    std::span<const double> phase_;
    int differences_ = 2;
    std::int64_t steps_ = 0;
    std::int64_t last_ = 0;
    bool known_ = false;
    int kept_ = 0;
};

/// Phase with straight lines where it is missing; where its origin was lost it goes on from the last value.
std::vector<double> bridged(const Phase& phase) {
    std::vector<double> x(phase.x);
    double raised = 0.0;
    for (std::size_t k = 0; k < phase.stretches.size(); ++k) {
        const Stretch& s = phase.stretches[k];
        if (k > 0) {
            const std::size_t before = phase.stretches[k - 1].end - 1;
            if (!phase.one_origin) raised = x[before] - phase.x[s.begin];
            const double step = (phase.x[s.begin] + raised - x[before]) / static_cast<double>(s.begin - before);
            for (std::size_t i = before + 1; i < s.begin; ++i) x[i] = x[i - 1] + step;
        }
        for (std::size_t i = s.begin; i < s.end; ++i) x[i] = phase.x[i] + raised;
    }
    return x;
}

/// A record, and the stretches into which gaps divide it.
struct Record {
    std::span<const double> x;
    std::span<const Stretch> stretches;
    bool one_origin = true;

    std::span<const double> of(const Stretch& s) const { return x.subspan(s.begin, s.size()); }
    bool skipping() const { return stretches.size() > 1 && one_origin; }
};

std::vector<SquareMean> difference_sums(const Traits& t, const Record& record, std::span<const std::size_t> m) {
    const Difference difference{.order = t.differences, .skipping = record.skipping()};
    if (t.overlapping) return sums_of_differences(record.x, difference, m);
    std::vector<SquareMean> out;
    for (const std::size_t step : m) out.push_back(sum_of_strided_differences(record.x, difference, step, step));
    return out;
}

std::vector<SquareMean> gapped_sums(const Traits& t, const Phase& phase, std::span<const std::size_t> m) {
    const GappedRates rates(phase);
    std::vector<SquareMean> out;
    for (const std::size_t step : m) out.push_back(rates.sum(t.differences, step, t.overlapping ? 1 : step));
    return out;
}

/// Errors of time where the origin was lost: within stretches.
std::vector<SquareMean> error_sums(const Record& record, std::span<const std::size_t> m) {
    std::vector<SquareMean> sums(m.size());
    for (const Stretch& s : record.stretches) {
        const std::vector<SquareMean> more = sums_of_differences(record.of(s), {.order = 1}, m);
        for (std::size_t k = 0; k < sums.size(); ++k) sums[k] += more[k];
    }
    return sums;
}

std::vector<SquareMean> mean_difference_sums(const Record& record, std::span<const std::size_t> m) {
    std::vector<SquareMean> sums(m.size());
    for (const Stretch& s : record.stretches) {
        const MeanDifferences differences(record.of(s));
        for (std::size_t k = 0; k < m.size(); ++k) sums[k] += differences.sum(m[k]);
    }
    return sums;
}

std::vector<SquareMean> piece_sums(const Record& record, std::span<const std::size_t> m, bool of_frequency) {
    std::vector<SquareMean> sums(m.size());
    for (const Stretch& s : record.stretches) {
        const std::span<const double> x = record.of(s);
        std::vector<double> steps;
        for (std::size_t i = 0; of_frequency && i + 1 < x.size(); ++i) steps.push_back(x[i + 1] - x[i]);
        for (std::size_t k = 0; k < m.size(); ++k) {
            // With a single sample in a tau there is nothing to reflect (SP1065 section 5.2.14).
            sums[k] += of_frequency && m[k] == 1
                           ? sum_of_differences(x, {.order = 3}, 1, 0, x.size() > 3 ? x.size() - 3 : 0)
                           : sum_of_pieces(of_frequency ? std::span<const double>(steps) : x, m[k]);
        }
    }
    return sums;
}

/// The sums of squares of the estimator's family at each factor.
std::vector<SquareMean> square_sums(const Traits& t, const Record& record, const Phase* phase,
                                    std::span<const std::size_t> m) {
    switch (t.family) {
        case Family::difference:
            return record.one_origin ? difference_sums(t, record, m) : gapped_sums(t, *phase, m);
        case Family::interval_error:
            return record.one_origin ? difference_sums(t, record, m) : error_sums(record, m);
        case Family::modified:
            return mean_difference_sums(record, m);
        case Family::modified_total:
            return piece_sums(record, m, false);
        case Family::hadamard_total:
            return piece_sums(record, m, true);
        case Family::total: {
            Phase copy;
            if (phase == nullptr) {
                copy.x.assign(record.x.begin(), record.x.end());
                copy.stretches.assign(record.stretches.begin(), record.stretches.end());
            }
            const Reflected reflected(phase == nullptr ? copy : *phase);
            std::vector<SquareMean> out;
            for (const std::size_t step : m) out.push_back(reflected.sum(step));
            return out;
        }
    }
    return {};
}

/// Variance from the mean square of the differences that the family sums.
double variance_of(const Traits& t, double mean_square, std::int64_t m, double tau0_s) {
    const double tau = static_cast<double>(m) * tau0_s;
    switch (t.family) {
        case Family::interval_error:
            return mean_square;
        case Family::modified:
        case Family::modified_total:
            return t.time ? mean_square / 6.0 : mean_square / (2.0 * tau * tau);
        case Family::hadamard_total:
            return m == 1 ? mean_square / (6.0 * tau * tau) : mean_square / (6.0 * tau0_s * tau0_s);
        case Family::difference:
        case Family::total:
            break;
    }
    return mean_square / ((t.differences == 3 ? 6.0 : 2.0) * tau * tau);
}

/// Phase points of a record without gaps that has as many terms.
std::int64_t effective_points(Estimator estimator, std::int64_t m, std::int64_t terms, std::int64_t points) {
    const Traits& t = traits(estimator);
    if (terms >= term_count(estimator, m, points)) return points;
    if (t.family == Family::total) return std::max(span_of(estimator, m), terms + 2);
    return span_of(estimator, m) + (terms - 1) * (t.overlapping ? 1 : m);
}

void check_factors(Estimator estimator, std::span<const std::int64_t> factors, std::int64_t points) {
    const std::int64_t largest = largest_factor(estimator, points);
    for (const std::int64_t m : factors) {
        if (m >= 1 && m <= largest) continue;
        throw InputError(
            fmt::format("averaging factor {}: {} of {} phase points (one more than increments or rates) allows 1 to {}",
                        m, name(estimator), points, largest));
    }
}

std::vector<Point> interval_errors(Estimator estimator, const Record& record, double tau0_s,
                                   std::span<const std::int64_t> factors) {
    std::vector<Point> out(factors.size());
    for (std::size_t k = 0; k < factors.size(); ++k) {
        out[k].m = factors[k];
        out[k].tau_s = static_cast<double>(factors[k]) * tau0_s;
        out[k].edf = out[k].lo = out[k].hi = std::numeric_limits<double>::quiet_NaN();
    }
    if (estimator == Estimator::tierms) {
        const std::vector<std::size_t> steps(factors.begin(), factors.end());
        const std::vector<SquareMean> sums = square_sums(traits(estimator), record, nullptr, steps);
        for (std::size_t k = 0; k < out.size(); ++k) {
            out[k].terms = sums[k].terms;
            out[k].dev = std::sqrt(sums[k].sum / static_cast<double>(sums[k].terms));
        }
        return out;
    }
    const auto add = [&](std::span<const double> x) {
        const std::vector<Largest> largest = maximum_interval_errors(x, factors);
        for (std::size_t k = 0; k < out.size(); ++k) {
            out[k].dev = std::max(out[k].dev, largest[k].range);
            out[k].terms += largest[k].windows;
        }
    };
    if (record.one_origin) {
        add(record.x);
    } else {
        for (const Stretch& s : record.stretches) add(record.of(s));
    }
    return out;
}

std::vector<Point> variances_with_intervals(Estimator estimator, const Record& record, const Phase* phase,
                                            double tau0_s, std::span<const std::int64_t> factors,
                                            const Options& options) {
    const Traits& t = traits(estimator);
    const auto points = static_cast<std::int64_t>(record.x.size());
    const std::vector<std::size_t> steps(factors.begin(), factors.end());
    const std::vector<SquareMean> sums = square_sums(t, record, phase, steps);
    const std::vector<double> filled = record.stretches.size() > 1 ? bridged(*phase) : std::vector<double>{};
    NoisePerFactor noise(filled.empty() ? record.x : std::span<const double>(filled), t.differences);

    std::vector<Point> out;
    for (std::size_t k = 0; k < factors.size(); ++k) {
        Point p;
        p.m = factors[k];
        p.tau_s = static_cast<double>(p.m) * tau0_s;
        p.terms = sums[k].terms;
        out.push_back(p);
        if (p.terms == 0) continue;
        Point& there = out.back();
        there.alpha = noise(p.m);
        const std::int64_t alike = effective_points(estimator, p.m, p.terms, points);
        const Uncertainty u = uncertainty_of(estimator, there.alpha, p.m, alike, options.confidence);
        if (options.bias == Bias::published) there.bias = published_bias(estimator, there.alpha, p.m, alike);
        if (options.bias == Bias::exact) there.bias = u.bias;
        there.dev = std::sqrt(variance_of(t, sums[k].sum / static_cast<double>(p.terms), p.m, tau0_s) / there.bias);
        there.edf = u.edf;
        there.lo = there.dev / std::sqrt(u.high);
        there.hi = there.dev / std::sqrt(u.low);
    }
    return out;
}

std::vector<Point> deviation_of(Estimator estimator, const Record& record, const Phase* phase, double tau0_s,
                                std::span<const std::int64_t> factors, const Options& options) {
    check_deviation_input(tau0_s, options.confidence);
    check_factors(estimator, factors, static_cast<std::int64_t>(record.x.size()));
    std::vector<Point> out = traits(estimator).has_interval
                                 ? variances_with_intervals(estimator, record, phase, tau0_s, factors, options)
                                 : interval_errors(estimator, record, tau0_s, factors);
    std::erase_if(out, [](const Point& p) { return p.terms == 0; });
    return out;
}

}  // namespace

std::vector<Point> deviation(Estimator estimator, const Phase& phase, double tau0_s,
                             std::span<const std::int64_t> factors, const Options& options) {
    const bool as_it_is = traits(estimator).family == Family::interval_error && phase.line_per_sample != 0.0;
    const std::vector<double> raw = as_it_is ? with_line(phase) : std::vector<double>{};
    const Record record{.x = as_it_is ? std::span<const double>(raw) : std::span<const double>(phase.x),
                        .stretches = phase.stretches,
                        .one_origin = phase.one_origin};
    return deviation_of(estimator, record, &phase, tau0_s, factors, options);
}

std::vector<Point> deviation(Estimator estimator, std::span<const double> phase, double tau0_s,
                             std::span<const std::int64_t> factors, const Options& options) {
    const Stretch all{0, phase.size()};
    return deviation_of(estimator, {.x = phase, .stretches = {&all, 1}}, nullptr, tau0_s, factors, options);
}

}  // namespace ringlock::allan
