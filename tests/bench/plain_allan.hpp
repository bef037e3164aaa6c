#pragma once
#include <cstddef>

/// What anybody would write first, with the compiler free to use vectors: to be compared with.
namespace ringlock::bench {

/// Sum of the squares of all second differences at step m, 2 m < points.
double plain_sum_of_squares(const double* x, std::size_t points, std::size_t m);

/// Sum of all: what it costs to read them.
double read_all(const double* x, std::size_t points);

}  // namespace ringlock::bench
