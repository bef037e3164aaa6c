#include "analysis/closure/closure.hpp"

#include <fmt/format.h>
#include <oneapi/tbb/task_arena.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/report/report.hpp"
#include "analysis/closure/types.hpp"
#include "analysis/instrument/declare.hpp"
#include "analysis/instrument/simulate.hpp"
#include "analysis/record/record.hpp"
#include "engine/core/error.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/stop.hpp"
#include "library/detail.hpp"

namespace ringlock {
inline namespace v1 {

struct Record::Data {
    record::Record record;
    std::string name;
};

namespace {

record::Declared declared_of(const Declared& declared) {
    record::Declared out;
    out.scale_factor_arcsec = declared.scale_factor_arcsec;
    out.lockin_threshold_deg_h = declared.lockin_threshold_deg_h;
    out.dither_frequency_hz = declared.dither_frequency_hz;
    out.dither_peak_rate_deg_s = declared.dither_peak_rate_deg_s;
    out.bias_deg_h = declared.bias_deg_h;
    out.clock_hz = declared.clock_hz;
    out.readout_noise_rad = declared.readout_noise_rad;
    out.input_rate_deg_h = declared.input_rate_deg_h;
    return out;
}

template <class T>
std::vector<T> copy_of(std::span<const T> values) {
    return {values.begin(), values.end()};
}

record::Track track_of(const TrackView& track) { return {copy_of(track.time_s), copy_of(track.value)}; }

void add(const Surroundings& around, record::Record& record) {
    record.declared = declared_of(around.declared);
    record.temperature_c = track_of(around.temperature_c);
    record.input_rate_deg_h = track_of(around.input_rate_deg_h);
}

/// Kind and values of samples, of which one column must be there.
void set_values(const SamplesView& samples, const std::string& name, record::Samples& out) {
    const int columns = static_cast<int>(!samples.angle_increment_arcsec.empty()) +
                        static_cast<int>(!samples.angle_arcsec.empty()) +
                        static_cast<int>(!samples.quarter_count.empty());
    if (columns != 1) {
        throw InputError(
            fmt::format("{}: samples: {} of the columns angle_increment_arcsec, angle_arcsec and "
                        "quarter_count have values; exactly one must",
                        name, columns));
    }
    if (!samples.quarter_count.empty()) {
        out.kind = record::SampleKind::quarter_count;
        out.counts = copy_of(samples.quarter_count);
    } else if (!samples.angle_arcsec.empty()) {
        out.kind = record::SampleKind::angle_arcsec;
        out.values = copy_of(samples.angle_arcsec);
    } else {
        out.kind = record::SampleKind::angle_increment_arcsec;
        out.values = copy_of(samples.angle_increment_arcsec);
    }
}

std::vector<Estimate> estimates_of(const std::vector<closure::Estimate>& estimates) {
    std::vector<Estimate> out;
    for (const closure::Estimate& e : estimates) out.push_back({e.name, e.value, e.sd, e.text});
    return out;
}

Step step_of(const closure::Step& step) {
    Step out;
    out.effect = step.name();
    out.parameters = estimates_of(step.parameters);
    out.heldout_error_before = step.heldout_error_before;
    out.heldout_error_after = step.heldout_error_after;
    out.heldout_log_score_gain = step.heldout_log_score_gain;
    out.p_value = step.p_value;
    out.confounded_with = closure::names_of(step.confounded_with);
    out.experiment = step.experiment;
    return out;
}

Verdict verdict_of(closure::Verdict verdict) {
    switch (verdict) {
        case closure::Verdict::closed:
            return Verdict::closed;
        case closure::Verdict::unexplained:
            return Verdict::unexplained;
        case closure::Verdict::nothing_missing:
            break;
    }
    return Verdict::nothing_missing;
}

/// Stage and share of a loop, from its threads to the caller's.
class LoopProgress {
   public:
    closure::Monitor monitor() {
        return {[this](const std::string& stage) {
                    const std::lock_guard lock(mutex_);
                    stage_ = stage;
                    share_ = 0.0;
                },
                [this](double share) {
                    const std::lock_guard lock(mutex_);
                    share_ = share;
                }};
    }
    std::pair<std::string, double> now() const {
        const std::lock_guard lock(mutex_);
        return {stage_, share_};
    }

   private:
    mutable std::mutex mutex_;
    std::string stage_ = "reading the record";
    double share_ = 0.0;
};

}  // namespace

Record::Record(std::shared_ptr<const Data> data) : data_(std::move(data)) {}

Record Record::from_file(const std::filesystem::path& path, bool follow_links) {
    const std::lock_guard lock(library::files());
    auto data = std::make_shared<Data>();
    data->record = record::read_record(path.string(), follow_links ? store::Links::follow : store::Links::refuse);
    data->name = path.string();
    return Record(std::move(data));
}

Record Record::of_samples(const SamplesView& samples, const Surroundings& around, std::string_view name) {
    auto data = std::make_shared<Data>();
    data->name = name;
    const std::string shown = printable(name);
    record::Samples& to = data->record.samples.emplace();
    to.rate_hz = samples.rate_hz;
    to.t0_s = samples.t0_s;
    set_values(samples, shown, to);
    for (const auto& [witness, values] : samples.witnesses) to.witnesses[witness] = copy_of(values);
    add(around, data->record);
    record::refuse_errors(shown, data->record);
    return Record(std::move(data));
}

Record Record::of_turns(const TurnsView& turns, const Surroundings& around, std::string_view name) {
    auto data = std::make_shared<Data>();
    data->name = name;
    record::Turns& to = data->record.turns.emplace();
    to.time_s = copy_of(turns.time_s);
    to.direction = copy_of(turns.direction);
    to.quarter_count = copy_of(turns.quarter_count);
    to.sine = copy_of(turns.sin);
    to.cosine = copy_of(turns.cos);
    to.accel_before_rad_s2 = copy_of(turns.accel_before_rad_s2);
    to.accel_after_rad_s2 = copy_of(turns.accel_after_rad_s2);
    // As the readers do it: 0 where no acceleration was seen.
    if (to.accel_before_rad_s2.empty()) to.accel_before_rad_s2.assign(to.size(), 0.0);
    if (to.accel_after_rad_s2.empty()) to.accel_after_rad_s2.assign(to.size(), 0.0);
    add(around, data->record);
    record::refuse_errors(printable(name), data->record);
    return Record(std::move(data));
}

void Record::write(const std::filesystem::path& path) const {
    const std::lock_guard lock(library::files());
    record::write_record(path.string(), data_->record);
}

const std::string& Record::name() const { return data_->name; }

std::size_t Record::rows() const {
    const record::Record& record = data_->record;
    if (record.turns) return record.turns->size();
    return record.samples ? record.samples->size() : 0;
}

Record Library::simulate_record(const Scenario& scenario, std::int64_t gyro) {
    auto data = std::make_shared<Record::Data>();
    data->record = instrument::simulate_record(parsed(scenario), gyro);
    data->name = scenario.name();
    return Record(std::move(data));
}

Record simulate_record(const Scenario& scenario, std::int64_t gyro) { return Library::simulate_record(scenario, gyro); }

std::string_view name_of(Verdict verdict) {
    switch (verdict) {
        case Verdict::closed:
            return "closed";
        case Verdict::unexplained:
            return "unexplained";
        case Verdict::nothing_missing:
            break;
    }
    return "nothing_missing";
}

Scenario Closure::closed_scenario() const {
    if (closed_) return *closed_;
    throw InputError("the closure has no scenario: it is not the outcome of close_loop()");
}

Closure Library::close_loop(const Record& record, const CloseOptions& options) {
    // One loop at a time: a request to stop is one for the whole process.
    static std::mutex loop_mutex;
    record::Record measured = record.data_->record;
    if (options.model) instrument::declare(measured.declared, parsed(*options.model));
    const std::string shown = printable(record.name());
    const int threads = library::threads_of(options.threads);
    LoopProgress progress;
    closure::Closure closed;
    const std::lock_guard lock(loop_mutex);
    StopByRequest stop;
    library::Attended attended;
    attended.interval_s = options.interval_s;
    attended.work = [&] {
        try {
            oneapi::tbb::task_arena arena(threads);
            arena.execute([&] { closed = closure::close_loop(measured, progress.monitor()); });
        } catch (const InputError& error) {
            throw InputError(fmt::format("{}: {}", shown, error.what()));
        }
    };
    attended.look = [&] {
        if (!options.progress) return;
        const auto [stage, share] = progress.now();
        options.progress(stage, share);
    };
    attended.ended = options.cancel;
    attended.stop = [&] { stop.request(); };
    library::attend(attended);

    Closure out;
    out.verdict = verdict_of(closed.verdict);
    out.base = estimates_of(closed.base);
    for (const closure::Step& step : closed.steps) out.steps.push_back(step_of(step));
    out.error_unit = closed.unit;
    out.heldout_error_before = closed.heldout_before;
    out.heldout_error_after = closed.heldout_after;
    out.noise_floor = closed.noise_floor;
    if (closed.unexplained) {
        out.unexplained = {std::string(closure::name_of(closed.unexplained->where)), closed.unexplained->description()};
    }
    out.notes = closed.notes;
    const closure::ClosedScenario scenario = closure::closed_scenario(measured, closed);
    nlohmann::json json = closure::to_json(closed);
    json["closed"] = closure::to_json(scenario);
    out.json_ = json_text(json);
    out.text_ = closure::to_text(closed);
    out.closed_ = scenario_of(scenario.scenario, record.name());
    return out;
}

Closure close_loop(const Record& record, const CloseOptions& options) { return Library::close_loop(record, options); }

Closure close_loop(const std::filesystem::path& record, const CloseOptions& options) {
    return Library::close_loop(Record::from_file(record), options);
}

}  // namespace v1
}  // namespace ringlock
