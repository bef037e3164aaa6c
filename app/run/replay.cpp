#include "analysis/study/replay.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <chrono>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <system_error>

#include "analysis/study/experiment.hpp"
#include "analysis/study/result/columns.hpp"
#include "analysis/study/result/replay_file.hpp"
#include "analysis/study/result/result_file.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/run/room.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"
#include "engine/ensemble/progress/progress.hpp"
#include "engine/scenario/read_arms.hpp"
#include "engine/simd/target.hpp"
#include "engine/store/provenance.hpp"

namespace ringlock::app {
namespace {

struct ReplayArguments {
    std::string result;
    std::optional<std::string> arm, gyro, point, from, to, out;
    bool json = false;
    bool quiet = false;
};

std::string names_of(const std::vector<scenario::Arm>& arms) {
    std::string names;
    for (const scenario::Arm& arm : arms) names += (names.empty() ? "" : ", ") + arm.name;
    return names;
}

std::size_t arm_of(const ReplayArguments& arguments, const study::Experiment& experiment) {
    const auto& arms = experiment.scenario.arms;
    const std::string there = fmt::format("{} has {}", arguments.result, names_of(arms));
    if (!arguments.arm) throw InputError(fmt::format("replay: give the arm with --arm: {}", there));
    for (std::size_t i = 0; i < arms.size(); ++i) {
        if (arms[i].name == *arguments.arm) return i;
    }
    throw InputError(fmt::format("--arm {}: is not an arm of the result; {}", *arguments.arm, there));
}

/// Points are counted from 1, as tables and errors do.
std::size_t point_of(const ReplayArguments& arguments, const study::Experiment& experiment) {
    const auto points = static_cast<std::int64_t>(experiment.points.size());
    const std::string there =
        experiment.has_design()
            ? fmt::format("{} has the points 1 to {}", arguments.result, points)
            : fmt::format("{} has no design and only the point 1; leave --point out", arguments.result);
    if (!arguments.point) {
        if (points == 1) return 0;
        throw InputError(fmt::format("replay: give the point of the design with --point: {}", there));
    }
    const std::int64_t point = whole_number("--point", *arguments.point, points, "from 1 on: " + there);
    if (point == 0) throw InputError(fmt::format("--point 0: must be a whole number from 1 on: {}", there));
    return static_cast<std::size_t>(point - 1);
}

/// A replay goes from turn to turn, where readers have no outputs.
void need_angles_at_turns(const study::GyroOfResult& of) {
    const scenario::Scenario& scenario = of.study().scenario;
    if (!scenario::reads_arms(scenario)) return;
    throw InputError(
        fmt::format("{}: its arms were read by readers (reader.output_hz = {:g}), "
                    "and a replay goes from turn to turn of the dither, where these have no outputs to compare with. "
                    "Run its scenario with --set reader.output_hz=0 into another result and replay that, "
                    "which has the same gyros; `ringlock record` writes the outputs of a reader",
                    printable(of.result), scenario.reader.output_hz));
}

std::int64_t gyro_of(const ReplayArguments& arguments, const study::Experiment& experiment, std::size_t point) {
    const auto gyros = static_cast<std::int64_t>(experiment.points[point].gyros.size());
    std::string there = fmt::format("{} has the gyros 0 to {}", arguments.result, gyros - 1);
    if (experiment.has_design()) there += " at each point";
    if (const std::int64_t rates = experiment.scenario.input.sweep_points; rates > 1) {
        there += fmt::format(": {} at each of {} rates, one rate after the other", gyros / rates, rates);
    }
    if (!arguments.gyro) throw InputError(fmt::format("replay: give the gyro with --gyro: {}", there));
    return whole_number("--gyro", *arguments.gyro, gyros - 1, "from 0 on: " + there);
}

/// A time of the record; `otherwise` where none is given.
double seconds(std::string_view option, const std::optional<std::string>& text, double otherwise) {
    if (!text) return otherwise;
    double value = 0.0;
    const char* const last = text->data() + text->size();
    const auto [end, error] = std::from_chars(text->data(), last, value);
    if (error != std::errc() || end != last || !std::isfinite(value)) {
        throw InputError(
            fmt::format("{} {}: must be a number of seconds since the start of the record, "
                        "negative while the gyro settles",
                        option, *text));
    }
    return value;
}

study::GyroReplay::Range range_of(const ReplayArguments& arguments, const study::GyroReplay& replay) {
    constexpr double all = std::numeric_limits<double>::infinity();
    const double from_s = seconds("--from", arguments.from, -all);
    const double to_s = seconds("--to", arguments.to, all);
    const auto range = replay.turns_between(from_s, to_s);
    if (range.first < range.last) return range;
    throw InputError(
        fmt::format("no turn lies between --from {} and --to {}; there are turns from {:.6g} s to {:.6g} s",
                    arguments.from.value_or("(the first)"), arguments.to.value_or("(the last)"), replay.time_s(0),
                    replay.time_s(replay.schedule().turns() - 1)));
}

std::filesystem::path output_of(const ReplayArguments& arguments, const study::GyroOfResult& of) {
    if (arguments.out) return *arguments.out;
    const std::string point = of.experiment.has_design() ? fmt::format("-point-{}", of.point + 1) : "";
    return fmt::format("{}-{}{}-gyro-{}.h5", of.result.stem().string(), of.arm_name(), point, of.gyro);
}

/// The data from which the summary of a finished replay is made.
struct ReplayReport {
    const study::GyroOfResult& of;
    const study::GyroReplay& replay;
    const study::GyroReplay::Range& range;
    const study::ReplayFigures& figures;
    bool compared;
    std::filesystem::path out;
};

std::string in_words(const ReplayReport& report) {
    const study::ReplayFigures& figures = report.figures;
    std::string text = fmt::format("{}\n", report.of.text());
    const auto line = [&](std::string_view what, const std::string& value) {
        text += fmt::format("  {:<33}{}\n", fmt::format("{}:", what), value);
    };
    for (const auto& parameter : study::drawn_parameters) {
        line(parameter.name, fmt::format("{:.9g}", report.replay.setup().*parameter.field));
    }
    line("turns", fmt::format("{}, from {:.6g} s to {:.6g} s of the record", figures.turns,
                              report.replay.time_s(report.range.first), report.replay.time_s(report.range.last - 1)));
    line("lock-in from turn to turn, rms", fmt::format("{:.6g} rad", figures.lockin_step_rms_rad));
    line("the compensator leaves, rms", fmt::format("{:.6g} rad", figures.left_step_rms_rad));
    if (figures.angle_error_arcsec) {
        line("angle error at the end", fmt::format("{:.6g} arcsec", *figures.angle_error_arcsec));
    }
    if (figures.rate_error_deg_h) line("rate error", fmt::format("{:.6g} deg/h", *figures.rate_error_deg_h));
    std::string agrees = "parameters as drawn";
    if (figures.rate_error_deg_h) agrees += ", rate error";
    if (report.compared) {
        agrees += fmt::format(", {} of {} samples of the record", figures.samples, report.replay.schedule().samples);
    }
    line("identical to the stored values", agrees);
    if (!report.compared) line("angle record", "not stored (output.angle_record = false), so not compared");
    return text;
}

std::string in_json(const ReplayReport& report, const store::Provenance& provenance) {
    const study::ReplayFigures& figures = report.figures;
    const auto number = [](const std::optional<double>& value) {
        return value ? nlohmann::ordered_json(*value) : nlohmann::ordered_json(nullptr);
    };
    nlohmann::ordered_json drawn;
    for (const auto& parameter : study::drawn_parameters)
        drawn[parameter.name] = report.replay.setup().*parameter.field;
    const nlohmann::ordered_json json{
        {"replay", report.out.string()},
        {"result", report.of.result.string()},
        {"seed", report.of.experiment.scenario.ensemble.seed},
        {"arm", report.of.arm_name()},
        {"point", report.of.point + 1},
        {"gyro", report.of.gyro},
        {"drawn", drawn},
        {"turns", figures.turns},
        {"from_s", report.replay.time_s(report.range.first)},
        {"to_s", report.replay.time_s(report.range.last - 1)},
        {"lockin_step_rms_rad", figures.lockin_step_rms_rad},
        {"left_step_rms_rad", figures.left_step_rms_rad},
        {"angle_error_arcsec", number(figures.angle_error_arcsec)},
        {"rate_error_deg_h", number(figures.rate_error_deg_h)},
        {"agrees",
         {{"drawn", true},
          {"rate_error", figures.rate_error_deg_h ? nlohmann::ordered_json(true) : nlohmann::ordered_json(nullptr)},
          {"record", report.compared ? nlohmann::ordered_json(true) : nlohmann::ordered_json(nullptr)}}},
        {"samples_compared", report.compared ? figures.samples : 0},
        {"samples", report.replay.schedule().samples},
        {"wall_s", provenance.wall_s}};
    return json_text(json, 2) + "\n";
}

void run(const ReplayArguments& arguments, std::span<const char* const> command_line) {
    store::Provenance provenance = store::collect_provenance(command_line, 1, arguments.result);
    const auto start = std::chrono::steady_clock::now();
    const study::Experiment experiment = study::read_result(arguments.result);
    study::GyroOfResult of{arguments.result, experiment};
    of.arm = arm_of(arguments, experiment);
    of.point = point_of(arguments, experiment);
    need_angles_at_turns(of);
    of.gyro = gyro_of(arguments, experiment, of.point);
    study::StoredGyro stored(of);
    study::GyroReplay replay(of.study().scenario, experiment.scenario.arms[of.arm], of.gyro);
    const study::GyroReplay::Range range = range_of(arguments, replay);
    const std::filesystem::path out = output_of(arguments, of);
    refuse_same_files({{"OUT.h5", arguments.result, NamedFile::Use::input}, {"-o", out, NamedFile::Use::output}});
    const auto bytes = [&] { return study::expected_replay_bytes(range.last - range.first, replay.has_pulses()); };
    check_room(out, {0, bytes, "", "write less of it with --from and --to"}, arguments.quiet);
    study::ReplayWriter writer(out, of, replay, range);
    stored.check(replay.setup());

    ensemble::Progress progress(1, {.quiet = arguments.quiet, .total_turns = range.last});
    const ensemble::PlannedBlock block{1, range.last};
    progress.plan({&block, 1}, 1);
    progress.enter(0, ensemble::BlockStage::turns);
    const study::ReplayFigures figures = replay.run(
        range, writer, [&](std::int64_t sample, double angle_arcsec) { stored.check_sample(sample, angle_arcsec); },
        {interrupted, &progress});
    stored.check(figures);
    progress.advance(0, 1, 0, false);
    progress.enter(0, ensemble::BlockStage::over);
    progress.finish();
    check_interrupt();

    provenance.wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    provenance.turns_per_s = static_cast<double>(range.last) / provenance.wall_s;
    provenance.instruction_set = simd::active_target();
    writer.finish(figures, stored.has_record(), provenance);
    const ReplayReport report{of, replay, range, figures, stored.has_record(), out};
    if (arguments.json) {
        put(in_json(report, provenance));
    } else if (!arguments.quiet) {
        put(in_words(report));
    }
    if (!arguments.quiet) tell(fmt::format("replay: {}\n", printable(writer.path())));
}

}  // namespace

void add_replay(CLI::App& root, std::span<const char* const> command_line) {
    CLI::App* command = root.add_subcommand(
        "replay", "Repeat the simulation of one gyro of a result, and write every turn of its dither in full detail");
    auto arguments = std::make_shared<ReplayArguments>();
    command->add_option("OUT.h5", arguments->result, "result of ringlock run; it holds its scenario")->required();
    command->add_option("--arm", arguments->arm, "arm, as the result names it")->type_name("ARM");
    command->add_option("--gyro", arguments->gyro, "gyro, from 0: a row of the result's datasets, of the point")
        ->type_name("N");
    command->add_option("--point", arguments->point, "point of a design, from 1 as in tables")->type_name("P");
    command->add_option("-o,--output", arguments->out,
                        "file to write (default: OUT-ARM-gyro-N.h5, in a design OUT-ARM-point-P-gyro-N.h5, here)");
    command
        ->add_option("--from", arguments->from,
                     "write turns from this time of the record on; negative while the gyro settles (default: all)")
        ->type_name("S");
    command->add_option("--to", arguments->to, "write turns up to this time, and end there")->type_name("S");
    command->add_flag("--json", arguments->json, "print one JSON object instead of text");
    command->add_flag("-q,--quiet", arguments->quiet, "no text and no progress");
    command->callback(
        [arguments, command_line] { name_file_of_failure(arguments->result, [&] { run(*arguments, command_line); }); });
}

}  // namespace ringlock::app
