#include "analysis/design/correlation.hpp"

#include <fmt/format.h>

#include <Eigen/Core>
#include <algorithm>
#include <boost/math/distributions/normal.hpp>
#include <cmath>
#include <limits>
#include <optional>

#include "engine/core/dense.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"

namespace ringlock::design {
namespace {

/// A matrix of which an eigenvalue is smaller has correlations that differ from the impossible by rounding only.
constexpr double least_eigenvalue = 1e-10;

Eigen::Index index_of(std::span<const Factor> factors, const std::string& key, const Correlation& c) {
    const auto found = std::ranges::find(factors, key, &Factor::key);
    const std::string what = fmt::format("correlation of {} and {}", c.first, c.second);
    if (found == factors.end()) throw InputError(fmt::format("{}: no factor has the key {}", what, key));
    if (!has_distribution(*found)) {
        throw InputError(
            fmt::format("{}: {} has values and no distribution; give it one, or leave the correlation out", what, key));
    }
    return found - factors.begin();
}

double normal_score_correlation(double value, CorrelationOf of) {
    return of == CorrelationOf::ranks ? 2.0 * std::sin(units::pi * value / 6.0) : value;
}

/// The keys that the direction of the smallest eigenvalue is made of.
std::string contradicting(std::span<const Factor> factors, const Eigen::VectorXd& direction) {
    const double largest = direction.cwiseAbs().maxCoeff();
    std::string keys;
    for (Eigen::Index i = 0; i < direction.size(); ++i) {
        if (std::abs(direction[i]) < 0.05 * largest) continue;
        keys += (keys.empty() ? "" : ", ") + factors[static_cast<std::size_t>(i)].key;
    }
    return keys;
}

}  // namespace

GaussianCopula::GaussianCopula(std::span<const Factor> factors, std::span<const Correlation> correlations,
                               CorrelationOf of)
    : depends_(factors.size(), 0) {
    if (correlations.empty()) return;
    const auto n = static_cast<Eigen::Index>(factors.size());
    Eigen::MatrixXd matrix = Eigen::MatrixXd::Identity(n, n);
    Eigen::MatrixXi given = Eigen::MatrixXi::Zero(n, n);
    for (const Correlation& c : correlations) {
        const Eigen::Index i = index_of(factors, c.first, c);
        const Eigen::Index j = index_of(factors, c.second, c);
        if (i == j) throw InputError(fmt::format("correlation of {} with itself: leave it out", c.first));
        if (given(i, j) != 0) {
            throw InputError(fmt::format("correlation of {} and {}: is given twice; leave one out", c.first, c.second));
        }
        if (!(std::abs(c.value) <= 1.0)) {
            throw InputError(
                fmt::format("correlation of {} and {}: {} must lie above -1 and below 1", c.first, c.second, c.value));
        }
        if (std::abs(c.value) == 1.0) {
            throw InputError(
                fmt::format("correlation of {} and {}: {} must lie above -1 and below 1; "
                            "two factors that determine each other are one factor; leave one of them out",
                            c.first, c.second, c.value));
        }
        given(i, j) = given(j, i) = 1;
        matrix(i, j) = matrix(j, i) = normal_score_correlation(c.value, of);
    }
    const dense::SymmetricEigen eigen = dense::symmetric_eigen(matrix);
    const std::optional<Eigen::MatrixXd> factor = dense::cholesky(matrix);
    if (eigen.values[0] < least_eigenvalue || !factor) {
        throw InputError(
            fmt::format("the correlations of {} contradict each other: no factors can have them all (the "
                        "smallest eigenvalue of their matrix is {:.3g} and must be above 0); bring them nearer to 0",
                        contradicting(factors, eigen.vectors.col(0)), eigen.values[0]));
    }
    factor_ = *factor;
    for (Eigen::Index i = 0; i < n; ++i) {
        depends_[static_cast<std::size_t>(i)] = (factor_.row(i).head(i).array() != 0.0).any() ? 1 : 0;
    }
}

bool GaussianCopula::independent() const {
    return std::ranges::none_of(depends_, [](char depends) { return depends != 0; });
}

void GaussianCopula::operator()(std::span<const double> u, std::span<Probability> v) const {
    std::ranges::transform(u, v.begin(), &Probability::of);
    if (independent()) return;
    const boost::math::normal standard;
    std::vector<double> z(u.size());
    for (std::size_t i = 0; i < u.size(); ++i) {
        z[i] = u[i] < 0.5 ? boost::math::quantile(standard, u[i])
                          : boost::math::quantile(boost::math::complement(standard, 1.0 - u[i]));
    }
    // The product overwrites z, so it runs from the last row to the first: a row uses only the scores before its own.
    for (std::size_t i = u.size(); i-- > 0;) {
        if (depends_[i] == 0) continue;
        double w = 0.0;
        for (std::size_t j = 0; j <= i; ++j)
            w += factor_(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) * z[j];
        // Many extremes at once can leave the range of a double.
        const double smallest = std::numeric_limits<double>::min();
        v[i] = {std::max(boost::math::cdf(standard, w), smallest),
                std::max(boost::math::cdf(boost::math::complement(standard, w)), smallest)};
    }
}

}  // namespace ringlock::design
