#pragma once
#include <cstddef>
#include <vector>

/// The functions of engine/simd/math-inl.hpp for arrays, by the instruction set in use: that header is for sources
/// compiled by Highway, tests are not.
namespace ringlock::test {

enum class Operation {
    fma,         ///< a b + c
    fnma,        ///< c - a b
    nearest,     ///< of a
    fraction,    ///< of a
    sine,        ///< of a fringes
    cosine,      ///< of a fringes
    atan_small,  ///< of a
    arg_right,   ///< of a + i b
    arg,         ///< of a + i b
    log,         ///< of a
    exp,         ///< of a
};

/// Element by element; an operation of fewer arguments leaves the others alone.
std::vector<double> probe(Operation operation, std::vector<double> a, std::vector<double> b = {},
                          std::vector<double> c = {});

/// Coefficients of probe_polynomial().
double probe_coefficient(std::size_t k);
/// The polynomial of 2 to 10 terms at each x.
std::vector<double> probe_polynomial(std::size_t terms, std::vector<double> x);

}  // namespace ringlock::test
