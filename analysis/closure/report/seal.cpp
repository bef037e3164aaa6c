#include "analysis/closure/report/seal.hpp"

#include <fmt/format.h>

#include <boost/crc.hpp>

namespace ringlock::closure {
namespace {

std::string seal_of(std::string_view text, Comment comment) {
    boost::crc_32_type sum;
    sum.process_bytes(text.data(), text.size());
    const std::string words =
        fmt::format("written by ringlock closure; CRC-32 of all above {:08x}", static_cast<unsigned>(sum.checksum()));
    return comment == Comment::toml ? fmt::format("# {}\n", words) : fmt::format("<!-- {} -->\n", words);
}

}  // namespace

std::string sealed(std::string text, Comment comment) {
    if (!text.ends_with('\n')) text += '\n';
    return text + seal_of(text, comment);
}

bool is_sealed(std::string_view text) {
    if (!text.ends_with('\n')) return false;
    const std::size_t before = text.rfind('\n', text.size() - 2);
    if (before == std::string_view::npos || text.size() < 2) return false;
    const std::string_view above = text.substr(0, before + 1);
    const std::string_view last = text.substr(before + 1);
    return last == seal_of(above, Comment::toml) || last == seal_of(above, Comment::markup);
}

}  // namespace ringlock::closure
