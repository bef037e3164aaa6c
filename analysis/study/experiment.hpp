#pragma once
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "analysis/lot/pairs.hpp"
#include "analysis/study/design_points.hpp"
#include "analysis/study/figures/scale_factor.hpp"
#include "analysis/study/study.hpp"
#include "analysis/study/summary.hpp"

/// A study with all points of its design; without a design it has one.
namespace ringlock::study {

/// How a lot grew, where the scenario has a stopping rule.
struct Growth {
    std::vector<std::int64_t> looks;  ///< numbers of gyros at which the rule was asked
    bool precise = false;             ///< every requested precision is reached
    std::string why;                  ///< why no gyros were added: a sentence
};

struct Experiment {
    /// Plans it: nothing is simulated. Throws InputError where complaints() are about the design.
    explicit Experiment(const scenario::Scenario& what) : Experiment(what, design_axes(what)) {}
    /// The same with these axes in the place of design_axes().
    Experiment(const scenario::Scenario& what, std::vector<Axis> with_axes);

    scenario::Scenario scenario;   ///< as written, with its design
    std::vector<Axis> axes;        ///< empty without a design
    std::vector<Study> points;     ///< each the study of its scenario alone
    std::optional<Growth> growth;  ///< of a run with a stopping rule

    bool has_design() const { return !axes.empty(); }
    std::int64_t gyros() const;  ///< of all points
    std::int64_t turns() const;  ///< of all points
};

/// Store of the gyros of an experiment: it keeps finished blocks, so that they need not be simulated again.
class Store {
   public:
    virtual ~Store() = default;
    /// Puts the kept gyros of [first, last) of each point into the points, and returns the missing ones.
    virtual std::vector<Stretch> take_up(std::span<Study> points, std::int64_t first, std::int64_t last) = 0;
    /// A keeper for a block that is about to be simulated.
    virtual std::unique_ptr<BlockKeeper> keeper(std::size_t point, std::int64_t first_gyro, std::size_t gyros) = 0;
    /// All that was missing of gyros [first, last) is simulated. Where other processes have simulated some of it, puts
    /// these gyros into the points.
    virtual void collect(std::span<Study> points, std::int64_t first, std::int64_t last) = 0;
    /// Wall time that was spent on the kept blocks [h].
    virtual double hours_before() const = 0;
};

/// Runs all points side by side. With a stopping rule gyros are added to all points until every one is precise, and
/// ensemble.gyros of the scenario becomes their number. Throws RunError, Interrupted.
Experiment run(Experiment experiment, int threads, Store& store, const ensemble::Monitor& monitor);

/// The same without a store; samples are handed on.
Experiment run(Experiment experiment, int threads, const OnSamples& on_samples = nullptr,
               const ensemble::Monitor& monitor = {});

/// The parts of gyros [first, last) of a point that are not among the stretches `there`, which do not overlap.
std::vector<Stretch> missing(std::size_t point, std::int64_t first, std::int64_t last, std::vector<Stretch> there);

/// Sums every point up.
std::vector<Summary> summarise(const Experiment& experiment);

/// Random walks of an arm at a point over those at the first one, gyro by gyro: both share their random numbers.
/// Nothing where the records of either point show no random walk.
std::optional<lot::PairedFigure> arw_over_first(const Experiment& experiment, const std::vector<Summary>& summaries,
                                                std::size_t point, std::size_t arm);

/// The straight line of every arm through the rates of a design that varies input.rate_deg_h alone; empty for others.
std::vector<std::optional<ScaleFactor>> scale_factors(const Experiment& experiment);

/// Turns that the whole experiment will count; with a stopping rule, at most.
std::int64_t expected_turns(const Experiment& experiment);

}  // namespace ringlock::study
