#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "analysis/export/csv.hpp"
#include "analysis/export/json.hpp"
#include "analysis/export/matlab.hpp"
#include "analysis/export/numpy.hpp"
#include "analysis/export/tables.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/waiting.hpp"
#include "engine/store/part_file.hpp"

namespace ringlock::app {
namespace {

struct ExportArguments {
    std::string file, out, table;
    std::vector<std::string> only;
    bool csv = false, json = false, matlab = false, npz = false, tables = false;
};

struct ExportFormat {
    const char* option;
    const char* ending;
    bool is_text;
};

ExportFormat format_of(const ExportArguments& a) {
    std::vector<ExportFormat> chosen;
    if (a.csv) chosen.push_back({"--csv", ".csv", true});
    if (a.json) chosen.push_back({"--json", ".json", true});
    if (a.matlab) chosen.push_back({"--matlab", ".mat", false});
    if (a.npz) chosen.push_back({"--npz", ".npz", false});
    if (chosen.size() != 1) {
        throw InputError(
            fmt::format("{} of --csv, --json, --matlab and --npz {} given; give one of them, or --tables for a list of "
                        "the tables that --csv makes",
                        chosen.empty() ? "none" : "several", chosen.empty() ? "is" : "are"));
    }
    return chosen.front();
}

void check_export(const ExportArguments& a) {
    if (a.tables) {
        if (a.csv || a.json || a.matlab || a.npz || !a.out.empty()) {
            throw InputError("--tables prints a list and writes nothing; leave out -o and the format");
        }
        return;
    }
    const ExportFormat format = format_of(a);
    if (!a.table.empty() && !a.csv) {
        throw InputError(fmt::format("--table chooses a table of --csv; {} has all of the file, or what --only names",
                                     format.option));
    }
    if (a.out.empty() && !format.is_text) {
        throw InputError(
            fmt::format("{} makes a binary file, which does not go to standard output; name it with -o "
                        "FILE{}",
                        format.option, format.ending));
    }
    const std::filesystem::path ending = std::filesystem::path(a.out).extension();
    if (!a.out.empty() && ending != format.ending) {
        // A file that is there is replaced; the ending keeps a slip of the hand from costing another one.
        throw InputError(fmt::format("-o {}: must end in {} for {}", printable(a.out), format.ending, format.option));
    }
    refuse_same_files({{"the file", a.file, NamedFile::Use::input}, {"-o", a.out, NamedFile::Use::output}});
}

const exports::Table& chosen_table(const std::vector<exports::Table>& tables, const std::string& name) {
    if (name.empty()) return tables.front();
    const auto found = std::find_if(tables.begin(), tables.end(), [&](const auto& t) { return t.name == name; });
    if (found != tables.end()) return *found;
    std::string known;
    for (const exports::Table& table : tables) known += (known.empty() ? "" : ", ") + printable(table.name);
    throw InputError(fmt::format("--table {}: the file has no such table; it has {}", printable(name), known));
}

/// Names of tables can be long; their content then begins on a line of its own.
std::string table_list(const std::vector<exports::Table>& tables) {
    constexpr std::size_t name_columns = 28;
    constexpr std::size_t content_columns = 50;
    std::string text = fmt::format("{:<{}}{:>10}{:>9}  {}\n", "table", name_columns, "rows", "columns", "content");
    for (const exports::Table& table : tables) {
        const std::string name = printable(table.name);
        const bool fits = name.size() < name_columns;
        if (!fits) text += name + "\n";
        text += fmt::format("{:<{}}{:>10}{:>9}  ", fits ? name : "", name_columns, table.lines(), table.header.size());
        std::string content = printable(table.content);
        for (bool begins = true; begins || !content.empty(); begins = false) {
            std::size_t end = content.size();
            if (end > content_columns) end = content.rfind(' ', content_columns);
            if (end == std::string::npos || end == 0) end = std::min(content_columns, content.size());
            text += (begins ? "" : std::string(name_columns + 21, ' ')) + content.substr(0, end) + "\n";
            content.erase(0, std::min(content.size(), end + 1));
        }
    }
    return text;
}

/// Text to the file, or to standard output where none is named.
class TextTarget {
   public:
    explicit TextTarget(const std::string& path) {
        if (!path.empty()) file_ = std::make_unique<AtomicPath>(path);
    }
    void write(std::string_view text) {
        if (!file_) return put(text);
        if (const int error = write_all(file_->descriptor(), text); error != 0) {
            throw RunError(fmt::format("{}: cannot be written: {}", printable(file_->target()),
                                       std::generic_category().message(error)));
        }
    }
    void commit() {
        if (file_) file_->commit();
    }

   private:
    std::unique_ptr<AtomicPath> file_;
};

void export_objects(const ExportArguments& a, const store::File& file,
                    const std::vector<store::ListedObject>& objects) {
    if (a.csv || a.tables) {
        const std::vector<exports::Table> tables = exports::tables_of(file, objects);
        if (tables.empty()) throw InputError(fmt::format("{}: has no dataset", printable(a.file)));
        if (a.tables) return put(table_list(tables));
        const exports::Table& table = chosen_table(tables, a.table);
        TextTarget target(a.out);
        exports::write_csv(file, table, [&](std::string_view text) { target.write(text); });
        return target.commit();
    }
    if (a.json) {
        TextTarget target(a.out);
        exports::write_json(file, objects, [&](std::string_view text) { target.write(text); });
        return target.commit();
    }
    if (a.matlab) exports::check_matlab_size(objects);
    AtomicPath target(a.out);
    if (a.matlab) exports::write_matlab(file, objects, target.partial(), a.out);
    if (a.npz) exports::write_npz(file, objects, target.descriptor(), a.out);
    target.commit();
}

void run_export(const ExportArguments& a) {
    check_export(a);
    if (store::is_part(a.file)) {
        throw InputError(
            fmt::format("{}: is a shard or a checkpoint of a run and not a result; ringlock merge makes a result of "
                        "shards, ringlock run --resume of checkpoints",
                        printable(a.file)));
    }
    store::guarded(a.file, [&](const store::GuardedPath& path) {
        const store::File file = store::File::open(path);
        const std::vector<store::ListedObject> objects = exports::part_of(store::contents_of(file), a.only);
        // Nothing is written before the trial has read the whole file.
        if (store::is_trial()) {
            exports::read_through(file, objects);
        } else {
            export_objects(a, file, objects);
        }
        return 0;
    });
}

}  // namespace

void add_export(CLI::App& root) {
    CLI::App* command = root.add_subcommand(
        "export", "Write a result, record, replay or closure.h5 as CSV, JSON, MAT-file or arrays of NumPy");
    const auto arguments = std::make_shared<ExportArguments>();
    command->add_option("FILE.h5", arguments->file, "any HDF5 file that ringlock writes")->required();
    command->add_flag("--csv", arguments->csv, "one table, for spreadsheets: that of --table");
    command->add_flag("--json", arguments->json, "all values with units and descriptions, as one JSON object");
    command->add_flag("--matlab", arguments->matlab, "a MAT-file (version 5) with a struct for each group; needs -o");
    command->add_flag("--npz", arguments->npz, "arrays of NumPy under the paths of the datasets; needs -o");
    command->add_option("-o,--output", arguments->out,
                        "file to write, with the ending .csv, .json, .mat or .npz (default: standard output)");
    command->add_option(
        "--table", arguments->table,
        "table of --csv. Results have gyros (default), arms, allan, allan-gyros, angle, pairs and, in a "
        "design, points; records turns or samples, environment, reference; replays turns; closure.h5 "
        "parameters, residual, scores, predictive/NAME; all of them attributes. --tables lists those "
        "of a file");
    command->add_flag("--tables", arguments->tables, "list the tables of the file, with rows and columns, and end");
    command
        ->add_option("--only", arguments->only,
                     "this group or dataset alone, as in --only arms/ideal/noise; may be given several times")
        ->type_name("PATH")
        ->take_all()
        ->allow_extra_args(false);
    command->callback([arguments] { name_file_of_failure(arguments->file, [&] { run_export(*arguments); }); });
}

}  // namespace ringlock::app
