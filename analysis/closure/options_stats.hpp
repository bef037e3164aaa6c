#pragma once
#include <cstddef>

namespace ringlock::closure {

/// Numbers that decide in the statistics of stats/, for records of turns and of samples.
struct StatsOptions {
    /// Tests of whether innovations are normal.
    struct Normality {
        /// P-value below which innovations that are flatter than normal ones are taken for bounded noise. This changes
        /// the likelihood and omits a test, so that it must not happen by chance in any of a million records.
        double flat_p_value = 1e-6;
        /// Ratio of successive m for which sums of m innovations are tested, from m = 1 on: tests at nearer m are
        /// nearly the same test.
        std::size_t growth_of_sums = 4;
        /// Sums of m innovations are tested in records of more than m times this number of rows.
        std::size_t rows_per_sum = 400;
        /// Fewest sums without a held-out row. The normal approximation of Anscombe and Glynn (1983) for the kurtosis
        /// is good from some tens of values on.
        std::size_t fewest_sums = 200;
    };
    Normality normality;

    /// The search for the largest jump in the residual of a random rate.
    struct Jumps {
        /// Share of the sum of squares of the whitened step that the search uses [1]; the rest arrives slowly and costs
        /// computing time.
        double share_of_response = 0.9;
        /// Places tried within the length of that response: a place 1/32 of it off loses little of the chi-squared.
        std::size_t positions_per_length = 16;
        /// Share of the response's squares that must fall on training rows for a place to count [1].
        double share_counted = 0.3;
        /// Fewest places. With fewer, the response to a step hardly decays within the record, and a random rate looks
        /// like a step.
        double fewest_positions = 40.0;
    };
    Jumps jumps;

    /// Number of lags in the test of whether innovations are correlated with earlier ones. Two dozen cover twelve
    /// cycles of a dither; more lags would weaken the test for correlations of adjacent innovations.
    std::size_t lags = 24;

    /// A rate that jumps between two levels.
    struct TwoLevels {
        /// Cost of the difference of the levels [nats]; the mean of both belongs to the bias.
        double cost_of_levels = 1.0;
        /// Most ranges whose levels are exchanged in the search, per stretch. A longer search only follows rounding
        /// errors.
        int most_steps_per_stretch = 4;
        /// Probabilities that a state is left from one stretch to the next are kept in this range [1]: below it no jump
        /// is expected in ten thousand stretches; above it a state is shorter than a stretch and cannot be seen.
        double least_chance = 1e-4;
        double most_chance = 0.5;
        /// Most passes of the algorithm of Baum et al. for the two states.
        int most_passes = 200;
    };
    TwoLevels two_levels;

    /// The hidden Markov chain of miscounts.
    struct CountChain {
        /// Standard deviations of the edges at which a counter changes quarters [quarters]; the likeliest is taken. A
        /// counter may share the quadrature's edges, have noise of its own, or edges a tenth of a quarter elsewhere.
        double edge_sds[3] = {1e-4, 0.03, 0.1};
        /// Least probability of any observation [1]: the chain must continue after an event that it does not describe.
        double never = 1e-12;
        /// Probabilities of two quarters at once, and of one against the direction, relative to a lost one [1]. They
        /// matter only where a path has no other transition.
        double two_at_once = 1e-4;
        double against_direction = 1e-2;
    };
    CountChain count_chain;
};

}  // namespace ringlock::closure
