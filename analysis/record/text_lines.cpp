#include "analysis/record/text_lines.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <charconv>
#include <cstring>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/core/waiting.hpp"

namespace ringlock::record {

bool is_space(char c) { return c == ' ' || c == '\t' || c == '\r' || c == '\v' || c == '\f'; }

std::string_view trimmed(std::string_view s) {
    while (!s.empty() && is_space(s.front())) s.remove_prefix(1);
    while (!s.empty() && is_space(s.back())) s.remove_suffix(1);
    return s;
}

bool Fields::next(std::string_view& field) {
    if (done_) return false;
    if (commas_) {
        const std::size_t comma = rest_.find(',');
        field = trimmed(rest_.substr(0, comma));
        done_ = comma == std::string_view::npos;
        if (!done_) rest_.remove_prefix(comma + 1);
        return true;
    }
    while (!rest_.empty() && is_space(rest_.front())) rest_.remove_prefix(1);
    if (rest_.empty()) return false;
    std::size_t end = 0;
    while (end < rest_.size() && !is_space(rest_[end])) ++end;
    field = rest_.substr(0, end);
    rest_.remove_prefix(end);
    return true;
}

namespace {

template <class Number>
std::errc parse_whole_field(std::string_view field, Number& value) {
    if (field.size() > 1 && field.front() == '+' && field[1] != '-') field.remove_prefix(1);
    const auto [end, error] = std::from_chars(field.data(), field.data() + field.size(), value);
    return end == field.data() + field.size() ? error : std::errc::invalid_argument;
}

}  // namespace

bool parse_number(std::string_view field, double& value) { return parse_whole_field(field, value) == std::errc(); }

std::errc parse_whole_number(std::string_view field, std::int64_t& value) { return parse_whole_field(field, value); }

std::string shown(std::string_view text) {
    constexpr std::size_t longest = 60;
    std::string out;
    for (const char c : text.substr(0, longest)) {
        out += static_cast<unsigned char>(c) < 0x20 || c == 0x7f ? '?' : c;
    }
    return out + (text.size() > longest ? "..." : "");
}

std::string name_of_file(const std::string& path) { return path == standard_input ? "standard input" : path; }

void for_each_line(const std::string& given_path, const std::function<void(std::string_view)>& line) {
    const bool standard = given_path == standard_input;
    const std::string path = name_of_file(given_path);
    const Descriptor file = standard ? Descriptor() : open_to_read(path);
    if (!standard && !file.valid()) {
        throw InputError(fmt::format("{}: cannot be opened: {}", path, std::strerror(errno)));
    }
    const int descriptor = standard ? STDIN_FILENO : file.get();
    constexpr std::size_t longest_line = std::size_t{1} << 22;
    std::vector<char> buffer(std::size_t{1} << 18);
    std::size_t filled = 0;
    for (;;) {
        const ssize_t got = read_some(descriptor, buffer.data() + filled, buffer.size() - filled);
        if (got < 0) throw InputError(fmt::format("{}: cannot be read: {}", path, std::strerror(errno)));
        if (got == 0) {
            if (filled > 0) line({buffer.data(), filled});
            break;
        }
        filled += static_cast<std::size_t>(got);
        std::size_t begin = 0;
        while (const void* found = std::memchr(buffer.data() + begin, '\n', filled - begin)) {
            const auto end = static_cast<std::size_t>(static_cast<const char*>(found) - buffer.data());
            line({buffer.data() + begin, end - begin});
            begin = end + 1;
        }
        std::memmove(buffer.data(), buffer.data() + begin, filled - begin);
        filled -= begin;
        if (filled == buffer.size()) {
            if (buffer.size() >= longest_line) {
                throw InputError(
                    fmt::format("{}: a line is longer than {} bytes; is this a text file?", path, longest_line));
            }
            buffer.resize(2 * buffer.size());
        }
    }
}

}  // namespace ringlock::record
