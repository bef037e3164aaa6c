#pragma once
#include <functional>
#include <vector>

namespace ringlock::closure {

using Point = std::vector<double>;

/// Values of a function at several points, computed together: that takes much less time than one after the other.
using ValuesAt = std::function<std::vector<double>(const std::vector<Point>&)>;

/// Point of the smallest value of a function of a few numbers (Nelder and Mead, Computer Journal 7, 308, 1965). All
/// candidates for the next step are computed together.
/// \param size   edge of the first simplex, along each number
/// \param steps  at most this number
Point smallest(const ValuesAt& f, const Point& start, double size, int steps);

}  // namespace ringlock::closure
