#include "engine/propagate/chebyshev.hpp"

#include <algorithm>
#include <cmath>

#include "engine/core/units.hpp"

namespace ringlock::propagate {

namespace {

/// Matrix of `terms` columns in each row.
using Matrix = std::vector<std::vector<double>>;

/// Row n: weights of the values at the Chebyshev nodes in the coefficient of the n-th Chebyshev polynomial.
Matrix chebyshev_weights(std::size_t terms) {
    Matrix rows(terms, std::vector<double>(terms, 0.0));
    for (std::size_t i = 0; i < terms; ++i) {
        const double angle = units::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(terms);
        for (std::size_t n = 0; n < terms; ++n) {
            rows[n][i] = (n == 0 ? 1.0 : 2.0) / static_cast<double>(terms) * std::cos(static_cast<double>(n) * angle);
        }
    }
    return rows;
}

/// Row k: weights of the Chebyshev polynomials in the coefficient of the k-th power.
Matrix chebyshev_powers(std::size_t terms) {
    Matrix rows(terms, std::vector<double>(terms, 0.0));
    rows[0][0] = 1.0;
    if (terms > 1) rows[1][1] = 1.0;
    for (std::size_t n = 2; n < terms; ++n) {
        for (std::size_t k = 0; k < terms; ++k) {
            rows[k][n] = (k > 0 ? 2.0 * rows[k - 1][n - 1] : 0.0) - rows[k][n - 2];
        }
    }
    return rows;
}

}  // namespace

double chebyshev_node(std::size_t i, std::size_t terms) {
    return terms == 1 ? 0.0 : std::cos(units::pi * (static_cast<double>(i) + 0.5) / static_cast<double>(terms));
}

std::vector<Point> chebyshev_nodes(const Terms& terms) {
    std::vector<Point> points;
    const std::size_t count = terms[0] * terms[1] * terms[2] * terms[3];
    for (std::size_t i = 0; i < count; ++i) {
        Point point{};
        std::size_t rest = i;
        for (std::size_t v = 0; v < terms.size(); ++v) {
            point[v] = chebyshev_node(rest % terms[v], terms[v]);
            rest /= terms[v];
        }
        points.push_back(point);
    }
    return points;
}

std::vector<Point> points_between_nodes(const Terms& terms) {
    std::vector<Point> points;
    constexpr double shares[] = {0.618034, 0.754878, 0.569840, 0.656673};
    const int each = terms[3] == 1 ? 8 : 16;
    for (int i = 0; i < each; ++i) {
        Point inside{};
        Point corner{};
        for (std::size_t v = 0; v < terms.size(); ++v) {
            if (terms[v] == 1) continue;
            const double golden = (static_cast<double>(i) + 0.5) * shares[v];
            inside[v] = 2.0 * (golden - std::floor(golden)) - 1.0;
            corner[v] = (i >> v & 1) != 0 ? 1.0 : -1.0;
        }
        points.push_back(inside);
        points.push_back(corner);
    }
    return points;
}

namespace {

/// Applies to each quantity in turn the matrices that `of` gives for its number of terms.
template <class Of>
void transform(const Terms& terms, std::size_t columns, std::span<double> values, const Of& of) {
    std::vector<double> next(values.size());
    std::size_t stride = columns;
    for (const std::size_t n : terms) {
        for (const Matrix& matrix : of(n)) {
            std::fill(next.begin(), next.end(), 0.0);
            for (std::size_t i = 0; i < values.size(); ++i) {
                const std::size_t at = i / stride % n;
                for (std::size_t k = 0; k < n; ++k) next[i - at * stride + k * stride] += matrix[k][at] * values[i];
            }
            std::copy(next.begin(), next.end(), values.begin());
        }
        stride *= n;
    }
}

}  // namespace

void nodes_to_chebyshev(const Terms& terms, std::size_t columns, std::span<double> values) {
    transform(terms, columns, values, [](std::size_t n) { return std::array{chebyshev_weights(n)}; });
}

void chebyshev_to_powers(const Terms& terms, std::size_t columns, std::span<double> values) {
    transform(terms, columns, values, [](std::size_t n) { return std::array{chebyshev_powers(n)}; });
}

void nodes_to_powers(const Terms& terms, std::size_t columns, std::span<double> values) {
    // The two steps must not be made one: rows of their product are as large as 2.4^terms, and a shift of many fringes
    // would be summed up from parts as large. Chebyshev coefficients are small by then.
    transform(terms, columns, values, [](std::size_t n) {
        return std::array{chebyshev_weights(n), chebyshev_powers(n)};
    });
}

}  // namespace ringlock::propagate
