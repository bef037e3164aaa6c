#include "analysis/text/layout/evidence.hpp"

#include <algorithm>
#include <map>

#include "analysis/text/layout/headings.hpp"
#include "analysis/text/numbers.hpp"
#include "analysis/text/words.hpp"

namespace ringlock::text {
namespace {

constexpr std::size_t most_rows = 200;  // at the end of the sample, behind the lines above the table

/// Rows with at least one value by their number of fields, and the number of most; the first of two that are as many.
std::size_t commonest_width(Fields& divider, const Candidates& candidates, std::size_t from) {
    std::map<std::size_t, std::size_t> rows;
    std::vector<std::size_t> order;
    for (std::size_t i = from; i < candidates.lines.size(); ++i) {
        const auto& fields = divider.divide(candidates.lines[i]);
        const bool any = std::any_of(fields.begin(), fields.end(),
                                     [&](std::string_view f) { return is_value(f, divider.dialect()); });
        if (any && rows[fields.size()]++ == 0) order.push_back(fields.size());
    }
    std::size_t best = 0;
    for (const std::size_t width : order) {
        if (best == 0 || rows[width] > rows[best]) best = width;
    }
    return best;
}

bool explains_better(const Evidence& found, const Evidence& best) {
    constexpr double clearly = 1.02;
    if (found.score <= 0.0) return false;
    if (found.score > clearly * best.score) return true;
    if (found.score * clearly <= best.score) return false;
    if (found.others != best.others) return found.others < best.others;
    return found.header_fits && !best.header_fits;
}

bool has_decimal_comma(std::string_view field, const Dialect& dialect) {
    double value = 0.0;
    return field.find(',') != std::string_view::npos && parse_number(field, value, dialect.decimal_comma);
}

}  // namespace

bool is_value(std::string_view field, const Dialect& dialect) {
    double value = 0.0;
    return !field.empty() && parse_value(field, value, dialect.decimal_comma);
}

Candidates candidates_of(const std::vector<std::string>& sample, std::size_t skip, const Dialect& dialect) {
    Candidates out;
    for (std::size_t i = skip; i < sample.size(); ++i) {
        if (trimmed(sample[i]).empty() || is_comment(sample[i], dialect)) continue;
        out.lines.emplace_back(sample[i]);
        out.numbers.push_back(i + 1);
    }
    return out;
}

Evidence evidence_for(const Dialect& dialect, const Candidates& candidates) {
    Evidence out;
    out.dialect = dialect;
    Fields divider(dialect);
    const std::size_t all = candidates.lines.size();
    const std::size_t from = all > most_rows ? all - most_rows : 0;
    out.columns = commonest_width(divider, candidates, from);
    if (out.columns == 0) return out;
    std::vector<std::size_t> values(out.columns, 0), words(out.columns, 0);
    double rows = 0.0, value_fields = 0.0, filled_fields = 0.0;
    bool commas = false;
    for (std::size_t i = from; i < all; ++i) {
        const auto& fields = divider.divide(candidates.lines[i]);
        if (fields.size() != out.columns || divider.broken() != 0) continue;
        std::size_t here = 0;
        for (const std::string_view field : fields) here += is_value(field, dialect) ? 1 : 0;
        if (here == 0) continue;
        rows += 1.0;
        for (std::size_t k = 0; k < fields.size(); ++k) {
            if (fields[k].empty()) continue;
            filled_fields += 1.0;
            const bool value = is_value(fields[k], dialect);
            value_fields += value ? 1.0 : 0.0;
            ++(value ? values : words)[k];
            commas = commas || (dialect.decimal_comma && has_decimal_comma(fields[k], dialect));
        }
    }
    for (std::size_t k = 0; k < out.columns; ++k) out.numeric.push_back(values[k] > 0 && values[k] >= words[k]);
    out.others = all - from - static_cast<std::size_t>(rows);
    out.last_empty = values.back() + words.back() == 0;
    if (dialect.decimal_comma && !commas) return out;  // no reason for it
    out.score = filled_fields > 0.0 ? rows * value_fields / filled_fields : 0.0;
    std::string_view header;
    for (std::size_t i = 0; i < all; ++i) {
        if (kind_of(divider.divide(candidates.lines[i]), out) != RowKind::data) continue;
        if (i > 0) header = candidates.lines[i - 1];
        break;
    }
    out.header_fits = !header.empty() && divider.divide(header, true).size() == out.columns;
    // "1,2" is one number only if the header above has a single name.
    const bool one_name = !headings(header, dialect, 1).empty() && header.find(',') == std::string_view::npos;
    if (dialect.decimal_comma && out.columns == 1 && !one_name) out.score = 0.0;
    return out;
}

Evidence best_evidence(const std::vector<std::string>& sample, const Options& options) {
    std::vector<char> delimiters{',', ';', ' ', '\t'};
    if (options.delimiter) delimiters = {*options.delimiter};
    Evidence best;
    best.dialect.delimiter = delimiters.front();
    for (const char delimiter : delimiters) {
        for (const bool decimal_comma : {false, true}) {
            if (decimal_comma && delimiter == ',') continue;
            const Dialect dialect{delimiter, decimal_comma};
            const Evidence found = evidence_for(dialect, candidates_of(sample, options.skip, dialect));
            // A character that divides no row is no delimiter: a single column counts as delimited by white space.
            if (found.columns < 2 && delimiter != ' ' && !options.delimiter) continue;
            if (explains_better(found, best)) best = found;
        }
    }
    return best;
}

RowKind kind_of(const std::vector<std::string_view>& fields, const Evidence& evidence) {
    if (evidence.columns == 0 || fields.size() != evidence.columns) return RowKind::other;
    std::size_t values = 0, words = 0, filled = 0;
    for (std::size_t k = 0; k < fields.size(); ++k) {
        if (fields[k].empty()) continue;
        ++filled;
        if (!evidence.numeric[k]) continue;
        ++(is_value(fields[k], evidence.dialect) ? values : words);
    }
    if (filled == 0) return RowKind::empty;
    if (words == 0) return values > 0 ? RowKind::data : RowKind::words;
    return values > 0 ? RowKind::mixed : RowKind::words;
}

}  // namespace ringlock::text
