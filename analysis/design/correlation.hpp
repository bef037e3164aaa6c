#pragma once
#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "analysis/design/factor.hpp"

namespace ringlock::design {

/// Quantities to which a given correlation applies.
///
/// ranks: Spearman's, the correlation of the ranks of two factors over the lot. Monotone functions of the factors and
/// bounds that cut their distributions off leave it as it is.
/// normal_scores: Pearson's correlation of the normal scores Phi^-1(F(x)), the parameter of the Gaussian copula; for
/// two normal factors without bounds it is the usual correlation coefficient. With either the dependence is that of a
/// Gaussian copula; the two are tied by rho = 2 sin(pi rho_s/6) (Kruskal, J. Am. Stat. Assoc. 53, 814, 1958) and differ
/// by 0.018 at most.
enum class CorrelationOf { ranks, normal_scores };

/// Of the factors of two keys; pairs that are not named are independent.
struct Correlation {
    std::string first;
    std::string second;
    double value = 0.0;  ///< above -1 and below 1: two factors of correlation 1 are one
};

/// Makes independent coordinates of the unit cube depend on each other by a Gaussian copula: z = Phi^-1(u), w = L z
/// with the correlation matrix L L^T, v = Phi(w) (Nelsen, "An introduction to copulas", 2nd ed. 2006, 2.3). Each
/// coordinate by itself stays uniform. The first of the factors that depend on each other keeps the strata of a Latin
/// hypercube; the others lose theirs.
class GaussianCopula {
   public:
    /// Throws InputError, naming the keys: one that no factor has or whose factor has no distribution, a factor with
    /// itself, a pair given twice, a number that is not above -1 and below 1, or a matrix that is not positive
    /// definite.
    GaussianCopula(std::span<const Factor> factors, std::span<const Correlation> correlations, CorrelationOf of);

    /// Whether it leaves all points as they are.
    bool independent() const;

    /// \param u  one point of the unit cube, one coordinate a factor, all above 0 and below 1
    /// \param v  as many
    void operator()(std::span<const double> u, std::span<Probability> v) const;

   private:
    Eigen::MatrixXd factor_;     ///< L
    std::vector<char> depends_;  ///< whether the row of L is not that of the identity
};

}  // namespace ringlock::design
