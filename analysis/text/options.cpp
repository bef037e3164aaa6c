#include "analysis/text/options.hpp"

#include <fmt/format.h>

#include <utility>

#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"

namespace ringlock::text {

void set_header(Options& options, const std::string& word) {
    if (word == "yes" || word == "no") {
        options.header = word == "yes" ? Options::Header::yes : Options::Header::no;
        return;
    }
    options.header = Options::Header::line;
    if (parse_index(word, options.header_line) && options.header_line > 0) return;
    throw InputError(
        fmt::format("--header {}: must be yes, no or the number of the line with the names, from 1", shown(word)));
}

void set_delimiter(Options& options, const std::string& word) {
    for (const auto& [name, character] :
         {std::pair{"comma", ','}, {"semicolon", ';'}, {"tab", '\t'}, {"space", ' '}, {"\\t", '\t'}}) {
        if (word == name) options.delimiter = character;
    }
    if (options.delimiter) return;
    const bool usable = word.size() == 1 && word[0] > ' ' && word[0] < 0x7f &&
                        word.find_first_of("\"#.+-0123456789") == std::string::npos;
    if (!usable) {
        throw InputError(
            fmt::format("--delimiter {}: must be comma, semicolon, tab, "
                        "space or one character that is part of no number, such as '|'",
                        shown(word)));
    }
    options.delimiter = word[0];
}

}  // namespace ringlock::text
