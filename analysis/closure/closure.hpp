#pragma once
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/closure/types.hpp"
#include "analysis/record/record.hpp"

/// The closed loop with measured data: fit, residual, trace, add, report (docs/closure.md).
namespace ringlock::closure {

enum class Verdict { nothing_missing, closed, unexplained };
std::string_view name_of(Verdict verdict);

/// An effect that the loop has added.
struct Step {
    std::string effect;
    std::vector<Estimate> parameters;
    double heldout_error_before = 0.0;
    double heldout_error_after = 0.0;
    double heldout_log_score_gain = 0.0;
    double p_value = 1.0;
    std::vector<std::string> confounded_with;  ///< effects that explain this record as well
    std::string experiment;                    ///< what would tell them apart
    std::string note = {};                     ///< of its parameters; empty: nothing to be said
};

/// One-step predictions of the final model.
struct Residual {
    std::vector<double> time_s;
    std::vector<double> innovation;
    std::vector<double> sd;              ///< that the model foretells
    std::vector<std::uint8_t> reported;  ///< 1: held out, used for nothing but the report
};

/// What a record says of the model.
struct Closure {
    Verdict verdict = Verdict::nothing_missing;
    std::vector<Estimate> base;
    std::vector<Step> steps;
    std::string unit;  ///< of the errors: rad or arcsec
    double heldout_before = 0.0;
    double heldout_after = 0.0;
    double noise_floor = 0.0;
    /// Of the model of all that was chosen over the base model, on the rows that choose [nats].
    double log_likelihood_gain = 0.0;
    std::vector<ResidualTest> tests;  ///< of the final residual
    std::optional<ResidualTest> unexplained;
    std::vector<std::string> notes;      ///< what was assumed
    double level = 0.0;                  ///< probability of any false alarm
    double mean_input_rate_deg_h = 0.0;  ///< known input, of which the bias is free
    bool rounding_in_noise = true;       ///< of samples: the white noise of the angle has that of its steps in it
    Residual residual;
};

/// Runs the loop on the record's turns, or on its samples where it has no turns. Throws InputError where the record
/// does not suffice.
Closure close_loop(const record::Record& record);

}  // namespace ringlock::closure
