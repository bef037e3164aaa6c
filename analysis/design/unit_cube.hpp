#pragma once
#include <cstdint>
#include <span>
#include <vector>

namespace ringlock::design {

/// Points of a space, one a row.
struct Points {
    std::size_t count = 0;
    std::size_t dimensions = 0;
    std::vector<double> values;  ///< [point][dimension]

    std::span<const double> operator[](std::size_t point) const {
        return {values.data() + point * dimensions, dimensions};
    }
    std::span<double> operator[](std::size_t point) { return {values.data() + point * dimensions, dimensions}; }
};

/// Room for so many points, all zero.
///
/// \param limit  largest number of points that the caller is willing to compute
/// Throws InputError, before memory is allocated, where count or dimensions is 0, there are more points than the limit,
/// or memory does not hold them.
Points room_for(std::uint64_t count, std::uint64_t dimensions, std::uint64_t limit);

/// Latin hypercube: of n points, exactly one lies in each of the n strata [i/n, (i + 1)/n) of each dimension, at random
/// within it; the strata of the dimensions are paired at random (McKay, Beckman, Conover, Technometrics 21, 239, 1979).
/// The same seed gives the same points; designs for different n share no points.
///
/// All coordinates are above 0 and below 1. Throws the exceptions of room_for().
Points latin_hypercube(std::uint64_t count, std::uint64_t dimensions, std::uint64_t seed, std::uint64_t limit);

/// The largest number of dimensions of sobol().
std::uint64_t most_sobol_dimensions();

/// Scrambled Sobol' sequence: Sobol' points with the direction numbers of Joe and Kuo (SIAM J. Sci. Comput. 30, 2635,
/// 2008) from Boost, in the order of the Gray code (Antonov, Saleev, USSR Comput. Maths. Math. Phys. 19, 252, 1980) and
/// beginning with the zero, scrambled by Owen's nested uniform method ("Randomly permuted (t,m,s)-nets and
/// (t,s)-sequences", 1995): each binary digit is flipped or not by chance, and each node of the tree of the digits
/// before it has a chance of its own. That is a hash of seed, dimension and node, as in Laine and Karras (Comput.
/// Graph. Forum 30(4), 1123, 2011) and Burley (J. Comput. Graph. Tech. 9(4), 1, 2020), but with Philox (Salmon et al.,
/// SC11), so that all nodes of 56 levels are independent and the scrambling is Owen's and no approximation to it.
///
/// Each point by itself is uniform in the unit cube; 2^m points are a (t, m, s)-net as those of Sobol' are. The same
/// seed gives the same points on every machine, and a longer sequence begins with the shorter one. Numbers of points
/// that are powers of 2 are balanced best.
///
/// All coordinates are odd multiples of 2^-53, above 0 and below 1. Throws the exceptions of room_for(), and InputError
/// beyond most_sobol_dimensions().
Points sobol(std::uint64_t count, std::uint64_t dimensions, std::uint64_t seed, std::uint64_t limit);

}  // namespace ringlock::design
