#pragma once
#include <string>
#include <string_view>
#include <vector>

/// Arms of a study: treatments of the same gyros, with the same random numbers.
namespace ringlock::scenario {

enum class Compensator {
    none,
    published,     ///< equations of Gao and Deng 2007 as printed
    corrected,     ///< the same with corrected coefficients
    exact,         ///< the turn map inverted
    adaptive,      ///< the same with a coupling that it learns
    extrapolated,  ///< the pulses of both sides extrapolated to the turn (Lim 1982)
    two_train,     ///< two trains of corrections, scaled so that the output varies least (Fan et al. 2011)
};

struct Arm {
    std::string name;
    bool ideal = false;           ///< no lock-in at all
    bool noise_injected = false;  ///< random noise on the dither angle at the turns
    Compensator compensator = Compensator::none;
    bool operator==(const Arm&) const = default;
};

/// The arm of that name.
/// @throws InputError that lists the arms, without a position in a file.
Arm parse_arm(std::string_view name);

/// The same of several names, in their order.
std::vector<Arm> parse_arms(const std::vector<std::string>& names);

/// Every name that parse_arm() understands.
std::vector<std::string> arm_names();

}  // namespace ringlock::scenario
