#include "app/text_arguments.hpp"

#include <fmt/format.h>

#include <CLI/CLI.hpp>

#include "analysis/text/stamps.hpp"
#include "app/arguments.hpp"
#include "engine/core/error.hpp"

namespace ringlock::app {

void add_text_options(CLI::App& command, TextArguments& arguments) {
    command.add_option("--time-unit", arguments.time_unit,
                       "s | ms | us | ns | iso | mjd: unit of the times; default: the unit in the header, "
                       "ISO dates where the column has them, or s");
    command.add_option("--header", arguments.header,
                       "yes | no | N: whether the first line of a text has the names of the columns, "
                       "or the number of the line that has them; default: detected");
    command.add_option("--skip", arguments.skip, "lines to skip at the start of a text");
    command.add_option("--delimiter", arguments.delimiter,
                       "comma | semicolon | tab | space | a character: delimiter of the columns of a text; "
                       "default: detected");
}

text::Options text_options(const TextArguments& arguments) {
    text::Options options;
    constexpr std::int64_t most_lines = 1'000'000'000;
    if (!arguments.skip.empty()) {
        options.skip = static_cast<std::size_t>(
            whole_number("--skip", arguments.skip, most_lines, "a number of lines, from 0 to 1e9"));
    }
    if (!arguments.header.empty()) text::set_header(options, arguments.header);
    if (!arguments.delimiter.empty()) text::set_delimiter(options, arguments.delimiter);
    return options;
}

std::optional<std::string> time_unit_of(const TextArguments& arguments, bool has_time) {
    if (arguments.time_unit.empty()) return std::nullopt;
    if (!has_time) {
        throw InputError(
            fmt::format("--time-unit {}: needs --time, which names the column of the times", arguments.time_unit));
    }
    return text::time_unit(arguments.time_unit).name;
}

}  // namespace ringlock::app
