#include "analysis/closure/stats/normality.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "analysis/closure/options.hpp"
#include "analysis/closure/stats/p_values.hpp"

namespace ringlock::closure {

namespace {

/// Kurtosis beyond 3, and its deviation from the expected one in standard errors: Anscombe and Glynn (Biometrika 70,
/// 227, 1983).
struct Excess {
    double kurtosis, z;
};
Excess excess_of(std::span<const double> values, double expected = 0.0) {
    const auto count = static_cast<double>(values.size());
    double second = 0.0;
    double fourth = 0.0;
    for (const double s : values) second += s * s / count;
    for (const double s : values) fourth += s * s * s * s / count;
    const double kurtosis = fourth / (second * second) - 3.0;
    const double mean = -6.0 / (count + 1.0);
    const double variance =
        24.0 * count * (count - 2.0) * (count - 3.0) / ((count + 1.0) * (count + 1.0) * (count + 3.0) * (count + 5.0));
    const double x = (kurtosis - expected - mean) / std::sqrt(variance);
    const double skew = 6.0 * (count * count - 5.0 * count + 2.0) / ((count + 7.0) * (count + 9.0)) *
                        std::sqrt(6.0 * (count + 3.0) * (count + 5.0) / (count * (count - 2.0) * (count - 3.0)));
    const double a = 6.0 + 8.0 / skew * (2.0 / skew + std::sqrt(1.0 + 4.0 / (skew * skew)));
    const double inner = (1.0 - 2.0 / a) / (1.0 + x * std::sqrt(2.0 / (a - 4.0)));
    return {kurtosis, ((1.0 - 2.0 / (9.0 * a)) - std::cbrt(inner)) / std::sqrt(2.0 / (9.0 * a))};
}

}  // namespace

bool is_of_even_density(std::span<const double> innovations) {
    const auto [kurtosis, z] = excess_of(innovations);
    return kurtosis < 0.0 && chi2_tail(z * z, 1) < options.stats.normality.flat_p_value;
}

bool is_of_even_density(const std::vector<double>& innovations, const Rows& rows) {
    std::vector<double> counted;
    for (std::size_t i = 0; i < innovations.size(); ++i) {
        if (rows[i]) counted.push_back(innovations[i]);
    }
    return is_of_even_density(counted);
}

std::optional<ResidualTest> fourth_moments(const std::vector<double>& innovations, const Rows& rows,
                                           std::size_t shortest, std::size_t shortest_bounded,
                                           const std::function<double(std::size_t)>& expected_excess) {
    const StatsOptions::Normality& of = options.stats.normality;
    const std::size_t n = innovations.size();
    double least = 1.0;
    std::size_t at = 0;
    double tried = 0.0;
    double excess = 0.0;
    for (std::size_t m = 1; m * of.rows_per_sum < n; m *= of.growth_of_sums) {
        if (m < shortest) continue;
        std::vector<double> sums;
        for (std::size_t a = 0; a + m <= n; a += m) {
            double sum = 0.0;
            bool all = true;
            for (std::size_t i = a; i < a + m && all; ++i) {
                all = rows[i] != 0;
                sum += innovations[i];
            }
            if (all) sums.push_back(sum);
        }
        if (sums.size() < of.fewest_sums) break;
        const auto [kurtosis, z] = excess_of(sums, expected_excess ? expected_excess(m) : 0.0);
        const double p = chi2_tail(z * z, 1);
        tried += 1.0;
        if (m < shortest_bounded && kurtosis < 0.0) continue;
        if (p < least) {
            least = p;
            at = m;
            excess = kurtosis;
        }
    }
    if (tried == 0.0) return std::nullopt;
    return ResidualTest{Where::amplitude, "fourth moment of sums of the residual", of_several(least, tried),
                        fmt::format("excess {:.3g} of sums of {}", excess, at)};
}

std::optional<Jump> largest_jump(const std::vector<double>& innovations, const Rows& rows,
                                 const std::vector<double>& response) {
    const StatsOptions::Jumps& of = options.stats.jumps;
    const std::size_t n = innovations.size();
    const std::size_t middle = n / 2;
    double all = 0.0;
    for (std::size_t i = middle; i < n; ++i) all += response[i] * response[i];
    Jump jump;
    double part = 0.0;
    while (part < of.share_of_response * all && middle + jump.length < n) {
        part += response[middle + jump.length] * response[middle + jump.length];
        ++jump.length;
    }
    const std::size_t stride = std::max<std::size_t>(1, jump.length / of.positions_per_length);
    for (std::size_t a = 0; a + jump.length <= n; a += stride) {
        double sum = 0.0;
        double weight = 0.0;
        for (std::size_t i = 0; i < jump.length; ++i) {
            if (!rows[a + i]) continue;
            const double h = response[middle + i];
            sum += h * innovations[a + i];
            weight += h * h;
        }
        if (!(weight > of.share_counted * part)) continue;
        jump.positions += 1.0;
        if (sum * sum / weight <= jump.chi2) continue;
        jump.chi2 = sum * sum / weight;
        jump.row = a;
    }
    if (jump.positions < of.fewest_positions) return std::nullopt;
    return jump;
}

ResidualTest test_of(const Jump& jump) {
    return {Where::time, "jumps of a rate that wanders", of_several(chi2_tail(jump.chi2, 1), jump.positions),
            fmt::format("{:.1f} standard errors", std::sqrt(jump.chi2))};
}

}  // namespace ringlock::closure
