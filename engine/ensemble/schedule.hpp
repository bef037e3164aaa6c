#pragma once
#include <cstdint>

#include "engine/scenario/scenario.hpp"

namespace ringlock::ensemble {

/// Times of the arms' outputs, from which statistics are computed, and which of them are samples of the record.
///
/// An output is the angle at a minimum of the phase, one a cycle of the nominal dither, or the output of a reader at
/// `reader.output_hz`. Readers begin at the turn at which settling ends, and the record once they are fit for use.
struct Schedule {
    explicit Schedule(const scenario::Scenario& scenario);

    double output_s;  ///< from an output to the next
    std::int64_t outputs_per_sample;
    std::int64_t settle_cycles;    ///< of the dither, before the record
    std::int64_t warm_up_outputs;  ///< of readers, after that and before the record
    double delay_s;                ///< by which the outputs of readers lag behind the angle
    double start_s;            ///< time of the run whose angle the record's first output is: readers' outputs are late
    std::int64_t samples;      ///< of one record, the one at time 0 included
    double sample_interval_s;  ///< outputs_per_sample outputs
    std::int64_t samples_per_fit;  ///< from one that noise coefficients are fitted to to the next, at least

    /// Outputs of a record, those of the first and the last sample included.
    std::int64_t outputs() const { return outputs_per_sample * (samples - 1) + 1; }
    /// Zero-rate points of one trajectory before the record, and with it.
    std::int64_t settle_turns() const { return 2 * settle_cycles; }
    std::int64_t turns() const { return settle_turns() + 2 * cycles_read + 1; }

    std::int64_t cycles_read;  ///< of the dither, in which all outputs of readers and of the record come
    std::int64_t piece_turns;  ///< most turns that are gone through at once
    /// Turn before which the piece that begins with this one ends. Results depend on the pieces: compensators and
    /// tables take the first one as a whole. No piece holds turns both before the record and of it.
    std::int64_t piece_end(std::int64_t turn) const;
};

/// Whole outputs nearest to a time, one at least.
std::int64_t outputs_in(const Schedule& schedule, double time_s);

}  // namespace ringlock::ensemble
