#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <map>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/study/experiment.hpp"
#include "analysis/study/experiment_json.hpp"
#include "analysis/study/family.hpp"
#include "analysis/study/result/result_file.hpp"
#include "analysis/study/summary.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/ensemble/progress/observer.hpp"
#include "engine/simd/target.hpp"
#include "engine/store/provenance.hpp"
#include "library/detail.hpp"

namespace ringlock {
inline namespace v1 {

namespace {

using Samples = std::shared_ptr<const std::vector<double>>;
using SampleKey = std::pair<std::size_t, std::size_t>;  // point and arm

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

Figure figure_of(const study::Figure& figure) {
    return {figure.median, figure.lo, figure.hi, figure.median_lo, figure.median_hi, figure.resolved};
}

GyroFigures each_of(const study::Study& study, const study::ArmStatistics& arm) {
    GyroFigures out;
    for (const std::int64_t factor : study.factors) {
        out.allan_tau_s.push_back(static_cast<double>(factor) * study.schedule.output_s);
    }
    for (const study::GyroStatistics& gyro : arm.gyros) {
        const noise::Coefficient& arw = gyro.noise.arw_deg_rt_h;
        out.arw_deg_rt_h.push_back(arw.value.value_or(nan));
        out.arw_lo_deg_rt_h.push_back(arw.lo.value_or(nan));
        out.arw_hi_deg_rt_h.push_back(arw.hi.value_or(nan));
        out.rate_error_deg_h.push_back(gyro.rate_error_deg_h);
        for (const allan::Point& point : gyro.allan) out.allan_dev_deg_h.push_back(point.dev);
    }
    return out;
}

Arm arm_of(const study::Study& study, const study::ArmStatistics& statistics, const study::ArmSummary& summary) {
    Arm arm;
    arm.name = summary.name;
    arm.gyros = summary.gyros;
    if (study::has_arw(summary)) arm.arw_deg_rt_h = figure_of(summary.arw_deg_rt_h);
    arm.arw_reason = summary.arw_reason;
    if (summary.bias_instability_deg_h) arm.bias_instability_deg_h = figure_of(*summary.bias_instability_deg_h);
    arm.rate_error_deg_h = {summary.rate_error_deg_h.mean, summary.rate_error_deg_h.lo, summary.rate_error_deg_h.hi};
    for (const study::EnsemblePoint& point : summary.allan) {
        arm.allan.push_back({point.tau_s, point.dev_deg_h, point.lo, point.hi, point.edf});
    }
    arm.each = each_of(study, statistics);
    return arm;
}

std::vector<Point> points_of(const study::Experiment& experiment, const std::vector<study::Summary>& summaries) {
    std::vector<Point> points;
    for (std::size_t p = 0; p < experiment.points.size(); ++p) {
        const study::Study& study = experiment.points[p];
        Point point;
        for (const study::Axis& axis : experiment.axes) point.values[axis.key] = axis.values[p];
        for (std::size_t a = 0; a < study.arms.size(); ++a) {
            point.arms.push_back(arm_of(study, study.arms[a], summaries[p].arms[a]));
        }
        point.theory = {summaries[p].theory.arw_deg_rt_h, summaries[p].theory.dead_band_deg_h};
        point.sample_interval_s = study.schedule.sample_interval_s;
        points.push_back(std::move(point));
    }
    return points;
}

/// Counts what a run has done.
class Counts : public ensemble::Observer {
   public:
    void stage(const std::string& name) override {
        const std::lock_guard lock(mutex_);
        progress_.stage = name;
    }
    void plan(std::span<const ensemble::PlannedBlock> /*blocks*/, int /*threads*/) override {
        stage("simulating gyros");
    }
    void enter(std::size_t /*block*/, ensemble::BlockStage /*stage*/) override {}
    void advance(std::size_t /*block*/, std::int64_t gyros, std::int64_t turns, bool /*tabulated*/) override {
        const std::lock_guard lock(mutex_);
        progress_.gyros += gyros;
        progress_.turns += turns;
    }
    Progress now() const {
        const std::lock_guard lock(mutex_);
        return progress_;
    }

   private:
    mutable std::mutex mutex_;
    Progress progress_;
};

/// Keeps the angle samples of a run.
class SampleKeeper {
   public:
    void take(const study::Experiment& plan, const study::SampledAngles& samples) {
        const auto columns = static_cast<std::size_t>(plan.points[samples.study].schedule.samples);
        const std::lock_guard lock(mutex_);
        std::vector<double>& all = kept_[{samples.study, samples.arm}];
        const std::size_t rows = static_cast<std::size_t>(samples.first_gyro) + samples.gyros;
        if (all.size() < rows * columns) all.resize(rows * columns, nan);
        const std::size_t width = samples.angle_arcsec.size() / samples.gyros;
        for (std::size_t g = 0; g < samples.gyros; ++g) {
            const std::size_t to = (static_cast<std::size_t>(samples.first_gyro) + g) * columns +
                                   static_cast<std::size_t>(samples.first_sample);
            std::copy_n(samples.angle_arcsec.begin() + static_cast<std::ptrdiff_t>(g * width), width,
                        all.begin() + static_cast<std::ptrdiff_t>(to));
        }
    }
    std::map<SampleKey, Samples> all() {
        std::map<SampleKey, Samples> out;
        for (auto& [key, values] : kept_) {
            out[key] = std::make_shared<const std::vector<double>>(std::move(values));
        }
        return out;
    }

   private:
    std::mutex mutex_;
    std::map<SampleKey, std::vector<double>> kept_;
};

}  // namespace

struct Result::Data {
    explicit Data(study::Experiment what) : experiment(std::move(what)) {}

    study::Experiment experiment;
    std::vector<study::Summary> summaries;
    store::Provenance provenance;
    std::vector<Point> points;
    std::filesystem::path file;  ///< that it was read from; empty for a run
    mutable std::mutex mutex;    ///< of the samples
    mutable std::map<SampleKey, Samples> samples;

    void sum_up() {
        summaries = study::summarise(experiment);
        points = points_of(experiment, summaries);
    }

    Samples samples_of(std::size_t point, std::size_t arm) const {
        const std::lock_guard lock(mutex);
        Samples& kept = samples[{point, arm}];
        if (!kept && !file.empty()) {
            const std::lock_guard reading(library::files());
            kept = std::make_shared<const std::vector<double>>(study::angle_samples(file, experiment, point, arm));
        }
        return kept;
    }
};

Result Library::run(const Scenario& scenario, const RunOptions& options) {
    const int threads = library::threads_of(options.threads);
    constexpr std::array<const char*, 1> command_line = {"libringlock"};
    auto data = std::make_shared<Result::Data>(study::Experiment(parsed(scenario)));
    data->provenance = store::collect_provenance(command_line, threads, scenario.name());
    const std::int64_t all_gyros = data->experiment.gyros();
    const std::int64_t all_turns = study::expected_turns(data->experiment);
    const auto start = std::chrono::steady_clock::now();
    const auto wall_s = [start] {
        return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    };
    Counts counts;
    SampleKeeper keeper;
    std::atomic<bool> cancelled = false;
    library::Attended attended;
    attended.interval_s = options.interval_s;
    attended.work = [&] {
        const study::Experiment plan = data->experiment;
        study::OnSamples on_samples;
        if (plan.scenario.output.angle_record) {
            on_samples = [&](const study::SampledAngles& samples) { keeper.take(plan, samples); };
        }
        data->experiment =
            study::run(std::move(data->experiment), threads, on_samples, {[&] { return cancelled.load(); }, &counts});
        counts.stage("summing up");
        data->provenance.wall_s = wall_s();
        data->sum_up();
    };
    attended.look = [&] {
        if (!options.progress) return;
        Progress progress = counts.now();
        progress.all_gyros = all_gyros;
        progress.all_turns = all_turns;
        progress.wall_s = wall_s();
        options.progress(progress);
    };
    attended.ended = options.cancel;
    attended.stop = [&] { cancelled = true; };
    library::attend(attended);
    data->provenance.turns_per_s = static_cast<double>(data->experiment.turns()) / data->provenance.wall_s;
    data->provenance.instruction_set = simd::active_target();
    data->samples = keeper.all();
    return Result(std::move(data));
}

Result run(const Scenario& scenario, const RunOptions& options) { return Library::run(scenario, options); }

Result::Result(std::shared_ptr<const Data> data) : data_(std::move(data)) {}

Result Result::read(const std::filesystem::path& path) {
    const std::lock_guard lock(library::files());
    auto data = std::make_shared<Data>(study::read_result(path));
    data->provenance = study::read_provenance(path);
    data->file = std::filesystem::absolute(path);
    data->sum_up();
    return Result(std::move(data));
}

void Result::write(const std::filesystem::path& path) const {
    const study::Experiment& experiment = data_->experiment;
    // Before the lock, under which those of a file are read.
    std::map<SampleKey, Samples> samples;
    if (experiment.scenario.output.angle_record) {
        for (std::size_t p = 0; p < experiment.points.size(); ++p) {
            for (std::size_t a = 0; a < experiment.points[p].arms.size(); ++a) {
                samples[{p, a}] = data_->samples_of(p, a);
            }
        }
    }
    const std::lock_guard lock(library::files());
    study::ResultWriter writer(path, experiment);
    for (const auto& [key, values] : samples) {
        if (!values) continue;
        constexpr std::size_t at_once = 64;
        const std::size_t gyros = experiment.points[key.first].gyros.size();
        const std::size_t width = values->size() / gyros;
        for (std::size_t first = 0; first < gyros; first += at_once) {
            const std::size_t count = std::min(at_once, gyros - first);
            const auto begin = values->begin() + static_cast<std::ptrdiff_t>(first * width);
            const std::vector<double> rows(begin, begin + static_cast<std::ptrdiff_t>(count * width));
            writer.write_samples({key.first, key.second, static_cast<std::int64_t>(first), count, 0, rows});
        }
    }
    writer.finish(experiment, data_->summaries, data_->provenance);
}

const std::vector<Point>& Result::points() const { return data_->points; }

const std::vector<Arm>& Result::arms(std::size_t point) const {
    if (point < data_->points.size()) return data_->points[point].arms;
    throw InputError(fmt::format("point {}: the result has {}, counted from 0", point, data_->points.size()));
}

const Arm& Result::arm(std::string_view name, std::size_t point) const {
    std::vector<std::string> names;
    for (const Arm& arm : arms(point)) {
        if (arm.name == name) return arm;
        names.push_back(arm.name);
    }
    throw InputError(
        fmt::format("arm \"{}\": is not in the result, which has {}", printable(name), fmt::join(names, ", ")));
}

const Theory& Result::theory(std::size_t point) const {
    static_cast<void>(arms(point));
    return data_->points[point].theory;
}

AngleRecord Result::angle_record(std::string_view arm_name, std::size_t point) const {
    const Arm& found = arm(arm_name, point);
    const auto index = static_cast<std::size_t>(&found - arms(point).data());
    const Samples samples = data_->samples_of(point, index);
    if (!samples) {
        throw InputError("no angle samples were kept; run the scenario with output.angle_record = true");
    }
    const study::Study& study = data_->experiment.points[point];
    return {study.gyros.size(), static_cast<std::size_t>(study.schedule.samples), study.schedule.sample_interval_s,
            samples};
}

Scenario Result::scenario() const {
    return Library::scenario_of(data_->experiment.scenario, data_->provenance.scenario_file);
}

std::int64_t Result::seed() const { return static_cast<std::int64_t>(data_->experiment.scenario.ensemble.seed); }
std::int64_t Result::turns() const { return data_->experiment.turns(); }
double Result::wall_s() const { return data_->provenance.wall_s; }

std::string Result::to_json() const {
    std::string text = study::experiment_json(data_->experiment, data_->summaries, data_->provenance);
    text.pop_back();  // the newline
    return text;
}

}  // namespace v1
}  // namespace ringlock
