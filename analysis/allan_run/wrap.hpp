#pragma once
#include <optional>
#include <string>
#include <string_view>

namespace ringlock::allan_run {

/// Whether wraps of a counter or an angle are undone in a series.
struct WrapChoice {
    bool undo = false;              ///< false: wraps are reported, and undone for the coefficients alone
    std::optional<double> modulus;  ///< range of the counter in the unit of the data; without it it is searched for
};

/// `off`, `auto`, a power such as 2^16, or a positive number. Throws InputError, naming `option`, for
/// anything else.
WrapChoice parse_wrap(const std::string& text, std::string_view option);

}  // namespace ringlock::allan_run
