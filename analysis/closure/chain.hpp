#pragma once
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/record/record.hpp"

/// Several records of one box. Its data chain resamples all of them from one source clock, whose rate is estimated
/// from all records together (docs/dev/closure-chain.md).
namespace ringlock::closure {

/// A rate with its standard error.
struct RateEstimate {
    double hz = 0.0;
    double sd_hz = 0.0;
};

/// The part of the result that belongs to one record of the chain.
struct ChainRecord {
    std::string name;
    Closure closure;  ///< with the shared rate if the records agree on one, else of this record alone

    std::optional<double> alone_hz;      ///< rate that the loop found on this record alone
    std::vector<double> alone_other_hz;  ///< rates that explain this record as well as that
    /// Its own rate near the shared one; none if the record does not show the source.
    std::optional<RateEstimate> near_shared;
    /// Gains of the log-likelihood [nats]: of the shared rate over no source at all, and of the rate that explains this
    /// record most, another rate or none, over the shared rate.
    double gain_of_shared = 0.0;
    double gain_alone = 0.0;
    std::optional<double> likeliest_hz;  ///< most likely rate for this record; none: no source is likelier
    double p_alone = 1.0;                ///< probability that gain_alone is as large by chance
    bool contradicts = false;
};

/// A rate that the source may have, tested against all records.
struct ChainRate {
    double hz = 0.0;                     ///< as estimated from the record that determines its pattern best
    std::vector<double> log_likelihood;  ///< of each record, less that of the most likely rate
    double sum = 0.0;
    bool tied = false;  ///< with the most likely rate
};

/// Result on several records of one data chain.
struct Chain {
    std::vector<ChainRecord> records;
    double record_rate_hz = 0.0;
    const effects::Effect* effect = nullptr;  ///< effect of the source; null where no record shows one
    std::vector<ChainRate> rates;             ///< the most likely first
    std::optional<RateEstimate> shared;  ///< none if no record shows a source or if the records contradict each other
    /// Test of the records' own rates against their mean; 0 degrees of freedom if fewer than two records show one.
    double chi2 = 0.0;
    int freedom = 0;
    double p_value = 1.0;

    bool contradicted() const;
    std::vector<double> tied_hz() const;  ///< rates that explain the records as well as the most likely one
};

/// A record and the name that errors, progress and reports give it.
struct NamedRecord {
    std::string name;
    const record::Record* record = nullptr;
};

/// Throws InputError if the records cannot belong to one data chain, or if the loop would analyse them by their turns.
void refuse_no_chain(std::span<const NamedRecord> records);

/// Runs the loop on each record alone, and then with the shared rate. Throws as close_loop() does, with the name of
/// the record.
Chain close_chain(std::span<const NamedRecord> records, const Monitor& monitor = {});

}  // namespace ringlock::closure
