#pragma once
#include <optional>
#include <string>

namespace ringlock::app {

/// The sampling interval as a command line gives it.
struct Sampling {
    std::string said;        ///< the option and its value, as in "--rate 1/300"
    bool from_file = false;  ///< the file has to declare it
    double rate_hz = 0.0;    ///< 0 where the file has to declare it
    double tau0_s = 0.0;     ///< its reciprocal; of --rate 1/300 and of --tau0 exactly the number that is meant
};

/// \param rate  of --rate: samples a second, a number, a fraction of two numbers (1/300) or "file"; empty where it was
///              not given
/// \param tau0  of --tau0: seconds, a number, a fraction or a time with its unit (10ms); empty likewise
///
/// Throws InputError where neither or both are given, or one is not positive and finite.
Sampling sampling_of(const std::string& rate, const std::string& tau0);

/// The sampling of a file that declares its rate. Throws InputError where it declares none.
Sampling declared_sampling(const std::string& file, const std::optional<double>& rate_hz);

}  // namespace ringlock::app
