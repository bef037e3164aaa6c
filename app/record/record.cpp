#include "analysis/record/record.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "analysis/instrument/simulate.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/record/record_output.hpp"
#include "app/run/room.hpp"
#include "engine/core/json_text.hpp"

namespace ringlock::app {
namespace {

struct RecordArguments {
    std::string scenario;
    std::string out;
    std::string gyro = "0";
    Changes changes;
    bool json = false;
};

void run(const RecordArguments& arguments) {
    const scenario::Scenario scenario = load_scenario(arguments.scenario, arguments.changes);
    constexpr std::int64_t largest = std::numeric_limits<std::int64_t>::max();
    const std::int64_t gyro = whole_number("--gyro", arguments.gyro, largest, "from 0 on");
    refuse_same_files(
        {{"SCENARIO", arguments.scenario, NamedFile::Use::input}, {"-o", arguments.out, NamedFile::Use::output}});
    const instrument::Room room = instrument::expected_room(scenario, gyro);
    const std::string shorter = "record a shorter time (ensemble.duration_s)";
    check_room(arguments.out, {room.memory_bytes, [&] { return room.disk_bytes; }, shorter, shorter}, false);
    record::RecordWriter writer(arguments.out);
    const record::Record record = instrument::simulate_record(scenario, gyro);
    writer.write(record);
    if (!arguments.json) {
        put(fmt::format("{}: gyro {}, seed {}: {}\n", arguments.out, gyro, scenario.ensemble.seed,
                        record_text(record)));
        return;
    }
    nlohmann::ordered_json json{{"record", arguments.out},
                                {"scenario", arguments.scenario},
                                {"seed", scenario.ensemble.seed},
                                {"gyro", gyro},
                                {"kind", record.turns ? "turns" : "samples"},
                                {"rows", record.turns ? record.turns->size() : record.samples->size()}};
    if (record.turns) {
        json["duration_s"] = record.turns->time_s.back() - record.turns->time_s.front();
    } else {
        json["rate_hz"] = record.samples->rate_hz;
        json["duration_s"] = static_cast<double>(record.samples->size()) / record.samples->rate_hz;
    }
    put(json_text(json, 2) + "\n");
}

}  // namespace

void add_record(CLI::App& root) {
    CLI::App* command = root.add_subcommand("record", "Simulate the record of an instrumented gyro of a scenario");
    auto arguments = std::make_shared<RecordArguments>();
    command
        ->add_option("SCENARIO.toml", arguments->scenario,
                     "scenario to simulate; "
                     "its section [record] selects the data")
        ->required();
    command->add_option("-o,--output", arguments->out, "record to write (.h5)")->required();
    command->add_option("--gyro", arguments->gyro, "number of the gyro in the ensemble, from 0")
        ->capture_default_str()
        ->type_name("N");
    add_settings(*command, arguments->changes);
    command->add_option("--seed", arguments->changes.seed, "replaces ensemble.seed")->type_name("S");
    command->add_flag("--json", arguments->json, "print one JSON object instead of a line");
    command->callback([arguments] { name_file_of_failure(arguments->scenario, [&] { run(*arguments); }); });
}

}  // namespace ringlock::app
