#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <ringlock/device.hpp>
#include <ringlock/settings.hpp>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

/// Simulation of ensembles: `ringlock run` and `ringlock analyze`.
namespace ringlock {
inline namespace v1 {

class Library;

/// A study that can be run, always valid: each change is checked with all rules of scenarios. Copies are cheap.
class Scenario {
   public:
    /// The empty scenario: every key at its default, the device of Gao and Deng (2007).
    Scenario();

    /// Reads a scenario; settings replace values of the file. Throws InputError with every problem, one a line.
    static Scenario from_file(const std::filesystem::path& path, const Settings& settings = {});
    /// The same for TOML text; `name` stands in messages and results in place of the file.
    static Scenario from_text(std::string_view toml, const Settings& settings = {}, std::string_view name = "scenario");

    /// Replaces values, all at once or, where it throws InputError, none of them.
    Scenario& set(const Settings& settings);
    Scenario& set(std::string_view key, Value value) { return set({{std::string(key), std::move(value)}}); }

    /// Takes the constants of a device of one's own, in place of those of the scenario. Later changes replace them.
    /// Throws InputError.
    Scenario& use(const Device& device);

    /// Value of a key in force. Throws InputError where no scenario has that key.
    Value value(std::string_view key) const;
    /// The same of a key that is a number.
    double number(std::string_view key) const;

    /// All keys as TOML, which from_text() reads back to an equal scenario.
    std::string to_toml() const;
    /// The file, or the name that was given.
    const std::string& name() const;

   private:
    struct Data;
    explicit Scenario(std::shared_ptr<const Data> data);
    std::shared_ptr<const Data> data_;
    friend class Library;
};

/// A figure over the gyros of an arm; values that the data do not resolve are absent.
struct Figure {
    std::optional<double> median;
    std::optional<double> lo;         ///< lower end of the central 68.27 % of the gyros
    std::optional<double> hi;         ///< upper end; a 95 % upper limit where there is no median
    std::optional<double> median_lo;  ///< bootstrap 95 % interval of the median
    std::optional<double> median_hi;
    std::int64_t resolved = 0;  ///< gyros whose record shows the figure by itself
};

/// A mean over the gyros with the central 68.27 % of them.
struct MeanFigure {
    double mean = 0.0;
    double lo = 0.0;
    double hi = 0.0;
};

/// Allan deviation over the ensemble at one averaging time, with its 68.27 % interval.
struct EnsemblePoint {
    double tau_s = 0.0;
    double dev_deg_h = 0.0;  ///< root of the mean Allan variance of the gyros
    double lo = 0.0;
    double hi = 0.0;
    double edf = 0.0;  ///< equivalent degrees of freedom
};

/// Figures of each gyro of an arm, in the order of the gyros. NaN where the record of a gyro does not show a figure.
struct GyroFigures {
    std::vector<double> arw_deg_rt_h;
    std::vector<double> arw_lo_deg_rt_h;   ///< 68.27 % interval
    std::vector<double> arw_hi_deg_rt_h;   ///< its upper end; where arw_deg_rt_h is NaN a 95 % upper limit
    std::vector<double> rate_error_deg_h;  ///< mean output rate less the input rate
    std::vector<double> allan_dev_deg_h;   ///< [gyro][tau], rows of allan_tau_s.size()
    std::vector<double> allan_tau_s;
};

/// One way to use the gyros, by its name as in docs/scenario.md: "noise_injected+compensated".
struct Arm {
    std::string name;
    std::int64_t gyros = 0;
    std::optional<Figure> arw_deg_rt_h;  ///< angle random walk; absent for the reason below
    std::string arw_reason;              ///< why arw_deg_rt_h has no median; empty where it has one
    std::optional<Figure> bias_instability_deg_h;
    MeanFigure rate_error_deg_h;
    std::vector<EnsemblePoint> allan;
    GyroFigures each;
};

/// Closed-form figures of the device without spread.
struct Theory {
    double arw_deg_rt_h = 0.0;     ///< of turns at random phases
    double dead_band_deg_h = 0.0;  ///< half width, to first order
};

/// A point of a design; a scenario without a design has one.
struct Point {
    std::map<std::string, double> values;  ///< of the keys that the design varies
    std::vector<Arm> arms;
    Theory theory;
    double sample_interval_s = 0.0;  ///< between samples of the angle record
};

/// Samples of the angle output of all gyros of an arm at a point.
struct AngleRecord {
    std::size_t gyros = 0;
    std::size_t samples = 0;  ///< of each gyro, from time 0 on
    double interval_s = 0.0;
    std::shared_ptr<const std::vector<double>> angle_arcsec;  ///< [gyro][sample]

    std::span<const double> of_gyro(std::size_t gyro) const {
        return std::span(*angle_arcsec).subspan(gyro * samples, samples);
    }
};

/// The outcome of a run. Copies are cheap.
class Result {
   public:
    /// Reads a result file of `ringlock run` or of write(). Throws InputError where it is none or is damaged.
    static Result read(const std::filesystem::path& path);

    /// Writes the result file, whole or not at all; results/FORMAT.md describes it. A file of the same scenario and
    /// seed is replaced. Throws InputError where the path cannot be written or has another file, RunError where the
    /// disk refuses.
    void write(const std::filesystem::path& path) const;

    const std::vector<Point>& points() const;
    /// Arms of a point. Throws InputError where there is no such point or arm.
    const std::vector<Arm>& arms(std::size_t point = 0) const;
    const Arm& arm(std::string_view name, std::size_t point = 0) const;
    const Theory& theory(std::size_t point = 0) const;

    /// Angle samples of an arm; those of a file are read at the first call. Throws InputError where none were kept
    /// (output.angle_record = false).
    AngleRecord angle_record(std::string_view arm, std::size_t point = 0) const;

    Scenario scenario() const;
    std::int64_t seed() const;
    std::int64_t turns() const;  ///< zero-rate points of distinct physical trajectories
    double wall_s() const;       ///< duration of the run

    /// The object that `ringlock run --json` and `ringlock analyze --json` print, without the newline.
    std::string to_json() const;

   private:
    struct Data;
    explicit Result(std::shared_ptr<const Data> data);
    std::shared_ptr<const Data> data_;
    friend class Library;
};

/// How to run.
struct RunOptions {
    int threads = 0;  ///< 0: all cores. Results do not depend on it
    /// Called now and then, and at the end; on the thread that called run().
    std::function<void(const Progress&)> progress = {};
    /// Asked as often on the same thread; true ends the run with Interrupted, usually within a second.
    std::function<bool()> cancel = {};
    double interval_s = 0.1;  ///< time between calls of these two
};

/// Simulates the ensemble of the scenario and compares its arms. All results are kept in memory, angle samples too
/// unless output.angle_record is false; checkpoints are for the program `ringlock run`. Throws InputError, RunError,
/// Interrupted, and what a callback throws.
Result run(const Scenario& scenario, const RunOptions& options = {});

}  // namespace v1
}  // namespace ringlock
