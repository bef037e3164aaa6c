#pragma once
#include <optional>
#include <string>

namespace ringlock::app {

/// The value of --wrap.
struct WrapChoice {
    bool undo = false;              ///< false: wraps are reported, and undone for the coefficients alone
    std::optional<double> modulus;  ///< range of the counter in the unit of the data; without it it is searched for
};

/// `off`, `auto`, a power such as 2^16, or a positive number. Throws InputError for anything else.
WrapChoice parse_wrap(const std::string& text);

}  // namespace ringlock::app
