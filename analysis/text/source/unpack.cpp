#include "analysis/text/source/unpack.hpp"

#include <fmt/format.h>
#include <lzma.h>
#include <zlib.h>
#include <zstd.h>
#include <zstd_errors.h>

#include <new>
#include <vector>

#include "engine/core/error.hpp"

namespace ringlock::text {
namespace {

using namespace std::string_view_literals;

constexpr std::size_t piece_bytes = std::size_t{1} << 17;

/// Common part of the three formats: packed bytes in pieces, and the message for damaged data.
class Unpacking : public Source {
   public:
    Unpacking(std::unique_ptr<Source> from, const char* program, std::string name)
        : from_(std::move(from)), program_(program), name_(std::move(name)), packed_(piece_bytes) {}

   protected:
    /// The next packed bytes; 0 at the end of the file.
    std::size_t refill() {
        const std::size_t got = from_->read(packed_.data(), packed_.size());
        read_bytes_ += got;
        return got;
    }
    char* packed() { return packed_.data(); }

    [[noreturn]] void fail_damaged(std::string_view why) const {
        throw InputError(
            fmt::format("{}: is packed with {} and damaged within its first {} bytes ({}); take another copy, "
                        "or check it with `{} -t`",
                        name_, program_, read_bytes_, why, program_));
    }
    [[noreturn]] void fail_early() const {
        throw InputError(
            fmt::format("{}: is packed with {} and ends too early, after {} bytes: the rest is missing; "
                        "take another copy",
                        name_, program_, read_bytes_));
    }
    [[noreturn]] void fail_window() const {
        throw InputError(
            fmt::format("{}: is packed with {} so that unpacking needs more than 64 MB at a time; "
                        "unpack it yourself, or pack it with a smaller window",
                        name_, program_));
    }

   private:
    std::unique_ptr<Source> from_;
    const char* program_;
    std::string name_;
    std::vector<char> packed_;
    std::size_t read_bytes_ = 0;
};

class Gzip final : public Unpacking {
   public:
    Gzip(std::unique_ptr<Source> from, std::string name) : Unpacking(std::move(from), "gzip", std::move(name)) {
        constexpr int gzip_header = 16;
        if (inflateInit2(&stream_, MAX_WBITS + gzip_header) != Z_OK) throw std::bad_alloc();
    }
    ~Gzip() override { inflateEnd(&stream_); }

    std::size_t read(char* to, std::size_t size) override {
        stream_.next_out = reinterpret_cast<Bytef*>(to);
        stream_.avail_out = static_cast<uInt>(std::min(size, piece_bytes));
        const uInt room = stream_.avail_out;
        while (stream_.avail_out == room) {
            if (stream_.avail_in == 0) {
                stream_.avail_in = static_cast<uInt>(refill());
                stream_.next_in = reinterpret_cast<Bytef*>(packed());
                if (stream_.avail_in == 0) {
                    if (within_) fail_early();
                    return 0;
                }
            }
            if (!within_ && skip_padding()) continue;
            within_ = true;
            const int result = inflate(&stream_, Z_NO_FLUSH);
            if (result == Z_STREAM_END) {
                within_ = false;
                first_ = false;
                inflateReset(&stream_);
            } else if (result == Z_MEM_ERROR) {
                throw std::bad_alloc();
            } else if (result != Z_OK && result != Z_BUF_ERROR) {
                fail_damaged(stream_.msg != nullptr ? stream_.msg : "a preset dictionary is needed");
            }
        }
        return room - stream_.avail_out;
    }

   private:
    /// Tapes and some writers pad the end with zeros. True where there is nothing else so far.
    bool skip_padding() {
        if (first_) return false;
        while (stream_.avail_in > 0 && *stream_.next_in == 0) {
            ++stream_.next_in;
            --stream_.avail_in;
        }
        return stream_.avail_in == 0;
    }

    z_stream stream_{};
    bool within_ = false;  ///< a stream whose end has not been seen
    bool first_ = true;
};

class Xz final : public Unpacking {
   public:
    Xz(std::unique_ptr<Source> from, std::string name) : Unpacking(std::move(from), "xz", std::move(name)) {
        // A window of 64 MiB, as `xz -9` has it, and 1 MiB and a bit around it.
        constexpr std::uint64_t most_bytes = (std::uint64_t{64} << 20) + (std::uint64_t{2} << 20);
        if (lzma_stream_decoder(&stream_, most_bytes, LZMA_CONCATENATED) != LZMA_OK) throw std::bad_alloc();
    }
    ~Xz() override { lzma_end(&stream_); }

    std::size_t read(char* to, std::size_t size) override {
        if (ended_) return 0;
        stream_.next_out = reinterpret_cast<std::uint8_t*>(to);
        stream_.avail_out = size;
        while (stream_.avail_out == size && !ended_) {
            if (stream_.avail_in == 0 && action_ == LZMA_RUN) {
                stream_.avail_in = refill();
                stream_.next_in = reinterpret_cast<const std::uint8_t*>(packed());
                if (stream_.avail_in == 0) action_ = LZMA_FINISH;
            }
            const lzma_ret result = lzma_code(&stream_, action_);
            ended_ = result == LZMA_STREAM_END;
            if (result == LZMA_MEMLIMIT_ERROR) fail_window();
            if (result == LZMA_MEM_ERROR) throw std::bad_alloc();
            if (result == LZMA_BUF_ERROR) fail_early();
            if (result == LZMA_OPTIONS_ERROR) fail_damaged("it has options that this liblzma does not know");
            if (result != LZMA_OK && result != LZMA_STREAM_END) fail_damaged("its checks do not hold");
        }
        return size - stream_.avail_out;
    }

   private:
    lzma_stream stream_ = LZMA_STREAM_INIT;
    lzma_action action_ = LZMA_RUN;
    bool ended_ = false;
};

class Zstandard final : public Unpacking {
   public:
    Zstandard(std::unique_ptr<Source> from, std::string name)
        : Unpacking(std::move(from), "zstd", std::move(name)), context_(ZSTD_createDCtx()) {
        if (context_ == nullptr) throw std::bad_alloc();
        constexpr int largest_window_log = 26;  // 64 MiB
        ZSTD_DCtx_setParameter(context_, ZSTD_d_windowLogMax, largest_window_log);
    }
    ~Zstandard() override { ZSTD_freeDCtx(context_); }

    std::size_t read(char* to, std::size_t size) override {
        ZSTD_outBuffer out{to, size, 0};
        while (out.pos == 0) {
            if (in_.pos == in_.size && !more_within_) {
                in_ = {packed(), refill(), 0};
                if (in_.size == 0) {
                    if (within_) fail_early();
                    return 0;
                }
            }
            const std::size_t left = ZSTD_decompressStream(context_, &out, &in_);
            if (ZSTD_isError(left) != 0) {
                const ZSTD_ErrorCode code = ZSTD_getErrorCode(left);
                if (code == ZSTD_error_frameParameter_windowTooLarge) fail_window();
                if (code == ZSTD_error_memory_allocation) throw std::bad_alloc();
                fail_damaged(ZSTD_getErrorName(left));
            }
            within_ = left != 0;
            more_within_ = out.pos == out.size && left != 0;  // the bytes that it still holds come out before it takes
                                                              // more in
        }
        return out.pos;
    }

   private:
    ZSTD_DCtx* context_;
    ZSTD_inBuffer in_{nullptr, 0, 0};
    bool within_ = false;
    bool more_within_ = false;
};

}  // namespace

Packing packing_of(std::string_view first) {
    if (first.starts_with("\x1f\x8b"sv)) return Packing::gzip;
    if (first.starts_with("\xfd\x37zXZ\0"sv)) return Packing::xz;
    if (first.starts_with("\x28\xb5\x2f\xfd"sv)) return Packing::zstandard;
    // A frame that is to be skipped may come first; pzstd writes one.
    if (first.size() >= 4 && first[0] >= '\x50' && first[0] <= '\x5f' &&
        first.substr(1).starts_with("\x2a\x4d\x18"sv)) {
        return Packing::zstandard;
    }
    return Packing::none;
}

std::unique_ptr<Source> unpack(std::unique_ptr<Source> from, Packing packing, const std::string& name) {
    if (packing == Packing::gzip) return std::make_unique<Gzip>(std::move(from), name);
    if (packing == Packing::xz) return std::make_unique<Xz>(std::move(from), name);
    return std::make_unique<Zstandard>(std::move(from), name);
}

}  // namespace ringlock::text
