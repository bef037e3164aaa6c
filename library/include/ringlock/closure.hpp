#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <ringlock/study.hpp>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// Error sources in measured records: `ringlock closure`.
namespace ringlock {
inline namespace v1 {

/// What the operator says about the instrument: a starting point, not truth.
struct Declared {
    std::optional<double> scale_factor_arcsec;  ///< arcsec of rotation per fringe, 2 pi of optical phase
    std::optional<double> lockin_threshold_deg_h;
    std::optional<double> dither_frequency_hz;
    std::optional<double> dither_peak_rate_deg_s;
    std::optional<double> bias_deg_h;
    std::optional<double> clock_hz;
    std::optional<double> readout_noise_rad;
    std::optional<double> input_rate_deg_h;
};

/// A quantity at times of its own, linear between them; both spans have one length.
struct TrackView {
    std::span<const double> time_s = {};
    std::span<const double> value = {};
};

/// What a record can have next to its rows.
struct Surroundings {
    Declared declared = {};
    TrackView temperature_c = {};
    TrackView input_rate_deg_h = {};
};

/// Uniform samples: one of the three spans has them.
struct SamplesView {
    double rate_hz = 0.0;
    double t0_s = 0.0;
    std::span<const double> angle_increment_arcsec = {};  ///< gained over each interval; NaN where missing
    std::span<const double> angle_arcsec = {};            ///< cumulative; NaN where missing
    std::span<const std::int64_t> quarter_count = {};     ///< cumulative count of quarter fringes
    /// accel_x, accel_y, accel_z, temperature_c: as many values as samples.
    std::map<std::string, std::span<const double>> witnesses = {};
};

/// Consecutive zero-rate points of the dither, one row each; all spans have one length, and the accelerations may be
/// empty. docs/record.md defines the columns.
struct TurnsView {
    std::span<const double> time_s = {};
    std::span<const std::int8_t> direction = {};  ///< +1 at a phase minimum, -1 at a maximum
    std::span<const std::int64_t> quarter_count = {};
    std::span<const double> sin = {};
    std::span<const double> cos = {};
    std::span<const double> accel_before_rad_s2 = {};
    std::span<const double> accel_after_rad_s2 = {};
};

/// A measured record, copied from the caller's data, checked. Copies are cheap.
class Record {
   public:
    /// Reads an rlg-record (HDF5) or its form as text. Throws InputError.
    static Record from_file(const std::filesystem::path& path, bool follow_links = false);
    /// Throw InputError, naming `name` and the column, where the data are no record.
    static Record of_samples(const SamplesView& samples, const Surroundings& around = {},
                             std::string_view name = "record");
    static Record of_turns(const TurnsView& turns, const Surroundings& around = {}, std::string_view name = "record");

    /// Writes the HDF5 form, whole or not at all. Throws InputError where the path cannot be written or has a file that
    /// is no record, RunError where the disk refuses.
    void write(const std::filesystem::path& path) const;

    const std::string& name() const;
    std::size_t rows() const;  ///< turns, or samples where it has no turns

   private:
    struct Data;
    explicit Record(std::shared_ptr<const Data> data);
    std::shared_ptr<const Data> data_;
    friend class Library;
};

/// A record as the electronics of gyro `gyro` of the scenario would have made it, by its section [record]: the same as
/// `ringlock record`. Throws InputError, RunError.
Record simulate_record(const Scenario& scenario, std::int64_t gyro = 0);

enum class Verdict {
    nothing_missing,  ///< the base model describes the record
    closed,           ///< it does with the effects of the steps
    unexplained       ///< the residual has structure that no effect explains
};

/// "nothing_missing", "closed" or "unexplained".
std::string_view name_of(Verdict verdict);

/// A fitted parameter; its unit is part of the name.
struct Estimate {
    std::string name;
    double value = 0.0;
    double std = 0.0;  ///< standard error; NaN where there is none
    std::string text;  ///< in place of a number, where it is not empty
};

/// An effect that the record shows.
struct Step {
    std::string effect;
    std::vector<Estimate> parameters;
    double heldout_error_before = 0.0;  ///< rms one-step prediction error on rows that chose nothing
    double heldout_error_after = 0.0;
    double heldout_log_score_gain = 0.0;  ///< [nats]
    double p_value = 1.0;
    std::vector<std::string> confounded_with;  ///< effects that explain this record as well
    std::string experiment;                    ///< a record that would distinguish them
};

/// Structure of the final residual.
struct Unexplained {
    std::string where;  ///< phase, time, frequency, temperature, rate or amplitude
    std::string detail;
};

/// Outcome of the closed loop on one record.
class Closure {
   public:
    Verdict verdict = Verdict::nothing_missing;
    std::vector<Estimate> base;
    std::vector<Step> steps;
    std::string error_unit;             ///< rad for turns, arcsec for samples
    double heldout_error_before = 0.0;  ///< of the base model
    double heldout_error_after = 0.0;   ///< of the final model
    double noise_floor = 0.0;           ///< what the fitted noise alone would leave
    std::optional<Unexplained> unexplained;
    std::vector<std::string> notes;

    /// The object that `ringlock closure --json` prints, without the newline.
    const std::string& to_json() const { return json_; }
    /// The report for people.
    const std::string& to_text() const { return text_; }
    /// The device as fitted with the effects that were added, to be run.
    Scenario closed_scenario() const;

   private:
    std::string json_;
    std::string text_;
    std::optional<Scenario> closed_;
    friend class Library;
};

/// How to close the loop.
struct CloseOptions {
    /// Supplies scale factor, threshold and dither where the record does not declare them.
    std::optional<Scenario> model = {};
    int threads = 0;  ///< 0: all cores. The outcome does not depend on it
    /// Called now and then on the thread that called close_loop(): the stage and its finished share, 0 where that is
    /// not known.
    std::function<void(const std::string& stage, double share)> progress = {};
    std::function<bool()> cancel = {};  ///< asked as often; true ends the loop with Interrupted within some seconds
    double interval_s = 0.1;            ///< time between calls of these two
};

/// Fits the record, adds the effects that unseen rows support, and says what remains. Calls on several threads follow
/// one another. Throws InputError where the record does not suffice, Interrupted, and what a callback throws.
Closure close_loop(const Record& record, const CloseOptions& options = {});
/// The same of a file.
Closure close_loop(const std::filesystem::path& record, const CloseOptions& options = {});

}  // namespace v1
}  // namespace ringlock
