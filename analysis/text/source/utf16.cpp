#include "analysis/text/source/utf16.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <cstring>

#include "engine/core/error.hpp"

namespace ringlock::text {
namespace {

using namespace std::string_view_literals;

class WithoutMark final : public Source {
   public:
    explicit WithoutMark(std::unique_ptr<Source> from) : from_(std::move(from), mark_bytes) {}

    std::size_t read(char* to, std::size_t size) override {
        if (!passed_) {
            std::array<char, mark_bytes> mark{};
            from_.read(mark.data(), mark.size());
            passed_ = true;
        }
        return from_.read(to, size);
    }

   private:
    static constexpr std::size_t mark_bytes = 3;
    Peeked from_;
    bool passed_ = false;
};

class Utf16 final : public Source {
   public:
    Utf16(std::unique_ptr<Source> from, bool big, std::string name)
        : from_(std::move(from)), big_(big), name_(std::move(name)) {}

    std::size_t read(char* to, std::size_t size) override {
        while (given_ == out_.size()) {
            if (!fill()) return 0;
        }
        const std::size_t count = std::min(size, out_.size() - given_);
        std::memcpy(to, out_.data() + given_, count);
        given_ += count;
        return count;
    }

   private:
    [[noreturn]] void fail(const char* why) const {
        throw InputError(fmt::format("{}: is text in UTF-16 that is damaged at character {}: {}; save it as UTF-8",
                                     name_, units_, why));
    }

    /// False at the end.
    bool fill() {
        out_.clear();
        given_ = 0;
        std::array<char, 1 << 14> bytes{};
        bytes[0] = odd_;
        const std::size_t kept = has_odd_ ? 1 : 0;
        const std::size_t got = from_->read(bytes.data() + kept, bytes.size() - kept);
        if (got == 0) {
            if (has_odd_) fail("it ends within a character");
            if (high_ != 0) fail("half of a surrogate pair");
            return false;
        }
        const std::size_t count = kept + got;
        for (std::size_t i = 0; i + 1 < count; i += 2) {
            const auto first = static_cast<unsigned char>(bytes[i]);
            const auto second = static_cast<unsigned char>(bytes[i + 1]);
            take(static_cast<std::uint32_t>(big_ ? first * 256 + second : second * 256 + first));
        }
        has_odd_ = count % 2 == 1;
        if (has_odd_) odd_ = bytes[count - 1];
        return true;
    }

    void take(std::uint32_t unit) {
        ++units_;
        const bool low = unit >= 0xdc00 && unit < 0xe000;
        if (low != (high_ != 0)) fail("half of a surrogate pair");
        if (units_ == 1 && unit == 0xfeff) return;
        if (unit >= 0xd800 && unit < 0xdc00) {
            high_ = unit;
            return;
        }
        put(low ? 0x10000 + ((high_ - 0xd800) << 10) + (unit - 0xdc00) : unit);
        high_ = 0;
    }

    void put(std::uint32_t c) {
        const auto add = [this](std::uint32_t byte) { out_ += static_cast<char>(byte); };
        if (c < 0x80) return add(c);
        if (c < 0x800) {
            add(0xc0 | (c >> 6));
        } else {
            if (c < 0x10000) {
                add(0xe0 | (c >> 12));
            } else {
                add(0xf0 | (c >> 18));
                add(0x80 | ((c >> 12) & 0x3f));
            }
            add(0x80 | ((c >> 6) & 0x3f));
        }
        add(0x80 | (c & 0x3f));
    }

    std::unique_ptr<Source> from_;
    bool big_;
    std::string name_;
    std::string out_;
    std::size_t given_ = 0;
    std::size_t units_ = 0;
    std::uint32_t high_ = 0;
    bool has_odd_ = false;
    char odd_ = '\0';
};

}  // namespace

Encoding encoding_of(std::string_view first) {
    if (first.starts_with("\xef\xbb\xbf"sv)) return Encoding::marked;
    if (first.starts_with("\xff\xfe"sv)) return Encoding::utf16_le;
    if (first.starts_with("\xfe\xff"sv)) return Encoding::utf16_be;
    std::array<std::size_t, 2> zeros{};
    for (std::size_t i = 0; i < first.size(); ++i) zeros[i % 2] += first[i] == '\0' ? 1 : 0;
    // Numbers and names are nearly all ASCII, whose other byte is zero.
    const std::size_t most = first.size() / 2 - first.size() / 16;
    if (first.size() < 4) return Encoding::bytes;
    if (zeros[0] == 0 && zeros[1] >= most) return Encoding::utf16_le;
    if (zeros[1] == 0 && zeros[0] >= most) return Encoding::utf16_be;
    return Encoding::bytes;
}

std::unique_ptr<Source> decode(std::unique_ptr<Source> from, Encoding encoding, const std::string& name) {
    if (encoding == Encoding::marked) return std::make_unique<WithoutMark>(std::move(from));
    return std::make_unique<Utf16>(std::move(from), encoding == Encoding::utf16_be, name);
}

}  // namespace ringlock::text
