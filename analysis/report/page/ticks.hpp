#pragma once
#include <string>
#include <vector>

namespace ringlock::report {

/// Ends of an axis.
struct AxisRange {
    double lo = 0.0;
    double hi = 1.0;
};

/// Positions of the ticks of an axis, ascending, within its range.
struct Ticks {
    std::vector<double> major;  ///< with labels and grid lines
    std::vector<double> minor;  ///< without
};

/// The range of an axis that shows all values: finite ones and, on a logarithmic axis, those above zero. It is a little
/// wider than the values; where there is no value, or one only, it is a range about it that can be drawn.
AxisRange axis_range(const std::vector<double>& values, bool logarithmic);

/// Ticks at multiples of 1, 2 or 5 times a power of ten.
///
/// \param most   largest number of major ticks, > 1
/// \param whole  at whole numbers only
Ticks linear_ticks(AxisRange range, int most, bool whole = false);

/// Ticks of a logarithmic axis with 0 < lo < hi: powers of ten, every one or every n-th; where the range has fewer than
/// two of them, their multiples by 2 and 5 too; where it has fewer than two of these, those of a linear axis.
Ticks log_ticks(AxisRange range, int most);

/// A label of at most some seven characters: "0.002", "25", "10⁻⁵".
std::string tick_label(double value);

}  // namespace ringlock::report
