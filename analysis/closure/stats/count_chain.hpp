#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ringlock::closure {

/// Readings of a counter and of the quadrature at each turn.
struct CountedQuarters {
    std::vector<double>
        off;                 ///< phase of the quadrature less the middle of the counted quarter [quarters]; modulo four
    std::vector<double> sd;  ///< standard deviation of the noise of that phase [quarters]
    std::span<const std::int8_t> direction;
};

/// A hidden Markov chain of the number of quarters that a counter has lost, modulo the four that the quadrature
/// distinguishes. At each turn it falls or rises by one with some probability, in the direction of the phase. A turn
/// near the edge of a quarter only says of two adjacent numbers that it is one of them. Single changes of the
/// difference between count and quadrature would not contain those that the next turn compensates.
class CountChain {
   public:
    static constexpr std::size_t quarters = 4;
    using Chances = std::array<double, quarters>;

    /// \param edge  standard deviation of the edges at which the counter changes quarters [quarters]
    CountChain(const CountedQuarters& counted, double edge);

    struct Pass {
        double log_likelihood = 0.0;
        double steps = 0.0;  ///< expected number of steps at the rows that count
    };
    /// One pass of the method of Baum, Petrie, Soules and Weiss (Annals of Mathematical Statistics 41, 1970, 164).
    Pass pass(double p, std::span<const std::uint8_t> rows);
    double log_likelihood(double p) { return forward(p); }

    /// The most probable path of the number of lost quarters, turn by turn (Viterbi, IEEE Transactions on Information
    /// Theory 13, 1967, 260), from between 0 and 3 at the first turn. Steps against the direction, and of two quarters,
    /// are possible with far smaller probabilities.
    std::vector<std::int64_t> likeliest_path(double p) const;

   private:
    double forward(double p);

    std::vector<Chances> seen_;      ///< likelihood of each reading for each number of lost quarters
    std::vector<std::size_t> step_;  ///< modulo four
    std::vector<Chances> forward_;
};

}  // namespace ringlock::closure
