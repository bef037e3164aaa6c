#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <concepts>
#include <cstddef>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "analysis/study/result/columns.hpp"
#include "analysis/study/result/result_file.hpp"
#include "analysis/study/result/result_layout.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::study {

namespace {

std::int64_t whole_or_zero(double value) { return std::isnan(value) ? 0 : static_cast<std::int64_t>(value); }

std::optional<double> or_nothing(double value) { return std::isnan(value) ? std::nullopt : std::optional(value); }

/// Numbers that a column may hold.
struct Allowed {
    double least = -1e100;  // sums of squares of all that is within stay finite
    double most = 1e100;
    bool nan = true;  // stands for nothing
    const char* words = "a number up to 1e100 in size, or NaN where there is none";
};
constexpr Allowed finite_number{-1e100, 1e100, false, "a finite number up to 1e100 in size"};
constexpr Allowed allowed_deviation{0.0, 1e100, true, "a number from 0 on, or NaN where there is none"};
constexpr Allowed allowed_freedom{0.0, 1e15, true,
                                  "0 or degrees of freedom from 0.01 to 1e15, or NaN where there are none"};
constexpr double least_freedom = 0.01;

/// Checks that values are within their range, since they are evaluated later by functions that have no value far
/// outside it.
void check_values(const store::Dataset& dataset, const std::vector<double>& values, const Allowed& allowed) {
    for (std::size_t i = 0; i < values.size(); ++i) {
        const double v = values[i];
        const bool too_free = allowed.words == allowed_freedom.words && v > 0.0 && v < least_freedom;
        if (std::isnan(v) ? allowed.nan : v >= allowed.least && v <= allowed.most && !too_free) continue;
        throw InputError(
            fmt::format("{}: dataset {}: element {} (counted from 0, row by row) is {}; must be {}: "
                        "the result is damaged",
                        printable(dataset.file()), printable(dataset.path()), i, v, allowed.words));
    }
}

/// A dataset of the shape that the study requires.
template <class T = double>
std::vector<T> read_column(const store::Group& group, const std::string& name, const store::Shape& expected,
                           const Allowed& allowed = {}) {
    const store::Dataset dataset = group.dataset(name);
    if (dataset.shape() != expected) {
        throw InputError(fmt::format("{}: dataset {} has the shape [{}], [{}] is wanted: the result is damaged",
                                     printable(dataset.file()), printable(dataset.path()),
                                     fmt::join(dataset.shape(), ", "), fmt::join(expected, ", ")));
    }
    std::vector<T> values = dataset.read<T>();
    if constexpr (std::same_as<T, double>) check_values(dataset, values, allowed);
    return values;
}

/// FigureReader as the writer has them: attributes of a group, or in a design datasets with one value a point.
class FigureReader {
   public:
    FigureReader(const store::Group& home, std::optional<store::Group> rows, std::size_t points)
        : home_(home), rows_(std::move(rows)), points_(points) {}

    std::vector<double> numbers(const std::string& name) const {
        return rows_ ? read_column(*rows_, name, {points_}) : std::vector<double>{home_.double_attribute(name)};
    }
    std::vector<std::int64_t> counts(const std::string& name) const {
        return rows_ ? read_column<std::int64_t>(*rows_, name, {points_})
                     : std::vector<std::int64_t>{home_.int_attribute(name)};
    }
    std::vector<std::string> texts(const std::string& name) const {
        return rows_ ? read_column<std::string>(*rows_, name, {points_})
                     : std::vector<std::string>{home_.string_attribute(name)};
    }

   private:
    const store::Group& home_;
    std::optional<store::Group> rows_;
    std::size_t points_;
};

/// One arm of all points.
class ArmReader {
   public:
    ArmReader(const store::Group& group, Experiment& experiment, std::size_t arm)
        : group_(group), experiment_(experiment), arm_(arm), gyros_(static_cast<std::uint64_t>(experiment.gyros())) {}

    void read() const {
        read_numbers(
            group_, "rate_error_deg_h", [](GyroStatistics& g, double v) { g.rate_error_deg_h = v; }, finite_number);
        // Absent from results of earlier programs, too.
        if (group_.has_dataset(closed_form_column.name)) {
            read_numbers(group_, closed_form_column.name,
                         [](GyroStatistics& g, double v) { g.*closed_form_column.field = or_nothing(v); });
        }
        read_noise();
        read_allan();
        read_angle_errors();
        read_noise_effectiveness();
    }

   private:
    /// Calls set(gyro, value) for every gyro of every point.
    template <class Set>
    void each_gyro(const std::vector<double>& values, Set&& set) const {
        std::size_t row = 0;
        for (Study& study : experiment_.points) {
            for (GyroStatistics& gyro : study.arms[arm_].gyros) set(gyro, values[row++]);
        }
    }
    template <class Set>
    void read_numbers(const store::Group& group, const std::string& name, Set&& set,
                      const Allowed& allowed = {}) const {
        each_gyro(read_column(group, name, {gyros_}, allowed), set);
    }

    void read_noise() const {
        const store::Group noise = group_.group("noise");
        for (const auto& column : coefficient_columns) {
            const std::string name = column.name;
            read_numbers(noise, name, [&](GyroStatistics& g, double v) {
                (g.noise.*column.field).value = or_nothing(v);
                (g.noise.*column.field).resolved = !std::isnan(v);
            });
            read_numbers(noise, name + "_lo",
                         [&](GyroStatistics& g, double v) { (g.noise.*column.field).lo = or_nothing(v); });
            read_numbers(noise, name + "_hi",
                         [&](GyroStatistics& g, double v) { (g.noise.*column.field).hi = or_nothing(v); });
        }
        for (const auto& column : pooling_columns) {
            read_numbers(
                noise, column.name, [&](GyroStatistics& g, double v) { g.noise.pooling.*column.field = v; },
                finite_number);
        }
        read_numbers(noise, "red", [](GyroStatistics& g, double v) { g.noise.pooling.red = v != 0.0; });
        read_numbers(noise, "described", [](GyroStatistics& g, double v) { g.noise.described = v != 0.0; });
    }

    void read_allan() const {
        const store::Group allan = group_.group("allan");
        const std::uint64_t taus = layout::most_taus(experiment_);
        const Allowed whole{-128.0, 9e15, true, "a whole number up to 9e15"};
        const auto tau = read_column(allan, "tau_s", layout::tau_shape(experiment_), allowed_deviation);
        const auto terms = read_column(allan, "terms", layout::tau_shape(experiment_), whole);
        const auto alpha = read_column(allan, "alpha", {gyros_, taus}, whole);
        std::vector<std::vector<double>> columns;
        for (const auto& column : allan_columns) {
            const bool is_edf = column.field == &allan::Point::edf;
            columns.push_back(
                read_column(allan, column.name, {gyros_, taus}, is_edf ? allowed_freedom : allowed_deviation));
        }
        std::size_t row = 0;
        for (std::size_t p = 0; p < experiment_.points.size(); ++p) {
            Study& study = experiment_.points[p];
            for (GyroStatistics& gyro : study.arms[arm_].gyros) {
                gyro.allan.resize(study.factors.size());
                for (std::size_t t = 0; t < study.factors.size(); ++t) {
                    allan::Point& point = gyro.allan[t];
                    for (std::size_t c = 0; c < columns.size(); ++c) {
                        point.*allan_columns[c].field = columns[c][row * taus + t];
                    }
                    point.m = study.factors[t];
                    point.tau_s = tau[p * taus + t];
                    point.terms = whole_or_zero(terms[p * taus + t]);
                    point.alpha = static_cast<int>(whole_or_zero(alpha[row * taus + t]));
                }
                ++row;
            }
        }
    }

    /// Results of earlier programs have no angle errors.
    void read_angle_errors() const {
        const std::size_t times = experiment_.points.front().angle_times_s.size();
        std::vector<double> errors(gyros_ * times, layout::nan);
        if (group_.has_dataset("angle_error_arcsec"))
            errors = read_column(group_, "angle_error_arcsec", {gyros_, times});
        auto next = errors.begin();
        for (Study& study : experiment_.points) {
            for (GyroStatistics& gyro : study.arms[arm_].gyros) {
                gyro.angle_error_arcsec.assign(next, next + static_cast<std::ptrdiff_t>(times));
                next += static_cast<std::ptrdiff_t>(times);
            }
        }
    }

    /// Restores the prediction of an arm and its gyros' figures; only some arms have them.
    void read_noise_effectiveness() const {
        if (!group_.has_dataset("change_per_cycle_rad")) return;
        read_numbers(group_, "change_per_cycle_rad", [](GyroStatistics& g, double v) { g.change_per_cycle_rad = v; });
        std::optional<store::Group> rows;
        if (experiment_.has_design()) rows = group_.group("points");
        const FigureReader figures(group_, std::move(rows), experiment_.points.size());
        const auto rate = figures.numbers("predicted_input_rate_deg_h");
        const auto change = figures.numbers("predicted_change_per_cycle_rad");
        const auto arw = figures.numbers("predicted_arw_over_theory");
        const auto bias = figures.numbers("predicted_bias_deg_h");
        const auto reason = figures.texts("predicted_reason");
        for (std::size_t p = 0; p < experiment_.points.size(); ++p) {
            dither::NoiseEffectiveness& predicted = experiment_.points[p].predicted_noise.emplace();
            predicted.input_rate_deg_h = rate[p];
            predicted.change_per_cycle_rad = change[p];
            predicted.arw_over_theory = or_nothing(arw[p]);
            predicted.bias_deg_h = or_nothing(bias[p]);
            predicted.reason = reason[p];
        }
        for (const double after_s : dither::spread_times_s) {
            const auto spread = figures.numbers(layout::spread_figure(after_s) + "_arcsec");
            for (std::size_t p = 0; p < experiment_.points.size(); ++p) {
                if (std::isnan(spread[p])) continue;
                experiment_.points[p].predicted_noise->angle_spread.push_back({after_s, spread[p]});
            }
        }
    }

    const store::Group& group_;
    Experiment& experiment_;
    std::size_t arm_;
    std::uint64_t gyros_;
};

/// The axes as they were: another machine may draw points that differ in a last digit.
std::vector<Axis> read_axes(const store::File& file, const scenario::Scenario& scenario) {
    std::vector<Axis> axes = design_axes(scenario);
    if (axes.empty()) return axes;
    const store::Group design = file.group("design");
    for (Axis& axis : axes) {
        const std::vector<double> drawn =
            std::exchange(axis.values, read_column(design, axis.key, {axis.values.size()}));
        // Far more than rounding, and less than anyone would set by hand.
        constexpr double rounding = 1e-9;
        double scale = 0.0;
        for (const double value : drawn) scale = std::max(scale, std::abs(value));
        for (std::size_t p = 0; p < drawn.size(); ++p) {
            if (std::abs(axis.values[p] - drawn[p]) <= rounding * scale) continue;
            throw InputError(fmt::format(
                "{}: dataset {}/{} holds {:.10g} for point {}, where the scenario's design has {:.10g}: "
                "the result is damaged",
                printable(design.file()), printable(design.path()), axis.key, axis.values[p], p + 1, drawn[p]));
        }
    }
    return axes;
}

void read_counts(const store::File& file, Experiment& experiment) {
    std::optional<store::Group> rows;
    if (experiment.has_design()) rows = file.group("design");
    const FigureReader figures(file, std::move(rows), experiment.points.size());
    const auto turns = figures.counts("turns");
    const auto remade = figures.counts("tables_remade");
    const auto error = figures.numbers("turn_map_error_rad");
    // Absent from results of earlier programs.
    const bool contradictions = file.has_attribute("contradictory_readings");
    const auto contradictory =
        contradictions ? figures.counts("contradictory_readings") : std::vector<std::int64_t>(turns.size(), 0);
    for (std::size_t p = 0; p < experiment.points.size(); ++p) {
        Study& study = experiment.points[p];
        study.turns = turns[p];
        study.tables_remade = remade[p];
        study.turn_map_error_rad = error[p];
        study.contradictory_readings = contradictory[p];
    }
}

void read_gyros(const store::File& file, Experiment& experiment) {
    // Parameters that are not drawn are in the scenario.
    for (Study& study : experiment.points) {
        std::fill(study.gyros.begin(), study.gyros.end(), ensemble::nominal_setup(study.scenario));
    }
    const store::Group gyros = file.group("gyros");
    for (const auto& parameter : drawn_parameters) {
        const auto values =
            read_column(gyros, parameter.name, {static_cast<std::uint64_t>(experiment.gyros())}, finite_number);
        std::size_t row = 0;
        for (Study& study : experiment.points) {
            for (gyro::Setup& setup : study.gyros) setup.*parameter.field = values[row++];
        }
    }
}

}  // namespace

namespace {

/// Gyros and points take memory as soon as they are planned: only as many of them as the file has rows, and as many
/// rows as it can hold.
void check_size(const store::File& file, const scenario::Scenario& scenario, std::size_t points) {
    const store::Dataset rows = file.group("gyros").dataset(drawn_parameters.front().name);
    const auto wanted = static_cast<double>(points) * static_cast<double>(ensemble::total_gyros(scenario));
    if (rows.shape().size() != 1 || static_cast<double>(rows.shape()[0]) != wanted) {
        throw InputError(
            fmt::format("{}: dataset {} has the shape [{}], and the scenario has {:.10g} gyros: the result is damaged",
                        printable(file.file()), printable(rows.path()), fmt::join(rows.shape(), ", "), wanted));
    }
    const double needed = static_cast<double>(points) * static_cast<double>(expected_memory_bytes(scenario));
    std::error_code unknown;
    const auto there = static_cast<double>(std::filesystem::file_size(file.file(), unknown));
    constexpr double fixed_bytes = 1e8;      // of a small result with many points
    constexpr double greatest_ratio = 64.0;  // size in memory over that of the file, even if h5repack has packed it
    if (!unknown && needed > fixed_bytes + greatest_ratio * there) {
        throw InputError(
            fmt::format("{}: dataset /scenario asks for {:.10g} gyros, which the file of {:.4g} bytes cannot hold: "
                        "the result is damaged",
                        printable(file.file()), wanted, there));
    }
    store::expect_memory(2.0 * needed);
}

Experiment read_experiment(const store::File& file) {
    const std::string& path = file.file();
    if (!layout::is_result(file)) {
        throw InputError(
            fmt::format("{}: not a ringlock result (attribute \"format\" is not \"{}\"); "
                        "results are written by ringlock run",
                        printable(path), layout::format_name));
    }
    const std::int64_t version = file.int_attribute("format_version");
    if (version != result_format_version) {
        throw InputError(fmt::format("{}: format_version is {}, this program reads {}", printable(path), version,
                                     result_format_version));
    }
    const store::Dataset texts = file.dataset("scenario");
    if (texts.shape() != store::Shape{1}) {
        throw InputError(fmt::format("{}: dataset /scenario must hold one text", printable(path)));
    }
    const auto scenario = scenario::parse_string(texts.read<std::string>().at(0), path + ":/scenario", {}, complaints);
    std::vector<Axis> axes = read_axes(file, scenario);
    check_size(file, scenario, axes.empty() ? 1 : axes.front().values.size());
    Experiment experiment(scenario, std::move(axes));
    read_counts(file, experiment);
    read_gyros(file, experiment);
    if (file.has_group("stop")) {
        const store::Group stop = file.group("stop");
        experiment.growth = Growth{stop.dataset("looks").read<std::int64_t>(), stop.int_attribute("precise") != 0,
                                   stop.string_attribute("why")};
    }
    for (std::size_t arm = 0; arm < scenario.arms.size(); ++arm) {
        const store::Group group = file.group("arms").group(scenario.arms[arm].name);
        ArmReader(group, experiment, arm).read();
    }
    return experiment;
}

}  // namespace

Experiment read_result(const std::filesystem::path& path) {
    return store::guarded(
        path, [](const store::GuardedPath& guarded) { return read_experiment(store::File::open(guarded)); });
}

store::Provenance read_provenance(const std::filesystem::path& path) {
    return store::guarded(
        path, [](const store::GuardedPath& guarded) { return store::read_provenance(store::File::open(guarded)); });
}

}  // namespace ringlock::study
