#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace ringlock::closure {

/// What a counter and the quadrature beside it say, turn by turn.
struct CountedQuarters {
    std::vector<double>
        off;                 ///< phase of the quadrature less the middle of the counted quarter [quarters]; modulo four
    std::vector<double> sd;  ///< of the noise of that phase [quarters]
    std::span<const std::int8_t> direction;
};

/// A hidden Markov chain: how many quarters a counter has lost, modulo the four that the quadrature tells apart, falls
/// or rises by one at each turn with some probability, as the phase went. A turn near the edge of a quarter says of two
/// neighbours only that it is one of them; changes of the difference between count and quadrature, taken one by one,
/// lose those that the next turn takes back.
class CountChain {
   public:
    static constexpr std::size_t quarters = 4;
    using Chances = std::array<double, quarters>;

    /// \param edge  standard deviation of where the counter sees the edges of a quarter [quarters]
    CountChain(const CountedQuarters& counted, double edge);

    struct Pass {
        double log_likelihood = 0.0;
        double steps = 0.0;  ///< expected number of them at the rows that count
    };
    /// One pass of the method of Baum, Petrie, Soules and Weiss (Annals of Mathematical Statistics 41, 1970, 164).
    Pass pass(double p, std::span<const std::uint8_t> rows);
    double log_likelihood(double p) { return forward(p); }

    /// The likeliest course of what is lost, turn by turn (Viterbi, IEEE Transactions on Information Theory 13, 1967,
    /// 260), from between 0 and 3 at the first. Steps against the direction, and of two quarters, may come too, far
    /// more rarely.
    std::vector<std::int64_t> likeliest_course(double p) const;

   private:
    double forward(double p);

    std::vector<Chances> seen_;      ///< how likely what is seen is with so many lost
    std::vector<std::size_t> step_;  ///< modulo four
    std::vector<Chances> forward_;
};

}  // namespace ringlock::closure
