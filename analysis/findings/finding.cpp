#include "analysis/findings/finding.hpp"

#include <algorithm>
#include <array>
#include <numeric>

#include "analysis/findings/words.hpp"

namespace ringlock::findings {

const char* name_of(Kind kind) {
    switch (kind) {
        case Kind::outlier:
            return "outlier";
        case Kind::jump:
            return "jump";
        case Kind::variance:
            return "variance";
        case Kind::wrap:
            return "wrap";
        case Kind::repeated:
            return "repeated";
        case Kind::clipped:
            return "clipped";
        case Kind::gap:
            break;
    }
    return "gap";
}

std::vector<std::size_t> listed(std::span<const Finding> found) {
    std::vector<std::size_t> places(found.size());
    std::iota(places.begin(), places.end(), std::size_t{0});
    std::stable_partition(places.begin(), places.end(), [&](std::size_t i) { return found[i].kind != Kind::gap; });
    return places;
}

std::string estimated_without(std::span<const Finding> found) {
    struct Named {
        Kind kind;
        const char* plural;
    };
    constexpr std::array<Named, 4> named = {{{Kind::outlier, "outliers"},
                                             {Kind::jump, "jumps"},
                                             {Kind::wrap, "wraps"},
                                             {Kind::repeated, "repeated values"}}};
    std::vector<std::string> names;
    for (const Named& of : named) {
        if (std::any_of(found.begin(), found.end(), [&](const Finding& f) { return f.kind == of.kind; })) {
            names.emplace_back(of.plural);
        }
    }
    return in_words(names);
}

}  // namespace ringlock::findings
