// The part of the Python module that is written in C++: types and numbers. python/ringlock/__init__.py has the rest,
// and is what users import.
#include <pybind11/functional.h>
#include <pybind11/numpy.h>
#include <pybind11/pybind11.h>
#include <pybind11/stl.h>
#include <pybind11/stl/filesystem.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <ringlock/ringlock.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

namespace py = pybind11;
using namespace py::literals;

namespace {

/// Data of the caller, one-dimensional and without gaps in memory; a copy where they are not so or of another type.
template <class T>
using Numbers = py::array_t<T, py::array::c_style | py::array::forcecast>;

template <class T>
std::span<const T> span_of(const Numbers<T>& array, const char* name) {
    if (array.ndim() != 1) {
        throw ringlock::InputError(std::string(name) + ": has " + std::to_string(array.ndim()) +
                                   " dimensions; it must have one");
    }
    return {array.data(), static_cast<std::size_t>(array.size())};
}

/// A read-only view of memory that `owner` keeps alive.
py::array view(const std::vector<double>& values, const std::vector<py::ssize_t>& shape, py::handle owner) {
    py::array_t<double> array(shape, values.data(), owner);
    py::detail::array_proxy(array.ptr())->flags &= ~py::detail::npy_api::NPY_ARRAY_WRITEABLE_;
    return array;
}

py::array view(const std::vector<double>& values, py::handle owner) {
    return view(values, {static_cast<py::ssize_t>(values.size())}, owner);
}

/// Ctrl-C, as Python has noted it, ends what runs with KeyboardInterrupt.
bool check_signals() {
    const py::gil_scoped_acquire gil;
    if (PyErr_CheckSignals() != 0) throw py::error_already_set();
    return false;
}

ringlock::Result run(const ringlock::Scenario& scenario, int threads, const py::object& progress) {
    ringlock::RunOptions options;
    options.threads = threads;
    options.cancel = check_signals;
    if (!progress.is_none()) {
        options.progress = [&](const ringlock::Progress& now) {
            const py::gil_scoped_acquire gil;
            progress(now);
        };
    }
    const py::gil_scoped_release no_gil;
    return ringlock::run(scenario, options);
}

ringlock::Closure close_loop(const ringlock::Record& record, std::optional<ringlock::Scenario> model, int threads,
                             const py::object& progress) {
    ringlock::CloseOptions options;
    options.model = std::move(model);
    options.threads = threads;
    options.cancel = check_signals;
    if (!progress.is_none()) {
        options.progress = [&](const std::string& stage, double share) {
            const py::gil_scoped_acquire gil;
            progress(stage, share);
        };
    }
    const py::gil_scoped_release no_gil;
    return ringlock::close_loop(record, options);
}

/// Options as keywords of Python.
ringlock::AllanOptions allan_options(const py::dict& keywords) {
    ringlock::AllanOptions options;
    using Set = std::function<void(const py::handle&)>;
    const std::map<std::string, Set> known = {
        {"rate_hz", [&](const py::handle& v) { options.rate_hz = v.cast<double>(); }},
        {"tau0_s", [&](const py::handle& v) { options.tau0_s = v.cast<double>(); }},
        {"unit", [&](const py::handle& v) { options.unit = v.cast<std::string>(); }},
        {"scale", [&](const py::handle& v) { options.scale = v.cast<double>(); }},
        {"deviations", [&](const py::handle& v) { options.deviations = v.cast<std::vector<std::string>>(); }},
        {"taus", [&](const py::handle& v) { options.taus = v.cast<std::string>(); }},
        {"confidence", [&](const py::handle& v) { options.confidence = v.cast<double>(); }},
        {"wrap", [&](const py::handle& v) { options.wrap = v.cast<std::string>(); }},
        {"clean", [&](const py::handle& v) { options.clean = v.cast<bool>(); }},
        {"arw_unit", [&](const py::handle& v) { options.arw_unit = v.cast<std::string>(); }},
        {"column", [&](const py::handle& v) { options.column = v.cast<std::string>(); }},
        {"kind",
         [&](const py::handle& v) {
             const auto word = v.cast<std::string>();
             if (word == "phase") options.kind = ringlock::Kind::phase;
             if (word == "increment") options.kind = ringlock::Kind::increment;
             if (word == "rate") options.kind = ringlock::Kind::rate;
             if (!options.kind) {
                 throw ringlock::InputError("kind = '" + word + "': must be 'phase', 'increment' or 'rate'");
             }
         }},
        {"bias",
         [&](const py::handle& v) {
             const auto word = v.cast<std::string>();
             if (word == "exact") options.bias = ringlock::Bias::exact;
             if (word == "raw") options.bias = ringlock::Bias::raw;
             if (word != "exact" && word != "raw" && word != "published") {
                 throw ringlock::InputError("bias = '" + word + "': must be 'published', 'exact' or 'raw'");
             }
         }},
    };
    for (const auto& [key, value] : keywords) {
        if (!value.is_none()) known.at(key.cast<std::string>())(value);
    }
    return options;
}

template <class T>
std::string allan(const Numbers<T>& data, const py::dict& keywords) {
    const ringlock::AllanOptions options = allan_options(keywords);
    const std::span<const T> values = span_of(data, "data");
    const py::gil_scoped_release no_gil;
    return ringlock::allan(values, options).to_json();
}

template <class T>
std::span<const T> column(const py::dict& columns, const char* name, std::vector<Numbers<T>>& kept) {
    if (!columns.contains(name)) return {};
    kept.push_back(columns[name].cast<Numbers<T>>());
    return span_of(kept.back(), name);
}

/// Spans over arrays that are kept as long as this lives.
struct Columns {
    std::vector<Numbers<double>> real = {};
    std::vector<Numbers<std::int64_t>> whole = {};
    std::vector<Numbers<std::int8_t>> small = {};
};

ringlock::Surroundings surroundings(const py::dict& columns, Columns& kept) {
    ringlock::Surroundings around;
    const auto declared = columns["declared"].cast<std::map<std::string, double>>();
    ringlock::Declared& to = around.declared;
    const std::map<std::string, std::optional<double>*> known = {
        {"scale_factor_arcsec", &to.scale_factor_arcsec},
        {"lockin_threshold_deg_h", &to.lockin_threshold_deg_h},
        {"dither_frequency_hz", &to.dither_frequency_hz},
        {"dither_peak_rate_deg_s", &to.dither_peak_rate_deg_s},
        {"bias_deg_h", &to.bias_deg_h},
        {"clock_hz", &to.clock_hz},
        {"readout_noise_rad", &to.readout_noise_rad},
        {"input_rate_deg_h", &to.input_rate_deg_h},
    };
    for (const auto& [key, value] : declared) {
        const auto found = known.find(key);
        if (found == known.end()) {
            std::string names;
            for (const auto& entry : known) names += (names.empty() ? "" : ", ") + entry.first;
            throw ringlock::InputError("declared: '" + key + "' is not known; there are " + names);
        }
        *found->second = value;
    }
    around.temperature_c = {column(columns, "temperature_time_s", kept.real),
                            column(columns, "temperature_value_c", kept.real)};
    around.input_rate_deg_h = {column(columns, "input_rate_time_s", kept.real),
                               column(columns, "input_rate_value_deg_h", kept.real)};
    return around;
}

ringlock::Record record_of_samples(double rate_hz, double t0_s, const py::dict& columns, const std::string& name) {
    Columns kept;
    ringlock::SamplesView samples;
    samples.rate_hz = rate_hz;
    samples.t0_s = t0_s;
    samples.angle_increment_arcsec = column(columns, "angle_increment_arcsec", kept.real);
    samples.angle_arcsec = column(columns, "angle_arcsec", kept.real);
    samples.quarter_count = column(columns, "quarter_count", kept.whole);
    for (const auto& [witness, values] : columns["witnesses"].cast<py::dict>()) {
        kept.real.push_back(values.cast<Numbers<double>>());
        const auto key = witness.cast<std::string>();
        samples.witnesses[key] = span_of(kept.real.back(), key.c_str());
    }
    return ringlock::Record::of_samples(samples, surroundings(columns, kept), name);
}

ringlock::Record record_of_turns(const py::dict& columns, const std::string& name) {
    Columns kept;
    ringlock::TurnsView turns;
    turns.time_s = column(columns, "time_s", kept.real);
    turns.direction = column(columns, "direction", kept.small);
    turns.quarter_count = column(columns, "quarter_count", kept.whole);
    turns.sin = column(columns, "sin", kept.real);
    turns.cos = column(columns, "cos", kept.real);
    turns.accel_before_rad_s2 = column(columns, "accel_before_rad_s2", kept.real);
    turns.accel_after_rad_s2 = column(columns, "accel_after_rad_s2", kept.real);
    return ringlock::Record::of_turns(turns, surroundings(columns, kept), name);
}

py::object optional_figure(const std::optional<ringlock::Figure>& figure) {
    return figure ? py::cast(*figure) : py::object(py::none());
}

void add_exceptions(py::module_& m) {
    py::register_exception<ringlock::RunError>(m, "RunError", PyExc_RuntimeError);
    py::register_exception<ringlock::InputError>(m, "InputError", PyExc_ValueError);
    py::register_exception<ringlock::Interrupted>(m, "Interrupted", PyExc_RuntimeError);
    m.attr("RunError").attr("__doc__") = "The input was right but the run failed: disk, resource, trajectory.";
    m.attr("InputError").attr("__doc__") = "Wrong input; the message names the place, the value and what is allowed.";
    m.attr("Interrupted").attr("__doc__") = "The work was asked to stop.";
}

void add_figures(py::module_& m) {
    py::class_<ringlock::Progress>(
        m, "Progress", "Progress of a run: stage, finished and all gyros and turns, seconds since the start.")
        .def_readonly("stage", &ringlock::Progress::stage)
        .def_readonly("gyros", &ringlock::Progress::gyros)
        .def_readonly("all_gyros", &ringlock::Progress::all_gyros)
        .def_readonly("turns", &ringlock::Progress::turns)
        .def_readonly("all_turns", &ringlock::Progress::all_turns)
        .def_readonly("wall_s", &ringlock::Progress::wall_s);
    py::class_<ringlock::Figure>(
        m, "Figure",
        "A figure over the gyros of an arm: median, central 68.27 % (lo, hi), 95 % interval of the median; None where "
        "the data do not resolve a value, and hi a 95 % upper limit where there is no median.")
        .def_readonly("median", &ringlock::Figure::median)
        .def_readonly("lo", &ringlock::Figure::lo)
        .def_readonly("hi", &ringlock::Figure::hi)
        .def_readonly("median_lo", &ringlock::Figure::median_lo)
        .def_readonly("median_hi", &ringlock::Figure::median_hi)
        .def_readonly("resolved", &ringlock::Figure::resolved);
    py::class_<ringlock::MeanFigure>(m, "MeanFigure", "A mean over the gyros with the central 68.27 % of them.")
        .def_readonly("mean", &ringlock::MeanFigure::mean)
        .def_readonly("lo", &ringlock::MeanFigure::lo)
        .def_readonly("hi", &ringlock::MeanFigure::hi);
    py::class_<ringlock::Theory>(m, "Theory", "Closed-form figures of the device without spread.")
        .def_readonly("arw_deg_rt_h", &ringlock::Theory::arw_deg_rt_h)
        .def_readonly("dead_band_deg_h", &ringlock::Theory::dead_band_deg_h);
}

/// An arm of a result, which it keeps alive.
struct ArmOfResult {
    ringlock::Result result;
    const ringlock::Arm* arm;
};

template <double ringlock::EnsemblePoint::*member>
py::array_t<double> ensemble_column(const ArmOfResult& self) {
    py::array_t<double> out(static_cast<py::ssize_t>(self.arm->allan.size()));
    double* to = out.mutable_data();
    for (const ringlock::EnsemblePoint& point : self.arm->allan) *to++ = point.*member;
    return out;
}

template <std::vector<double> ringlock::GyroFigures::*member>
py::array gyro_column(const py::object& self) {
    return view(self.cast<const ArmOfResult&>().arm->each.*member, self);
}

void add_arm(py::module_& m) {
    using Each = ringlock::GyroFigures;
    using Ensemble = ringlock::EnsemblePoint;
    py::class_<ArmOfResult>(m, "Arm",
                            "One way to use the gyros: figures over the ensemble, and gyro_... arrays with one row a "
                            "gyro, NaN where the record of a gyro does not show a figure.")
        .def_property_readonly("name", [](const ArmOfResult& self) { return self.arm->name; })
        .def_property_readonly("gyros", [](const ArmOfResult& self) { return self.arm->gyros; })
        .def_property_readonly("arw_deg_rt_h",
                               [](const ArmOfResult& self) { return optional_figure(self.arm->arw_deg_rt_h); })
        .def_property_readonly("arw_reason", [](const ArmOfResult& self) { return self.arm->arw_reason; })
        .def_property_readonly(
            "bias_instability_deg_h",
            [](const ArmOfResult& self) { return optional_figure(self.arm->bias_instability_deg_h); })
        .def_property_readonly("rate_error_deg_h", [](const ArmOfResult& self) { return self.arm->rate_error_deg_h; })
        .def_property_readonly("allan_tau_s", &ensemble_column<&Ensemble::tau_s>)
        .def_property_readonly("allan_dev_deg_h", &ensemble_column<&Ensemble::dev_deg_h>)
        .def_property_readonly("allan_lo_deg_h", &ensemble_column<&Ensemble::lo>)
        .def_property_readonly("allan_hi_deg_h", &ensemble_column<&Ensemble::hi>)
        .def_property_readonly("gyro_arw_deg_rt_h", &gyro_column<&Each::arw_deg_rt_h>)
        .def_property_readonly("gyro_arw_lo_deg_rt_h", &gyro_column<&Each::arw_lo_deg_rt_h>)
        .def_property_readonly("gyro_arw_hi_deg_rt_h", &gyro_column<&Each::arw_hi_deg_rt_h>)
        .def_property_readonly("gyro_rate_error_deg_h", &gyro_column<&Each::rate_error_deg_h>)
        .def_property_readonly("gyro_allan_tau_s", &gyro_column<&Each::allan_tau_s>)
        .def_property_readonly("gyro_allan_dev_deg_h", [](const py::object& self) {
            const Each& each = self.cast<const ArmOfResult&>().arm->each;
            const auto taus = static_cast<py::ssize_t>(each.allan_tau_s.size());
            const auto gyros = taus == 0 ? 0 : static_cast<py::ssize_t>(each.allan_dev_deg_h.size()) / taus;
            return view(each.allan_dev_deg_h, {gyros, taus}, self);
        });
}

void add_scenario(py::module_& m) {
    using ringlock::Scenario;
    py::class_<Scenario>(m, "Scenario")
        .def(py::init<>())
        .def_static("from_file", &Scenario::from_file, "path"_a, "settings"_a)
        .def_static("from_text", &Scenario::from_text, "toml"_a, "settings"_a, "name"_a)
        .def("set", py::overload_cast<const ringlock::Settings&>(&Scenario::set), "settings"_a)
        .def("use", &Scenario::use, "device"_a)
        .def("value", &Scenario::value, "key"_a)
        .def("to_toml", &Scenario::to_toml)
        .def("copy", [](const Scenario& self) { return Scenario(self); })
        .def_property_readonly("name", &Scenario::name);
    py::class_<ringlock::Setting>(m, "Setting").def(py::init<std::string, ringlock::Value>());
    py::class_<ringlock::Device>(m, "Device")
        .def_static("from_file", &ringlock::Device::from_file, "path"_a)
        .def_static("from_text", &ringlock::Device::from_text, "toml"_a, "name"_a)
        .def_readonly("name", &ringlock::Device::name)
        .def_readonly("summary", &ringlock::Device::summary);
}

void add_result(py::module_& m) {
    using ringlock::Result;
    py::class_<Result>(m, "Result")
        .def_static("read", &Result::read, "path"_a, py::call_guard<py::gil_scoped_release>())
        .def("write", &Result::write, "path"_a, py::call_guard<py::gil_scoped_release>())
        .def("to_json", &Result::to_json)
        .def("scenario", &Result::scenario)
        .def_property_readonly("seed", &Result::seed)
        .def_property_readonly("turns", &Result::turns)
        .def_property_readonly("wall_s", &Result::wall_s)
        .def_property_readonly("points", [](const Result& self) { return self.points().size(); })
        .def("values",
             [](const Result& self, std::size_t point) {
                 static_cast<void>(self.arms(point));
                 return self.points()[point].values;
             })
        .def("theory", &Result::theory, "point"_a)
        .def("arms",
             [](const Result& self, std::size_t point) {
                 std::vector<ArmOfResult> arms;
                 for (const ringlock::Arm& arm : self.arms(point)) arms.push_back({self, &arm});
                 return arms;
             })
        .def("angle_record", [](const Result& self, const std::string& arm, std::size_t point) {
            const ringlock::AngleRecord record = [&] {
                const py::gil_scoped_release no_gil;
                return self.angle_record(arm, point);
            }();
            using Kept = std::shared_ptr<const std::vector<double>>;
            auto kept = std::make_unique<Kept>(record.angle_arcsec);
            const py::capsule owner(kept.release(), [](void* p) { delete static_cast<Kept*>(p); });
            const py::array angles =
                view(*record.angle_arcsec,
                     {static_cast<py::ssize_t>(record.gyros), static_cast<py::ssize_t>(record.samples)}, owner);
            return py::make_tuple(angles, record.interval_s);
        });
}

void add_closure(py::module_& m) {
    using ringlock::Record;
    py::class_<Record>(m, "Record")
        .def_static("from_file", &Record::from_file, "path"_a, "follow_links"_a)
        .def_static("of_samples", &record_of_samples)
        .def_static("of_turns", &record_of_turns)
        .def("write", &Record::write, "path"_a, py::call_guard<py::gil_scoped_release>())
        .def_property_readonly("name", &Record::name)
        .def("__len__", &Record::rows);
    py::class_<ringlock::Closure>(m, "Closure")
        .def("to_json", &ringlock::Closure::to_json)
        .def("to_text", &ringlock::Closure::to_text)
        .def("scenario", &ringlock::Closure::closed_scenario);
    m.def("close_loop", &close_loop);
    m.def("simulate_record", &ringlock::simulate_record, "scenario"_a, "gyro"_a,
          py::call_guard<py::gil_scoped_release>());
}

}  // namespace

PYBIND11_MODULE(_ringlock, m) {
    m.doc() = "The part of ringlock that is written in C++; import ringlock instead.";
    m.attr("version") = std::string(ringlock::version());
    m.attr("git_hash") = std::string(ringlock::git_hash());
    add_exceptions(m);
    add_figures(m);
    add_arm(m);
    add_scenario(m);
    add_result(m);
    add_closure(m);
    m.def("run", &run);
    m.def("allan_real", &allan<double>);
    m.def("allan_whole", &allan<std::int64_t>);
    m.def("known_devices", &ringlock::known_devices);
}
