#pragma once
#include <Eigen/Dense>

namespace ringlock::closure {

/// A rate of two states, each kept or left from one stretch of the record to the next with its own probability: a
/// hidden Markov chain, whose likelihood is the sum over all paths. A single path that is found by a search
/// (two_levels.hpp) must pay for the place of every jump. The sum can be compared with a random rate, whose likelihood
/// has its path integrated out as well.
struct TwoStates {
    double gain = 0.0;  ///< of the log-likelihood over a constant rate
    double rate = 0.0;  ///< of the lower state, in the units of the regression
    double step = 0.0;  ///< of the upper state less the lower one
    double up = 0.0;    ///< probabilities of a change from one stretch to the next
    double down = 0.0;
    Eigen::VectorXd expected = {};  ///< expected rate of each stretch
};

/// By the method of Baum, Petrie, Soules and Weiss (Annals of Mathematical Statistics 41, 1970, 164), from the normal
/// equations of a regression on the rates of stretches (one column a stretch, in the order of time). Stretches must be
/// so long that only adjacent ones are correlated: elements beyond the second diagonal are neglected.
/// \param shape  start of the iteration: 1 in the stretches of one state, 0 in those of the other
TwoStates two_states(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right, const Eigen::VectorXd& shape);

}  // namespace ringlock::closure
