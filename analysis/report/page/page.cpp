#include "analysis/report/page/page.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cstdint>
#include <nlohmann/json.hpp>
#include <utility>

#include "analysis/report/page/assets.hpp"
#include "analysis/report/page/chart.hpp"
#include "analysis/report/page/html.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/version.hpp"

namespace ringlock::report {

namespace {

unsigned digit_of(char c) { return static_cast<unsigned>(c >= 'a' ? c - 'a' + 10 : c >= 'A' ? c - 'A' + 10 : c - '0'); }

/// JSON as the content of a script element: nothing in it can end the element.
std::string data_text(const nlohmann::ordered_json& json) {
    std::string out;
    for (const char c : json_text(json)) out += c == '<' ? std::string("\\u003c") : std::string(1, c);
    return out;
}

const char* align_class(Align align) { return align == Align::right ? " class=\"n\"" : ""; }

}  // namespace

std::string page_script() { return assets::script_name.empty() ? "none" : std::string(assets::script_name); }

std::string csp_hash(std::string_view hex) {
    constexpr std::string_view letters = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    std::string out = "'sha256-";
    std::uint32_t bits = 0;
    int held = 0;
    for (std::size_t i = 0; i + 1 < hex.size(); i += 2) {
        bits = (bits << 8U) | (digit_of(hex[i]) << 4U) | digit_of(hex[i + 1]);
        for (held += 8; held >= 6; held -= 6) out += letters[(bits >> static_cast<unsigned>(held - 6)) & 63U];
    }
    if (held > 0) out += letters[(bits << static_cast<unsigned>(6 - held)) & 63U];
    while ((out.size() - 8) % 4 != 0) out += '=';
    return out + "'";
}

Page::Page(std::string title, std::string kind) : title_(std::move(title)), kind_(std::move(kind)) {}

void Page::heading(std::string_view text) {
    body_ += fmt::format("<h2 id=\"part-{}\">{}</h2>\n", ++sections_, html_escaped(text));
}

void Page::subheading(std::string_view text) { body_ += fmt::format("<h3>{}</h3>\n", html_escaped(text)); }

void Page::paragraph(std::string_view text) {
    if (!text.empty()) body_ += fmt::format("<p>{}</p>\n", html_escaped(text));
}

void Page::answer(std::string_view label, const std::vector<std::string>& sentences) {
    if (sentences.empty()) return;
    body_ += fmt::format("<div class=\"answer\"><p class=\"kind\">{}</p>\n", html_escaped(label));
    for (const std::string& sentence : sentences) body_ += fmt::format("<p>{}</p>\n", html_escaped(sentence));
    body_ += "</div>\n";
}

void Page::list(const std::vector<std::string>& items) {
    if (items.empty()) return;
    body_ += "<ul>\n";
    for (const std::string& item : items) body_ += fmt::format("<li>{}</li>\n", html_escaped(item));
    body_ += "</ul>\n";
}

void Page::scrolled(std::string_view name, const std::string& inner) {
    // Readers of the screen list regions by their names.
    std::string unique(name);
    if (const int times = ++names_[unique]; times > 1) unique += fmt::format(" ({})", times);
    body_ += fmt::format("<div class=\"scroll\" role=\"region\" tabindex=\"0\" aria-label=\"{}\">\n{}</div>\n",
                         html_escaped(unique), inner);
}

void Page::table(const Table& table, std::string_view caption) {
    std::string html = "<table>";
    if (!caption.empty()) html += fmt::format("<caption>{}</caption>", html_escaped(caption));
    html += "\n<thead><tr>";
    for (const Column& column : table.columns()) {
        html += fmt::format("<th scope=\"col\"{}>{}</th>", align_class(column.align), html_escaped(column.header));
    }
    html += "</tr></thead>\n<tbody>\n";
    for (const auto& row : table.rows()) {
        html += "<tr>";
        for (std::size_t i = 0; i < row.size(); ++i) {
            html += fmt::format("<td{}>{}</td>", align_class(table.columns()[i].align), html_escaped(row[i]));
        }
        html += "</tr>\n";
    }
    const std::string_view name = caption.empty() ? std::string_view(table.columns().front().header) : caption;
    scrolled(fmt::format("Table: {}", name), html + "</tbody></table>\n");
}

void Page::chart(Figure figure, std::string_view caption) {
    const Chart chart(std::move(figure));
    const std::string id = fmt::format("figure-{}", chart_data_.size() + 1);
    body_ += fmt::format("<figure class=\"chart\" id=\"{}\">\n<figcaption>{}</figcaption>\n", id,
                         html_escaped(chart.figure().title));
    scrolled(fmt::format("Figure: {}", chart.figure().title), chart_svg(chart, id));
    body_ += chart_legend(chart);
    if (!caption.empty()) body_ += fmt::format("<p class=\"note\">{}</p>\n", html_escaped(caption));
    body_ += "<details><summary>The numbers of this figure</summary>\n";
    scrolled(fmt::format("Numbers: {}", chart.figure().title), chart_table(chart));
    body_ += "</details>\n</figure>\n";
    chart_data_.push_back(data_text(chart_json(chart, id)));
}

void Page::facts(const std::vector<std::pair<std::string, std::string>>& rows, std::string_view caption) {
    std::string html = fmt::format("<table class=\"facts\"><caption>{}</caption><tbody>\n", html_escaped(caption));
    for (const auto& [name, value] : rows) {
        html += fmt::format("<tr><th scope=\"row\">{}</th><td>{}</td></tr>\n", html_escaped(name), html_escaped(value));
    }
    scrolled(caption, html + "</tbody></table>\n");
}

void Page::code(std::string_view text, std::string_view name) {
    scrolled(name, fmt::format("<pre>{}</pre>\n", html_escaped_lines(text)));
}

void Page::folded_code(std::string_view summary, std::string_view text) {
    body_ += fmt::format("<details><summary>{}</summary>\n", html_escaped(summary));
    code(text, summary);
    body_ += "</details>\n";
}

std::string Page::html() const {
    const bool interactive = !assets::script.empty() && !chart_data_.empty();
    std::string policy = fmt::format("default-src 'none'; style-src {}", csp_hash(assets::style_sha256));
    if (interactive) policy += fmt::format("; script-src {}", csp_hash(assets::script_sha256));
    policy += "; base-uri 'none'; form-action 'none'";
    std::string html = fmt::format(
        "<!DOCTYPE html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n"
        "<meta http-equiv=\"Content-Security-Policy\" content=\"{}\">\n"
        "<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n"
        "<meta name=\"color-scheme\" content=\"light dark\">\n"
        "<meta name=\"generator\" content=\"ringlock {}\">\n<title>{}</title>\n<style>{}</style>\n</head>\n<body>\n",
        policy, version(), html_escaped(title_), assets::style);
    html += fmt::format("<header><p class=\"kind\">{}</p><h1>{}</h1></header>\n<main>\n{}</main>\n",
                        html_escaped(kind_), html_escaped(title_), body_);
    html += fmt::format(
        "<footer><p>Written by ringlock {} ({}). The page is complete in itself; it loads nothing.{}</p></footer>\n",
        version(), git_hash(),
        interactive ? " In a figure, drag to zoom, move the pointer to read values, click twice to see all." : "");
    if (interactive) {
        html += fmt::format("<script type=\"application/json\" id=\"figures\">[{}]</script>\n<script>{}</script>\n",
                            fmt::join(chart_data_, ",\n"), assets::script);
    }
    return html + "</body>\n</html>\n";
}

}  // namespace ringlock::report
