#include "engine/scenario/keys/sections.hpp"

namespace ringlock::scenario {
namespace {

/// The element that is read or written; a default one if the list is empty.
template <class T>
T& last(std::vector<T>& list) {
    return list.back();
}
template <class T>
const T& last(const std::vector<T>& list) {
    static const T none{};
    return list.empty() ? none : list.back();
}

/// Key NAME of the elements of the list SECTION.LIST.
#define RINGLOCK_ELEMENT_KEY(section, list, name) \
#section "." #list, #name, [](auto& s) -> auto& { return last(s.section.list).name; }

}  // namespace

/// The keys and distributions of a study's design.
std::vector<Section> design_sections() {
    const Bounds none;
    const Bounds any = between(-1e300, 1e300, "in the unit of the key");
    const Elements variations{
        [](const Scenario& s) { return s.design.vary.size(); },
        [](Scenario& s, std::size_t size) { s.design.vary.resize(size); },
        [](const Scenario& s) { return form_of(last(s.design.vary)); },
    };
    const Elements correlations{
        [](const Scenario& s) { return s.design.correlation.size(); },
        [](Scenario& s, std::size_t size) { s.design.correlation.resize(size); },
        [](const Scenario&) {
            return VariationForm{"a correlation", {"second", "value"}};
        },
    };
    return {
        {"design",
         "Points of the study: scenarios that differ in the keys of [[design.vary]] "
         "and share their random numbers gyro by gyro. ensemble.gyros gyros are run at each.",
         {
             key(RINGLOCK_KEY(design, kind), none,
                 "none: the scenario alone; grid: every combination of values and ranges, the last key "
                 "changes fastest; list: the i-th value of every key; latin_hypercube and sobol (Owen's scrambling): "
                 "design.points points of the distributions, values and ranges, seeded by ensemble.seed."),
             key(RINGLOCK_KEY(design, points),
                 between<std::int64_t>(0, 100'000'000, "0: as many as a grid or list has"),
                 "Points of a Latin hypercube or a Sobol' sequence (powers of 2 are balanced best)."),
             key(RINGLOCK_KEY(design, sensitivity_base_points), between<std::int64_t>(0, 1'000'000, "0: no indices"),
                 "Base points n of Sobol' sensitivity indices, of a sobol design in the place of points: "
                 "n (k + 2) points for k keys."),
         }},
        {"design.vary",
         "A key that the design varies: with values, or from, to and points (and scale), "
         "or a distribution over the lot that the key's bounds cut off: "
         "normal (mean, sd), uniform (from, to), lognormal (median, sd_relative), triangular (from, mode, to).",
         {
             key(RINGLOCK_ELEMENT_KEY(design, vary, key), none,
                 "Path of a numeric key of the scenario, as in gyro.lockin_threshold_deg_h; "
                 "numbers below are in its unit. ensemble.gyros, ensemble.seed and propagation.* do not vary."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, values), any, "Values, in the order of the points of a list."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, from), any, "First value of a range; lowest of a distribution."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, to), any, "Last value of a range; highest of a distribution."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, points),
                 between<std::int64_t>(0, 100'000'000, "2 or more of a range"),
                 "Values of a range, both ends included."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, scale), none, "Equal distances, or equal ratios."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, distribution), none, "Distribution of the key over the lot."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, mean), any, "Mean of a normal distribution before it is cut off."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, sd), any, "Its standard deviation."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, median), any, "Median of a lognormal distribution."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, sd_relative), any, "Its standard deviation over its mean."),
             key(RINGLOCK_ELEMENT_KEY(design, vary, mode), any, "Likeliest value of a triangular distribution."),
         },
         variations},
        {"design.correlation",
         "Rank correlation of two keys that have distributions; pairs that are not named are independent.",
         {
             key(RINGLOCK_ELEMENT_KEY(design, correlation, first), none, "One key."),
             key(RINGLOCK_ELEMENT_KEY(design, correlation, second), none, "The other."),
             key(RINGLOCK_ELEMENT_KEY(design, correlation, value), between(-1.0, 1.0, "both ends excluded"),
                 "Spearman's rank correlation; the dependence is that of a Gaussian copula."),
         },
         correlations},
        {"stop",
         "Stopping rule of the lot: gyros are added at 16, 32, 64, ... until every requested precision is reached. "
         "ensemble.gyros is not used then.",
         {
             key(RINGLOCK_KEY(stop, arw_relative), zero_or(1e-4, 1.0, "0 switches this limit off"),
                 "Half width of the 95 % interval of every arm's mean random walk (mean of its logarithm), relative."),
             key(RINGLOCK_KEY(stop, yield_absolute), zero_or(1e-4, 0.49, "0 switches this limit off"),
                 "Half width of the 95 % interval of every arm's yield: 0.02 is +-2 %. Needs a [specification]."),
             key(RINGLOCK_KEY(stop, most_gyros), between<std::int64_t>(1, 10'000'000, "each one's results are kept"),
                 "The lot ends at this number in any case; in a design, at every point."),
             key(RINGLOCK_KEY(stop, most_hours), between(0.0, 1e5, "0: no limit"),
                 "Wall time after which no gyros are added; it is checked only at the numbers of gyros above, "
                 "so that a run can take up to twice as long."),
         }},
    };
}

#undef RINGLOCK_ELEMENT_KEY

}  // namespace ringlock::scenario
