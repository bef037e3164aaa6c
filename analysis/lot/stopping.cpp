#include "analysis/lot/stopping.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <string>
#include <vector>

#include "analysis/lot/mean.hpp"
#include "analysis/lot/share.hpp"
#include "engine/core/error.hpp"

namespace ringlock::lot {
namespace {

/// Most figures that a sentence names.
constexpr std::size_t most_named = 4;

/// Lists the figures that met their precision, or those that did not: the ones with the largest ratio of reached to
/// wanted half width come first.
std::string list_of(const std::vector<Reached>& figures, bool met) {
    std::vector<const Reached*> listed;
    for (const Reached& f : figures) {
        if (f.met == met) listed.push_back(&f);
    }
    const auto share = [](const Reached* f) {
        return f->reached ? *f->reached / f->wanted : std::numeric_limits<double>::infinity();
    };
    const std::size_t named = std::min(listed.size(), most_named);
    if (named < listed.size()) {
        std::stable_sort(listed.begin(), listed.end(),
                         [&](const Reached* a, const Reached* b) { return share(a) > share(b); });
    }
    std::string text;
    for (std::size_t i = 0; i < named; ++i) {
        const Reached& f = *listed[i];
        const std::string reached =
            f.reached ? fmt::format("+-{:.3g} of +-{:.3g}", *f.reached, f.wanted) : "no interval yet";
        text += fmt::format("{}{} ({})", text.empty() ? "" : ", ", f.name, reached);
    }
    if (named < listed.size()) text += fmt::format(" and {} more", listed.size() - named);
    return text;
}

}  // namespace

std::optional<std::int64_t> next_look(std::int64_t n, std::int64_t most) {
    if (n < 0) throw InputError(fmt::format("{} gyros before a look: a lot has 0 gyros or more", n));
    if (most < 1) throw InputError(fmt::format("a lot of at most {} gyros: must be 1 or more", most));
    if (n >= most) return std::nullopt;
    std::int64_t look = first_look;
    while (look <= n && look <= most / 2) look *= 2;
    return look > n ? std::min(look, most) : most;
}

StoppingRule::StoppingRule(const Precision& precision, std::int64_t most_gyros, double level)
    : precision_(precision), most_gyros_(most_gyros), level_(level) {
    const std::optional<double> arw = precision.arw_relative;
    if (arw && !(*arw > 0.0 && std::isfinite(*arw))) {
        throw InputError(
            fmt::format("precision {} of the random walk: a relative half width is positive; 0.05 is 5 %", *arw));
    }
    const std::optional<double> yield = precision.yield_absolute;
    if (yield && !(*yield > 0.0 && *yield < 0.5)) {
        throw InputError(fmt::format(
            "precision {} of a yield: a half width lies between 0 and 0.5, without them; 0.02 is +-2 % of the gyros",
            *yield));
    }
    if (most_gyros < 1) {
        throw InputError(fmt::format("a lot of at most {} gyros: must be 1 or more", most_gyros));
    }
    check(confidence());
}

Confidence StoppingRule::confidence() const {
    const bool asked = precision_.arw_relative || precision_.yield_absolute;
    return {.level = level_, .sampling = asked ? Sampling::until_precise : Sampling::fixed};
}

std::optional<std::int64_t> StoppingRule::next(std::int64_t gyros) const {
    const std::optional<std::int64_t> look = next_look(gyros, most_gyros_);
    if (look && confidence().sampling == Sampling::fixed) return most_gyros_;
    return look;
}

Decision StoppingRule::decide(std::int64_t gyros, std::span<const ArwColumn> arws,
                              std::span<const YieldCount> yields) const {
    if (gyros < 1 || next(gyros - 1) != gyros) {
        throw InputError(
            fmt::format("a stopping rule asked at {} gyros: it may look at 16, 32, 64, ... and at {}, the most, only; "
                        "otherwise its intervals do not have their confidence level",
                        gyros, most_gyros_));
    }
    if (precision_.arw_relative && arws.empty()) {
        throw InputError("arw_relative is asked for, but no arm's random walk is given to judge it by");
    }
    if (precision_.yield_absolute && yields.empty()) {
        throw InputError("yield_absolute is asked for, but no yield is given to judge it by");
    }
    Decision d;
    for (const ArwColumn& column : arws) {
        if (column.values.size() != static_cast<std::size_t>(gyros)) {
            throw InputError(fmt::format("{} random walks of {} in a lot of {} gyros: one each, NaN for none",
                                         column.values.size(), column.name, gyros));
        }
        if (!precision_.arw_relative) continue;
        const GeometricMean g = geometric_mean(column.values, confidence());
        // Few values can agree by chance: those that stopped a lot would hold the truth least often.
        const bool enough = g.n >= std::min(first_look, most_gyros_);
        const bool met = enough && g.relative_half_width && *g.relative_half_width <= *precision_.arw_relative;
        d.figures.push_back({"random walk of " + column.name, *precision_.arw_relative, g.relative_half_width, met});
    }
    for (const YieldCount& yield : yields) {
        const Share s = share(yield.k, gyros, confidence());
        if (!precision_.yield_absolute) continue;
        const bool met = *s.half_width() <= *precision_.yield_absolute;
        d.figures.push_back({yield.name, *precision_.yield_absolute, s.half_width(), met});
    }
    d.precise = !d.figures.empty() && std::ranges::all_of(d.figures, &Reached::met);
    d.stop = d.precise || gyros >= most_gyros_;
    if (!d.stop) d.next = next(gyros);
    if (d.figures.empty()) {
        d.why = fmt::format("{} gyros, as many as were asked for", gyros);
    } else if (d.precise) {
        d.why = fmt::format("precise enough with {} gyros: {}", gyros, list_of(d.figures, true));
    } else if (d.stop) {
        d.why =
            fmt::format("stopped at the most gyros, {}, not precise enough yet: {}", gyros, list_of(d.figures, false));
    } else {
        d.why =
            fmt::format("{} gyros are not precise enough, {} are next: {}", gyros, *d.next, list_of(d.figures, false));
    }
    return d;
}

}  // namespace ringlock::lot
