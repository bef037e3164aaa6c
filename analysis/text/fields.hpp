#pragma once
#include <cstddef>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

/// The fields of one row of a table.
namespace ringlock::text {

/// How rows are divided into fields, and numbers written.
struct Dialect {
    char delimiter = ' ';        ///< ' ' stands for any white space
    bool decimal_comma = false;  ///< 0,5 for a half

    bool by_space() const { return delimiter == ' '; }
    bool operator==(const Dialect&) const = default;
};

/// "commas", "white space", "'|'", for messages.
std::string name_of(const Dialect& dialect);

/// Whether a line is a comment: it begins with #, //, % or, where semicolons part no columns, a semicolon.
bool is_comment(std::string_view line, const Dialect& dialect);
/// A comment without its mark.
std::string_view without_mark(std::string_view line);

/// Divides rows. White space around a field never counts; an empty field between delimiters does. A field in double
/// quotes may hold delimiters, and "" stands for a quote in it. `#` begins a comment at the start of a row and after
/// white space, between delimiters only with white space on both sides or no delimiter behind it, and nowhere in
/// quotes.
class Fields {
   public:
    explicit Fields(Dialect dialect);

    const Dialect& dialect() const { return dialect_; }

    /// Divides a row; the fields are valid until the next call. With `whole` a `#` in it is no comment.
    const std::vector<std::string_view>& divide(std::string_view row, bool whole = false);

    /// Number, from 1, of the field of that row whose quotes do not close or are followed by text; 0 where none is.
    std::size_t broken() const { return broken_; }

   private:
    bool divide_plain(std::string_view row);
    bool begins_comment(std::string_view row, std::size_t at) const;
    void divide_quoted(std::string_view row, bool whole);
    std::size_t take_quoted(std::string_view row, std::size_t at);
    std::size_t take_plain(std::string_view row, std::size_t at, bool whole);

    Dialect dialect_;
    std::vector<unsigned char> kinds_;  ///< of each byte: 0 ordinary, 1 delimiter, 2 needs the slow way
    std::vector<std::string_view> fields_;
    std::deque<std::string> unquoted_;
    std::size_t broken_ = 0;
};

}  // namespace ringlock::text
