#include "analysis/record/arrays/array_choice.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>

#include "analysis/record/readers.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::record {
namespace {

/// A name requested by an option.
struct Asked {
    const std::string& file;
    const char* option;
    const std::string& name;
};

std::vector<std::string> paths(const std::vector<Dataset>& datasets) {
    std::vector<std::string> out;
    for (const Dataset& d : datasets) out.push_back(printable(d.path));
    return out;
}

/// "'/a[I,:]', row I = 0 to 3, or ..."
std::string slices_of(const char* option, const std::string& name, const Dataset& table) {
    const auto range = [](const char* what, std::uint64_t side) {
        return side == 1 ? fmt::format("{} = 0", what) : fmt::format("{} = 0 to {}", what, side - 1);
    };
    const std::string plain = printable(name);
    const std::string column = fmt::format("'{}[:,J]' for column {}", plain, range("J", table.sides[1]));
    if (table.field_is_array) return fmt::format("{} {}", option, column);
    return fmt::format("{} '{}[I,:]' for row {} or {}", option, plain, range("I", table.sides[0]), column);
}

std::string shape_of(const Dataset& table) {
    return fmt::format("{} row{} and {} column{}", table.sides[0], table.sides[0] == 1 ? "" : "s", table.sides[1],
                       table.sides[1] == 1 ? "" : "s");
}

/// Whether a path is the name or ends with it.
bool ends_with_name(const std::string& path, const std::string& name) {
    const std::string absolute = name.starts_with("/") ? name : fmt::format("/{}", name);
    return path == absolute || path.ends_with(absolute);
}

/// The one whose path is the name or ends with it, if any.
const Dataset* named(const Asked& asked, const std::string& name, const std::vector<Dataset>& datasets) {
    const std::string absolute = name.starts_with("/") ? name : fmt::format("/{}", name);
    std::vector<const Dataset*> matches;
    const Dataset* alias = nullptr;
    for (const Dataset& d : datasets) {
        if (d.path == absolute) return &d;
        if (!d.path.ends_with(absolute)) continue;
        if (d.is_alias) {
            alias = &d;
        } else {
            matches.push_back(&d);
        }
    }
    if (matches.empty()) return alias;
    if (matches.size() == 1) return matches.front();
    std::vector<std::string> names;
    for (const Dataset* d : matches) names.push_back(printable(d->path));
    throw InputError(fmt::format("{}: '{}' is the name of several datasets; choose one: {}", printable(asked.file),
                                 printable(name), listed(names)));
}

/// Throws InputError: the requested dataset exists, but is no series of numbers; the message says why.
void refuse_unreadable(const Asked& asked, const std::vector<Unreadable>& others) {
    const std::string plain = without_brackets(asked.name);
    for (const Unreadable& other : others) {
        if (!ends_with_name(other.path, asked.name) && !ends_with_name(other.path, plain)) continue;
        throw InputError(fmt::format("{}: dataset {}: {}", printable(asked.file), printable(other.path), other.why));
    }
}

/// A name with brackets after it.
struct Bracketed {
    std::string name;
    bool row = false;
    std::uint64_t index = 0;
};

std::optional<Bracketed> in_brackets(const Asked& asked) {
    const std::string& text = asked.name;
    const std::size_t open = text.find_last_of('[');
    if (open == std::string::npos || !text.ends_with("]")) return std::nullopt;
    std::string inside = text.substr(open + 1, text.size() - open - 2);
    std::erase(inside, ' ');
    const bool row = inside.ends_with(",:");
    const std::string digits =
        row ? inside.substr(0, inside.size() - 2) : inside.substr(std::min<std::size_t>(2, inside.size()));
    Bracketed out{text.substr(0, open), row, 0};
    const auto [end, error] = std::from_chars(digits.data(), digits.data() + digits.size(), out.index);
    if ((!row && !inside.starts_with(":,")) || error != std::errc{} || end != digits.data() + digits.size()) {
        throw InputError(
            fmt::format("{}: {} '{}': in brackets must stand [I,:] for row I "
                        "or [:,J] for column J of a two-dimensional dataset, counted from 0",
                        printable(asked.file), asked.option, printable(text)));
    }
    return out;
}

Slice whole(const Dataset& series) {
    return {.of = series, .along = series.sides.size() == 2 && series.sides[1] != 1 ? 1 : 0, .at = 0, .brackets = ""};
}

void check_not_empty(const Asked& asked, const Dataset& table) {
    if (table.sides[0] > 0 && table.sides[1] > 0) return;
    throw InputError(
        fmt::format("{}: dataset {}: is empty ({})", printable(asked.file), printable(table.path), shape_of(table)));
}

Slice slice(const Asked& asked, const Bracketed& of, const Dataset& table) {
    check_not_empty(asked, table);
    if (of.row && table.field_is_array) {
        throw InputError(
            fmt::format("{}: dataset {}: time runs along its records, so that only columns of it are series; give {}",
                        printable(asked.file), printable(table.path), slices_of(asked.option, of.name, table)));
    }
    const std::uint64_t side = table.sides[of.row ? 0 : 1];
    const std::string brackets = of.row ? fmt::format("[{},:]", of.index) : fmt::format("[:,{}]", of.index);
    if (of.index >= side) {
        throw InputError(fmt::format("{}: dataset {} has no {} {}: it has {}, counted from 0; give {}",
                                     printable(asked.file), printable(table.path), of.row ? "row" : "column", of.index,
                                     shape_of(table), slices_of(asked.option, of.name, table)));
    }
    return {.of = table, .along = of.row ? 1 : 0, .at = of.index, .brackets = brackets};
}

[[noreturn]] void refuse_without_brackets(const Asked& asked, const Dataset& table) {
    check_not_empty(asked, table);
    throw InputError(fmt::format("{}: dataset {} has {}, but only one is read; choose it with {}, counted from 0",
                                 printable(asked.file), printable(table.path), shape_of(table),
                                 slices_of(asked.option, asked.name, table)));
}

Slice find(const Asked& asked, const std::vector<Dataset>& series, const std::vector<Dataset>& tables,
           const std::vector<Unreadable>& others) {
    if (const Dataset* found = named(asked, asked.name, series)) return whole(*found);
    if (const Dataset* found = named(asked, asked.name, tables)) refuse_without_brackets(asked, *found);
    if (const std::optional<Bracketed> of = in_brackets(asked)) {
        // MATLAB's n x 1 is a series and has rows and columns all the same.
        if (const Dataset* found = named(asked, of->name, tables)) return slice(asked, *of, *found);
        if (const Dataset* found = named(asked, of->name, series)) {
            if (found->sides.size() == 2) return slice(asked, *of, *found);
            throw InputError(
                fmt::format("{}: {} '{}': dataset {} has one dimension and no rows and columns; leave the brackets out",
                            printable(asked.file), asked.option, printable(asked.name), printable(found->path)));
        }
    }
    refuse_unreadable(asked, others);
    std::vector<Dataset> all = series;
    all.insert(all.end(), tables.begin(), tables.end());
    throw InputError(fmt::format("{}: has no dataset of numbers '{}' of one or two dimensions; there are {}",
                                 printable(asked.file), printable(asked.name), listed(paths(all))));
}

}  // namespace

std::string without_brackets(const std::string& name) {
    const std::size_t open = name.find_last_of('[');
    return open == std::string::npos || !name.ends_with("]") ? name : name.substr(0, open);
}

namespace {

[[noreturn]] void refuse_without_numbers(const std::string& file, const std::vector<Unreadable>& others) {
    constexpr std::size_t most = 5;
    std::string why;
    for (std::size_t i = 0; i < std::min(most, others.size()); ++i) {
        why += fmt::format("; {}: {}", printable(others[i].path), others[i].why);
    }
    if (others.size() > most) why += fmt::format("; and {} more", others.size() - most);
    throw InputError(fmt::format("{}: holds no dataset of numbers of one or two dimensions{}", printable(file), why));
}

}  // namespace

void refuse_repeated(const std::set<std::string>& repeated, Contents& contents) {
    std::erase_if(contents.datasets, [&](const Dataset& dataset) {
        const bool is_one = repeated.contains(dataset.dataset);
        if (is_one)
            contents.others.push_back({dataset.path, "occurs more than once in the file; rename or remove one"});
        return is_one;
    });
}

std::vector<std::string> names_of_times(const std::string& asked) {
    int depth = 0;
    for (std::size_t i = 0; i < asked.size(); ++i) {
        depth += asked[i] == '[' ? 1 : asked[i] == ']' ? -1 : 0;
        if (asked[i] == ',' && depth == 0) return {asked.substr(0, i), asked.substr(i + 1)};
    }
    return {asked};
}

Choice choose_datasets(const SeriesRequest& request, const Contents& there) {
    const std::string& file = request.path;
    std::vector<Dataset> series;
    std::vector<Dataset> tables;
    for (const Dataset& d : there.datasets) (d.is_series() ? series : tables).push_back(d);
    Choice choice;
    const auto find_asked = [&](const char* option, const std::string& name) {
        if (there.datasets.empty()) refuse_unreadable({file, option, name}, there.others);
        if (there.datasets.empty()) refuse_without_numbers(file, there.others);
        return find({file, option, name}, series, tables, there.others);
    };
    if (request.time) {
        const std::vector<std::string> names = names_of_times(*request.time);
        choice.time = find_asked("--time", names[0]);
        if (names.size() > 1) choice.nanoseconds = find_asked("--time", names[1]);
        if (choice.nanoseconds && choice.nanoseconds->name() == choice.time->name()) {
            throw InputError(fmt::format("{}: --time {}: is one dataset twice; seconds and nanoseconds are two",
                                         printable(file), printable(*request.time)));
        }
    }
    if (request.column) {
        choice.column = find_asked("--column", *request.column);
        return choice;
    }
    if (there.datasets.empty()) refuse_without_numbers(file, there.others);
    const auto is_out = [&](const Dataset& d) {
        return d.is_alias || (choice.time && d.path == choice.time->of.path) ||
               (choice.nanoseconds && d.path == choice.nanoseconds->of.path);
    };
    std::erase_if(series, is_out);
    std::erase_if(tables, [](const Dataset& d) { return d.is_alias; });
    if (series.size() == 1) {
        choice.column = whole(series.front());
        return choice;
    }
    if (series.empty() && tables.size() == 1) {
        refuse_without_brackets({file, "--column", tables.front().path}, tables.front());
    }
    std::vector<std::string> names = paths(series);
    for (const Dataset& d : tables) {
        names.push_back(fmt::format("{}{}", printable(d.path), d.field_is_array ? "[:,J]" : "[I,:] or [:,J]"));
    }
    throw InputError(fmt::format(
        "{}: has {} datasets{}; choose one with --column ({})", printable(file), names.size(),
        choice.time ? fmt::format(" in addition to {}, the time", printable(choice.time->name())) : "", listed(names)));
}

}  // namespace ringlock::record
