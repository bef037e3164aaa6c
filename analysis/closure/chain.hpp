#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/record/record.hpp"

/// Several records of one box: its data chain resamples all of them from one source clock, whose rate they tell
/// together (docs/dev/closure-chain.md).
namespace ringlock::closure {

/// A rate with its standard error.
struct RateEstimate {
    double hz = 0.0;
    double sd_hz = 0.0;
};

/// What one record of a chain says of the source.
struct ChainRecord {
    std::string name;
    Closure closure;  ///< with the shared rate where the records agree on one, else by the record alone

    std::optional<double> alone_hz;      ///< that the loop found on this record alone
    std::vector<double> alone_other_hz;  ///< rates that explain this record as well as that
    /// Its own rate near the shared one; none where the record does not show the source.
    std::optional<RateEstimate> near_shared;
    /// Gains of the log-likelihood [nats]: of the shared rate over no source at all, and of the rate that explains this
    /// record most, another rate or none, over the shared rate.
    double gain_of_shared = 0.0;
    double gain_alone = 0.0;
    std::optional<double> likeliest_hz;  ///< the rate that explains this record most; none: no source does
    double p_alone = 1.0;                ///< that the latter gain is so large by chance
    bool contradicts = false;
};

/// A rate that the source may have, held against all records.
struct ChainRate {
    double hz = 0.0;                     ///< as the record that knows its pattern best has it
    std::vector<double> log_likelihood;  ///< of each record, less that of the likeliest rate
    double sum = 0.0;
    bool tied = false;  ///< with the likeliest rate
};

/// What several records of one data chain have in common.
struct Chain {
    std::vector<ChainRecord> records;
    double record_rate_hz = 0.0;
    const effects::Effect* effect = nullptr;  ///< that the source is found as; null where no record shows one
    std::vector<ChainRate> rates;             ///< the likeliest first
    std::optional<RateEstimate> shared;  ///< none where no record shows a source or where they contradict each other
    /// Of the records' own rates against their mean; of 0 degrees of freedom where fewer than two records show one.
    double chi2 = 0.0;
    int freedom = 0;
    double p_value = 1.0;

    bool contradicted() const;
    std::vector<double> tied_hz() const;  ///< rates that explain the records as well as the likeliest
};

/// A record and the name that errors, progress and reports give it.
struct NamedRecord {
    std::string name;
    const record::Record* record = nullptr;
};

/// Refuses records that cannot be of one data chain, or that the loop would read by their turns. Throws InputError.
void refuse_no_chain(std::span<const NamedRecord> records);

/// Runs the loop on each record, and then what they share on all of them. Throws as close_loop() does, with the name of
/// the record.
Chain close_chain(std::span<const NamedRecord> records, const Monitor& monitor = {});

}  // namespace ringlock::closure
