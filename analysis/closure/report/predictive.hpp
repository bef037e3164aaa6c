#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/options.hpp"

/// Whether the closed model, simulated, makes records like the one that was measured.
namespace ringlock::closure {

/// A statistic of the measured record, point by point, among the same of the simulated ones.
struct PredictiveStatistic {
    std::string name;         ///< allan_deviation, spectrum, folded_minima, folded_maxima
    std::string description;  ///< one line
    std::string x_name, x_unit;
    std::string unit;       ///< of what follows but for probabilities
    bool positive = false;  ///< compared by its logarithm
    std::vector<double> x = {};
    std::vector<double> measured = {};
    std::vector<double> lowest = {}, highest = {};  ///< of the simulations
    /// Of the record with the stretches that the fit left out as disturbed; empty where there are none. All other
    /// curves are without them.
    std::vector<double> measured_whole = {};
    std::vector<double> base = {};     ///< mean of simulations of the base model alone; empty where nothing was added
    std::vector<double> p_value = {};  ///< of each point by itself, both sides
    double p_value_all = 1.0;          ///< of the largest deviation over the points
    double largest = 0.0;              ///< that deviation, in standard deviations of the simulations
    std::size_t at = 0;                ///< point where it is
};

struct Predictive {
    int simulations = 0;
    std::int64_t turns = 0;  ///< simulated, of all of them
    std::vector<PredictiveStatistic> statistics = {};
    std::vector<std::string> notes = {};  ///< what was left out, and why
};

/// Simulates the closed model as often as `options.report.most_turns` last, `options.report.fewest_simulations` to
/// `simulations` times, with the record's own input and length, and compares. What cannot be simulated is a note, and
/// no error. Tells the monitor the share of the simulations that is done. Throws Interrupted.
Predictive check_predictive(const record::Record& record, const Closure& closure,
                            int simulations = options.report.most_simulations, const Monitor& monitor = {});

}  // namespace ringlock::closure
