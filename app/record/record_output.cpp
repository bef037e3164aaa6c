#include "app/record/record_output.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <string_view>
#include <vector>

#include "app/output.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {
namespace {

std::string_view kind_text(record::SampleKind kind) {
    switch (kind) {
        case record::SampleKind::angle_increment_arcsec:
            return "angle increments";
        case record::SampleKind::angle_arcsec:
            return "angles";
        case record::SampleKind::quarter_count:
            break;
    }
    return "counts of quarter fringes";
}

}  // namespace

std::string record_text(const record::Record& record) {
    std::vector<std::string> parts;
    if (record.turns) {
        const record::Turns& turns = *record.turns;
        parts.push_back(
            fmt::format("{} turns over {:.6g} s", turns.size(), turns.time_s.back() - turns.time_s.front()));
    }
    if (record.samples) {
        const record::Samples& samples = *record.samples;
        std::string text = fmt::format("{} {} at {:g} Hz, {:.6g} s", samples.size(), kind_text(samples.kind),
                                       samples.rate_hz, static_cast<double>(samples.size()) / samples.rate_hz);
        std::vector<std::string> names;
        for (const auto& witness : samples.witnesses) names.push_back(witness.first);
        if (!names.empty()) text += fmt::format(" with {}", fmt::join(names, ", "));
        const auto missing =
            std::count_if(samples.values.begin(), samples.values.end(), [](double v) { return std::isnan(v); });
        if (missing > 0) text += fmt::format(", {} of them missing", missing);
        parts.push_back(text);
    }
    if (!record.temperature_c.empty()) parts.emplace_back("a temperature");
    if (!record.input_rate_deg_h.empty()) parts.emplace_back("a reference of the input rate");
    return fmt::format("{}", fmt::join(parts, "; "));
}

void tell_warnings(const std::string& path, const record::Record& record) {
    for (const record::Finding& finding : record::check(record)) {
        if (finding.severity != record::Severity::warning) continue;
        tell(fmt::format("ringlock: warning: {}: {}: {}\n", printable(path), printable(finding.where), finding.what));
    }
}

}  // namespace ringlock::app
