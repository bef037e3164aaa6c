#pragma once
#include <cstdint>
#include <functional>
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
    const effects::Effect* effect = nullptr;
    std::vector<Estimate> parameters;
    double heldout_error_before = 0.0;
    double heldout_error_after = 0.0;
    double heldout_log_score_gain = 0.0;
    double p_value = 1.0;
    std::vector<const effects::Effect*> confounded_with;  ///< effects that explain this record as well
    std::string experiment;                               ///< a record that would distinguish them
    std::string note = {};                                ///< on its parameters; may be empty

    std::string name() const { return std::string(effect->name()); }
};

/// One-step predictions of the final model.
struct Residual {
    std::vector<double> time_s;
    std::vector<double> innovation;
    std::vector<double> sd;              ///< standard deviation that the model predicts
    std::vector<std::uint8_t> reported;  ///< 1 in held-out rows, 0 in training rows
};

/// A part of a record, by the record's clock.
struct TimeSpan {
    double from_s = 0.0;
    double to_s = 0.0;
};

/// Result of the closed loop on one record.
struct Closure {
    Verdict verdict = Verdict::nothing_missing;
    std::vector<Estimate> base;
    std::vector<Estimate> base_alone;  ///< of the base model without the steps; empty where there are none
    std::vector<Step> steps;
    std::string unit;  ///< of the errors: rad or arcsec
    double heldout_before = 0.0;
    double heldout_after = 0.0;
    double noise_floor = 0.0;
    /// Log-likelihood gain of the final model over the base model on the training rows [nats].
    double log_likelihood_gain = 0.0;
    std::vector<ResidualTest> tests;  ///< of the final residual
    std::optional<ResidualTest> unexplained;
    std::vector<std::string> notes;      ///< assumptions and remarks for the reader
    double level = 0.0;                  ///< probability of any false alarm
    double mean_input_rate_deg_h = 0.0;  ///< mean of the known input, which the bias does not contain
    bool rounding_in_noise = true;    ///< records of samples: the white noise of the angle includes the rounding noise
    std::vector<TimeSpan> disturbed;  ///< stretches that the fit and the tests exclude
    double disturbed_share = 0.0;     ///< share of the samples that lie in them
    std::vector<TimeSpan> gaps;       ///< spans whose samples are missing
    Residual residual;
};

/// Receives the progress of the loop.
struct Monitor {
    /// Called with a short description of each stage, on the thread that runs the loop; may be empty.
    std::function<void(const std::string& stage)> on_stage = {};
    /// Called with the completed share of a stage [0 to 1], if its parts take equal times and hardly anything follows
    /// them; on any thread, one call at a time; may be empty.
    std::function<void(double share)> on_share = {};

    void tell(const std::string& stage) const {
        if (on_stage) on_stage(stage);
    }
    void tell_share(double share) const {
        if (on_share) on_share(share);
    }
};

/// Runs the loop on the turns of the record, or on its samples if it has no turns. Throws InputError if the record
/// does not suffice, and Interrupted after a signal (engine/core/interrupt.hpp).
Closure close_loop(const record::Record& record, const Monitor& monitor = {});

}  // namespace ringlock::closure
