#include "analysis/design/unit_cube.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <boost/random/sobol.hpp>
#include <boost/random/uniform_int_distribution.hpp>
#include <cmath>
#include <new>
#include <numeric>
#include <utility>

#include "engine/core/error.hpp"
#include "engine/random/stream.hpp"

namespace ringlock::design {
namespace {

/// Levels of the digits' tree that one word of 256 bits decides: 255 nodes.
constexpr unsigned levels_a_word = 8;
constexpr unsigned scrambled_levels = 56;
constexpr unsigned coordinate_bits = 52;

std::uint64_t nested_uniform_scramble(std::uint64_t digits, std::uint64_t dimension, std::uint64_t seed) {
    const r123::Philox4x64::key_type key = {{seed, static_cast<std::uint64_t>(random::Purpose::design_scrambling)}};
    r123::Philox4x64 philox;
    std::uint64_t scrambled = 0;
    for (unsigned done = 0; done < scrambled_levels; done += levels_a_word) {
        const std::uint64_t before = done == 0 ? 0 : digits >> (64 - done);
        const r123::Philox4x64::ctr_type counter = {{before, done, dimension, 0}};
        const r123::Philox4x64::ctr_type flips = philox(counter, key);
        // Nodes are numbered from 1 at the root; the two below node i are 2 i and 2 i + 1.
        unsigned node = 1;
        for (unsigned level = done; level < done + levels_a_word; ++level) {
            const auto digit = static_cast<unsigned>((digits >> (63 - level)) & 1);
            const auto flip = static_cast<unsigned>((flips[node / 64] >> (node % 64)) & 1);
            scrambled = (scrambled << 1) | (digit ^ flip);
            node = 2 * node + digit;
        }
    }
    return scrambled;
}

/// The middle of the cell that the leading digits name: neither 0 nor 1, and exact.
double middle_of_cell(std::uint64_t scrambled) {
    const std::uint64_t cell = scrambled >> (scrambled_levels - coordinate_bits);
    return std::ldexp(static_cast<double>(cell) + 0.5, -static_cast<int>(coordinate_bits));
}

}  // namespace

Points room_for(std::uint64_t count, std::uint64_t dimensions, std::uint64_t limit) {
    if (count == 0) throw InputError("a design of no points: ask for one or more");
    if (dimensions == 0) throw InputError("a design without factors: name one or more");
    if (count > limit) {
        throw InputError(fmt::format("a design of {} points: {} is the limit; ask for fewer", count, limit));
    }
    Points points;
    const std::string what = fmt::format(
        "a design of {} points in {} dimensions: memory does not hold it; ask for fewer points", count, dimensions);
    if (count > points.values.max_size() / dimensions) throw InputError(what);
    points.count = count;
    points.dimensions = dimensions;
    try {
        points.values.resize(count * dimensions);
    } catch (const std::bad_alloc&) {
        throw InputError(what);
    }
    return points;
}

Points latin_hypercube(std::uint64_t count, std::uint64_t dimensions, std::uint64_t seed, std::uint64_t limit) {
    Points points = room_for(count, dimensions, limit);
    const auto n = static_cast<double>(count);
    std::vector<std::uint64_t> strata(count);
    for (std::uint64_t dimension = 0; dimension < dimensions; ++dimension) {
        random::Engine engine = random::make_engine({seed, dimension}, random::Purpose::design_strata);
        std::iota(strata.begin(), strata.end(), std::uint64_t{0});
        // Durstenfeld's shuffle (Commun. ACM 7, 420, 1964): the order of std::shuffle is the library's own affair.
        for (std::uint64_t i = count - 1; i > 0; --i) {
            boost::random::uniform_int_distribution<std::uint64_t> pick(0, i);
            std::swap(strata[i], strata[pick(engine)]);
        }
        for (std::uint64_t i = 0; i < count; ++i) {
            const double within = std::ldexp(static_cast<double>(engine() >> 32) + 0.5, -32);
            const auto stratum = static_cast<double>(strata[i]);
            // Of more than a million strata the sum may be rounded up to the next.
            const double end = (stratum + 1.0) / n;
            points[i][dimension] = std::min((stratum + within) / n, std::nextafter(end, 0.0));
        }
    }
    return points;
}

std::uint64_t most_sobol_dimensions() { return boost::random::default_sobol_table::max_dimension; }

Points sobol(std::uint64_t count, std::uint64_t dimensions, std::uint64_t seed, std::uint64_t limit) {
    if (dimensions > most_sobol_dimensions()) {
        throw InputError(
            fmt::format("a Sobol' sequence in {} dimensions: direction numbers are known for {}; "
                        "vary fewer factors or take a Latin hypercube",
                        dimensions, most_sobol_dimensions()));
    }
    Points points = room_for(count, dimensions, limit);
    boost::random::sobol sequence(dimensions);
    for (std::uint64_t i = 0; i < count; ++i) {
        const std::span<double> point = points[i];
        for (std::uint64_t dimension = 0; dimension < dimensions; ++dimension) {
            // Boost leaves the zero out, without which 2^m points are no net.
            const std::uint64_t digits = i == 0 ? 0 : sequence();
            point[dimension] = middle_of_cell(nested_uniform_scramble(digits, dimension, seed));
        }
    }
    return points;
}

}  // namespace ringlock::design
