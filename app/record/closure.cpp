#include "analysis/closure/closure.hpp"

#include <fmt/format.h>
#include <malloc.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstddef>
#include <exception>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "analysis/closure/chain.hpp"
#include "analysis/closure/report/chain_report.hpp"
#include "analysis/closure/report/closed_scenario.hpp"
#include "analysis/closure/report/folder.hpp"
#include "analysis/closure/report/report.hpp"
#include "analysis/instrument/declare.hpp"
#include "analysis/record/record.hpp"
#include "analysis/report/chain_page.hpp"
#include "analysis/report/closure_page.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/record/record_output.hpp"
#include "app/run/stage_progress.hpp"
#include "engine/core/error.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::app {

namespace {

struct ClosureArguments {
    std::vector<std::string> records;
    bool same_chain = false;
    std::string model;
    std::string out;
    bool follow_links = false;
    bool json = false;
    bool quiet = false;
};

/// The folder of each record: that of -o or, of a data chain, one in it.
std::vector<std::filesystem::path> folders_of(const ClosureArguments& arguments) {
    if (arguments.out.empty()) return {};
    if (!arguments.same_chain) return {arguments.out};
    std::vector<std::filesystem::path> folders;
    for (const std::string& name : closure::record_folders(arguments.records)) {
        folders.push_back(std::filesystem::path(arguments.out) / name);
    }
    return folders;
}

/// Refuses a number of records that the options do not allow, and one record that is named twice: its noise would count
/// as that of two.
void refuse_other_records(const ClosureArguments& arguments) {
    if (!arguments.same_chain && arguments.records.size() > 1) {
        throw InputError(
            fmt::format("closure takes one RECORD, but there are {}: {}. Name one, or give --same-chain "
                        "to read records of one box together, whose data chain resamples them from one source",
                        arguments.records.size(), fmt::join(arguments.records, ", ")));
    }
    if (arguments.same_chain && arguments.records.size() < 2) {
        throw InputError(
            fmt::format("--same-chain takes two or more records of one box, but there is one: {}. "
                        "Name the others too, or leave --same-chain out",
                        arguments.records.front()));
    }
    for (auto one = arguments.records.begin(); one != arguments.records.end(); ++one) {
        for (auto other = arguments.records.begin(); other != one; ++other) {
            std::error_code none;
            if (*one != *other && !std::filesystem::equivalent(*one, *other, none)) continue;
            throw InputError(
                fmt::format("RECORD {} and RECORD {} are the same file, whose noise would count twice; "
                            "nothing was done. Name each record once",
                            *other, *one));
        }
    }
}

/// Refuses, before the work, output folders in which another file would be lost.
void refuse_to_lose(const ClosureArguments& arguments) {
    if (arguments.out.empty()) return;
    std::vector<NamedFile> files{{"--model", arguments.model, NamedFile::Use::input}};
    for (const std::string& record : arguments.records) files.push_back({"RECORD", record, NamedFile::Use::input});
    const auto write = [&](const std::vector<std::filesystem::path>& outputs) {
        for (const std::filesystem::path& file : outputs) files.push_back({"-o", file, NamedFile::Use::output});
    };
    if (arguments.same_chain) write(closure::chain_files_of(arguments.out));
    for (const std::filesystem::path& folder : folders_of(arguments)) write(closure::files_of(folder));
    refuse_same_files(files);
    if (arguments.same_chain) closure::check_chain_folder(arguments.out);
    for (const std::filesystem::path& folder : folders_of(arguments)) closure::check_folder(folder);
}

record::Record record_of(const std::string& path, const ClosureArguments& arguments) {
    record::Record record =
        record::read_record(path, arguments.follow_links ? store::Links::follow : store::Links::refuse);
    tell_warnings(path, record);
    if (!arguments.model.empty()) instrument::declare(record.declared, scenario::parse_file(arguments.model));
    return record;
}

/// The printed result, and the reason if a file could not be written: the result is printed in that case too.
struct Printed {
    nlohmann::json json;
    std::string text;
    std::exception_ptr not_written;
};

/// Before there are threads: the C library gives each of them a heap of its own, unless it is configured otherwise, and
/// leaves a quarter of the memory to gaps in these. Threads that share one wait for each other now and then: where
/// records are short and threads many, they keep theirs.
void share_heap_where_long(const record::Record& record) {
#ifdef M_ARENA_MAX
    constexpr std::size_t long_record = 50000;
    if (record.turns && record.turns->size() > long_record) mallopt(M_ARENA_MAX, 1);
#else
    static_cast<void>(record);
#endif
}

/// Does something that writes, and keeps why it could not.
template <class Write>
void attempt(std::exception_ptr& not_written, Write&& write) {
    try {
        write();
    } catch (const Interrupted&) {
        throw;
    } catch (...) {
        if (!not_written) not_written = std::current_exception();
    }
}

/// The report of one record, which is written where a folder is given.
Printed report_of(const std::string& path, const record::Record& record, const closure::Closure& closure,
                  const std::filesystem::path& folder, const closure::Monitor& monitor) {
    Printed printed{closure::to_json(closure), closure::to_text(closure), {}};
    printed.json["closed"] = closure::to_json(closure::closed_scenario(record, closure));
    if (folder.empty()) return printed;
    const std::string name = printable(std::filesystem::path(path).filename());
    monitor.tell("simulating the closed model");
    const closure::Predictive predictive =
        closure::check_predictive(record, closure, closure::options.report.most_simulations, monitor);
    printed.json["predictive"] = closure::to_json(predictive);
    printed.text += "\n" + closure::to_text(predictive);
    attempt(printed.not_written, [&] {
        closure::write_closure(folder, name, record, closure, predictive);
        report::write_closure_page(folder, name, record, closure, predictive);
    });
    return printed;
}

Printed close_one(const ClosureArguments& arguments, const closure::Monitor& monitor) {
    const std::string& path = arguments.records.front();
    const record::Record record = record_of(path, arguments);
    share_heap_where_long(record);
    closure::Closure closure;
    try {
        closure = closure::close_loop(record, monitor);
    } catch (const InputError& error) {
        throw InputError(fmt::format("{}: {}", printable(path), error.what()));
    }
    return report_of(path, record, closure, arguments.out, monitor);
}

Printed close_several(const ClosureArguments& arguments, const closure::Monitor& monitor) {
    std::vector<record::Record> records;
    for (const std::string& path : arguments.records) records.push_back(record_of(path, arguments));
    std::vector<closure::NamedRecord> named;
    for (std::size_t r = 0; r < records.size(); ++r) named.push_back({printable(arguments.records[r]), &records[r]});
    const closure::Chain chain = closure::close_chain(named, monitor);
    Printed all{
        {{"chain", closure::to_json(chain)}, {"records", nlohmann::json::array()}}, closure::to_text(chain), {}};
    const std::vector<std::filesystem::path> folders = folders_of(arguments);
    for (std::size_t r = 0; r < records.size(); ++r) {
        const std::string& path = arguments.records[r];
        const closure::Monitor of_record{
            [&](const std::string& stage) { monitor.tell(printable(path) + ": " + stage); },
            [&](double share) { monitor.tell_share(share); }};
        Printed one = report_of(path, records[r], chain.records[r].closure,
                                folders.empty() ? std::filesystem::path() : folders[r], of_record);
        all.json["records"].push_back(std::move(one.json));
        all.text += fmt::format("\n{}\n{}\n{}", printable(path), std::string(path.size(), '='), one.text);
        if (!all.not_written) all.not_written = one.not_written;
    }
    if (!folders.empty() && !all.not_written) {
        attempt(all.not_written, [&] {
            report::write_chain_page(arguments.out, chain, closure::record_folders(arguments.records), all.json);
        });
    }
    return all;
}

void close_records(const ClosureArguments& arguments) {
    refuse_other_records(arguments);
    refuse_to_lose(arguments);
    StageProgress progress(arguments.quiet);
    const closure::Monitor monitor{[&](const std::string& stage) { progress.show(stage); },
                                   [&](double share) { progress.show_share(share); }};
    const Printed printed = arguments.same_chain ? close_several(arguments, monitor) : close_one(arguments, monitor);
    put(arguments.json ? json_text(printed.json) + "\n" : printed.text);
    if (printed.not_written) std::rethrow_exception(printed.not_written);
}

}  // namespace

void add_closure(CLI::App& root) {
    CLI::App* command = root.add_subcommand("closure", "Identify the error sources in a measured record");
    auto arguments = std::make_shared<ClosureArguments>();
    command
        ->add_option("RECORD", arguments->records,
                     "rlg-record (.h5), or samples as text; with --same-chain two or more")
        ->required();
    command->add_flag("--same-chain", arguments->same_chain,
                      "the records are of one box, whose data chain resamples all of them from one source: "
                      "the rate of the source is fitted once");
    command->add_option("--model", arguments->model,
                        "scenario (.toml) that supplies scale factor, threshold and dither "
                        "where the record does not declare them");
    command->add_option("-o,--output", arguments->out,
                        "folder for report.md with its figures, closed.toml, closure.h5 and closure.json; "
                        "with --same-chain each record has a folder in it");
    add_follow_links(*command, arguments->follow_links);
    command->add_flag("--json", arguments->json, "one JSON object on standard output");
    command->add_flag("-q,--quiet", arguments->quiet, "no progress on standard error");
    command->callback([arguments] {
        name_file_of_failure(fmt::format("{}", fmt::join(arguments->records, ", ")),
                             [&] { close_records(*arguments); });
    });
}

}  // namespace ringlock::app
