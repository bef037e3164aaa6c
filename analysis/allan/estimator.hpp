#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string_view>
#include <vector>

namespace ringlock::allan {

/// The Allan family. Sections are those of W. Riley, Handbook of Frequency Stability Analysis, NIST SP1065 (2008).
enum class Estimator {
    adev,     ///< Allan deviation, every tau once (5.2.2)
    oadev,    ///< overlapping Allan deviation (5.2.4)
    mdev,     ///< modified Allan deviation (5.2.5)
    tdev,     ///< time deviation, tau mdev/sqrt(3) (5.2.6)
    hdev,     ///< Hadamard deviation, every tau once (5.2.8)
    ohdev,    ///< overlapping Hadamard deviation (5.2.9)
    totdev,   ///< total deviation (5.2.11)
    mtotdev,  ///< modified total deviation (5.2.12)
    ttotdev,  ///< time total deviation, tau mtotdev/sqrt(3) (5.2.13)
    htotdev,  ///< Hadamard total deviation (5.2.14)
    mtie,     ///< maximum time interval error (5.2.17)
    tierms    ///< rms time interval error (5.2.18)
};

/// How an estimator uses the phase.
enum class Family {
    difference,      ///< squares of differences of sampled phase
    modified,        ///< the same of phase averaged over tau
    total,           ///< differences of phase reflected at both ends of the record
    modified_total,  ///< averaged differences of pieces of 3 tau, each less a line and reflected
    hadamard_total,  ///< the same of the frequency
    interval_error   ///< differences of phase as it is, the line in it included
};

struct Traits {
    Estimator estimator;
    std::string_view name;  ///< as on the command line
    Family family;
    int differences;           ///< of phase: 1 time error, 2 Allan, 3 Hadamard
    bool overlapping = true;   ///< starts at every sample, or at every tau
    bool time = false;         ///< a time error: phase without division by tau
    bool has_interval = true;  ///< chi-squared statistics apply
};

inline constexpr std::array<Traits, 12> all_estimators = {{
    {Estimator::adev, "adev", Family::difference, 2, false},
    {Estimator::oadev, "oadev", Family::difference, 2},
    {Estimator::mdev, "mdev", Family::modified, 2},
    {Estimator::tdev, "tdev", Family::modified, 2, true, true},
    {Estimator::hdev, "hdev", Family::difference, 3, false},
    {Estimator::ohdev, "ohdev", Family::difference, 3},
    {Estimator::totdev, "totdev", Family::total, 2},
    {Estimator::mtotdev, "mtotdev", Family::modified_total, 2},
    {Estimator::ttotdev, "ttotdev", Family::modified_total, 2, true, true},
    {Estimator::htotdev, "htotdev", Family::hadamard_total, 3},
    {Estimator::mtie, "mtie", Family::interval_error, 1, true, true, false},
    {Estimator::tierms, "tierms", Family::interval_error, 1, true, true, false},
}};

constexpr const Traits& traits(Estimator estimator) { return all_estimators[static_cast<std::size_t>(estimator)]; }

/// The estimator's name as on the command line.
constexpr std::string_view name(Estimator estimator) { return traits(estimator).name; }

/// The estimator of that name, or nothing.
std::optional<Estimator> estimator_named(std::string_view name);

/// Phase points under one term at averaging factor m: the least record that has a deviation there.
std::int64_t span_of(Estimator estimator, std::int64_t m);

/// Terms of a record without gaps; 0 where none fits. Squares in the mean (windows, for the totals of pieces).
std::int64_t term_count(Estimator estimator, std::int64_t m, std::int64_t phase_points);

/// Largest averaging factor with at least one term.
std::int64_t largest_factor(Estimator estimator, std::int64_t phase_points);

/// Averaging factors up to `largest`: 1, 2, 4, ...; 1, 2, 4, 10, 20, 40, ...; every one.
std::vector<std::int64_t> octave_factors(std::int64_t largest);
std::vector<std::int64_t> decade_factors(std::int64_t largest);
std::vector<std::int64_t> all_factors(std::int64_t largest);

}  // namespace ringlock::allan
