#include "analysis/report/page/html.hpp"

#include "engine/core/printable.hpp"

namespace ringlock::report {

namespace {

std::string with_entities(const std::string& text) {
    std::string out;
    out.reserve(text.size());
    for (const char c : text) {
        switch (c) {
            case '&':
                out += "&amp;";
                break;
            case '<':
                out += "&lt;";
                break;
            case '>':
                out += "&gt;";
                break;
            case '"':
                out += "&quot;";
                break;
            case '\'':
                out += "&#39;";
                break;
            default:
                out += c;
        }
    }
    return out;
}

}  // namespace

std::string html_escaped(std::string_view text) { return with_entities(printable(text)); }

std::string html_escaped_lines(std::string_view text) { return with_entities(without_controls(text)); }

}  // namespace ringlock::report
