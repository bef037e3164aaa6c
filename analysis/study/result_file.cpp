#include "analysis/study/result_file.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <string>
#include <system_error>

#include "analysis/study/columns.hpp"
#include "engine/core/error.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/scenario/parse.hpp"
#include "engine/scenario/render.hpp"

namespace ringlock::study {

namespace {

constexpr const char* format_name = "ringlock-result";
constexpr double nan = std::numeric_limits<double>::quiet_NaN();

double or_nan(const std::optional<double>& value) { return value.value_or(nan); }
std::optional<double> or_nothing(double value) { return std::isnan(value) ? std::nullopt : std::optional(value); }

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

std::vector<double> over_gyros(const ArmStatistics& arm, const std::function<double(const GyroStatistics&)>& what) {
    std::vector<double> values;
    values.reserve(arm.gyros.size());
    for (const GyroStatistics& gyro : arm.gyros) values.push_back(what(gyro));
    return values;
}

/// Of the arm's group, the predicted spread of angles after that time.
std::string spread_attribute(double after_s) { return fmt::format("predicted_angle_spread_{:g}_s_arcsec", after_s); }

void write_noise(store::Group& group, const ArmStatistics& arm) {
    store::Group noise = group.create_group("noise");
    for (const auto& column : coefficient_columns) {
        const std::string name = column.name;
        const auto get = [&](std::optional<double> noise::Coefficient::*part) {
            return over_gyros(arm, [&](const GyroStatistics& g) { return or_nan(g.noise.*column.field.*part); });
        };
        noise.write(name, get(&noise::Coefficient::value),
                    {column.unit, fmt::format("{}; NaN where the record does not show it", column.description)});
        noise.write(name + "_lo", get(&noise::Coefficient::lo),
                    {column.unit, fmt::format("{}: lower end of its 68.27 % interval", column.description)});
        noise.write(name + "_hi", get(&noise::Coefficient::hi),
                    {column.unit, fmt::format("{}: upper end, or a 95 % limit where not shown", column.description)});
    }
    for (const auto& column : pooling_columns) {
        noise.write(column.name,
                    over_gyros(arm, [&](const GyroStatistics& g) { return g.noise.pooling.*column.field; }),
                    {column.unit, column.description});
    }
    std::vector<std::int8_t> red;
    for (const GyroStatistics& gyro : arm.gyros) red.push_back(gyro.noise.pooling.red ? 1 : 0);
    noise.write("red", red, {"1", "1 where the best model has flicker, rate random walk or a ramp"});
    std::vector<std::int8_t> described;
    for (const GyroStatistics& gyro : arm.gyros) described.push_back(gyro.noise.described ? 1 : 0);
    noise.write("described", described, {"1", "1 where the noise model describes the record"});
}

void write_allan(store::Group& group, const Study& study, const ArmStatistics& arm, const ArmSummary& summary) {
    store::Group allan = group.create_group("allan");
    const std::size_t taus = study.factors.size();
    const store::Shape shape{arm.gyros.size(), taus};
    std::vector<double> tau;
    for (const std::int64_t m : study.factors) tau.push_back(static_cast<double>(m) * study.schedule.cycle_s);
    allan.write("tau_s", tau, {"s", "averaging times"});
    allan.write("averaging_factor", study.factors, {"1", "averaging times in dither cycles"});
    for (const auto& column : allan_columns) {
        std::vector<double> values;
        for (const GyroStatistics& gyro : arm.gyros) {
            for (const allan::Point& point : gyro.allan) values.push_back(point.*column.field);
        }
        allan.write(column.name, std::span<const double>(values), shape, {column.unit, column.description});
    }
    std::vector<std::int8_t> alpha;
    std::vector<std::int64_t> terms;
    for (const GyroStatistics& gyro : arm.gyros) {
        for (const allan::Point& point : gyro.allan) alpha.push_back(static_cast<std::int8_t>(point.alpha));
    }
    for (const allan::Point& point : arm.gyros.front().allan) terms.push_back(point.terms);
    allan.write("alpha", std::span<const std::int8_t>(alpha), shape,
                {"1", "power law assumed for edf: S(f) ~ f^alpha"});
    allan.write("terms", terms, {"1", "squared differences in each deviation"});

    const auto ensemble = [&](double EnsemblePoint::*field) {
        std::vector<double> values;
        for (const EnsemblePoint& point : summary.allan) values.push_back(point.*field);
        return values;
    };
    allan.write("ensemble_deviation_deg_h", ensemble(&EnsemblePoint::dev_deg_h),
                {"deg/h", "root of the mean Allan variance over the gyros"});
    allan.write("ensemble_deviation_lo_deg_h", ensemble(&EnsemblePoint::lo),
                {"deg/h", "lower end of its 68.27 % interval"});
    allan.write("ensemble_deviation_hi_deg_h", ensemble(&EnsemblePoint::hi),
                {"deg/h", "upper end of its 68.27 % interval"});
    allan.write("ensemble_edf", ensemble(&EnsemblePoint::edf), {"1", "equivalent degrees of freedom, summed"});
}

/// The figures of the summary, for readers that want no computing; NaN where nothing is claimed.
void write_figures(store::Group& group, const ArmSummary& summary) {
    const auto figure = [&](const std::string& name, const Figure& f) {
        group.set_attribute(name + "_median", or_nan(f.median));
        group.set_attribute(name + "_lo", or_nan(f.lo));
        group.set_attribute(name + "_hi", or_nan(f.hi));
        group.set_attribute(name + "_median_ci_lo", or_nan(f.median_lo));
        group.set_attribute(name + "_median_ci_hi", or_nan(f.median_hi));
    };
    figure("arw_deg_rt_h", summary.arw_deg_rt_h);
    group.set_attribute("arw_reason", summary.arw_reason);
    group.set_attribute("theory_arw_deg_rt_h", summary.arw_theory.total_deg_rt_h);
    figure("bias_instability_deg_h", summary.bias_instability_deg_h.value_or(Figure{}));
    group.set_attribute("rate_error_deg_h_mean", summary.rate_error_deg_h.mean);
    group.set_attribute("rate_error_deg_h_lo", summary.rate_error_deg_h.lo);
    group.set_attribute("rate_error_deg_h_hi", summary.rate_error_deg_h.hi);
}

void write_angle_errors(store::Group& group, const Study& study, const ArmStatistics& arm) {
    std::vector<double> errors;
    for (const GyroStatistics& gyro : arm.gyros) {
        errors.insert(errors.end(), gyro.angle_error_arcsec.begin(), gyro.angle_error_arcsec.end());
    }
    group.write(
        "angle_error_arcsec", std::span<const double>(errors),
        store::Shape{arm.gyros.size(), study.angle_times_s.size()},
        {"arcsec", "angle turned beyond the input's after angle_error_after_s; NaN where the record ends before"});
    group.write("angle_error_after_s", study.angle_times_s, {"s", "since the start of the record"});
}

/// Effect of the injected noise: the prediction, the measurement, and the figures of each gyro.
void write_noise_effectiveness(store::Group& group, const ArmStatistics& arm, const ArmSummary& summary) {
    if (!summary.noise_effectiveness) return;
    group.write("change_per_cycle_rad", over_gyros(arm, [](const GyroStatistics& g) { return g.change_per_cycle_rad; }),
                {"rad", "rms change of the dither's amplitude from a turn to the next but one, optical phase"});
    const NoiseFigures& figures = *summary.noise_effectiveness;
    const dither::NoiseEffectiveness& predicted = figures.predicted;
    group.set_attribute("predicted_input_rate_deg_h", predicted.input_rate_deg_h);
    group.set_attribute("predicted_change_per_cycle_rad", predicted.change_per_cycle_rad);
    group.set_attribute("predicted_arw_over_theory", or_nan(predicted.arw_over_theory));
    group.set_attribute("predicted_bias_deg_h", or_nan(predicted.bias_deg_h));
    group.set_attribute("predicted_reason", predicted.reason);
    group.set_attribute("measured_change_per_cycle_rad", figures.measured.change_per_cycle_rad);
    group.set_attribute("measured_arw_over_theory", or_nan(figures.measured.arw_over_theory));
    group.set_attribute("measured_bias_deg_h", or_nan(figures.measured.bias_deg_h));
    for (std::size_t i = 0; i < std::size(dither::spread_times_s); ++i) {
        const bool told = i < predicted.angle_spread.size();
        group.set_attribute(spread_attribute(dither::spread_times_s[i]), told ? predicted.angle_spread[i].arcsec : nan);
    }
}

void write_gyros(store::Group& root, const Study& study) {
    store::Group gyros = root.create_group("gyros");
    for (const auto& parameter : drawn_parameters) {
        std::vector<double> values;
        for (const gyro::Setup& setup : study.gyros) values.push_back(setup.*parameter.field);
        gyros.write(parameter.name, values, {parameter.unit, parameter.description});
    }
}

bool is_result(const store::File& file) {
    return file.has_attribute("format") && file.string_attribute("format") == format_name;
}

/// Keeps results that are there: only a result of this very study may be replaced.
std::filesystem::path refuse_to_lose(const std::filesystem::path& path, const Study& study) {
    std::error_code unreachable;  // claiming the output says what is wrong with what is no file
    if (!std::filesystem::is_regular_file(path, unreachable)) return path;
    bool same = false;
    try {
        const store::File file = store::File::open(path);
        same =
            is_result(file) && file.dataset("scenario").read<std::string>().at(0) == scenario::to_toml(study.scenario);
    } catch (const std::exception&) {
        // Not HDF5 or not readable: somebody's file all the same.
    }
    if (!same) {
        throw InputError(
            fmt::format("{}: the file is there and is not a result of this scenario and seed; it is kept. Give "
                        "another name with -o, or remove it",
                        path.string()));
    }
    return path;
}

}  // namespace

std::uint64_t expected_size_bytes(const Study& study) {
    const auto gyros = static_cast<std::uint64_t>(study.gyros.size());
    const auto arms = static_cast<std::uint64_t>(study.arms.size());
    const auto samples = study.scenario.output.angle_record ? static_cast<std::uint64_t>(study.schedule.samples) : 0;
    const std::uint64_t taus = study.factors.size();
    // Doubles, then bytes: alpha at each tau, `red` and `described`.
    const std::uint64_t statistics =
        8 * (3 * coefficient_columns.size() + pooling_columns.size() + 1 + allan_columns.size() * taus) + taus + 2;
    std::uint64_t bytes = gyros * (8 * drawn_parameters.size() + arms * (8 * samples + statistics));
    for (const ArmStatistics& arm : study.arms) {
        bytes += has_closed_form(study.scenario, arm.arm) ? 8 * gyros : 0;
        bytes += 8 * (gyros + 1) * study.angle_times_s.size();
        if (shows_noise(arm.arm)) bytes += 8 * gyros;
    }
    return bytes;
}

ResultWriter::ResultWriter(const std::filesystem::path& path, const Study& study) : file_(refuse_to_lose(path, study)) {
    store::File& root = file_.file();
    root.set_attribute("format", format_name);
    root.set_attribute("format_version", result_format_version);
    root.set_attribute("seed", study.scenario.ensemble.seed);
    root.write("scenario", std::vector<std::string>{scenario::to_toml(study.scenario)},
               {"", "the full resolved scenario, TOML"});
    store::Group arms = root.create_group("arms");
    for (const ArmStatistics& arm : study.arms) {
        store::Group group = arms.create_group(arm.arm.name);
        group.set_attribute("ideal", static_cast<std::int64_t>(arm.arm.ideal));
        group.set_attribute("noise_injected", static_cast<std::int64_t>(arm.arm.noise_injected));
        group.set_attribute("compensator", compensator_name(arm.arm.compensator));
        if (!study.scenario.output.angle_record) continue;
        records_.push_back(group.create_dataset<double>(
            "angle_arcsec", {study.gyros.size(), static_cast<std::uint64_t>(study.schedule.samples)},
            {"arcsec", "angle output with the dither stripped, one row a gyro"}));
    }
}

void ResultWriter::write_samples(const SampledAngles& samples) {
    if (records_.empty()) return;
    const std::uint64_t columns = samples.angle_arcsec.size() / samples.gyros;
    records_[samples.arm].write_block(static_cast<std::uint64_t>(samples.first_gyro), samples.gyros,
                                      static_cast<std::uint64_t>(samples.first_sample), columns,
                                      std::span<const double>(samples.angle_arcsec));
}

void ResultWriter::finish(const Study& study, const Summary& summary, const store::Provenance& provenance) {
    store::File& root = file_.file();
    root.set_attribute("turns", study.turns);
    root.set_attribute("tables_remade", study.tables_remade);
    root.set_attribute("contradictory_readings", study.contradictory_readings);
    root.set_attribute("turn_map_error_rad", study.turn_map_error_rad);
    root.set_attribute("sample_interval_s", study.schedule.sample_interval_s);
    root.set_attribute("theory_arw_deg_rt_h", summary.theory.arw_deg_rt_h);
    root.set_attribute("theory_dead_band_deg_h", summary.theory.dead_band_deg_h);
    store::write_provenance(root, provenance);
    write_gyros(root, study);
    for (std::size_t i = 0; i < study.arms.size(); ++i) {
        store::Group group = root.group("arms").group(study.arms[i].arm.name);
        group.write("rate_error_deg_h",
                    over_gyros(study.arms[i], [](const GyroStatistics& g) { return g.rate_error_deg_h; }),
                    {"deg/h", "mean output rate less the input rate"});
        if (has_closed_form(study.scenario, study.arms[i].arm)) {
            const auto& column = closed_form_column;
            group.write(column.name,
                        over_gyros(study.arms[i], [&](const GyroStatistics& g) { return or_nan(g.*column.field); }),
                        {column.unit, column.description});
        }
        write_noise(group, study.arms[i]);
        write_allan(group, study, study.arms[i], summary.arms[i]);
        write_figures(group, summary.arms[i]);
        write_angle_errors(group, study, study.arms[i]);
        write_noise_effectiveness(group, study.arms[i], summary.arms[i]);
    }
    records_.clear();
    file_.commit();
}

namespace {

/// A dataset of the shape that the study asks for.
std::vector<double> read_column(const store::Group& group, const std::string& name, const store::Shape& expected) {
    const store::Dataset dataset = group.dataset(name);
    if (dataset.shape() != expected) {
        throw InputError(fmt::format("{}: dataset {} has the shape [{}], [{}] is wanted: the result is damaged",
                                     dataset.file(), dataset.path(), fmt::join(dataset.shape(), ", "),
                                     fmt::join(expected, ", ")));
    }
    return dataset.read<double>();
}

/// Results of earlier programs have none, or only some arms have.
void read_angle_errors(const store::Group& group, const Study& study, ArmStatistics& arm) {
    const std::size_t gyros = arm.gyros.size();
    const std::size_t times = study.angle_times_s.size();
    for (GyroStatistics& gyro : arm.gyros) gyro.angle_error_arcsec.assign(times, nan);
    if (!group.has_dataset("angle_error_arcsec")) return;
    const auto errors = read_column(group, "angle_error_arcsec", {gyros, times});
    for (std::size_t i = 0; i < errors.size(); ++i) arm.gyros[i / times].angle_error_arcsec[i % times] = errors[i];
}

/// Restores the prediction of an arm and its gyros' figures; results of earlier programs have none.
void read_noise_effectiveness(const store::Group& group, Study& study, ArmStatistics& arm) {
    const std::size_t gyros = arm.gyros.size();
    if (!group.has_dataset("change_per_cycle_rad")) return;
    const auto changes = read_column(group, "change_per_cycle_rad", {gyros});
    for (std::size_t g = 0; g < gyros; ++g) arm.gyros[g].change_per_cycle_rad = changes[g];
    dither::NoiseEffectiveness& predicted = study.predicted_noise.emplace();
    predicted.input_rate_deg_h = group.double_attribute("predicted_input_rate_deg_h");
    predicted.change_per_cycle_rad = group.double_attribute("predicted_change_per_cycle_rad");
    predicted.arw_over_theory = or_nothing(group.double_attribute("predicted_arw_over_theory"));
    predicted.bias_deg_h = or_nothing(group.double_attribute("predicted_bias_deg_h"));
    predicted.reason = group.string_attribute("predicted_reason");
    for (const double after_s : dither::spread_times_s) {
        const double arcsec = group.double_attribute(spread_attribute(after_s));
        if (!std::isnan(arcsec)) predicted.angle_spread.push_back({after_s, arcsec});
    }
}

void read_arm(const store::Group& group, const Study& study, ArmStatistics& arm) {
    const std::size_t gyros = arm.gyros.size();
    const std::size_t taus = study.factors.size();
    const auto errors = read_column(group, "rate_error_deg_h", {gyros});
    for (std::size_t g = 0; g < gyros; ++g) arm.gyros[g].rate_error_deg_h = errors[g];
    // Absent from results of earlier programs, too.
    if (has_closed_form(study.scenario, arm.arm) && group.has_dataset(closed_form_column.name)) {
        const auto values = read_column(group, closed_form_column.name, {gyros});
        for (std::size_t g = 0; g < gyros; ++g) arm.gyros[g].*closed_form_column.field = or_nothing(values[g]);
    }
    const store::Group noise = group.group("noise");
    for (const auto& column : coefficient_columns) {
        const std::string name = column.name;
        const auto value = read_column(noise, name, {gyros});
        const auto lo = read_column(noise, name + "_lo", {gyros});
        const auto hi = read_column(noise, name + "_hi", {gyros});
        for (std::size_t g = 0; g < gyros; ++g) {
            noise::Coefficient& coefficient = arm.gyros[g].noise.*column.field;
            coefficient = {!std::isnan(value[g]), or_nothing(value[g]), or_nothing(lo[g]), or_nothing(hi[g])};
        }
    }
    for (const auto& column : pooling_columns) {
        const auto values = read_column(noise, column.name, {gyros});
        for (std::size_t g = 0; g < gyros; ++g) arm.gyros[g].noise.pooling.*column.field = values[g];
    }
    const auto red = read_column(noise, "red", {gyros});
    const auto described = read_column(noise, "described", {gyros});
    for (std::size_t g = 0; g < gyros; ++g) {
        arm.gyros[g].noise.pooling.red = red[g] != 0.0;
        arm.gyros[g].noise.described = described[g] != 0.0;
    }
    const store::Group allan = group.group("allan");
    const auto tau = read_column(allan, "tau_s", {taus});
    const auto alpha = read_column(allan, "alpha", {gyros, taus});
    const auto terms = read_column(allan, "terms", {taus});
    for (std::size_t g = 0; g < gyros; ++g) arm.gyros[g].allan.resize(taus);
    for (const auto& column : allan_columns) {
        const auto values = read_column(allan, column.name, {gyros, taus});
        for (std::size_t g = 0; g < gyros; ++g) {
            for (std::size_t t = 0; t < taus; ++t) {
                allan::Point& point = arm.gyros[g].allan[t];
                point.*column.field = values[g * taus + t];
                point.m = study.factors[t];
                point.tau_s = tau[t];
                point.terms = static_cast<std::int64_t>(terms[t]);
                point.alpha = static_cast<int>(alpha[g * taus + t]);
            }
        }
    }
}

}  // namespace

Study read_result(const std::filesystem::path& path) {
    const store::File file = store::File::open(path);
    if (!is_result(file)) {
        throw InputError(
            fmt::format("{}: not a ringlock result (attribute \"format\" is not \"{}\"); results are written by "
                        "ringlock run",
                        path.string(), format_name));
    }
    const std::int64_t version = file.int_attribute("format_version");
    if (version != result_format_version) {
        throw InputError(fmt::format("{}: format_version is {}, this program reads {}", path.string(), version,
                                     result_format_version));
    }
    const auto text = file.dataset("scenario").read<std::string>();
    if (text.size() != 1) throw InputError(fmt::format("{}: dataset /scenario must hold one text", path.string()));
    Study study(scenario::parse_string(text[0], path.string() + ":/scenario"));
    study.turns = file.int_attribute("turns");
    study.tables_remade = file.int_attribute("tables_remade");
    // Absent from results of earlier programs.
    if (file.has_attribute("contradictory_readings")) {
        study.contradictory_readings = file.int_attribute("contradictory_readings");
    }
    study.turn_map_error_rad = file.double_attribute("turn_map_error_rad");
    // What is not drawn is in the scenario.
    std::fill(study.gyros.begin(), study.gyros.end(), ensemble::nominal_setup(study.scenario));
    const store::Group gyros = file.group("gyros");
    for (const auto& parameter : drawn_parameters) {
        const auto values = read_column(gyros, parameter.name, {study.gyros.size()});
        for (std::size_t g = 0; g < values.size(); ++g) study.gyros[g].*parameter.field = values[g];
    }
    for (ArmStatistics& arm : study.arms) {
        const store::Group group = file.group("arms").group(arm.arm.name);
        read_arm(group, study, arm);
        read_angle_errors(group, study, arm);
        read_noise_effectiveness(group, study, arm);
    }
    return study;
}

store::Provenance read_provenance(const std::filesystem::path& path) {
    return store::read_provenance(store::File::open(path));
}

}  // namespace ringlock::study
