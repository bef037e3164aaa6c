#pragma once
#include <cstddef>
#include <functional>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "analysis/text/fields.hpp"
#include "analysis/text/layout/layout.hpp"
#include "analysis/text/source/lines.hpp"

namespace ringlock::text {

/// A table in a text file, read row by row in memory that does not grow with the file.
class Table {
   public:
    /// Called with each comment: its line, from 1, and its text without the mark.
    using OnComment = std::function<void(std::size_t line, std::string_view text)>;

    /// Opens the file, or standard input for "-", and finds the table by its first lines: up to a thousand rows that
    /// look like numbers, or 1 MiB, comments not counted. Choices that are not obvious are reported in a notice, unless
    /// options.quiet. Throws InputError as open_text(), Lines and find_layout() do.
    Table(const std::string& path, const Options& options, const Wanted& wanted, OnComment on_comment);
    /// The same for bytes that are open already; `name` is their name in messages.
    Table(std::unique_ptr<Source> from, const std::string& name, const Options& options, const Wanted& wanted,
          OnComment on_comment);

    const Layout& layout() const { return layout_; }

    /// Goes to the next row; false behind the last. Comments on the way are handed on. Throws InputError, naming the
    /// line, where a row has another number of fields or quotes that do not close.
    bool next();

    /// Of the row: as many fields as there are columns; they stay until the next row.
    const std::vector<std::string_view>& fields() const { return *fields_; }
    /// Its line, or that of the last comment, from 1.
    std::size_t line() const { return line_; }
    /// Lines that have been read.
    std::size_t lines() const { return lines_.number(); }

   private:
    void take_sample(const Options& options);
    bool next_line(std::string_view& text);
    [[noreturn]] void fail(const std::string& what) const;
    void refuse_width() const;

    std::string name_;
    OnComment on_comment_;
    Lines lines_;
    std::vector<std::string> sample_;
    std::size_t given_ = 0;  ///< lines of the sample
    Layout layout_;
    Fields divider_{Dialect{}};
    const std::vector<std::string_view>* fields_ = nullptr;
    std::size_t line_ = 0;
};

}  // namespace ringlock::text
