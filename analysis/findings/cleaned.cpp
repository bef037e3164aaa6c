#include "analysis/findings/cleaned.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "analysis/findings/words.hpp"

namespace ringlock::findings {

Cleaned clean(std::span<const Finding> findings, allan::Kind kind, double tau0_s, std::span<double> values) {
    Cleaned out;
    const auto rows_from = [&](const Finding& found) { return values.subspan(std::min(found.row, values.size())); };
    const auto leave_out = [&](std::span<double> rows, std::size_t length) {
        for (double& value : rows.first(std::min(length, rows.size()))) {
            out.left_out += std::isnan(value) ? 0 : 1;
            value = std::numeric_limits<double>::quiet_NaN();
        }
    };
    for (const Finding& found : findings) {
        switch (found.kind) {
            case Kind::outlier:
                if (found.row >= values.size()) break;
                values[found.row] -= found.size;
                ++out.corrected;
                break;
            case Kind::jump: {
                // The first rate behind the jump leads to the datum of its row.
                const bool grows = kind == allan::Kind::phase && !found.of_angle;
                const bool one = kind != allan::Kind::phase && found.of_angle;
                double gone = grows ? 0.0 : found.size;
                for (double& value : rows_from(found)) {
                    if (grows) gone += found.size * tau0_s;
                    value -= gone;
                    if (one) break;
                }
                ++out.jumps;
                break;
            }
            case Kind::variance:
                leave_out(rows_from(found), found.length);
                break;
            case Kind::repeated:
                // The first one is a value of its own.
                if (found.length > 1) leave_out(rows_from(found).subspan(1), found.length - 1);
                break;
            case Kind::wrap:
            case Kind::clipped:
            case Kind::gap:
                break;
        }
    }
    return out;
}

std::string data_of(const Cleaned& cleaned) {
    std::vector<std::string> parts;
    const auto add = [&](std::size_t count, const char* one, const char* many) {
        if (count > 0) parts.push_back(fmt::format("{} {}", count, count == 1 ? one : many));
    };
    add(cleaned.corrected, "outlier", "outliers");
    add(cleaned.jumps, "jump", "jumps");
    constexpr const char* left_out = "data of disturbed stretches or of runs of one value";
    add(cleaned.left_out, left_out, left_out);
    return parts.empty() ? "all data" : fmt::format("the data without {}", in_words(parts));
}

}  // namespace ringlock::findings
