#pragma once
#include <functional>
#include <vector>

namespace ringlock::closure {

using Point = std::vector<double>;

/// Values of a function at several points, computed together: that takes much less time than one after the other.
using ValuesAt = std::function<std::vector<double>(const std::vector<Point>&)>;

/// Point of the smallest value of a function of a few numbers (Nelder and Mead, Computer Journal 7, 308, 1965). All
/// places that a step may go to are computed together.
/// \param size   of the first simplex, along each number
/// \param steps  at most
Point smallest(const ValuesAt& f, const Point& start, double size, int steps);

}  // namespace ringlock::closure
