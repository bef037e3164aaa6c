#pragma once
#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

/// The filter of Whitening (whitening.hpp), compiled for each instruction set, for one noise or for several at once.
namespace ringlock::closure {

struct TurnFrame;

/// Several noises with equal numbers of states: a, m, then the rates. All states except a are independent of the
/// others: x' = decay x, a' = a + gain_s x.
struct FilterNoises {
    static constexpr std::size_t most_states = 14;
    /// The length of rows is a multiple of the longest vector of any machine.
    FilterNoises(std::size_t noises, std::size_t states);

    std::size_t noises, states, row;
    std::vector<double> injected_rad2, readout_rad2;  // [noise]
    // [state][noise], rows of `row`
    std::vector<double> decay;
    std::vector<double> gain_s;
    std::vector<double> noise;       ///< variance gained from turn to turn
    std::vector<double> with_angle;  ///< covariance of that noise with the noise of a
    std::vector<double> start;       ///< variance at the first turn
};

/// For the first noise: gains [turn][state] per unit of innovation on the way to the next turn, and standard deviations
/// of the innovations [rad].
void filter_gains(const TurnFrame& frame, const FilterNoises& noises, std::span<double> gains, std::span<double> sd);

/// State of the filter between two turns of a series, from which it can be continued. Zero at the beginning.
using FilterState = std::array<double, FilterNoises::most_states>;

/// Innovations of a series over their standard deviations, with these gains: from the turn `first` on, for the length
/// of `series` and `innovations`, which may be the same.
void filter_innovations(const TurnFrame& frame, const FilterNoises& noises, std::span<const double> gains,
                        std::span<const double> sd, std::size_t first, FilterState& state,
                        std::span<const double> series, std::span<double> innovations);

/// The same for a whole series, and the standard deviations, without storing the gains.
void filter_innovations_once(const TurnFrame& frame, const FilterNoises& noises, std::span<const double> series,
                             std::span<double> innovations, std::span<double> sd);

/// Minus the log-likelihood of a series under each noise (Whitening::minus_log_likelihood).
std::vector<double> filter_likelihoods(const TurnFrame& frame, const FilterNoises& noises,
                                       std::span<const double> series, std::span<const std::uint8_t> counts);

}  // namespace ringlock::closure
