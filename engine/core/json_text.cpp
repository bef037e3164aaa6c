#include "engine/core/json_text.hpp"

#include "engine/core/printable.hpp"

namespace ringlock::detail {

// Outside its strings JSON has no such character, and within them \uXXXX is how JSON itself writes one. Its own dump
// has written out those below U+0020 and made the rest UTF-8; DEL alone is written in another way by
// without_controls().
std::string with_controls_escaped(const std::string& json) {
    std::string without_del;
    without_del.reserve(json.size());
    for (const char c : json) {
        if (c == 0x7f) {
            without_del += "\\u007f";
        } else {
            without_del += c;
        }
    }
    return without_controls(without_del);
}

}  // namespace ringlock::detail
