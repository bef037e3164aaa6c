#include "analysis/report/chain_page.hpp"

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "analysis/closure/report/chain_report.hpp"
#include "analysis/closure/report/folder.hpp"
#include "analysis/closure/report/report.hpp"
#include "analysis/closure/report/seal.hpp"
#include "engine/core/atomic_path.hpp"
#include "engine/core/json_text.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::report {

namespace {

/// The text escaped for a cell of a table, or for a link.
std::string escaped(std::string_view text) {
    std::string out;
    for (const char c : text) {
        if (c == '|' || c == '[' || c == ']') out += '\\';
        out += c == '\n' ? ' ' : c;
    }
    return out;
}

/// The name of a folder as part of an address: by RFC 3986 all but the unreserved characters as %XX.
std::string in_address(std::string_view name) {
    constexpr std::string_view unreserved = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789-._~";
    std::string out;
    for (const char c : name) {
        if (unreserved.find(c) != std::string_view::npos) {
            out += c;
        } else {
            out += fmt::format("%{:02X}", static_cast<unsigned char>(c));
        }
    }
    return out;
}

void add_chain_rates(const closure::Chain& chain, std::string& page) {
    page +=
        "## The source in each record\n\nThe gains are gains of the log-likelihood: that of the likeliest rate "
        "of all records over no source, and that of the best\nexplanation of the record by itself over that rate.\n\n";
    page +=
        "| record | rate found alone [Hz] | own rate near the shared one [Hz] | gain over no source | gain "
        "of its own |\n|---|---|---|---|---|\n";
    for (const closure::ChainRecord& record : chain.records) {
        const std::string alone = record.alone_hz ? fmt::format("{:.8g}", *record.alone_hz) : "none";
        const std::string near =
            record.near_shared ? fmt::format("{:.10g} ± {:.2g}", record.near_shared->hz, record.near_shared->sd_hz)
                               : "not seen";
        page += fmt::format("| {} | {} | {} | {:.1f} | {:.1f} |\n", markdown(record.name), alone, near,
                            record.gain_of_shared, record.gain_alone);
    }
    if (chain.freedom > 0) {
        page += fmt::format(
            "\nThe records' own rates differ from their mean by a chi-squared of {:.3g} of {} degrees of freedom, "
            "by chance p {}.\n",
            chain.chi2, chain.freedom, closure::probability(chain.p_value));
    }
    page +=
        "\n## Rates of the source\n\nSamples taken at any of these rates leave the same pattern in the records. "
        "The sum is the log-likelihood of all records minus that\nof the likeliest rate. A rate is tied "
        "with the likeliest rate if the sum is above -4, or if the rate is above twice that of the record.\n"
        "\n| rate [Hz] | sum | of each record | distinguished |\n|---|---|---|---|\n";
    for (const closure::ChainRate& rate : chain.rates) {
        std::string of_records;
        for (const double value : rate.log_likelihood) {
            of_records += fmt::format("{}{:.1f}", of_records.empty() ? "" : ", ", value);
        }
        const bool likeliest = &rate == &chain.rates.front();
        page += fmt::format("| {:.8g} | {:.1f} | {} | {} |\n", rate.hz, rate.sum, of_records,
                            likeliest   ? ""
                            : rate.tied ? "no"
                                        : "yes");
    }
    page += "\n";
}

}  // namespace

void write_chain_page(const std::filesystem::path& folder, const closure::Chain& chain,
                      const std::vector<std::string>& folders, const nlohmann::json& object) {
    closure::check_chain_folder(folder);  // again: the computation may have taken hours
    std::string page = fmt::format("# Error sources in {} records of one data chain\n\n**{}.**\n\n",
                                   chain.records.size(), closure::verdict_sentence(chain));
    const std::vector<std::string> against = closure::contradictions(chain);
    for (const std::string& line : against) page += fmt::format("- {}\n", escaped(line));
    if (!against.empty()) page += "\n";
    if (chain.effect != nullptr) add_chain_rates(chain, page);
    page += "## The records\n\n";
    for (std::size_t r = 0; r < chain.records.size(); ++r) {
        page += fmt::format("- [{}](<{}/report.md>): {}\n", markdown(chain.records[r].name), in_address(folders[r]),
                            escaped(closure::verdict_sentence(chain.records[r].closure)));
    }
    page += "\n`closure.json` has this page and those of the records for programs.\n";
    write_text(folder / "closure.json", json_text(object, 2) + "\n");
    write_text(folder / "report.md", closure::sealed(page, closure::Comment::markup));
}

}  // namespace ringlock::report
