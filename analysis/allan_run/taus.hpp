#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/allan/estimator.hpp"

namespace ringlock::allan_run {

/// The parts of "a, b, c", without white space around them.
std::vector<std::string> split(const std::string& text);

/// One of the averaging times of a list such as `analyze --tau` has.
struct AveragingTime {
    std::string text;              ///< as given
    std::optional<double> time_s;  ///< of a number with a unit
    std::int64_t samples = 0;      ///< averaging factor; 0 where a time is given and no sampling interval is known yet
};

/// A number with a unit (5ms, 100s, 2min, 1h) is a time, a whole number from 1 without one an averaging factor; nothing
/// where the text is neither.
std::optional<AveragingTime> averaging_time(const std::string& text);

/// The averaging times that are asked for: one of the words octave, decade and all, or a list.
struct TauChoice {
    std::string word;                 ///< empty where there is a list
    std::vector<AveragingTime> list;  ///< averaging factors, and times with a unit
};

/// Throws InputError, naming `option`.
TauChoice parse_tau(const std::string& tau, std::string_view option);

/// Averaging factors for a record of that many points of phase, ascending, each once. Throws InputError, naming
/// `option`, where the record is too short for one, or a time is no whole number of samples (to 1e-9); the message has
/// the nearest ones.
std::vector<std::int64_t> factors_for(const TauChoice& choice, allan::Estimator estimator, std::int64_t points,
                                      double tau0_s, std::string_view option);

}  // namespace ringlock::allan_run
