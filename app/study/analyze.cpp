#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/allan/estimator.hpp"
#include "analysis/allan_run/deviations.hpp"
#include "analysis/report/plot.hpp"
#include "analysis/study/experiment_json.hpp"
#include "analysis/study/family.hpp"
#include "analysis/study/result/result_file.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/study/study_output.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::app {
namespace {

struct AnalyzeArguments {
    std::string file;
    std::string plot;
    std::string dev;
    std::optional<std::string> tau;
    bool json = false;
};

/// A result without records must be simulated again; the error says how.
void need_angle_records(const std::string& file, const study::Study& study, const std::vector<AveragingTime>& asked) {
    if (study.scenario.output.angle_record) return;
    const double interval_s = study.schedule.sample_interval_s;
    std::string times;
    for (const AveragingTime& time : asked) {
        times += fmt::format("{}{:.10g}", times.empty() ? "" : ", ",
                             time.time_s.value_or(interval_s * static_cast<double>(time.samples)));
    }
    throw InputError(
        fmt::format("{}: --tau needs the angle records, which were not stored (output.angle_record = false). "
                    "Run the scenario anew with output.tau_s = [{}], which is computed while the study runs, "
                    "or with output.angle_record = true",
                    printable(file), times));
}

/// Fills in the nearest whole number of samples. The interval between samples and half of the duration are found by
/// their values in the scenario, too, although they were rounded to whole outputs and whole samples.
void find_among_samples(const study::Study& study, AveragingTime& time) {
    const scenario::Scenario& scenario = study.scenario;
    const std::int64_t largest = allan::largest_factor(allan::Estimator::oadev, study.schedule.samples);
    const double interval_s = study.schedule.sample_interval_s;
    const auto range = [&] {
        return fmt::format(
            "the stored samples have averaging times from {:.6g} s (one sample) to {:.6g} s ({} samples)", interval_s,
            interval_s * static_cast<double>(largest), largest);
    };
    if (!time.time_s) {
        if (time.samples <= largest) return;
        throw InputError(
            fmt::format("--tau {}: more samples than half of the record, "
                        "and an Allan deviation needs two of the averaging time; {}. A time in seconds has the unit s",
                        time.text, range()));
    }
    if (*time.time_s < std::min(interval_s, scenario.output.sample_interval_s)) {
        throw InputError(fmt::format(
            "--tau {}: shorter than a stored sample; {}. For such times run the scenario with output.tau_s, "
            "which takes times from {} ({:.4g} s) on",
            time.text, range(), scenario::reads_arms(scenario) ? "an output of the reader" : "a cycle of the dither",
            study.schedule.output_s));
    }
    constexpr double rounding = 1.0 + 1e-9;  // of a duration that is no binary fraction
    if (*time.time_s > 0.5 * scenario.ensemble.duration_s * rounding) {
        throw InputError(
            fmt::format("--tau {}: longer than half of the record, and an Allan deviation needs two "
                        "of the averaging time; {}. A longer time needs a longer ensemble.duration_s",
                        time.text, range()));
    }
    time.samples = std::min(std::max<std::int64_t>(1, std::llround(*time.time_s / interval_s)), largest);
}

/// The averaging times of --tau among the samples of the result: ascending, each once.
std::vector<AveragingTime> averaging_times(const std::string& file, const study::Study& study,
                                           std::vector<AveragingTime> asked) {
    if (asked.empty()) return asked;
    need_angle_records(file, study, asked);
    for (AveragingTime& time : asked) find_among_samples(study, time);
    const auto key = [](const AveragingTime& time) { return std::pair(time.samples, time.time_s); };
    std::sort(asked.begin(), asked.end(), [&](const auto& a, const auto& b) { return key(a) < key(b); });
    asked.erase(std::unique(asked.begin(), asked.end(), [&](const auto& a, const auto& b) { return key(a) == key(b); }),
                asked.end());
    return asked;
}

void add_asked(const std::string& file, const study::Experiment& experiment, std::size_t point,
               const std::vector<AveragingTime>& asked, study::Summary& summary) {
    if (asked.empty()) return;
    std::vector<std::int64_t> factors;
    for (const AveragingTime& time : asked) {
        if (factors.empty() || factors.back() != time.samples) factors.push_back(time.samples);
    }
    const auto family = study::family_deviations(file, experiment, point, std::array{allan::Estimator::oadev}, factors);
    for (std::size_t i = 0; i < family.size(); ++i) summary.arms[i].asked = family[i].front().points;
}

/// The requested figures of a result.
struct Analysis {
    std::vector<study::Summary> summaries;
    std::vector<AveragingTime> asked;
};

Analysis evaluate(const AnalyzeArguments& arguments, const study::Experiment& experiment) {
    const auto estimators = arguments.dev.empty() ? std::vector<allan::Estimator>{} : parse_deviations(arguments.dev);
    Analysis out;
    if (arguments.tau) out.asked = parse_averaging_times("--tau", *arguments.tau);
    // Points with angle records have one schedule.
    out.asked = averaging_times(arguments.file, experiment.points.front(), std::move(out.asked));
    name_file_of_values(arguments.file, [&] { out.summaries = study::summarise(experiment); });
    for (std::size_t point = 0; point < out.summaries.size(); ++point) {
        if (!estimators.empty()) {
            auto family = study::family_deviations(arguments.file, experiment, point, estimators);
            for (std::size_t i = 0; i < family.size(); ++i) {
                out.summaries[point].arms[i].family = std::move(family[i]);
            }
        }
        add_asked(arguments.file, experiment, point, out.asked, out.summaries[point]);
    }
    return out;
}

std::string text_of(const study::Experiment& experiment, const Analysis& analysis,
                    const store::Provenance& provenance) {
    std::string text = experiment_text(experiment, analysis.summaries, provenance);
    for (std::size_t point = 0; point < analysis.summaries.size(); ++point) {
        const study::Summary& summary = analysis.summaries[point];
        std::string more;
        // The text of a study has its deviations already.
        if (experiment.has_design()) more += family_text(summary);
        if (!analysis.asked.empty()) more += asked_text(experiment.points[point], summary, analysis.asked);
        if (experiment.has_design() && !more.empty()) text += fmt::format("\nPoint {}:", point + 1);
        text += more;
    }
    return text;
}

void analyze(const AnalyzeArguments& arguments) {
    refuse_same_files(
        {{"OUT.h5", arguments.file, NamedFile::Use::input}, {"--plot", arguments.plot, NamedFile::Use::output}});
    const std::unique_ptr<AtomicPath> figure = claim_figure(arguments.plot);
    std::string text;
    name_file_of_failure(arguments.file, [&] {
        const study::Experiment experiment = study::read_result(arguments.file);
        const store::Provenance provenance = study::read_provenance(arguments.file);
        const Analysis analysis = evaluate(arguments, experiment);
        if (figure) report::write_figure(*figure, experiment_figure(experiment, analysis.summaries));
        text = arguments.json ? study::experiment_json(experiment, analysis.summaries, provenance)
                              : text_of(experiment, analysis, provenance);
    });
    put(text);
}

}  // namespace

void add_analyze(CLI::App& root) {
    CLI::App* command =
        root.add_subcommand("analyze", "Compare the arms of a result: Allan deviation, noise, rate error");
    auto arguments = std::make_shared<AnalyzeArguments>();
    command->add_option("OUT.h5", arguments->file, "result of ringlock run")->required();
    command->add_option(
        "--dev", arguments->dev,
        "also these deviations of the angle records, separated by commas: " + allan_run::known_deviations());
    command->add_option("--tau", arguments->tau,
                        "also the Allan deviation of the angle records at these averaging times, separated "
                        "by commas: times with a unit (100s, 2min, 1h) or averaging factors M of stored samples");
    command->add_option("--plot", arguments->plot, "also draw the figure into this SVG file");
    command->add_flag("--json", arguments->json, "print one JSON object instead of a table");
    command->callback([arguments] { analyze(*arguments); });
}

}  // namespace ringlock::app
