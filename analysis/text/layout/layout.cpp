#include "analysis/text/layout/layout.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "analysis/text/layout/evidence.hpp"
#include "analysis/text/layout/headings.hpp"
#include "analysis/text/layout/units.hpp"
#include "analysis/text/words.hpp"
#include "engine/core/error.hpp"

namespace ringlock::text {
namespace {

class Finder {
   public:
    Finder(const std::vector<std::string>& sample, const Options& options, const Wanted& wanted, std::string file)
        : sample_(sample),
          options_(options),
          wanted_(wanted),
          file_(std::move(file)),
          evidence_(best_evidence(sample, options)),
          divider_(evidence_.dialect),
          candidates_(candidates_of(sample, options.skip, evidence_.dialect)) {}

    Layout run() {
        out_.dialect = evidence_.dialect;
        switch (options_.header) {
            case Options::Header::detect:
                detect();
                break;
            case Options::Header::no:
                first_ = 0;
                break;
            case Options::Header::yes:
                if (!candidates_.lines.empty()) take_header(candidates_.numbers[0]);
                break;
            case Options::Header::line:
                take_header(options_.header_line);
                break;
        }
        if (first_ < candidates_.lines.size()) out_.first_line = candidates_.numbers[first_];
        refuse_decimal_commas_between_commas();
        if (out_.columns.empty() && out_.first_line > 0) number_columns();
        note_dialect();
        return std::move(out_);
    }

   private:
    [[noreturn]] void fail(std::size_t line, const std::string& what) const {
        throw InputError(fmt::format("{}:{}: {}", file_, line, what));
    }
    void note(std::string text) { out_.notes.push_back(fmt::format("{}: {}", file_, text)); }

    const std::vector<std::string_view>& row(std::size_t candidate) {
        return divider_.divide(candidates_.lines[candidate]);
    }

    void note_dialect() {
        const Dialect& d = evidence_.dialect;
        if (options_.delimiter || out_.columns.empty()) {
            if (!d.decimal_comma) return;
        } else if (!d.decimal_comma && (d.delimiter == ',' || d.by_space())) {
            return;
        }
        note(fmt::format("columns are taken to be separated by {}{}; --delimiter overrides this", name_of(d),
                         d.decimal_comma ? ", and commas in numbers for decimal commas" : ""));
    }

    /// Numbers such as -0,05 with commas between them look like twice as many whole numbers. Whole numbers that begin
    /// with 0 are digits behind a comma where others are -0, or where a line above has half as many names.
    void refuse_decimal_commas_between_commas() {
        const Dialect& d = evidence_.dialect;
        if (options_.delimiter || d.delimiter != ',' || d.decimal_comma) return;
        if (out_.has_header || evidence_.columns % 2 != 0) return;
        constexpr std::size_t enough = 200;
        const std::size_t end = std::min(candidates_.lines.size(), first_ + enough);
        std::size_t minus_zero = end;
        std::size_t padded = end;
        for (std::size_t i = first_; i < end; ++i) {
            const auto& fields = row(i);
            if (fields.size() != evidence_.columns) return;
            for (std::size_t k = 0; k < fields.size(); k += 2) {
                const bool minus = fields[k].starts_with('-');
                std::size_t whole = 0;
                std::size_t digits = 0;
                if (!parse_index(fields[k].substr(minus ? 1 : 0), whole) || !parse_index(fields[k + 1], digits)) return;
                if (minus && whole == 0) minus_zero = std::min(minus_zero, i);
                if (fields[k + 1].size() > 1 && fields[k + 1].front() == '0') padded = std::min(padded, i);
            }
        }
        const bool half_as_many_names =
            first_ > 0 && 2 * divider_.divide(candidates_.lines[first_ - 1], true).size() == evidence_.columns;
        if (padded == end || (minus_zero == end && !half_as_many_names)) return;
        fail(candidates_.numbers[padded],
             fmt::format(
                 "commas seem to be decimal commas as well as between the columns: the line has {} whole numbers, "
                 "some of which begin with 0. {}; where they are whole numbers, say --delimiter comma",
                 evidence_.columns,
                 evidence_.columns == 2 ? "Put the name of the column above the numbers"
                                        : "Separate the columns by semicolons or tabs"));
    }

    void number_columns() {
        const std::size_t count = evidence_.columns > 0 ? evidence_.columns : row(first_).size();
        for (std::size_t k = 1; k <= count; ++k) out_.columns.push_back({std::to_string(k), std::to_string(k), ""});
    }

    // The header that the options name.

    void take_header(std::size_t line) {
        if (line > sample_.size() || trimmed(sample_[line - 1]).empty()) {
            fail(line, fmt::format("--header {}: that line has no text and cannot be the header", line));
        }
        const std::string_view text = sample_[line - 1];
        const std::string_view named = is_comment(text, evidence_.dialect) ? without_mark(text) : text;
        const auto below = std::upper_bound(candidates_.numbers.begin(), candidates_.numbers.end(), line);
        first_ = static_cast<std::size_t>(below - candidates_.numbers.begin());
        const std::size_t columns = evidence_.columns > 0 ? evidence_.columns : divider_.divide(named, true).size();
        const std::vector<std::string> names = headings(named, evidence_.dialect, columns, evidence_.last_empty);
        if (names.empty()) {
            fail(line, fmt::format("has {} fields where rows have {}, and cannot be their header; "
                                   "columns are separated by {} (--delimiter)",
                                   divider_.divide(named, true).size(), columns, name_of(evidence_.dialect)));
        }
        name_columns(names, line);
        if (first_ < candidates_.lines.size() && is_units(candidates_.lines[first_])) take_units(first_++);
    }

    void name_columns(const std::vector<std::string>& names, std::size_t line) {
        out_.has_header = true;
        out_.header_line = line;
        for (const std::string& heading : names) {
            NameAndUnit parts = split_unit(heading);
            out_.columns.push_back({heading, std::move(parts.name), std::move(parts.unit)});
        }
    }

    /// Whether the cells are units, or say that there is none. A row of more ones than units is data: "N,1".
    bool is_units(std::string_view line) const {
        std::size_t units = 0;
        std::size_t ones = 0;
        for (const std::string& cell : headings_of(line)) {
            const auto unit = unit_cell(cell);
            if (!unit) return false;
            if (!unit->empty()) ++units;
            if (trimmed(cell) == "1") ++ones;
        }
        return units > ones;
    }

    void take_units(std::size_t candidate) { take_units(candidates_.lines[candidate]); }
    void take_units(std::string_view line) {
        const std::vector<std::string> cells = headings_of(line);
        for (std::size_t k = 0; k < out_.columns.size(); ++k) {
            if (const std::string unit = unit_cell(cells[k]).value_or(""); !unit.empty()) out_.columns[k].unit = unit;
        }
    }

    // The header that is there.

    void detect() {
        first_ = candidates_.lines.size();
        for (std::size_t i = 0; i < candidates_.lines.size(); ++i) {
            if (kind_of(row(i), evidence_) != RowKind::data) continue;
            first_ = i;
            break;
        }
        if (first_ == candidates_.lines.size()) return without_rows();
        extend_upwards();
        std::size_t above = first_;  // candidates from here to the rows belong to the header
        if (!header_above(above) && !header_in_comment(above)) header_of_numbers();
        refuse_numbers_above(above);
    }

    /// A header at most, with no numbers below it: the line with the requested names, or the last one.
    void without_rows() {
        std::vector<std::string> names;
        std::size_t line = 0;
        for (std::size_t i = 0; i < candidates_.lines.size() && !names_wanted(names); ++i) {
            const auto& fields = divider_.divide(candidates_.lines[i], true);
            names.assign(fields.begin(), fields.end());
            line = candidates_.numbers[i];
        }
        if (line > 0) name_columns(names, line);
    }

    /// Rows above the first whole one that are rows all the same: those of empty fields, and those with a number in the
    /// wanted column.
    void extend_upwards() {
        while (first_ > 0) {
            const RowKind kind = kind_of(row(first_ - 1), evidence_);
            if (kind == RowKind::mixed) {
                if (!mixed_is_data(first_ - 1)) return;
                note(
                    fmt::format("line {} is taken for a row of data, for it has a number in the column that is asked "
                                "for; --header {} makes it the header",
                                candidates_.numbers[first_ - 1], candidates_.numbers[first_ - 1]));
            } else if (kind != RowKind::empty) {
                return;
            }
            --first_;
        }
    }

    bool mixed_is_data(std::size_t candidate) {
        if (wanted_.header_needed || wanted_.names.empty()) return false;
        std::size_t index = 0;
        if (!parse_index(wanted_.names.front(), index) || index < 1 || index > evidence_.columns) return false;
        const std::string field(row(candidate)[index - 1]);
        if (!is_value(field, evidence_.dialect)) return false;
        std::size_t whole = 0;
        if (!parse_index(field, whole)) return true;
        return !all_below_have_points(candidate + 1, index - 1, index);
    }

    /// Whether the next rows have decimals or an exponent in the fields [from, to).
    bool all_below_have_points(std::size_t candidate, std::size_t from, std::size_t to) {
        constexpr std::size_t enough = 20;
        const std::size_t end = std::min(candidates_.lines.size(), candidate + enough);
        for (std::size_t i = candidate; i < end; ++i) {
            const auto& fields = row(i);
            if (fields.size() != evidence_.columns) return false;
            for (std::size_t k = from; k < to; ++k) {
                std::size_t whole = 0;
                if (!fields[k].empty() && parse_index(fields[k].substr(fields[k].front() == '-' ? 1 : 0), whole)) {
                    return false;
                }
            }
        }
        return end > candidate;
    }

    /// A row of names right above the rows, or above a row of units there. A row with the requested names may stand
    /// higher: the lines between are then rows, even if they are wrong.
    bool header_above(std::size_t& above) {
        if (first_ == 0) return false;
        std::size_t header = first_ - 1;
        std::vector<std::string> names = headings_of(header);
        if (names.empty()) return false;
        for (std::size_t k = header; k > 0 && !names_wanted(names); --k) {
            std::vector<std::string> upper = headings_of(k - 1);
            if (upper.empty()) break;
            if (!names_wanted(upper)) continue;
            header = k - 1;
            names = std::move(upper);
        }
        if (header + 1 == first_ && is_units(candidates_.lines[header])) {
            const std::vector<std::string> upper = header > 0 ? headings_of(header - 1) : std::vector<std::string>{};
            if (upper.empty() && header_in_comment(header)) {
                take_units(header);
                above = header;
                return true;
            }
            if (!upper.empty()) {
                --header;
                names = upper;
            }
        }
        above = header;
        name_columns(names, candidates_.numbers[header]);
        std::size_t below = header + 1;
        if (below < first_ && is_units(candidates_.lines[below])) take_units(below++);
        first_ = below;
        const std::size_t plain = divider_.divide(candidates_.lines[header], true).size();
        if (header > 0 || plain != evidence_.columns) note_header();
        return true;
    }

    std::vector<std::string> headings_of(std::size_t candidate) const {
        return headings_of(candidates_.lines[candidate]);
    }
    std::vector<std::string> headings_of(std::string_view line) const {
        return headings(line, evidence_.dialect, evidence_.columns, evidence_.last_empty);
    }

    bool names_wanted(const std::vector<std::string>& names) const {
        return std::any_of(wanted_.names.begin(), wanted_.names.end(), [&](const std::string& asked) {
            return std::any_of(names.begin(), names.end(), [&](const std::string& name) {
                return name == asked || split_unit(name).name == asked;
            });
        });
    }

    void note_header() {
        std::vector<std::string> names;
        for (const Column& column : out_.columns) names.push_back(shown(column.heading));
        note(fmt::format("line {} is taken for the header: {}; --header and --skip override this", out_.header_line,
                         listed(names)));
    }

    /// The last comment above candidate `below`, where it has as many fields as the rows and no number.
    bool header_in_comment(std::size_t below) {
        const auto comment_above = [&](std::size_t line) -> std::size_t {
            while (line-- > options_.skip) {
                if (trimmed(sample_[line]).empty()) continue;
                return is_comment(sample_[line], evidence_.dialect) ? line + 1 : 0;
            }
            return 0;
        };
        std::size_t line = comment_above(candidates_.numbers[below] - 1);
        if (line == 0) return false;
        std::string_view text = without_mark(sample_[line - 1]);
        std::string_view units;
        if (is_units(text)) {
            const std::size_t upper = comment_above(line - 1);
            const std::string_view named = upper > 0 ? without_mark(sample_[upper - 1]) : "";
            if (is_comment_header(named)) {
                units = text;
                text = named;
                line = upper;
            }
        }
        if (!is_comment_header(text)) return false;
        name_columns(headings_of(text), line);
        if (!units.empty()) take_units(units);
        note_header();
        return true;
    }

    bool is_comment_header(std::string_view text) const {
        if (text.find('=') != std::string_view::npos) return false;
        const std::vector<std::string> names = headings_of(text);
        if (names.empty()) return false;
        for (const std::string& name : names) {
            if (is_value(name, evidence_.dialect)) return false;
        }
        return names.size() > 1 || !split_unit(names[0]).unit.empty();
    }

    /// The numbers of the columns as names, as pandas writes them for a table without names: 0, 1, 2, ... behind an
    /// empty field, or above rows that all have decimals.
    void header_of_numbers() {
        const auto& fields = row(first_);
        const std::size_t index = fields[0].empty() ? 1 : 0;
        if (fields.size() < 2) return;
        std::size_t number = 0;
        if (!parse_index(fields[index], number) || number > 1) return;
        for (std::size_t k = index; k < fields.size(); ++k) {
            std::size_t found = 0;
            if (!parse_index(fields[k], found) || found != number++) return;
        }
        std::vector<std::string> names(fields.begin(), fields.end());
        constexpr std::size_t fewest_rows = 3;
        const bool enough = candidates_.lines.size() >= first_ + 1 + (index == 1 ? 1 : fewest_rows);
        if (!enough || !all_below_have_points(first_ + 1, index, fields.size())) {
            if (index == 0) return;
            // Behind an empty field whole numbers are data where the fields below are empty, too.
            if (!enough || row(first_ + 1)[0].empty()) return;
        }
        name_columns(names, candidates_.numbers[first_]);
        note_header();
        ++first_;
    }

    /// Rows of numbers that the table leaves out would be lost without a word.
    void refuse_numbers_above(std::size_t above) {
        std::size_t left_aside = 0;
        for (std::size_t i = 0; i < above && i < first_; ++i) {
            if (out_.has_header && candidates_.numbers[i] == out_.header_line) continue;
            const auto& fields = row(i);
            std::size_t values = 0;
            for (const std::string_view field : fields) values += is_value(field, evidence_.dialect) ? 1 : 0;
            ++left_aside;
            if (values < fields.size() || fields.empty()) continue;
            fail(candidates_.numbers[i],
                 fmt::format("has {} {} where the rows below have {}; where it belongs to a preamble, say --skip {}",
                             fields.size(), fields.size() == 1 ? "column" : "columns", evidence_.columns,
                             candidates_.numbers[above > 0 ? above - 1 : 0]));
        }
        if (left_aside == 0) return;
        note(fmt::format("{} of text above the table, from line {} on, {} ignored",
                         left_aside == 1 ? "a line" : fmt::format("{} lines", left_aside), candidates_.numbers[0],
                         left_aside == 1 ? "is" : "are"));
    }

    const std::vector<std::string>& sample_;
    const Options& options_;
    const Wanted& wanted_;
    std::string file_;
    Evidence evidence_;
    Fields divider_;
    Candidates candidates_;
    std::size_t first_ = 0;  ///< candidate that is the first row
    Layout out_;
};

}  // namespace

Layout find_layout(const std::vector<std::string>& lines, const Options& options, const Wanted& wanted,
                   const std::string& name) {
    return Finder(lines, options, wanted, name).run();
}

}  // namespace ringlock::text
