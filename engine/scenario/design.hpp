#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

/// Several scenarios in one study: the keys that a design varies, as in a scenario's file.
namespace ringlock::scenario {

enum class DesignKind { none, grid, list, latin_hypercube, sobol };
enum class LevelScale { linear, log };
enum class LotDistribution { none, normal, uniform, lognormal, triangular };

/// One key that a design varies. It has values, or a range of them, or a distribution over the lot.
struct Variation {
    std::string key;  ///< path of a numeric key, "gyro.lockin_threshold_deg_h"; all numbers are in its unit
    std::vector<double> values = {};
    double from = 0.0;  ///< first value of a range, lowest of a uniform or triangular distribution
    double to = 0.0;
    std::int64_t points = 0;  ///< of a range, both ends included
    LevelScale scale = LevelScale::linear;
    LotDistribution distribution = LotDistribution::none;
    double mean = 0.0;
    double sd = 0.0;
    double median = 0.0;
    double sd_relative = 0.0;  ///< of a lognormal distribution, standard deviation over mean
    double mode = 0.0;
    bool operator==(const Variation&) const = default;
};

/// Rank correlation of two keys that have distributions.
struct KeyCorrelation {
    std::string first;
    std::string second;
    double value = 0.0;
    bool operator==(const KeyCorrelation&) const = default;
};

/// The points of a study: scenarios that differ in the values of some keys.
struct Design {
    DesignKind kind = DesignKind::none;
    std::int64_t points = 0;                   ///< of a Latin hypercube or a Sobol' sequence
    std::int64_t sensitivity_base_points = 0;  ///< n of the n (k + 2) points that sensitivity indices of k keys need
    std::vector<Variation> vary = {};
    std::vector<KeyCorrelation> correlation = {};
    bool operator==(const Design&) const = default;
};

/// When the lot is large enough; 0: no such condition. Gyros are added at looks, 16, 32, 64 and so on, until every
/// requested precision is reached.
struct Stop {
    double arw_relative = 0.0;    ///< half width of the 95 % interval of each arm's mean random walk, over the mean
    double yield_absolute = 0.0;  ///< half width of the 95 % interval of each arm's yield, a share
    std::int64_t most_gyros = 4096;
    double most_hours = 0.0;  ///< of wall time, checked at looks only
    bool operator==(const Stop&) const = default;
};

/// Whether a precision is requested.
bool asks(const Stop& stop);

/// The names of the keys of [[design.vary]] that belong together, for one kind of variation.
struct VariationForm {
    std::string_view name;                   ///< for messages: "a range"
    std::vector<std::string_view> required;  ///< in addition to `key`
    std::vector<std::string_view> optional = {};
};
const VariationForm& form_of(const Variation& variation);

}  // namespace ringlock::scenario
