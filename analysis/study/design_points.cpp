#include "analysis/study/design_points.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <optional>
#include <string_view>

#include "analysis/design/design.hpp"
#include "analysis/design/sensitivity.hpp"
#include "analysis/study/study.hpp"
#include "engine/core/error.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::study {

namespace {

using scenario::Complaint;
using scenario::Scenario;
using scenario::Variation;

constexpr std::int64_t most_gyros = 100'000'000;  // of all points, as of a sweep

std::string key_of(std::size_t variation, std::string_view name) {
    return fmt::format("design.vary[{}].{}", variation + 1, name);
}

/// Why a key cannot vary; empty where it can.
std::string why_not(const std::string& path) {
    const scenario::Key* key = scenario::find_key(path);
    if (path == "device") return "names a device; a design varies numbers";
    if (key == nullptr) return "is not a key of a scenario; `ringlock run --print-schema` prints all of them";
    const bool number = key->type == scenario::Type::real || key->type == scenario::Type::integer;
    if (!number) return fmt::format("is {}; a design varies numbers", scenario::allowed_text(*key));
    if (path.starts_with("propagation.")) return "is about how the equation is solved and does not vary";
    if (path.starts_with("design.")) return "is a key of the design itself";
    if (path.starts_with("record.")) return "is of `ringlock record`, which has no design";
    if (path == "ensemble.gyros") return "is the same at all points, which share their random numbers gyro by gyro";
    if (path == "ensemble.seed") return "is the same at all points; set another seed for another study";
    if (path == "input.sweep_points" || path == "input.sweep_stop_deg_h") {
        return "is of a sweep; vary input.rate_deg_h in its place";
    }
    return "";
}

/// Throws InputError where a scenario has no such key.
design::Factor factor_of(const Variation& v) {
    if (scenario::find_key(v.key) == nullptr) throw InputError(fmt::format("\"{}\" {}", v.key, why_not(v.key)));
    design::Factor factor{v.key, design::Values{v.values}};
    switch (v.distribution) {
        case scenario::LotDistribution::normal:
            factor.takes = design::Normal{v.mean, v.sd};
            break;
        case scenario::LotDistribution::uniform:
            factor.takes = design::Uniform{v.from, v.to};
            break;
        case scenario::LotDistribution::lognormal:
            factor.takes = design::Lognormal{v.median, v.sd_relative};
            break;
        case scenario::LotDistribution::triangular:
            factor.takes = design::Triangular{v.from, v.mode, v.to};
            break;
        case scenario::LotDistribution::none:
            if (!v.values.empty()) break;
            const auto scale = v.scale == scenario::LevelScale::log ? design::Scale::log : design::Scale::linear;
            factor.takes = design::Range{v.from, v.to, static_cast<std::uint64_t>(v.points), scale};
            break;
    }
    const scenario::Key& key = *scenario::find_key(v.key);
    const auto bound = [](const scenario::Value& value) {
        const auto* whole = std::get_if<std::int64_t>(&value);
        return whole != nullptr ? static_cast<double>(*whole) : std::get<double>(value);
    };
    factor.lower = bound(key.bounds.min);
    factor.upper = bound(key.bounds.max);
    // A bound that is excluded, or 0 that is allowed as well: the key itself says so when the point is set.
    if (key.bounds.or_zero && factor.lower > 0.0) factor.lower = 0.0;
    if (key.bounds.min_excluded) factor.lower = std::nextafter(factor.lower, factor.upper);
    return factor;
}

design::Plan plan_of(const Scenario& scenario) {
    const scenario::Design& wanted = scenario.design;
    design::Plan plan;
    switch (wanted.kind) {
        case scenario::DesignKind::grid:
            plan.kind = design::Kind::grid;
            break;
        case scenario::DesignKind::list:
            plan.kind = design::Kind::list;
            break;
        case scenario::DesignKind::latin_hypercube:
            plan.kind = design::Kind::latin_hypercube;
            break;
        case scenario::DesignKind::sobol:
        case scenario::DesignKind::none:
            plan.kind = design::Kind::sobol;
            break;
    }
    for (const Variation& v : wanted.vary) plan.factors.push_back(factor_of(v));
    for (const scenario::KeyCorrelation& c : wanted.correlation) {
        plan.correlations.push_back({c.first, c.second, c.value});
    }
    plan.points = static_cast<std::uint64_t>(wanted.points);
    plan.seed = scenario.ensemble.seed;
    return plan;
}

std::uint64_t point_limit(const Scenario& scenario) {
    return static_cast<std::uint64_t>(most_gyros / std::max<std::int64_t>(1, scenario.ensemble.gyros));
}

design::Points points_of(const Scenario& scenario) {
    const design::Plan plan = plan_of(scenario);
    const auto base_points = static_cast<std::uint64_t>(scenario.design.sensitivity_base_points);
    if (base_points == 0) return design::make_points(plan, point_limit(scenario));
    const auto unit = design::sensitivity_points(base_points, plan.factors.size(), plan.seed, point_limit(scenario));
    return design::at_quantiles(unit, plan.factors);
}

bool whole_number_key(const scenario::Key& key) { return key.type == scenario::Type::integer; }

/// Errors of a design that can be found before its points are made.
std::vector<Complaint> complaints_of_design(const Scenario& scenario) {
    const scenario::Design& wanted = scenario.design;
    std::vector<Complaint> found;
    const auto complain = [&](std::string key, std::string problem) {
        found.push_back({{std::move(key)}, std::move(problem)});
    };
    if (wanted.vary.empty()) {
        const char* nothing = "varies nothing; add a table [[design.vary]] for each key that varies";
        if (wanted.kind != scenario::DesignKind::none) complain("design.kind", nothing);
        if (wanted.points > 0) complain("design.points", nothing);
        if (wanted.sensitivity_base_points > 0) complain("design.sensitivity_base_points", nothing);
        if (!wanted.correlation.empty()) complain("design.correlation[1].first", nothing);
        return found;
    }
    if (wanted.kind == scenario::DesignKind::none) {
        complain("design.kind",
                 "does not say how [[design.vary]] is used; set \"grid\", \"list\", \"latin_hypercube\" or \"sobol\"");
    }
    if (scenario.input.sweep_points > 1) {
        complain("input.sweep_points", "a sweep and a design exclude each other; vary input.rate_deg_h in the design");
    }
    if (wanted.sensitivity_base_points > 0) {
        const char* key = "design.sensitivity_base_points";
        if (wanted.kind != scenario::DesignKind::sobol) complain(key, "needs design.kind = \"sobol\"");
        if (wanted.points > 0) complain(key, "sets the number of points itself; leave design.points out");
        if (static_cast<std::size_t>(wanted.sensitivity_base_points) < design::fewest_base_points) {
            complain(key, fmt::format("fewer than {} base points have no indices; set as many, or 0 for none",
                                      design::fewest_base_points));
        }
        if (!wanted.correlation.empty()) {
            complain(key, "Sobol' indices are of independent factors; leave the correlations out, or the indices");
        }
    }
    const bool reads =
        scenario::reads_arms(scenario) || std::any_of(wanted.vary.begin(), wanted.vary.end(),
                                                      [](const Variation& v) { return v.key == "reader.output_hz"; });
    for (std::size_t i = 0; i < wanted.vary.size(); ++i) {
        const Variation& v = wanted.vary[i];
        if (v.key.starts_with("reader.") && scenario::find_key(v.key) != nullptr && !reads) {
            complain(key_of(i, "key"), "is of the reader, and no arm of the study is read; set reader.output_hz, too");
            continue;
        }
        if (const std::string why = why_not(v.key); !why.empty()) {
            complain(key_of(i, "key"), why);
            continue;
        }
        const design::Factor factor = factor_of(v);
        try {
            design::check(factor);
        } catch (const InputError& error) {
            found.push_back({{key_of(i, scenario::form_of(v).required.front()), key_of(i, "key")}, error.what()});
            continue;
        }
        if (!whole_number_key(*scenario::find_key(v.key))) continue;
        if (design::has_distribution(factor)) {
            complain(key_of(i, "distribution"), fmt::format("{} is a whole number; give values", v.key));
            continue;
        }
        for (std::uint64_t level = 0; level < design::level_count(factor); ++level) {
            const double value = design::level(factor, level);
            if (value == std::round(value)) continue;
            found.push_back({{key_of(i, "values"), key_of(i, "points"), key_of(i, "key")},
                             fmt::format("{} is a whole number, but {:g} is not; give values", v.key, value)});
            break;
        }
    }
    return found;
}

std::vector<std::string> keys_of_axes(const std::vector<Axis>& axes) {
    std::vector<std::string> keys;
    for (std::size_t i = 0; i < axes.size(); ++i) keys.push_back(key_of(i, "key"));
    return keys;
}

/// The key, as the design's element where it varies.
std::vector<std::string> as_varied(const std::vector<std::string>& keys, const std::vector<Axis>& axes) {
    std::vector<std::string> out;
    for (const std::string& key : keys) {
        for (std::size_t i = 0; i < axes.size(); ++i) {
            if (axes[i].key == key) out.push_back(key_of(i, "key"));
        }
    }
    out.insert(out.end(), keys.begin(), keys.end());
    return out;
}

std::string point_text(const std::vector<Axis>& axes, std::size_t point) {
    std::string text;
    for (const Axis& axis : axes) {
        text += fmt::format("{}{} = {:g}", text.empty() ? "" : ", ", axis.key, axis.values[point]);
    }
    return text;
}

/// "point 3", or "points 3, 4 and 9", or the first of many.
std::string numbers_text(const std::vector<std::size_t>& points) {
    constexpr std::size_t most = 20;
    if (points.size() == 1) return fmt::format("point {}", points[0] + 1);
    std::string text = "points ";
    const std::size_t shown = std::min(points.size(), most);
    for (std::size_t i = 0; i < shown; ++i) {
        text += fmt::format("{}{}", i == 0 ? "" : i + 1 == points.size() ? " and " : ", ", points[i] + 1);
    }
    return points.size() > most ? text + fmt::format(" ... ({} points)", points.size()) : text;
}

/// Values that their keys do not allow: a design has a key's limits, but not the additional permission of 0.
std::vector<Complaint> out_of_bounds(const std::vector<Axis>& axes, std::size_t point) {
    std::vector<Complaint> found;
    for (const Axis& axis : axes) {
        const scenario::Key& key = *scenario::find_key(axis.key);
        if (scenario::can_take(key, axis.values[point])) continue;
        found.push_back({{axis.key}, fmt::format("must be {}", scenario::allowed_text(key))});
    }
    return found;
}

/// Rules that points break: the same keys and the same rule once, with all its points.
std::vector<Complaint> complaints_of_points(const Scenario& scenario, const std::vector<Axis>& axes) {
    struct Broken {
        Complaint first;
        std::vector<std::size_t> points;
    };
    std::vector<Broken> broken;
    std::map<std::string, std::size_t> known;  // by the first key and the beginning of the text, which has no figures
    const std::size_t points = axes.front().values.size();
    for (std::size_t point = 0; point < points; ++point) {
        std::vector<Complaint> rules = out_of_bounds(axes, point);
        if (rules.empty()) rules = scenario::check(scenario_at(scenario, axes, point));
        for (Complaint& complaint : rules) {
            const std::string rule =
                complaint.keys.front() + complaint.problem.substr(0, complaint.problem.find_first_of("0123456789"));
            const auto [entry, is_new] = known.emplace(rule, broken.size());
            if (is_new) broken.push_back({std::move(complaint), {}});
            broken[entry->second].points.push_back(point);
        }
    }
    std::vector<Complaint> found;
    for (const Broken& b : broken) {
        Complaint complaint{as_varied(b.first.keys, axes), {}};
        complaint.problem =
            fmt::format("{} of {}{}: {}: {}", numbers_text(b.points), points, b.points.size() > 1 ? ", the first" : "",
                        point_text(axes, b.points.front()), b.first.problem);
        found.push_back(std::move(complaint));
    }
    return found;
}

/// More points than memory holds, by the schedule of the scenario itself. Throws InputError where points cannot be
/// counted.
std::optional<Complaint> too_large(const Scenario& scenario) {
    const auto base_points = static_cast<std::uint64_t>(scenario.design.sensitivity_base_points);
    const std::uint64_t keys = scenario.design.vary.size();
    const std::uint64_t limit = point_limit(scenario);
    const std::uint64_t points =
        base_points > 0 ? base_points * (keys + 2) : design::point_count(plan_of(scenario), limit);
    const auto needed = static_cast<double>(points) * static_cast<double>(expected_memory_bytes(scenario));
    const double there = static_cast<double>(sysconf(_SC_PHYS_PAGES)) * static_cast<double>(sysconf(_SC_PAGE_SIZE));
    if (needed <= there) return std::nullopt;
    const std::int64_t gyros = asks(scenario.stop) ? scenario.stop.most_gyros : scenario.ensemble.gyros;
    return Complaint{{"design.points", "design.sensitivity_base_points", "design.kind"},
                     fmt::format("{} points of {} gyros need about {:.0f} GB of memory, and the machine has {:.0f} GB; "
                                 "take fewer points or gyros",
                                 points, gyros, needed * 1e-9, there * 1e-9)};
}

/// Points have the same limits and the same figures: results are compared across them, and stand in one dataset.
std::vector<Complaint> complaints_of_specification(const Scenario& scenario, const std::vector<Axis>& axes) {
    std::vector<Complaint> found;
    for (std::size_t i = 0; i < axes.size(); ++i) {
        const Axis& axis = axes[i];
        if (!axis.key.starts_with("specification.")) continue;
        const bool some = std::find(axis.values.begin(), axis.values.end(), 0.0) != axis.values.end();
        const bool all = std::all_of(axis.values.begin(), axis.values.end(), [](double value) { return value == 0.0; });
        if (some && !all) {
            found.push_back({{key_of(i, "key")},
                             fmt::format("{} is 0 at some points, where it is no limit, and not at others; leave 0 out",
                                         axis.key)});
        }
        const bool time = axis.key == "specification.at_s" || axis.key == "specification.after_s";
        if (time && scenario.design.sensitivity_base_points > 0) {
            found.push_back({{key_of(i, "key")},
                             fmt::format("{} selects the figure, and an index is that of one figure; "
                                         "leave it out, or the indices",
                                         axis.key)});
        }
    }
    return found;
}

bool same_schedule(const std::vector<Axis>& axes) {
    const auto changes = [](const Axis& axis) {
        return axis.values.end() != std::adjacent_find(axis.values.begin(), axis.values.end(), std::not_equal_to<>());
    };
    const std::array<std::string_view, 5> keys{"dither.frequency_hz", "ensemble.duration_s", "ensemble.settle_s",
                                               "output.sample_interval_s", "reader.output_hz"};
    return std::none_of(axes.begin(), axes.end(), [&](const Axis& axis) {
        return std::find(keys.begin(), keys.end(), axis.key) != keys.end() && changes(axis);
    });
}

}  // namespace

std::vector<Axis> design_axes(const Scenario& scenario) {
    std::vector<Axis> axes;
    if (scenario.design.vary.empty()) return axes;
    const design::Points points = points_of(scenario);
    for (std::size_t i = 0; i < scenario.design.vary.size(); ++i) {
        const std::string& key = scenario.design.vary[i].key;
        Axis axis{key, std::string(scenario::unit_of(scenario::find_key(key)->name)), {}};
        for (std::size_t point = 0; point < points.count; ++point) axis.values.push_back(points[point][i]);
        axes.push_back(std::move(axis));
    }
    return axes;
}

Scenario scenario_at(const Scenario& scenario, const std::vector<Axis>& axes, std::size_t point) {
    Scenario alone = scenario;
    alone.design = {};
    for (const Axis& axis : axes) {
        const scenario::Key& key = *scenario::find_key(axis.key);
        key.set(alone, scenario::value_of(key, axis.values[point]));
    }
    return alone;
}

std::vector<Complaint> complaints(const Scenario& scenario) {
    std::vector<Complaint> found = complaints_of_design(scenario);
    if (!found.empty()) return found;
    if (scenario.design.vary.empty()) return scenario::check(scenario);
    std::vector<Axis> axes;
    try {
        if (auto complaint = too_large(scenario)) return {*complaint};
        axes = design_axes(scenario);
    } catch (const InputError& error) {
        return {{{"design.points", "design.sensitivity_base_points", "design.kind"}, error.what()}};
    }
    found = complaints_of_points(scenario, axes);
    for (Complaint& complaint : complaints_of_specification(scenario, axes)) found.push_back(std::move(complaint));
    if (scenario.output.angle_record && !same_schedule(axes)) {
        std::vector<std::string> keys{"output.angle_record"};
        for (std::string& key : keys_of_axes(axes)) keys.push_back(std::move(key));
        found.push_back({std::move(keys),
                         "records of different lengths or sampling intervals have no place in one dataset; "
                         "set output.angle_record = false"});
    }
    return found;
}

}  // namespace ringlock::study
