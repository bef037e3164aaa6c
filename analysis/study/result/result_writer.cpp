#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <string>
#include <system_error>
#include <type_traits>
#include <variant>
#include <vector>

#include "analysis/study/reader_facts.hpp"
#include "analysis/study/result/columns.hpp"
#include "analysis/study/result/result_file.hpp"
#include "analysis/study/result/result_layout.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/read_arms.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/scenario/text/render.hpp"

namespace ringlock::study {

namespace layout {

bool is_result(const store::File& file) {
    return file.has_attribute("format") && file.string_attribute("format") == format_name;
}

std::size_t most_taus(const Experiment& experiment) {
    std::size_t most = 0;
    for (const Study& study : experiment.points) most = std::max(most, study.factors.size());
    return most;
}

store::Shape tau_shape(const Experiment& experiment) {
    const std::size_t taus = most_taus(experiment);
    return experiment.has_design() ? store::Shape{experiment.points.size(), taus} : store::Shape{taus};
}

}  // namespace layout

namespace {

double or_nan(const std::optional<double>& value) { return value.value_or(layout::nan); }

const char* compensator_name(scenario::Compensator compensator) {
    switch (compensator) {
        case scenario::Compensator::published:
            return "published";
        case scenario::Compensator::corrected:
            return "corrected";
        case scenario::Compensator::exact:
            return "exact";
        case scenario::Compensator::adaptive:
            return "adaptive";
        case scenario::Compensator::extrapolated:
            return "extrapolated";
        case scenario::Compensator::two_train:
            return "two_train";
        case scenario::Compensator::none:
            break;
    }
    return "none";
}

/// Whether the arms of any point are read by readers.
bool any_is_read(const Experiment& experiment) {
    return std::any_of(experiment.points.begin(), experiment.points.end(),
                       [](const Study& point) { return scenario::reads_arms(point.scenario); });
}

/// FigureWriter of a study: attributes of a group. In a design each is a dataset with one value a point.
class FigureWriter {
   public:
    /// \param home  group of the attributes
    /// \param rows  group of the datasets, where there is a design
    FigureWriter(store::Group& home, store::Group* rows, std::size_t points)
        : home_(home), rows_(rows), points_(points) {}

    /// \param base   with its unit at the end, as in "arw_deg_rt_h"
    /// \param after  suffix of the name behind it, as in "_median"
    template <class Value>
    void set(const std::string& base, const std::string& after, Value&& value) {
        if (rows_ == nullptr) return home_.set_attribute(base + after, value(std::size_t{0}));
        using Element = std::decay_t<decltype(value(std::size_t{0}))>;
        std::vector<Element> values;
        for (std::size_t point = 0; point < points_; ++point) values.push_back(value(point));
        constexpr bool text = std::is_same_v<Element, std::string>;
        rows_->write(base + after, values,
                     {text ? "" : std::string(scenario::unit_of(base)), "of each point; described in FORMAT.md"});
    }

   private:
    store::Group& home_;
    store::Group* rows_;
    std::size_t points_;
};

/// One arm of all points.
class ArmWriter {
   public:
    ArmWriter(const Experiment& experiment, const std::vector<Summary>& summaries, std::size_t arm)
        : experiment_(experiment), summaries_(summaries), arm_(arm) {}

    void write(store::Group& group) const {
        group.write("rate_error_deg_h", over_gyros([](const GyroStatistics& g) { return g.rate_error_deg_h; }),
                    {"deg/h", "mean output rate less the input rate"});
        const auto closed_form = [&](const Study& study) {
            return has_closed_form(study.scenario, study.arms[arm_].arm);
        };
        if (std::any_of(experiment_.points.begin(), experiment_.points.end(), closed_form)) {
            const auto& column = closed_form_column;
            group.write(column.name, over_gyros([&](const GyroStatistics& g) { return or_nan(g.*column.field); }),
                        {column.unit, column.description});
        }
        write_noise(group);
        write_allan(group);
        write_angle_errors(group);
        if (experiment_.has_design()) {
            store::Group rows = group.create_group("points");
            write_figures(group, &rows);
        } else {
            write_figures(group, nullptr);
        }
    }

   private:
    const ArmSummary& summary(std::size_t point) const { return summaries_[point].arms[arm_]; }

    template <class T = double, class What>
    std::vector<T> over_gyros(What&& what) const {
        std::vector<T> values;
        values.reserve(static_cast<std::size_t>(experiment_.gyros()));
        for (const Study& study : experiment_.points) {
            for (const GyroStatistics& gyro : study.arms[arm_].gyros) values.push_back(static_cast<T>(what(gyro)));
        }
        return values;
    }

    void write_noise(store::Group& group) const {
        store::Group noise = group.create_group("noise");
        for (const auto& column : coefficient_columns) {
            const std::string name = column.name;
            const auto get = [&](std::optional<double> noise::Coefficient::*part) {
                return over_gyros([&](const GyroStatistics& g) { return or_nan(g.noise.*column.field.*part); });
            };
            noise.write(name, get(&noise::Coefficient::value),
                        {column.unit, fmt::format("{}; NaN where the record does not show it", column.description)});
            noise.write(name + "_lo", get(&noise::Coefficient::lo),
                        {column.unit, fmt::format("{}: lower end of its 68.27 % interval", column.description)});
            noise.write(
                name + "_hi", get(&noise::Coefficient::hi),
                {column.unit, fmt::format("{}: upper end, or a 95 % limit where not shown", column.description)});
        }
        for (const auto& column : pooling_columns) {
            noise.write(column.name, over_gyros([&](const GyroStatistics& g) { return g.noise.pooling.*column.field; }),
                        {column.unit, column.description});
        }
        noise.write("red", over_gyros<std::int8_t>([](const GyroStatistics& g) { return g.noise.pooling.red ? 1 : 0; }),
                    {"1", "1 where the best model has flicker, rate random walk or a ramp"});
        noise.write("described",
                    over_gyros<std::int8_t>([](const GyroStatistics& g) { return g.noise.described ? 1 : 0; }),
                    {"1", "1 where the noise model describes the record"});
    }

    /// A row of averaging times for every gyro; some points may have fewer times.
    template <class T, class What>
    std::vector<T> over_taus(T none, What&& what) const {
        const std::size_t taus = layout::most_taus(experiment_);
        std::vector<T> values;
        for (const Study& study : experiment_.points) {
            for (const GyroStatistics& gyro : study.arms[arm_].gyros) {
                for (const allan::Point& point : gyro.allan) values.push_back(what(point));
                values.insert(values.end(), taus - gyro.allan.size(), none);
            }
        }
        return values;
    }

    /// Of every point a row of averaging times.
    template <class T, class What>
    std::vector<T> over_points(T none, What&& what) const {
        const std::size_t taus = layout::most_taus(experiment_);
        std::vector<T> values;
        for (std::size_t point = 0; point < experiment_.points.size(); ++point) {
            const std::size_t has = experiment_.points[point].factors.size();
            for (std::size_t tau = 0; tau < has; ++tau) values.push_back(what(point, tau));
            values.insert(values.end(), taus - has, none);
        }
        return values;
    }

    void write_allan(store::Group& group) const {
        store::Group allan = group.create_group("allan");
        const store::Shape taus = layout::tau_shape(experiment_);
        const store::Shape all{static_cast<std::uint64_t>(experiment_.gyros()), layout::most_taus(experiment_)};
        const auto write = [&](const std::string& name, const auto& values, const store::Shape& shape,
                               const store::Label& label) { allan.write(name, std::span(values), shape, label); };
        const auto& points = experiment_.points;
        write("tau_s",
              over_points(layout::nan,
                          [&](std::size_t point, std::size_t tau) {
                              return static_cast<double>(points[point].factors[tau]) * points[point].schedule.output_s;
                          }),
              taus, {"s", "averaging times"});
        write("averaging_factor",
              over_points(std::int64_t{0},
                          [&](std::size_t point, std::size_t tau) { return points[point].factors[tau]; }),
              taus,
              {"1", any_is_read(experiment_) ? "averaging times in outputs of the arms"
                                             : "averaging times in dither cycles"});
        for (const auto& column : allan_columns) {
            write(column.name, over_taus(layout::nan, [&](const allan::Point& p) { return p.*column.field; }), all,
                  {column.unit, column.description});
        }
        write("alpha",
              over_taus(std::int8_t{0}, [](const allan::Point& p) { return static_cast<std::int8_t>(p.alpha); }), all,
              {"1", "power law assumed for edf: S(f) ~ f^alpha"});
        write("terms",
              over_points(std::int64_t{0},
                          [&](std::size_t point, std::size_t tau) {
                              return points[point].arms[arm_].gyros.front().allan[tau].terms;
                          }),
              taus, {"1", "squared differences in each deviation"});
        const auto ensemble = [&](double EnsemblePoint::*field) {
            return over_points(layout::nan,
                               [&](std::size_t point, std::size_t tau) { return summary(point).allan[tau].*field; });
        };
        write("ensemble_deviation_deg_h", ensemble(&EnsemblePoint::dev_deg_h), taus,
              {"deg/h", "root of the mean Allan variance over the gyros"});
        write("ensemble_deviation_lo_deg_h", ensemble(&EnsemblePoint::lo), taus,
              {"deg/h", "lower end of its 68.27 % interval"});
        write("ensemble_deviation_hi_deg_h", ensemble(&EnsemblePoint::hi), taus,
              {"deg/h", "upper end of its 68.27 % interval"});
        write("ensemble_edf", ensemble(&EnsemblePoint::edf), taus, {"1", "equivalent degrees of freedom, summed"});
    }

    void write_angle_errors(store::Group& group) const {
        std::vector<double> errors;
        for (const Study& study : experiment_.points) {
            for (const GyroStatistics& gyro : study.arms[arm_].gyros) {
                errors.insert(errors.end(), gyro.angle_error_arcsec.begin(), gyro.angle_error_arcsec.end());
            }
        }
        // All points have as many times (complaints() see to it); that of the specification may differ.
        const std::size_t times = experiment_.points.front().angle_times_s.size();
        std::vector<double> after_s;
        for (const Study& study : experiment_.points) {
            after_s.insert(after_s.end(), study.angle_times_s.begin(), study.angle_times_s.end());
        }
        group.write(
            "angle_error_arcsec", std::span<const double>(errors),
            store::Shape{static_cast<std::uint64_t>(experiment_.gyros()), times},
            {"arcsec", "angle turned beyond the input's after angle_error_after_s; NaN where the record ends before"});
        const auto shape =
            experiment_.has_design() ? store::Shape{experiment_.points.size(), times} : store::Shape{times};
        group.write("angle_error_after_s", std::span<const double>(after_s), shape,
                    {"s", "since the start of the record"});
    }

    /// The figures of the summary, for readers that do not compute them; NaN where nothing is claimed.
    void write_figures(store::Group& group, store::Group* rows) const {
        FigureWriter figures(group, rows, experiment_.points.size());
        const auto figure = [&](const std::string& name, auto&& of) {
            figures.set(name, "_median", [&](std::size_t p) { return or_nan(of(p).median); });
            figures.set(name, "_lo", [&](std::size_t p) { return or_nan(of(p).lo); });
            figures.set(name, "_hi", [&](std::size_t p) { return or_nan(of(p).hi); });
            figures.set(name, "_median_ci_lo", [&](std::size_t p) { return or_nan(of(p).median_lo); });
            figures.set(name, "_median_ci_hi", [&](std::size_t p) { return or_nan(of(p).median_hi); });
        };
        figure("arw_deg_rt_h", [&](std::size_t p) { return summary(p).arw_deg_rt_h; });
        figures.set("arw_reason", "", [&](std::size_t p) { return summary(p).arw_reason; });
        figures.set("theory_arw_deg_rt_h", "", [&](std::size_t p) { return summary(p).arw_theory.total_deg_rt_h; });
        figure("bias_instability_deg_h",
               [&](std::size_t p) { return summary(p).bias_instability_deg_h.value_or(Figure{}); });
        figures.set("rate_error_deg_h", "_mean", [&](std::size_t p) { return summary(p).rate_error_deg_h.mean; });
        figures.set("rate_error_deg_h", "_lo", [&](std::size_t p) { return summary(p).rate_error_deg_h.lo; });
        figures.set("rate_error_deg_h", "_hi", [&](std::size_t p) { return summary(p).rate_error_deg_h.hi; });
        write_noise_effectiveness(group, figures);
    }

    /// Effect of the injected noise: the prediction, the measurement, and the figures of each gyro.
    void write_noise_effectiveness(store::Group& group, FigureWriter& figures) const {
        if (!summary(0).noise_effectiveness) return;
        group.write("change_per_cycle_rad", over_gyros([](const GyroStatistics& g) { return g.change_per_cycle_rad; }),
                    {"rad", "rms change of the dither's amplitude from a turn to the next but one, optical phase"});
        using Predicted = dither::NoiseEffectiveness;
        const auto predicted = [&](const char* base, auto&& what) {
            figures.set(base, "", [&](std::size_t p) { return what(summary(p).noise_effectiveness->predicted); });
        };
        const auto measured = [&](const char* base, auto&& what) {
            figures.set(base, "", [&](std::size_t p) { return what(summary(p).noise_effectiveness->measured); });
        };
        predicted("predicted_input_rate_deg_h", [](const Predicted& p) { return p.input_rate_deg_h; });
        predicted("predicted_change_per_cycle_rad", [](const Predicted& p) { return p.change_per_cycle_rad; });
        predicted("predicted_arw_over_theory", [](const Predicted& p) { return or_nan(p.arw_over_theory); });
        predicted("predicted_bias_deg_h", [](const Predicted& p) { return or_nan(p.bias_deg_h); });
        predicted("predicted_reason", [](const Predicted& p) { return p.reason; });
        measured("measured_change_per_cycle_rad", [](const auto& m) { return m.change_per_cycle_rad; });
        measured("measured_arw_over_theory", [](const auto& m) { return or_nan(m.arw_over_theory); });
        measured("measured_bias_deg_h", [](const auto& m) { return or_nan(m.bias_deg_h); });
        for (std::size_t i = 0; i < std::size(dither::spread_times_s); ++i) {
            const std::string name = layout::spread_figure(dither::spread_times_s[i]) + "_arcsec";
            predicted(name.c_str(), [&](const Predicted& p) {
                return i < p.angle_spread.size() ? p.angle_spread[i].arcsec : layout::nan;
            });
        }
    }

    const Experiment& experiment_;
    const std::vector<Summary>& summaries_;
    std::size_t arm_;
};

void write_gyros(store::Group& root, const Experiment& experiment) {
    store::Group gyros = root.create_group("gyros");
    for (const auto& parameter : drawn_parameters) {
        std::vector<double> values;
        for (const Study& study : experiment.points) {
            for (const gyro::Setup& setup : study.gyros) values.push_back(setup.*parameter.field);
        }
        gyros.write(parameter.name, values, {parameter.unit, parameter.description});
    }
}

/// Writes the counts of the whole run and the theoretical figures of its points.
void write_totals(store::File& root, const Experiment& experiment, const std::vector<Summary>& summaries) {
    std::optional<store::Group> design;
    if (experiment.has_design()) design = root.group("design");
    FigureWriter figures(root, design ? &*design : nullptr, experiment.points.size());
    const auto count = [&](const char* name, std::int64_t Study::*field) {
        std::int64_t sum = 0;
        for (const Study& study : experiment.points) sum += study.*field;
        root.set_attribute(name, sum);
        if (design) figures.set(name, "", [&](std::size_t p) { return experiment.points[p].*field; });
    };
    count("turns", &Study::turns);
    count("tables_remade", &Study::tables_remade);
    count("contradictory_readings", &Study::contradictory_readings);
    figures.set("turn_map_error_rad", "", [&](std::size_t p) { return experiment.points[p].turn_map_error_rad; });
    figures.set("sample_interval_s", "",
                [&](std::size_t p) { return experiment.points[p].schedule.sample_interval_s; });
    figures.set("theory_arw_deg_rt_h", "", [&](std::size_t p) { return summaries[p].theory.arw_deg_rt_h; });
    figures.set("theory_dead_band_deg_h", "", [&](std::size_t p) { return summaries[p].theory.dead_band_deg_h; });
}

/// The readers of the arms, where any point has them: attributes of a group, or in a design its datasets.
void write_readers(store::File& root, const Experiment& experiment) {
    if (!any_is_read(experiment)) return;
    const auto& points = experiment.points;
    store::Group group = root.create_group("reader");
    FigureWriter figures(group, experiment.has_design() ? &group : nullptr, points.size());
    std::vector<std::vector<ReaderFact>> facts;
    for (const Study& point : points) facts.push_back(reader_facts(point.scenario));
    for (std::size_t fact = 0; fact < facts.front().size(); ++fact) {
        const auto set = [&]<class Value>(const Value&) {
            figures.set(facts.front()[fact].name, "",
                        [&](std::size_t point) { return std::get<Value>(facts[point][fact].value); });
        };
        std::visit(set, facts.front()[fact].value);
    }
}

/// How the lot grew.
void write_growth(store::File& root, const Growth& growth) {
    store::Group stop = root.create_group("stop");
    stop.write("looks", growth.looks, {"1", "numbers of gyros at which the stopping rule was asked"});
    stop.set_attribute("precise", static_cast<std::int64_t>(growth.precise));
    stop.set_attribute("why", growth.why);
}

/// Random walks of arms gyro by gyro: a matrix, row over column; of a design one below the other.
void write_pairs(store::File& root, const Experiment& experiment, const std::vector<Summary>& summaries) {
    const std::size_t arms = experiment.scenario.arms.size();
    const std::size_t cells = summaries.size() * arms * arms;
    std::vector<double> ratio(cells, layout::nan), lo(cells, layout::nan), hi(cells, layout::nan);
    std::vector<std::int8_t> distinguishable(cells, 0);
    for (std::size_t p = 0; p < summaries.size(); ++p) {
        for (const ArmPair& pair : summaries[p].pairs) {
            const auto place = [&](const std::string& name) {
                std::size_t i = 0;
                while (summaries[p].arms[i].name != name) ++i;
                return i;
            };
            const std::size_t a = place(pair.first);
            const std::size_t b = place(pair.second);
            const std::size_t above = (p * arms + a) * arms + b;
            const std::size_t below = (p * arms + b) * arms + a;
            const lot::PairedFigure& figure = pair.arw_deg_rt_h.ratio;
            if (!figure.value) continue;
            ratio[above] = *figure.value;
            ratio[below] = 1.0 / *figure.value;
            distinguishable[above] = distinguishable[below] = figure.distinguishable ? 1 : 0;
            if (!figure.interval) continue;
            lo[above] = figure.interval->lo;
            hi[above] = figure.interval->hi;
            lo[below] = 1.0 / figure.interval->hi;
            hi[below] = 1.0 / figure.interval->lo;
        }
    }
    store::Group pairs = root.create_group("pairs");
    const store::Shape shape{summaries.size() * arms, arms};
    const auto write = [&](const char* name, const auto& values, const char* what) {
        pairs.write(name, std::span(values), shape, {"1", what});
    };
    write("arw_ratio", ratio, "random walk of the row's arm over that of the column's, geometric mean over the gyros");
    write("arw_ratio_lo", lo, "lower end of its 95 % interval");
    write("arw_ratio_hi", hi, "upper end of its 95 % interval");
    write("arw_distinguishable", distinguishable, "1 where the interval excludes 1");
}

/// Whether a scenario's text is that of the experiment; the number of gyros is not compared where a stopping rule
/// decides it.
bool is_text_of(const std::string& text, const Experiment& experiment) {
    if (!scenario::asks(experiment.scenario.stop)) return text == scenario::to_toml(experiment.scenario);
    scenario::Scenario other =
        scenario::parse_string(text, "result", {}, [](const auto&) { return std::vector<scenario::Complaint>{}; });
    other.ensemble.gyros = experiment.scenario.ensemble.gyros;
    return other == experiment.scenario;
}

/// Keeps results that are there: only a result of this very study may be replaced.
std::filesystem::path refuse_to_lose(const std::filesystem::path& path, const Experiment& experiment) {
    std::error_code unreachable;  // claiming the output reports the error if this is no file
    if (std::filesystem::is_regular_file(path, unreachable) && !is_result_of(path, experiment)) {
        throw InputError(
            fmt::format("{}: the file exists and is not a result of this scenario and seed; it is kept. "
                        "Give another name with -o, or remove it",
                        printable(path)));
    }
    return path;
}

}  // namespace

bool is_result_of(const std::filesystem::path& path, const Experiment& experiment) {
    try {
        return store::guarded(path, [&](const store::GuardedPath& guarded) {
            const store::File file = store::File::open(guarded);
            return layout::is_result(file) &&
                   is_text_of(file.dataset("scenario").read<std::string>().at(0), experiment);
        });
    } catch (const Interrupted&) {
        throw;
    } catch (const std::exception&) {
        return false;  // not there, not HDF5 or not readable: at any rate not a result
    }
}

std::uint64_t expected_size_bytes(const Experiment& experiment) {
    constexpr std::uint64_t real = 8;
    const std::uint64_t taus = layout::most_taus(experiment);
    // Doubles, then bytes: alpha at each tau, `red` and `described`.
    const std::uint64_t statistics =
        real * (3 * coefficient_columns.size() + pooling_columns.size() + 1 + allan_columns.size() * taus) + taus + 2;
    const std::uint64_t figures = real * (20 + 6 * taus);  // of each point and arm, in a design
    std::uint64_t bytes = 0;
    for (const Study& study : experiment.points) {
        const scenario::Stop& stop = study.scenario.stop;
        const auto gyros = scenario::asks(stop) ? static_cast<std::uint64_t>(stop.most_gyros)
                                                : static_cast<std::uint64_t>(study.gyros.size());
        const auto arms = static_cast<std::uint64_t>(study.arms.size());
        const auto samples =
            study.scenario.output.angle_record ? static_cast<std::uint64_t>(study.schedule.samples) : 0;
        bytes += gyros * (real * drawn_parameters.size() + arms * (real * samples + statistics));
        for (const ArmStatistics& arm : study.arms) {
            bytes += has_closed_form(study.scenario, arm.arm) ? real * gyros : 0;
            bytes += real * (gyros + 1) * study.angle_times_s.size();
            if (shows_noise(arm.arm)) bytes += real * gyros;
        }
        if (experiment.has_design()) bytes += real * experiment.axes.size() + arms * figures;
    }
    return bytes;
}

ResultWriter::ResultWriter(const std::filesystem::path& path, const Experiment& experiment)
    : file_(refuse_to_lose(path, experiment)),
      scenario_(experiment.scenario),
      axes_(experiment.axes),
      samples_(static_cast<std::uint64_t>(experiment.points.front().schedule.samples)) {
    std::uint64_t rows = 0;
    for (const Study& study : experiment.points) {
        first_rows_.push_back(rows);
        rows += study.gyros.size();
    }
    first_rows_.push_back(rows);
}

void ResultWriter::begin() {
    store::File& root = file_.file();
    root.set_attribute("format", layout::format_name);
    root.set_attribute("format_version", result_format_version);
    root.set_attribute("seed", scenario_.ensemble.seed);
    if (!axes_.empty()) {
        store::Group design = root.create_group("design");
        for (const Axis& axis : axes_) {
            design.write(axis.key, axis.values, {axis.unit, "value of the key at each point"});
        }
    }
    store::Group arms = root.create_group("arms");
    for (const scenario::Arm& arm : scenario_.arms) {
        store::Group group = arms.create_group(arm.name);
        group.set_attribute("ideal", static_cast<std::int64_t>(arm.ideal));
        group.set_attribute("noise_injected", static_cast<std::int64_t>(arm.noise_injected));
        group.set_attribute("compensator", compensator_name(arm.compensator));
        if (!scenario_.output.angle_record) continue;
        records_.push_back(
            group.create_dataset<double>("angle_arcsec", {first_rows_.back(), samples_},
                                         {"arcsec", "angle output with the dither stripped, one row a gyro"}));
    }
}

void ResultWriter::write_samples(const SampledAngles& samples) {
    std::call_once(begun_, [&] { begin(); });
    if (records_.empty()) return;
    const std::uint64_t columns = samples.angle_arcsec.size() / samples.gyros;
    records_[samples.arm].write_block(first_rows_[samples.study] + static_cast<std::uint64_t>(samples.first_gyro),
                                      samples.gyros, static_cast<std::uint64_t>(samples.first_sample), columns,
                                      std::span<const double>(samples.angle_arcsec));
}

void ResultWriter::finish(const Experiment& experiment, const std::vector<Summary>& summaries,
                          const store::Provenance& provenance) {
    std::call_once(begun_, [&] { begin(); });
    store::File& root = file_.file();
    // Not before: a stopping rule sets the number of gyros.
    root.write("scenario", std::vector<std::string>{scenario::to_toml(experiment.scenario)},
               {"", "the full resolved scenario, TOML"});
    write_totals(root, experiment, summaries);
    write_readers(root, experiment);
    if (experiment.growth) write_growth(root, *experiment.growth);
    write_pairs(root, experiment, summaries);
    store::write_provenance(root, provenance);
    write_gyros(root, experiment);
    for (std::size_t arm = 0; arm < experiment.scenario.arms.size(); ++arm) {
        store::Group group = root.group("arms").group(experiment.scenario.arms[arm].name);
        ArmWriter(experiment, summaries, arm).write(group);
    }
    records_.clear();
    file_.commit();
}

}  // namespace ringlock::study
