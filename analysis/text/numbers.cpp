#include "analysis/text/numbers.hpp"

#include <array>
#include <charconv>
#include <cstring>
#include <limits>

namespace ringlock::text {
namespace {

constexpr double not_a_number = std::numeric_limits<double>::quiet_NaN();

template <class Number>
std::errc parse_whole_field(std::string_view field, Number& value) {
    if (field.size() > 1 && field.front() == '+' && field[1] != '-') field.remove_prefix(1);
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    return end == field.data() + field.size() ? error : std::errc::invalid_argument;
}

bool is_digit(char c) { return c >= '0' && c <= '9'; }

/// "1.#INF00", "-1.#IND", "1.#QNAN0": the output of the C library of Windows, with the requested number of digits; with
/// fewer digits it rounds the words themselves ("1.#J", "1.#QO").
bool parse_windows_word(std::string_view field, double& value) {
    const bool negative = field.starts_with('-');
    if (negative || field.starts_with('+')) field.remove_prefix(1);
    if (!field.starts_with("1.#") || field.size() < 4) return false;
    std::string_view word = field.substr(3);
    while (!word.empty() && is_digit(word.back())) word.remove_suffix(1);
    if (word == "INF" || word == "J" || word == "IO") {
        value = negative ? -std::numeric_limits<double>::infinity() : std::numeric_limits<double>::infinity();
        return true;
    }
    for (const char* known : {"IND", "QNAN", "SNAN", "NAN", "QO", "R", "Q", "SN"}) {
        if (word != known) continue;
        value = not_a_number;
        return true;
    }
    return false;
}

/// A mantissa with an exponent by Fortran: D in the place of E, or nothing in its place before three digits.
bool parse_fortran(std::string_view field, double& value) {
    constexpr std::size_t longest = 64;
    std::array<char, longest + 1> text{};
    if (field.size() > longest) return false;
    std::memcpy(text.data(), field.data(), field.size());
    std::size_t size = field.size();
    const std::size_t letter = field.find_first_of("dD");
    if (letter != std::string_view::npos) {
        text[letter] = 'e';
    } else {
        const std::size_t sign = field.find_last_of("+-");
        if (sign == std::string_view::npos || sign < 2 || field.size() - sign != 4) return false;
        if (field.substr(0, sign).find('.') == std::string_view::npos) return false;
        if (!is_digit(field[sign - 1]) && field[sign - 1] != '.') return false;
        std::memmove(text.data() + sign + 1, text.data() + sign, size - sign);
        text[sign] = 'e';
        ++size;
    }
    return parse_whole_field(std::string_view(text.data(), size), value) == std::errc();
}

bool parse_with_point(std::string_view field, double& value) {
    const std::errc plain = parse_whole_field(field, value);
    if (plain == std::errc()) return true;
    if (field.empty() || plain == std::errc::result_out_of_range) return false;
    return parse_windows_word(field, value) || parse_fortran(field, value);
}

/// The field with its comma as a point; false where it is no number with a comma.
bool parse_with_comma(std::string_view field, double& value) {
    constexpr std::size_t longest = 64;
    std::array<char, longest> text{};
    const std::size_t comma = field.find(',');
    if (comma == std::string_view::npos) return parse_with_point(field, value);
    // A comma at the end parts columns: "1, 2".
    if (field.size() > longest || comma + 1 == field.size()) return false;
    if (!is_digit(field[comma + 1]) && field[comma + 1] != '#') return false;
    if (field.substr(0, comma).find('.') != std::string_view::npos) return false;  // 1.234,5: of thousands
    std::memcpy(text.data(), field.data(), field.size());
    text[comma] = '.';
    return parse_with_point({text.data(), field.size()}, value);
}

bool is_missing(std::string_view field) {
    if (field.empty() || field == "-" || field == "--" || field == "---") return true;
    if (field.size() > 1 && (field[0] == '+' || field[0] == '-')) field.remove_prefix(1);
    constexpr std::size_t longest = 8;
    if (field.size() > longest) return false;
    std::array<char, longest> small{};
    for (std::size_t i = 0; i < field.size(); ++i) {
        small[i] = static_cast<char>(field[i] >= 'A' && field[i] <= 'Z' ? field[i] - 'A' + 'a' : field[i]);
    }
    const std::string_view word(small.data(), field.size());
    for (const std::string_view known : {"na", "n/a", "nan", "nan(ind)", "null", "none", "#n/a"}) {
        if (word == known) return true;
    }
    return false;
}

}  // namespace

bool parse_number(std::string_view field, double& value, bool decimal_comma) {
    return decimal_comma ? parse_with_comma(field, value) : parse_with_point(field, value);
}

bool parse_value(std::string_view field, double& value, bool decimal_comma) {
    if (parse_number(field, value, decimal_comma)) return true;
    if (!is_missing(field)) return false;
    value = not_a_number;
    return true;
}

std::errc parse_whole_number(std::string_view field, std::int64_t& value) { return parse_whole_field(field, value); }

}  // namespace ringlock::text
