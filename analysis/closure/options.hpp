#pragma once
#include <cstddef>

#include "analysis/closure/options_report.hpp"
#include "analysis/closure/options_samples.hpp"
#include "analysis/closure/options_stats.hpp"
#include "analysis/closure/options_turns.hpp"

/// All numbers that decide which effects the closed loop reports, with reasons and sources.
namespace ringlock::closure {

/// Numbers that decide which effects are reported, tied, removed or refused, for turns and for samples.
struct Options {
    /// Probability of any false alarm in a record without a missing effect: one family-wise level for all tests of a
    /// record. With three in a thousand, a wrong level shows in a bench of some hundred null records.
    double level = 0.003;
    /// Share of the level that is spent on the selection of effects; the rest is spent on the tests of the final
    /// residual.
    double level_of_effects = 0.002;
    double level_of_residual = level - level_of_effects;

    /// Models whose log-likelihoods differ by less are not distinguished [nats]: a false model gains that much over the
    /// true one with a probability of exp(-4) at most.
    double tie = 4.0;
    /// A ramp or a step may be more likely than the random rate that generated the record by this much [nats], since
    /// its size is free, while the size of the random rate is fixed by its variance. Simulated (test
    /// `RandomRates.MayLookLikeARamp`): a ramp is likelier than a true random walk by 4 in one record of twenty, by 7
    /// in at most two of a thousand.
    double tie_with_random = 7.0;

    /// Most effects that one record may need, and most candidates that are fitted in full for each of them.
    std::size_t most_steps = 8;
    std::size_t most_finalists = 5;

    /// The record is cut into this number of contiguous blocks, and one block of each run of `blocks_in_a_row` is held
    /// out: effects are selected and parameters fitted on the others, so that the error on the held-out rows can be
    /// reported. Forty blocks are short compared with slow effects, and long compared with the memory of the filters.
    std::size_t blocks = 40;
    std::size_t blocks_in_a_row = 10;
    std::size_t held_out_block = 5;

    StatsOptions stats = {};
    TurnOptions turns = {};
    SampleOptions samples = {};
    ReportOptions report = {};
};

/// The options that the loop runs with.
inline constexpr Options options = {};

}  // namespace ringlock::closure
