#include "analysis/text/source/lines.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>

#include "engine/core/error.hpp"

namespace ringlock::text {
namespace {

constexpr std::size_t first_buffer_bytes = std::size_t{1} << 13;
constexpr std::size_t buffer_bytes = std::size_t{1} << 18;
constexpr std::size_t longest_line = std::size_t{1} << 22;

}  // namespace

Lines::Lines(std::unique_ptr<Source> from, std::string name)
    : from_(std::move(from)), name_(std::move(name)), buffer_(first_buffer_bytes) {}

void Lines::refuse_zeros(std::size_t from, std::size_t count) {
    const void* zero = std::memchr(buffer_.data() + from, '\0', count);
    if (zero == nullptr) return;
    const auto before = static_cast<std::size_t>(static_cast<const char*>(zero) - (buffer_.data() + begin_));
    const std::string_view text(buffer_.data() + begin_, before);
    const auto line = number_ + 1 + static_cast<std::size_t>(std::count(text.begin(), text.end(), end_of_line_));
    throw InputError(
        fmt::format("{}:{}: holds a zero byte: the file is binary, or damaged (where a disk was full, say); "
                    "text, HDF5 and packed text are read",
                    name_, line));
}

void Lines::make_room() {
    if (filled_ == buffer_.size() && buffer_.size() >= longest_line) {
        throw InputError(fmt::format("{}:{}: a line is longer than {} bytes; is this a text file?", name_, number_ + 1,
                                     longest_line));
    }
    // A large buffer costs more than reading a small file: it comes with the bytes that the file turns out to have.
    if (buffer_.size() < buffer_bytes && read_ >= buffer_.size() / 2) {
        buffer_.resize(std::min(8 * buffer_.size(), buffer_bytes));
    } else if (filled_ == buffer_.size()) {
        buffer_.resize(2 * buffer_.size());
    }
}

bool Lines::refill() {
    std::memmove(buffer_.data(), buffer_.data() + begin_, filled_ - begin_);
    filled_ -= begin_;
    begin_ = 0;
    make_room();
    const std::size_t got = from_->read(buffer_.data() + filled_, buffer_.size() - filled_);
    if (read_ == 0 && got > 0) {
        const std::string_view text(buffer_.data(), got);
        if (text.find('\n') == std::string_view::npos && text.find('\r') != std::string_view::npos) end_of_line_ = '\r';
    }
    refuse_zeros(filled_, got);
    filled_ += got;
    read_ += got;
    return got > 0;
}

bool Lines::next(std::string_view& line) {
    std::size_t searched = 0;
    for (;;) {
        const char* const start = buffer_.data() + begin_;
        const void* const found = std::memchr(start + searched, end_of_line_, filled_ - begin_ - searched);
        if (found != nullptr) {
            const auto length = static_cast<std::size_t>(static_cast<const char*>(found) - start);
            line = {start, length};
            begin_ += length + 1;
            ++number_;
            return true;
        }
        searched = filled_ - begin_;
        if (!at_end_ && refill()) continue;
        at_end_ = true;
        if (begin_ == filled_) return false;
        line = {buffer_.data() + begin_, filled_ - begin_};
        begin_ = filled_;
        ++number_;
        return true;
    }
}

}  // namespace ringlock::text
