#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "analysis/allan/estimator.hpp"
#include "app/arguments.hpp"

namespace ringlock::app {

/// The averaging times that --tau asks for: one of the words octave, decade and all, or a list.
struct TauChoice {
    std::string word;                 ///< empty where there is a list
    std::vector<AveragingTime> list;  ///< averaging factors, and times with a unit
};

/// Throws InputError.
TauChoice parse_tau(const std::string& tau);

/// Averaging factors for a record of that many points of phase, ascending, each once. Throws InputError where the
/// record is too short for one, or a time is no whole number of samples (to 1e-9); says which the nearest are.
std::vector<std::int64_t> factors_for(const TauChoice& choice, allan::Estimator estimator, std::int64_t points,
                                      double tau0_s);

}  // namespace ringlock::app
