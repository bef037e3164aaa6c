#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "analysis/record/record.hpp"
#include "app/command.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/record_output.hpp"

namespace ringlock::app {

void add_import(CLI::App& root) {
    struct Arguments {
        std::string data;
        std::string out;
    };
    CLI::App* command = root.add_subcommand("import", "Turn measured data in the text form into an rlg-record in HDF5");
    auto arguments = std::make_shared<Arguments>();
    command->add_option("DATA.csv", arguments->data, "samples as text: lines \"# key = value\", header, rows")
        ->required();
    command->add_option("-o,--output", arguments->out, "record to write (.h5)")->required();
    command->callback([arguments] {
        refuse_same_files(
            {{"DATA", arguments->data, NamedFile::Use::input}, {"-o", arguments->out, NamedFile::Use::output}});
        record::RecordWriter writer(arguments->out);
        const record::Record record = record::read_record(arguments->data);
        tell_warnings(arguments->data, record);
        writer.write(record);
        put(fmt::format("{}: {}\n", arguments->out, record_text(record)));
    });
}

}  // namespace ringlock::app
