#include "analysis/closure/report/chain_report.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

namespace ringlock::closure {

namespace {

using nlohmann::json;

json finite_json(double value) { return std::isfinite(value) ? json(value) : json(nullptr); }
json finite_json(const std::optional<double>& value) { return value ? finite_json(*value) : json(nullptr); }

/// A rate has a standard error only where no other rate explains as much.
json rate_estimate_json(const std::optional<RateEstimate>& rate, bool tied) {
    if (!rate) return nullptr;
    return {{"value", finite_json(rate->hz)}, {"std", tied ? json(nullptr) : finite_json(rate->sd_hz)}};
}

std::string hz_list(const std::vector<double>& hz) {
    std::string list;
    for (const double one : hz) list += fmt::format("{}{:.8g}", list.empty() ? "" : ", ", one);
    return list;
}

}  // namespace

nlohmann::json to_json(const Chain& chain) {
    json object;
    object["effect"] = chain.effect == nullptr ? json(nullptr) : json(chain.effect->name());
    object["record_rate_hz"] = finite_json(chain.record_rate_hz);
    object["contradicted"] = chain.contradicted();
    object["from_hz"] = rate_estimate_json(chain.shared, !chain.tied_hz().empty());
    object["tied_hz"] = chain.tied_hz();
    object["agreement"] = nullptr;
    if (chain.freedom > 0) {
        object["agreement"] = {
            {"chi2", finite_json(chain.chi2)}, {"freedom", chain.freedom}, {"p_value", finite_json(chain.p_value)}};
    }
    object["rates"] = json::array();
    for (const ChainRate& rate : chain.rates) {
        json of_records = json::array();
        for (const double value : rate.log_likelihood) of_records.push_back(finite_json(value));
        object["rates"].push_back({{"hz", finite_json(rate.hz)},
                                   {"sum", finite_json(rate.sum)},
                                   {"log_likelihood", std::move(of_records)},
                                   {"tied", rate.tied}});
    }
    object["records"] = json::array();
    for (const ChainRecord& record : chain.records) {
        json alone = nullptr;
        if (record.alone_hz) alone = {{"hz", finite_json(*record.alone_hz)}, {"tied_hz", record.alone_other_hz}};
        json one = {{"record", record.name}, {"alone", std::move(alone)}};
        if (chain.effect != nullptr) {
            one["near_shared"] = rate_estimate_json(record.near_shared, false);
            one["gain_of_shared"] = finite_json(record.gain_of_shared);
            one["gain_alone"] = finite_json(record.gain_alone);
            one["likeliest_hz"] = finite_json(record.likeliest_hz);
            one["p_alone"] = finite_json(record.p_alone);
            one["contradicts"] = record.contradicts;
        }
        object["records"].push_back(std::move(one));
    }
    return object;
}

std::string verdict_sentence(const Chain& chain) {
    const std::size_t count = chain.records.size();
    if (chain.effect == nullptr) {
        return fmt::format("data chain of {} records: none of them shows a source of another rate than {:.8g} Hz",
                           count, chain.record_rate_hz);
    }
    if (!chain.shared && !chain.contradicted()) {
        return fmt::format(
            "data chain of {} records: none of them gives the rate of the source with a standard error; "
            "each report is that of its record alone",
            count);
    }
    if (!chain.shared) {
        return fmt::format(
            "data chain of {} records: they contradict each other, because no single source explains all of them; "
            "each report is that of its record alone",
            count);
    }
    const auto showing = std::count_if(chain.records.begin(), chain.records.end(),
                                       [](const ChainRecord& record) { return record.near_shared.has_value(); });
    const std::string seen = static_cast<std::size_t>(showing) == count
                                 ? std::string("which all of them show")
                                 : fmt::format("which {} of them show{}", showing, showing == 1 ? "s" : "");
    const std::vector<double> tied = chain.tied_hz();
    if (tied.empty()) {
        return fmt::format("data chain of {} records: one source of {:.10g} +- {:.2g} Hz, {}", count, chain.shared->hz,
                           chain.shared->sd_hz, seen);
    }
    return fmt::format(
        "data chain of {} records: one source, most likely of {:.10g} Hz, {}; "
        "tied with {} Hz (the records support these rates equally well)",
        count, chain.shared->hz, seen, hz_list(tied));
}

std::vector<std::string> contradictions(const Chain& chain) {
    std::vector<std::string> all;
    if (chain.rates.empty()) return all;
    const double hz = chain.rates.front().hz;
    for (const ChainRecord& record : chain.records) {
        if (!record.contradicts) continue;
        const std::string other = record.likeliest_hz ? fmt::format("a source of {:.8g} Hz", *record.likeliest_hz)
                                                      : std::string("no source at all");
        all.push_back(
            fmt::format("{}: {} is more likely than the {:.8g} Hz that all records together favour, "
                        "by {:.1f} in the log-likelihood (by chance: p {})",
                        record.name, other, hz, record.gain_alone, probability(record.p_alone)));
    }
    if (chain.contradicted() && all.empty()) {
        all.push_back(
            fmt::format("the records' own rates near {:.8g} Hz differ by more than their standard errors: "
                        "chi-squared {:.4g} of {} degrees of freedom, by chance p {}",
                        hz, chain.chi2, chain.freedom, probability(chain.p_value)));
    }
    return all;
}

std::string to_text(const Chain& chain) {
    std::string text = verdict_sentence(chain) + "\n";
    if (chain.effect == nullptr) return text;
    for (const std::string& line : contradictions(chain)) text += "  " + line + "\n";
    if (chain.shared && chain.freedom > 0) {
        text += fmt::format("  the records' own rates agree: chi-squared {:.3g} of {} degrees of freedom, p {}\n",
                            chain.chi2, chain.freedom, probability(chain.p_value));
    }
    std::size_t width = std::string_view("record").size();
    for (const ChainRecord& record : chain.records) width = std::max(width, record.name.size());
    text +=
        "\ngains of the log-likelihood: of the likeliest rate of all records over no source, "
        "and of the best explanation of each record by itself over that rate\n";
    text += fmt::format("{:<{}}  {:>12}  {:>28}  {:>14}  {:>10}\n", "record", width, "alone [Hz]",
                        "near the shared one [Hz]", "over no source", "of its own");
    for (const ChainRecord& record : chain.records) {
        const std::string alone = record.alone_hz ? fmt::format("{:.8g}", *record.alone_hz) : "none";
        const std::string near =
            record.near_shared ? fmt::format("{:.10g} +- {:.2g}", record.near_shared->hz, record.near_shared->sd_hz)
                               : "not seen";
        text += fmt::format("{:<{}}  {:>12}  {:>28}  {:>+14.1f}  {:>+10.1f}\n", record.name, width, alone, near,
                            record.gain_of_shared, record.gain_alone);
    }
    text += "\nlog-likelihood by the rate of the source, sum of all records (each record):\n";
    for (const ChainRate& rate : chain.rates) {
        std::string of_records;
        for (const double value : rate.log_likelihood) {
            of_records += fmt::format("{}{:.1f}", of_records.empty() ? "" : ", ", value);
        }
        text += fmt::format("  {:>12.8g} Hz  {:>12.1f}  ({}){}\n", rate.hz, rate.sum, of_records,
                            rate.tied ? "  as likely" : "");
    }
    return text;
}

}  // namespace ringlock::closure
