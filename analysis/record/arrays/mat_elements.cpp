#include "analysis/record/arrays/mat_elements.hpp"

#include <fmt/format.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <new>
#include <string_view>
#include <system_error>
#include <utility>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/waiting.hpp"

// The format is that of "MAT-File Format" (The MathWorks): behind a head of 128 bytes elements of a type, a length and
// so many bytes; a matrix is made of elements for its class, sides, name and numbers, each padded to 8 bytes. A packed
// element holds another one as a stream of zlib (RFC 1950).
namespace ringlock::record {
namespace {

constexpr std::uint64_t mat_head_bytes = 128;
constexpr std::uint32_t matrix_type = 14;
constexpr std::uint32_t packed_type = 15;
/// The greatest ratio of deflate (RFC 1951): 258 bytes from two bits.
constexpr std::uint64_t deflate_ratio = 1032;

/// An element: its content is [begin, begin + bytes).
struct MatTag {
    std::uint32_t type = 0;
    std::uint64_t begin = 0;
    std::uint64_t bytes = 0;
    std::uint64_t next = 0;  ///< where the one behind it begins, in a matrix
};

/// MatElements in the file itself, or in what is unpacked of one of them.
class MatElements {
   public:
    MatElements(const std::string& path, bool swapped) : path_(path), swapped_(swapped) {}
    virtual ~MatElements() = default;
    MatElements(const MatElements&) = delete;
    MatElements& operator=(const MatElements&) = delete;

    MatTag tag_at(std::uint64_t at, std::uint64_t end) const {
        if (at + 8 > end) fail_cut();
        MatTag tag{word_at(at), at + 8, 0, 0};
        if (tag.type >> 16U != 0) {  // a short one: type, length and up to four bytes in eight
            tag.bytes = tag.type >> 16U;
            tag.type &= 0xffffU;
            tag.begin = at + 4;
            tag.next = at + 8;
        } else {
            tag.bytes = word_at(at + 4);
            tag.next = tag.begin + (tag.bytes + 7) / 8 * 8;
        }
        if (tag.begin + tag.bytes > end) fail_cut();
        return tag;
    }

    /// Whether it has as many numbers as its sides say.
    void check_matrix(const MatTag& whole) const {
        const std::uint64_t end = whole.begin + whole.bytes;
        if (whole.bytes == 0) return;
        const MatTag flags = tag_at(whole.begin, end);
        const std::uint32_t of = word_at(flags.begin) & 0xffU;
        constexpr std::uint32_t first_number = 6;  // classes of doubles to 64-bit integers
        constexpr std::uint32_t last_number = 15;
        if (of < first_number || of > last_number) return;
        const MatTag sides = tag_at(flags.next, end);
        double values = 1.0;
        for (std::uint64_t at = sides.begin; at + 4 <= sides.begin + sides.bytes; at += 4) values *= word_at(at);
        const MatTag name = tag_at(sides.next, end);
        if (values == 0.0) return;
        const MatTag numbers = tag_at(name.next, end);
        constexpr std::array<double, 14> size_of = {0, 1, 1, 2, 2, 4, 4, 4, 0, 8, 0, 0, 8, 8};  // by type
        const double each = numbers.type < size_of.size() ? size_of[numbers.type] : 0.0;
        if (each == 0.0 || values * each > static_cast<double>(numbers.bytes)) fail_cut();
    }

   protected:
    [[noreturn]] void fail_cut() const {
        throw InputError(
            fmt::format("{}: is cut off or damaged: it ends within one of its variables", printable(path_)));
    }
    /// False where they are not all there.
    virtual bool read(std::uint64_t at, std::array<unsigned char, 4>& into) const = 0;
    const std::string& path() const { return path_; }
    bool is_swapped() const { return swapped_; }

   private:
    std::uint32_t word_at(std::uint64_t at) const {
        std::array<unsigned char, 4> bytes{};
        if (!read(at, bytes)) fail_cut();
        std::uint32_t word = 0;
        for (std::size_t i = 0; i < 4; ++i) word |= std::uint32_t{bytes[swapped_ ? 3 - i : i]} << (8 * i);
        return word;
    }

    const std::string& path_;
    bool swapped_;
};

/// The first bytes of a packed element: class, sides, name and the head of the numbers are there or nowhere.
class UnpackedMatElements final : public MatElements {
   public:
    UnpackedMatElements(const std::string& path, bool swapped, int file, const MatTag& of)
        : MatElements(path, swapped), packed_bytes_(of.bytes) {
        stream_ = {};
        if (inflateInit(&stream_) != Z_OK) throw std::bad_alloc();
        const std::unique_ptr<z_stream, int (*)(z_stream*)> end(&stream_, inflateEnd);
        unpack(file, of);
    }

    void check() const {
        constexpr std::uint64_t no_end = std::uint64_t{1} << 40U;  // beyond what a length of four bytes can say
        const MatTag inner = tag_at(0, no_end);
        if (inner.type != matrix_type) return;
        const std::uint64_t claimed = inner.begin + inner.bytes;
        if (ended_ && claimed > there_) fail_cut();
        if (claimed > deflate_ratio * packed_bytes_) {
            throw InputError(
                fmt::format("{}: says that a variable of {} packed bytes unpacks to {}, which no packing can: it is "
                            "damaged",
                            printable(path()), packed_bytes_, claimed));
        }
        check_matrix(inner);
    }

   private:
    void unpack(int file, const MatTag& of) {
        stream_.next_out = first_.data();
        stream_.avail_out = static_cast<uInt>(first_.size());
        std::array<unsigned char, 4096> piece{};
        int status = Z_OK;
        for (std::uint64_t given = 0; status == Z_OK && stream_.avail_out > 0 && given < of.bytes;) {
            const std::size_t size = std::min<std::uint64_t>(piece.size(), of.bytes - given);
            const ssize_t got = pread(file, piece.data(), size, static_cast<off_t>(of.begin + given));
            if (got <= 0) fail_cut();
            given += static_cast<std::uint64_t>(got);
            stream_.next_in = piece.data();
            stream_.avail_in = static_cast<uInt>(got);
            status = inflate(&stream_, Z_NO_FLUSH);
            if (status != Z_OK && status != Z_STREAM_END && status != Z_BUF_ERROR) {
                throw InputError(
                    fmt::format("{}: is damaged: a packed variable cannot be unpacked", printable(path())));
            }
        }
        there_ = first_.size() - stream_.avail_out;
        ended_ = stream_.avail_out > 0;
    }

    bool read(std::uint64_t at, std::array<unsigned char, 4>& into) const override {
        if (at + into.size() > there_) return false;
        std::copy_n(first_.begin() + static_cast<std::ptrdiff_t>(at), into.size(), into.begin());
        return true;
    }

    std::uint64_t packed_bytes_;
    z_stream stream_;
    std::array<unsigned char, 4096> first_{};
    std::uint64_t there_ = 0;
    bool ended_ = false;  ///< all of it is there
};

class MatElementsOfFile final : public MatElements {
   public:
    MatElementsOfFile(const std::string& path, bool swapped, Descriptor file, std::uint64_t size)
        : MatElements(path, swapped), file_(std::move(file)), size_(size) {}

    void check() const {
        for (std::uint64_t at = mat_head_bytes; at < size_;) {
            const MatTag tag = tag_at(at, size_);
            if (tag.type == matrix_type) check_matrix(tag);
            if (tag.type == packed_type) UnpackedMatElements(path(), is_swapped(), file_.get(), tag).check();
            at = tag.begin + tag.bytes;
        }
    }

   private:
    bool read(std::uint64_t at, std::array<unsigned char, 4>& into) const override {
        return pread(file_.get(), into.data(), into.size(), static_cast<off_t>(at)) ==
               static_cast<ssize_t>(into.size());
    }

    Descriptor file_;
    std::uint64_t size_;
};

}  // namespace

void check_mat_elements(const std::string& path) {
    Descriptor file = open_to_read(path);
    std::error_code unknown;
    const auto bytes = std::filesystem::file_size(path, unknown);
    std::array<char, 2> order{};
    if (unknown || !file.valid() || pread(file.get(), order.data(), 2, mat_head_bytes - 2) != 2) {
        throw InputError(fmt::format("{}: is cut off or damaged: its head is not all there", printable(path)));
    }
    MatElementsOfFile(path, order[0] == 'M', std::move(file), bytes).check();
}

}  // namespace ringlock::record
