#pragma once
#include <Eigen/Dense>

namespace ringlock::closure {

/// A rate of two states, each kept or left from one stretch of the record to the next with a probability of its own: a
/// hidden Markov chain, all courses of which are summed over. What a single course explains, found by a search
/// (two_levels.hpp), must pay for the place of every jump; this is what can be held against a random rate, whose
/// likelihood has its course integrated out as well.
struct TwoStates {
    double gain = 0.0;  ///< of the log-likelihood over a rate that stays as it is
    double rate = 0.0;  ///< of the lower state; in the units of the regression
    double step = 0.0;  ///< of the other over it
    double up = 0.0;    ///< probabilities, from one stretch to the next
    double down = 0.0;
    Eigen::VectorXd expected = {};  ///< rate of each stretch
};

/// By the method of Baum, Petrie, Soules and Weiss (Annals of Mathematical Statistics 41, 1970, 164), from the normal
/// equations of a regression on the rates of stretches (one column a stretch, in the order of time). Stretches must be
/// long enough that only neighbours have anything to do with each other: what is beside the second diagonal is left
/// out. \param shape  to start from: 1 in the stretches of one state, 0 in those of the other
TwoStates two_states(const Eigen::MatrixXd& normal, const Eigen::VectorXd& right, const Eigen::VectorXd& shape);

}  // namespace ringlock::closure
