#pragma once
#include <Eigen/Dense>

namespace ringlock::closure {

/// A rate that jumps between two levels, from a regression on the rates of stretches of the record.
struct TwoLevels {
    double chi2 = 0.0;  ///< chi-squared that the jumps explain
    int changes = 0;
    double evidence = 0.0;       ///< gain of the log-likelihood less the cost
    double cost = 0.0;           ///< cost of levels and places
    double p_value = 1.0;        ///< by chance, with the search over all paths of as many changes
    Eigen::VectorXd shape = {};  ///< 1 in the stretches of one level, 0 in those of the other
};

/// The best path that is found, from the normal equations of the regression (one column a stretch, in the order of
/// time, with constant rates projected off). Starting from the best single jump, the levels of one range of stretches
/// are exchanged as long as the evidence rises. The path need not be the best of all, so its evidence is never too
/// large.
TwoLevels two_levels(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right);

}  // namespace ringlock::closure
