#pragma once
#include <optional>
#include <string>
#include <string_view>

/// Units in the headers of tables.
namespace ringlock::text {

/// Whether a text is a unit of measurement, such as deg/s, "rad s^-1", m/s^2 or degC: made of known symbols alone.
bool is_unit(std::string_view text);

/// The name of a column, and the unit that it declares at its end in brackets: "Gyro X (deg/s)", "w_x [rad s^-1]".
/// Brackets that hold no unit ("gyro[0]") belong to the name.
struct NameAndUnit {
    std::string name;
    std::string unit;  ///< empty where none is declared
};
NameAndUnit split_unit(std::string_view heading);

/// The unit in a cell of a row of units: "(deg/s)", "[s]", "rad/s" or, for a column without unit, "-" or "1"; nullopt
/// where the cell is no unit.
std::optional<std::string> unit_cell(std::string_view cell);

}  // namespace ringlock::text
