#pragma once
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

/// Deviations of the Allan family and noise coefficients of a series: `ringlock allan`.
namespace ringlock {
inline namespace v1 {

/// What the numbers of a series are. The same numbers give another deviation for each kind.
enum class Kind {
    phase,      ///< accumulated angle (velocity, time error) at each instant
    increment,  ///< gained over each sampling interval
    rate        ///< mean rate over each sampling interval
};

/// Divisor of the variances of the total family (docs/allan.md).
enum class Bias { published, exact, raw };

struct AllanOptions {
    double rate_hz = 0.0;           ///< samples a second; either this
    double tau0_s = 0.0;            ///< or the sampling interval must be given
    std::optional<Kind> kind = {};  ///< must be given
    /// Unit of the data, as --unit of the program: deg/h, deg/s, rad/s; arcsec, deg, rad; m/s^2, mg; m/s; s, ns.
    /// Empty: dimensionless, and no noise coefficients are estimated.
    std::string unit = {};
    double scale = 1.0;                               ///< size of one number of the data in that unit
    std::vector<std::string> deviations = {"oadev"};  ///< any of the twelve of docs/allan.md
    /// "octave", "decade", "all", averaging factors "1,2,4" or times with a unit "0.5s,10min".
    std::string taus = "octave";
    double confidence = 0.682689492137;  ///< two-sided level of the intervals of deviations
    Bias bias = Bias::published;
    std::string wrap = "off";   ///< "off", "auto" or a modulus such as "2^16": undo wraps of a counter or an angle
    bool clean = false;         ///< take outliers, jumps and wraps off, and leave disturbed stretches and repeats out
    std::string arw_unit = {};  ///< also the random walk in this unit, such as "deg/h/sqrt(Hz)"
    std::string column = "1";   ///< name of the series in messages and in to_json()
};

/// One averaging time of a deviation.
struct AllanPoint {
    std::int64_t m = 0;  ///< averaging factor
    double tau_s = 0.0;
    double dev = 0.0;  ///< in Allan::unit; in the unit of its integral for time errors
    double lo = 0.0;   ///< interval at the requested confidence; NaN for deviations without one
    double hi = 0.0;
    double edf = 0.0;        ///< equivalent degrees of freedom; NaN likewise
    double bias = 1.0;       ///< divisor of the variance
    std::int64_t terms = 0;  ///< squares in the mean
    int alpha = 0;           ///< power-law exponent of the noise that the interval assumes
};

struct Deviation {
    std::string name;
    std::vector<AllanPoint> points;
    std::vector<std::int64_t> factors_without_terms;  ///< gaps leave no term
};

/// A noise coefficient with its 68.27 % interval.
struct NoiseCoefficient {
    std::string key;   ///< as in JSON: "arw_deg_rt_h"
    std::string name;  ///< for people: "angle random walk N"
    std::string unit;
    std::optional<double> value;  ///< absent where the record does not show it
    std::optional<double> lo;
    std::optional<double> hi;
    std::optional<double> upper_limit_95;  ///< where it does not
};

/// A fault of the data that no noise model has.
struct Finding {
    std::string kind;         ///< outlier, jump, variance, wrap, repeated, clipped, gap
    std::size_t row = 0;      ///< first datum, counted from 0, missing ones included
    std::size_t rows = 1;     ///< data that are affected
    double size = 0.0;        ///< unit of the data; ratio of variances; modulus of a wrap; data in a gap
    double size_sigma = 0.0;  ///< over its standard error; NaN for wraps and gaps
};

/// The analysis of a series.
struct Allan {
    std::size_t n = 0;        ///< data used
    std::size_t missing = 0;  ///< NaN among the data
    double tau0_s = 0.0;
    std::string unit;  ///< of the deviations; empty where they have none
    std::vector<Deviation> deviations;
    std::vector<Finding> findings;
    std::size_t wraps_undone = 0;
    /// Of data with a unit; empty where they have none or the noise is not described by coefficients.
    std::vector<NoiseCoefficient> noise;
    std::string noise_withheld;  ///< why; empty where coefficients are given
    std::string json;            ///< to_json()

    /// The object that `ringlock allan --json` prints for the same data, without the newline.
    const std::string& to_json() const { return json; }
    /// Deviation of that name. Throws InputError where it was not asked for.
    const Deviation& deviation(std::string_view name) const;
    /// Coefficient of that key; null where there is none.
    const NoiseCoefficient* coefficient(std::string_view key) const;
};

/// Analyses a series.
///
/// \param data  samples in time order, one sampling interval apart; NaN where one is missing
///
/// Throws InputError where an option does not fit, a value is infinite or the series is too short. Thread-safe.
Allan allan(std::span<const double> data, const AllanOptions& options);

/// The same of whole numbers, such as a counter, exact to 63 bits.
Allan allan(std::span<const std::int64_t> data, const AllanOptions& options);

}  // namespace v1
}  // namespace ringlock
