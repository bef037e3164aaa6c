#pragma once
#include <cstdint>
#include <string>
#include <vector>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/options.hpp"

/// Comparison of the measured record with simulations of the closed model.
namespace ringlock::closure {

/// A statistic of the measured record, compared with those of the simulated records point by point.
struct PredictiveStatistic {
    std::string name;         ///< allan_deviation, spectrum, folded_minima, folded_maxima
    std::string description;  ///< one line
    std::string x_name, x_unit;
    std::string unit;       ///< of the following values except probabilities
    bool positive = false;  ///< compared by its logarithm
    std::vector<double> x = {};
    std::vector<double> measured = {};
    std::vector<double> lowest = {}, highest = {};  ///< of the simulations
    /// Statistic of the record with the outlier stretches that are excluded from the fit; empty where there are none.
    /// All other curves are without them.
    std::vector<double> measured_whole = {};
    std::vector<double> base = {};     ///< mean of simulations of the base model alone; empty where no effect was added
    std::vector<double> p_value = {};  ///< of each point by itself, two-sided
    double p_value_all = 1.0;          ///< of the largest deviation over the points
    double largest = 0.0;              ///< that deviation, in standard deviations of the simulations
    std::size_t at = 0;                ///< point of that deviation
};

struct Predictive {
    int simulations = 0;
    std::int64_t turns = 0;  ///< number of turns of all simulations together
    std::vector<PredictiveStatistic> statistics = {};
    std::vector<std::string> notes = {};  ///< parts of the model that were not simulated, and why
};

/// Simulates the closed model with the record's own input and length, and compares. The number of simulations is
/// limited by `options.report.most_turns`, with at least `options.report.fewest_simulations` and at most `simulations`.
/// A part that cannot be simulated is a note, and no error. Reports the finished share of the simulations to the
/// monitor. Throws Interrupted.
Predictive check_predictive(const record::Record& record, const Closure& closure,
                            int simulations = options.report.most_simulations, const Monitor& monitor = {});

}  // namespace ringlock::closure
