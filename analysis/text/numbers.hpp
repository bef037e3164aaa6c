#pragma once
#include <cstdint>
#include <string_view>
#include <system_error>

/// Numbers as programs and people write them.
namespace ringlock::text {

/// A number of the whole field: in plain notation, with an exponent by Fortran (1.5D-03, 1.5-103), or infinite or no
/// number as Windows spells it (1.#INF, -1.#IND). With `decimal_comma` a comma stands where the point would.
bool parse_number(std::string_view field, double& value, bool decimal_comma = false);

/// A number, or NaN where the field says that it is missing: empty, or one of missing_words() in any case, signed or
/// not.
bool parse_value(std::string_view field, double& value, bool decimal_comma = false);

/// For messages and help: words of a field for a missing value.
inline constexpr std::string_view missing_words = "nan, NA, N/A, null, none, -, --, or nothing between delimiters";

/// A whole number of digits alone. errc() where it is one; result_out_of_range where 64 bits do not hold it.
std::errc parse_whole_number(std::string_view field, std::int64_t& value);

}  // namespace ringlock::text
