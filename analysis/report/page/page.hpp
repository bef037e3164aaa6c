#pragma once
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/report/plot.hpp"
#include "analysis/report/table.hpp"

namespace ringlock::report {

/// The script that makes the figures of pages interactive in this build: "dygraphs 2.2.1", or "none" where the package
/// was missing when the program was built; pages then have their drawn figures only.
std::string page_script();

/// The words of a "Content-Security-Policy" that allows an inline style or script: 'sha256-' and the hash in base64.
///
/// \param hex  64 hexadecimal digits
std::string csp_hash(std::string_view hex);

/// One HTML page that needs neither network nor other files: built from top to bottom, then taken with html().
///
/// All texts are plain: they are escaped here, and control characters are shown as printable() writes them. Nothing in
/// a page depends on the time, so that equal contents give equal bytes.
class Page {
   public:
    /// \param kind  a word or two above the title, such as "Study"
    Page(std::string title, std::string kind);

    void heading(std::string_view text);
    void subheading(std::string_view text);
    void paragraph(std::string_view text);
    /// The answer of the page, set apart; sentences one below the other.
    void answer(std::string_view label, const std::vector<std::string>& sentences);
    void list(const std::vector<std::string>& items);
    /// \param caption  what the table shows; empty where its first column says it
    void table(const Table& table, std::string_view caption);
    /// The figure with legend, caption and its numbers as a table that can be unfolded.
    void chart(Figure figure, std::string_view caption = "");
    /// Names and values, one pair a row.
    void facts(const std::vector<std::pair<std::string, std::string>>& rows, std::string_view caption);
    /// Text that keeps its lines: a command, or a file.
    void code(std::string_view text, std::string_view name);
    /// The same, to be unfolded by the reader.
    void folded_code(std::string_view summary, std::string_view text);

    /// The whole page.
    std::string html() const;

   private:
    std::string title_;
    std::string kind_;
    std::string body_;
    std::vector<std::string> chart_data_;  ///< JSON
    std::size_t sections_ = 0;
    std::map<std::string, int> names_;  ///< of regions, and how often each was given
    void scrolled(std::string_view name, const std::string& inner);
};

}  // namespace ringlock::report
