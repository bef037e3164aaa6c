#pragma once
#include <optional>
#include <string>
#include <string_view>

#include "analysis/quantity/unit.hpp"

namespace ringlock::quantity {

/// The unit that a name declares: in brackets or parentheses at its end ("Gyro X (deg/s)", "w_x [rad s^-1]"), or in the
/// form of names of records and results ("angle_increment_arcsec", "rate_deg_h"). Nothing where the name declares no
/// unit or an unknown one; a lone letter at the end of a name ("gyro_s", "acc_g") is no unit.
std::optional<Unit> unit_in_name(std::string_view name);

/// Whether both are the same unit under two names.
bool are_same(const Unit& one, const Unit& other);

/// Throws InputError where the file declares for the column, by `unit_text` or by its name, another unit than `given`,
/// which comes from `option`. A text that is no known unit is not checked.
void refuse_contradiction(const std::string& file, const std::string& column,
                          const std::optional<std::string>& unit_text, const Unit& given, std::string_view option);

}  // namespace ringlock::quantity
