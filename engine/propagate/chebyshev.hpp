#pragma once
#include <array>
#include <cstddef>
#include <span>
#include <vector>

/// Interpolation in the quantities that differ from half cycle to half cycle, each scaled to [-1, 1].
namespace ringlock::propagate {

/// Amplitude, rate, coupling and change of the amplitude over the half cycle.
using Point = std::array<double, 4>;
/// Terms of a polynomial in each of them; 1: the quantity does not vary.
using Terms = std::array<std::size_t, 4>;
inline constexpr Terms one_term{1, 1, 1, 1};

/// Node i of `terms` Chebyshev nodes, from 1 downwards.
double chebyshev_node(std::size_t i, std::size_t terms);

/// All nodes: [change][coupling][rate][amplitude].
std::vector<Point> chebyshev_nodes(const Terms& terms);

/// Points between the nodes: spread over the ranges by the golden ratio, the corners among them.
std::vector<Point> points_between_nodes(const Terms& terms);

/// Turns values at the nodes, [change][coupling][rate][amplitude][column], into coefficients of Chebyshev polynomials
/// in the same order, those into coefficients of powers, or the first into the last.
void nodes_to_chebyshev(const Terms& terms, std::size_t columns, std::span<double> values);
void chebyshev_to_powers(const Terms& terms, std::size_t columns, std::span<double> values);
void nodes_to_powers(const Terms& terms, std::size_t columns, std::span<double> values);

}  // namespace ringlock::propagate
