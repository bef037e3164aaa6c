#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "analysis/allan/sums/pieces.hpp"

namespace ringlock::allan {

/// Second differences of means over m neighbouring points of one record.
class MeanDifferences {
   public:
    /// \param x  phase without gaps; kept by reference
    explicit MeanDifferences(std::span<const double> x);

    /// Squares of ((x_{i+2m} + ...) - 2 (x_{i+m} + ...) + (x_i + ...))/m for every i with i + 3m <= size.
    SquareMean sum(std::size_t m) const;

   private:
    /// A sum with twice the digits of a double.
    struct Exact {
        double value = 0.0;
        double rest = 0.0;
        void add(double x);
    };
    static constexpr std::size_t spacing = 256;

    Exact before(std::size_t i) const;
    double difference(std::size_t i, std::size_t m) const;

    std::span<const double> x_;
    std::vector<Exact> before_;  ///< sums over all points before every `spacing`-th one
};

}  // namespace ringlock::allan
