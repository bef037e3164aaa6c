#pragma once
#include <cstddef>

namespace ringlock::closure {

/// Numbers by which the statistics of stats/ decide, on records of turns and of samples alike.
struct StatsOptions {
    /// Tests of whether innovations are normal.
    struct Normality {
        /// P-value below which innovations that are flatter than normal ones are taken for bounded noise. It changes
        /// the likelihood and takes a test away, so that it must not happen by chance in any of a million records.
        double flat_p_value = 1e-6;
        /// Sums of m innovations are tested for m = 1, then this times as many, and so on: sums of neighbouring m are
        /// nearly the same test.
        std::size_t growth_of_sums = 4;
        /// Sums of m innovations are tested in records of more than m times this many rows ...
        std::size_t rows_per_sum = 400;
        /// ... of which at least so many sums have no held-out row in them. The normal approximation of Anscombe and
        /// Glynn (1983) for the kurtosis is good from some tens of values on.
        std::size_t fewest_sums = 200;
    };
    Normality normality;

    /// The search for the largest jump of a rate that wanders.
    struct Jumps {
        /// Share of the squares of the whitened step that the search looks at [1]; the rest comes slowly and costs
        /// time.
        double share_of_response = 0.9;
        /// Places tried within the length of that response: a place 1/32 of it off loses little of the chi-squared.
        std::size_t places_per_length = 16;
        /// Share of the response's squares that must fall on training rows for a place to count [1].
        double share_counted = 0.3;
        /// Fewest places: with fewer, a step is hardly ever forgotten within the record, and a rate that wanders looks
        /// like one.
        double fewest_places = 40.0;
    };
    Jumps jumps;

    /// Number of lags in the test of whether innovations are correlated with earlier ones. Two dozen cover twelve
    /// cycles of a dither; more lags would weaken the test for correlations of neighbours.
    std::size_t lags = 24;

    /// A rate that jumps between two levels.
    struct TwoLevels {
        /// Cost of the difference of the levels [nats]; the mean of both belongs to the bias.
        double cost_of_levels = 1.0;
        /// Most ranges turned over in the search, per stretch. A search that does not end there is rounding.
        int most_steps_per_stretch = 4;
        /// Probabilities that a state is left from one stretch to the next are kept in this range [1]: below, no jump
        /// is expected in ten thousand stretches; above, a state is shorter than a stretch and is none.
        double least_chance = 1e-4;
        double most_chance = 0.5;
        /// Most passes of the algorithm of Baum et al. for the two states.
        int most_passes = 200;
    };
    TwoLevels two_levels;

    /// The hidden Markov chain of miscounts.
    struct CountChain {
        /// Standard deviations of where a counter sees the edges of a quarter [quarters]; the likeliest is taken. A
        /// counter may share the quadrature's edges, have noise of its own, or edges a tenth of a quarter elsewhere.
        double edge_sds[3] = {1e-4, 0.03, 0.1};
        /// Least probability of any observation [1]: the chain must go on where something else has happened.
        double never = 1e-12;
        /// Probabilities of two quarters at once, and of one against the direction, relative to a lost one [1]. They
        /// only decide where a course has no other way.
        double two_at_once = 1e-4;
        double against_direction = 1e-2;
    };
    CountChain count_chain;
};

}  // namespace ringlock::closure
