#pragma once
#include <cstddef>
#include <span>
#include <vector>

#include "analysis/closure/chain.hpp"

/// One rate of the source for several records whose noises are independent.
namespace ringlock::closure {

/// Log-likelihood of every rate that the source may have on every record.
struct RateTable {
    double record_rate_hz = 0.0;
    std::vector<double> hz;
    std::vector<std::vector<double>> log_likelihood;  ///< by record, then by rate
};

/// Rates that leave the same pattern in a record as one of those found, without repetitions; of two equal ones the
/// first is kept.
std::vector<double> rates_of_patterns(std::span<const double> found_hz, double record_rate_hz);

/// The rates by the sum of the log-likelihoods, the most likely first. Tied to it are those whose sum is within the tie
/// and, where it is above twice the record's rate, all of the same pattern that are above it as well.
std::vector<ChainRate> ranked(const RateTable& table);

/// Mean of the rates, weighted by information, and chi-squared of their deviations from it.
struct SharedRate {
    RateEstimate mean;
    double chi2 = 0.0;
    int freedom = 0;
    double p_value = 1.0;
};
SharedRate shared_of(std::span<const RateEstimate> rates);

/// Upper bound of the probability that one of so many wrong models exceeds the log-likelihood of the true one by
/// `gain`.
double p_of_wrong(double gain, std::size_t models);

}  // namespace ringlock::closure
