#pragma once
#include <cstddef>

namespace ringlock::closure {

/// Numbers that decide what is named on a record of turns.
struct TurnOptions {
    /// The choice of effects (turns/loop).
    struct Loop {
        /// Held-out error below which the residual is the rounding of sums of that many numbers, here and where the
        /// record was made [rad].
        double rounding_rad = 1e-6;
        /// Injected noise at the turns that makes all phases independent [rad]: below it phases come in step, and
        /// anything that follows the phase makes lines.
        double randomising_noise_rad = 1.0;
        /// Factor by which kicks in a residual test count for more than a line on the beat of the phases: their merit
        /// is of first order only.
        double phase_against_beat = 2.0;
        /// Relative error of a residual test's merit, since its kicks are of first order only.
        double first_order_error = 0.02;
        /// A random rate can follow anything that follows a noisy column better than that column does, by so much of
        /// its merit.
        double noise_of_column = 0.1;
        /// Residual tests that are refitted with the noise, the largest merits first.
        std::size_t tests_refitted = 4;

        /// Largest p-value of a score test that is worth a full fit: scores are of the noise as it is, which may have
        /// absorbed most of an effect.
        double worth_a_fit_p = 0.1;
        /// Chi-squared of a rate that is strong enough to have led the other parameters astray.
        double strong_chi2 = 400.0;
        /// Share of an effect's estimate that the first fit starts from, where coupling, threshold and bias move
        /// together.
        double small_share = 0.01;
        /// A fit should gain half of the score's chi-squared. One that gains much less may lie in a neighbouring valley
        /// of the likelihood.
        double nearly_all_of_chi2 = 0.45;
        /// The same for a strong rate, after which the fit starts from scratch.
        double little_of_chi2 = 0.25;
        /// Starts with ever smaller shares of the estimate, where the fit gains nothing.
        int shorter_starts = 4;
        /// Candidates whose merit is as near to the best are fitted from scratch as well.
        double nearly_best = 0.9;
        /// Merit above which fits that come nowhere near it are not brought to the end [nats], and how near they must
        /// come.
        double much_merit = 200.0;
        double far_below = 0.5;

        /// Candidates that are tried as first and second member of a pair, and as third member of a triple.
        std::size_t first_of_pair = 3;
        std::size_t second_of_pair = 2;
        std::size_t third_of_triple = 2;
        /// Share of the best merit that a pair without a random rate must have for a third effect to make up the rest.
        double most_of_merit = 0.75;
        /// Second effects that are tried next to one of the coupling.
        std::size_t second_of_coupling = 3;

        /// Readings of the dither's shape after an effect was added; they converge within three.
        int shape_readings = 3;
        /// Rounds of the loop for each step that it may end with.
        std::size_t rounds_per_step = 3;
    };
    Loop loop = {};
};

}  // namespace ringlock::closure
