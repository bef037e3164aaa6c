#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <charconv>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "analysis/quantity/scale.hpp"
#include "analysis/quantity/unit.hpp"
#include "analysis/record/mapped_columns.hpp"
#include "analysis/record/record.hpp"
#include "analysis/text/words.hpp"
#include "app/arguments.hpp"
#include "app/command.hpp"
#include "app/failure.hpp"
#include "app/files.hpp"
#include "app/output.hpp"
#include "app/record/record_output.hpp"
#include "app/text_arguments.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {

namespace {

struct ImportArguments {
    std::string data;
    std::string out;
    std::vector<std::string> columns;
    std::string unit;
    std::string scale;
    double rate_hz = 0.0;
    std::string time;
    TextArguments text;
    std::vector<std::string> declared;
    bool follow_links = false;
};

/// "NAME=QUANTITY" in its two parts; the name itself may hold equals signs.
record::MappedColumn parse_column(const std::string& text) {
    const std::size_t equals = text.rfind('=');
    if (equals == std::string::npos || equals == 0) {
        throw InputError(
            fmt::format("--column {}: must be NAME=QUANTITY, such as gyro_x=rate or 2=angle_increment_arcsec", text));
    }
    return {text.substr(0, equals), text.substr(equals + 1)};
}

quantity::Unit gyro_unit(const ImportArguments& arguments, bool of_rate) {
    if (arguments.unit == "counts") return quantity::unit_of_counts(arguments.scale, of_rate);
    const quantity::Unit unit = quantity::unit_for(arguments.unit, of_rate, "--unit");
    if (unit.instrument != quantity::Instrument::gyro) {
        throw InputError(fmt::format("--unit {}: samples of a record are those of a gyro, in a unit such as {}",
                                     arguments.unit, of_rate ? "deg/h or rad/s" : "arcsec or deg"));
    }
    return arguments.scale.empty() ? unit : quantity::scaled(unit, arguments.scale);
}

record::MappedLog parse_log(const ImportArguments& arguments) {
    record::MappedLog log;
    log.path = arguments.data;
    log.follow_links = arguments.follow_links;
    for (const std::string& column : arguments.columns) log.columns.push_back(parse_column(column));
    if (!(arguments.rate_hz > 0.0) || !std::isfinite(arguments.rate_hz)) {
        throw InputError(fmt::format("--rate {}: with --column, give the number of samples a second, above zero",
                                     arguments.rate_hz));
    }
    log.rate_hz = arguments.rate_hz;
    if (!arguments.time.empty()) log.time = arguments.time;
    log.time_unit = time_unit_of(arguments.text, log.time.has_value());
    log.text = text_options(arguments.text);
    bool needs_unit = false;
    bool of_rate = false;
    for (const record::MappedColumn& mapped : log.columns) {
        needs_unit |= record::has_unit(mapped.quantity);
        of_rate |= record::is_rate(mapped.quantity);
    }
    if (!needs_unit) {
        if (arguments.unit.empty()) return log;
        throw InputError(fmt::format("--unit {}: no column of --column has a unit", arguments.unit));
    }
    if (arguments.unit.empty()) {
        throw InputError(fmt::format("--unit is missing: give the unit of the {}, such as {}",
                                     of_rate ? "rates" : "angles",
                                     of_rate ? "deg/h, deg/s or rad/s" : "arcsec, deg or rad"));
    }
    log.to_arcsec = gyro_unit(arguments, of_rate).factor;
    return log;
}

void take_declared(const std::vector<std::string>& declared, record::Record& record) {
    for (const std::string& text : declared) {
        const std::size_t equals = text.find('=');
        double value = 0.0;
        const char* const end = text.data() + text.size();
        const auto parsed = std::from_chars(text.data() + std::min(equals, text.size() - 1) + 1, end, value);
        if (equals == std::string::npos || parsed.ec != std::errc() || parsed.ptr != end || !std::isfinite(value)) {
            throw InputError(fmt::format("--declare {}: must be KEY=NUMBER, such as dither_frequency_hz=400", text));
        }
        record::declare(record, text.substr(0, equals), value);
    }
}

record::Record read(const ImportArguments& arguments) {
    if (!arguments.columns.empty()) return read_mapped(parse_log(arguments));
    for (const auto& [option, given] : {std::pair{"--unit", !arguments.unit.empty()},
                                        {"--scale", !arguments.scale.empty()},
                                        {"--rate", arguments.rate_hz != 0.0},
                                        {"--time", !arguments.time.empty()},
                                        {"--time-unit", !arguments.text.time_unit.empty()},
                                        {"--header", !arguments.text.header.empty()},
                                        {"--skip", !arguments.text.skip.empty()},
                                        {"--delimiter", !arguments.text.delimiter.empty()}}) {
        if (!given) continue;
        throw InputError(fmt::format(
            "{}: needs --column NAME=QUANTITY; without --column the file itself must declare its columns", option));
    }
    return record::read_record(arguments.data, arguments.follow_links ? store::Links::follow : store::Links::refuse);
}

void import_data(const ImportArguments& arguments) {
    refuse_same_files({{"DATA", arguments.data, NamedFile::Use::input}, {"-o", arguments.out, NamedFile::Use::output}});
    record::RecordWriter writer(arguments.out);
    record::Record record = read(arguments);
    take_declared(arguments.declared, record);
    refuse_errors(arguments.data, record);
    tell_warnings(arguments.data, record);
    writer.write(record);
    put(fmt::format("{}: {}\n", printable(arguments.out), record_text(record)));
}

}  // namespace

void add_import(CLI::App& root) {
    CLI::App* command = root.add_subcommand("import", "Turn measured data into an rlg-record in HDF5");
    auto arguments = std::make_shared<ImportArguments>();
    command
        ->add_option("DATA", arguments->data,
                     "samples as text with lines \"# key = value\", a header and rows; "
                     "with --column a log of any layout, as ringlock allan reads them. Example: ringlock "
                     "import log.csv -o log.h5 --column gx=rate --unit deg/s --rate 200 --time t --time-unit ms")
        ->required();
    command->add_option("-o,--output", arguments->out, "record to write (.h5)")->required();
    command
        ->add_option("--column", arguments->columns,
                     "NAME=QUANTITY: a column, by name, number or dataset, and its quantity in the record: "
                     "rate, angle_increment_arcsec, angle_arcsec, quarter_count, accel_x, accel_y, accel_z, "
                     "temperature_c; may be given several times")
        ->take_all()
        ->allow_extra_args(false);
    command->add_option("--unit", arguments->unit,
                        "unit of the gyro's column: arcsec, deg, rad of an angle; deg/h, deg/s, rad/s of a rate; "
                        "counts, with --scale");
    command->add_option("--scale", arguments->scale,
                        "size of one number of the gyro's column: "
                        "with --unit counts a number and a unit (0.25arcsec), with another unit a plain factor");
    command->add_option("--rate", arguments->rate_hz, "samples a second [Hz]");
    add_follow_links(*command, arguments->follow_links);
    command->add_option("--time", arguments->time,
                        "column of the times of the samples, or two, as in sec,nsec: "
                        "samples whose rows are left out are missing in the record");
    add_text_options(*command, arguments->text);
    command
        ->add_option("--declare", arguments->declared,
                     "KEY=NUMBER: a constant of the gyro as /declared has it, "
                     "such as scale_factor_arcsec=0.6 or dither_frequency_hz=400; may be given several times")
        ->take_all()
        ->allow_extra_args(false);
    command->callback(
        [arguments] { name_file_of_failure(text::name_of_file(arguments->data), [&] { import_data(*arguments); }); });
}

}  // namespace ringlock::app
