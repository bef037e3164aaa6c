#include "analysis/closure/stats/whiteness.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "analysis/closure/stats/p_values.hpp"

namespace ringlock::closure {

Correlations correlations_of(const std::vector<double>& innovations, const Rows& rows) {
    Correlations found;
    for (std::size_t k = 1; k < found.root.size(); ++k) {
        double sum = 0.0;
        double weight = 0.0;
        for (std::size_t i = k; i < innovations.size(); ++i) {
            if (!rows[i] || !rows[i - k]) continue;
            const double product = innovations[i] * innovations[i - k];
            sum += product;
            weight += product * product;
        }
        if (weight > 0.0) found.root[k] = sum / std::sqrt(weight);
    }
    return found;
}

ResidualTest Correlations::test(Where where, std::string subject) const {
    double chi2 = 0.0;
    for (const double r : root) chi2 += r * r;
    return {where, std::move(subject), chi2_tail(chi2, static_cast<int>(root.size()) - 1),
            fmt::format("first correlations {:.2f}, {:.2f}, {:.2f} standard errors", root[1], root[2], root[3])};
}

Squares squares_of(const std::vector<double>& innovations, const Rows& rows) {
    double mean = 0.0;
    double fourth = 0.0;
    double count = 0.0;
    for (std::size_t i = 0; i < innovations.size(); ++i) {
        if (!rows[i]) continue;
        const double square = innovations[i] * innovations[i];
        mean += square;
        fourth += square * square;
        count += 1.0;
    }
    mean /= count;
    return {mean, std::max(fourth / count - mean * mean, 1e-12)};
}

ResidualTest size_over_time(const std::vector<double>& innovations, const Rows& rows, std::size_t stretches,
                            double fewest) {
    const std::size_t n = innovations.size();
    const auto [mean, variance] = squares_of(innovations, rows);
    double chi2 = 0.0;
    int freedom = -1;
    for (std::size_t s = 0; s < stretches; ++s) {
        double sum = 0.0;
        double k = 0.0;
        for (std::size_t i = n * s / stretches; i < n * (s + 1) / stretches; ++i) {
            if (!rows[i]) continue;
            sum += innovations[i] * innovations[i] - mean;
            k += 1.0;
        }
        if (k < fewest) continue;
        chi2 += sum * sum / (k * variance);
        ++freedom;
    }
    return {Where::time, "size of the residual in stretches of the record", chi2_tail(chi2, freedom), ""};
}

}  // namespace ringlock::closure
