#pragma once
#include <Eigen/Dense>

namespace ringlock::closure {

/// A rate that jumps between two levels, as a regression on the rates of stretches of the record shows it.
struct TwoLevels {
    double chi2 = 0.0;  ///< that the jumps explain
    int changes = 0;
    double merit = 0.0;          ///< gain of the log-likelihood less the cost
    double cost = 0.0;           ///< of levels and places
    double p_value = 1.0;        ///< by chance, all courses of as many changes counted
    Eigen::VectorXd shape = {};  ///< 1 in the stretches of one level, 0 in those of the other
};

/// The best course found, from the normal equations of the regression (one column a stretch, in the order of time,
/// freed of constant rates). Ranges are turned over one by one from the best single jump on, for as long as the merit
/// rises: the largest of all courses is not promised, so what is found is never too much.
TwoLevels two_levels(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right);

}  // namespace ringlock::closure
