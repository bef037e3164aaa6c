#pragma once
#include <lzma.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "analysis/text/source/source.hpp"
#include "engine/core/error.hpp"

/// Texts as other programs pack and encode them.
namespace ringlock::test {

/// Bytes of a string.
class StringSource final : public text::Source {
   public:
    explicit StringSource(std::string bytes) : bytes_(std::move(bytes)) {}

    std::size_t read(char* to, std::size_t size) override {
        const std::size_t count = std::min(size, bytes_.size() - given_);
        std::memcpy(to, bytes_.data() + given_, count);
        given_ += count;
        return count;
    }

   private:
    std::string bytes_;
    std::size_t given_ = 0;
};

enum class Packer { none, gzip, xz, zstd };

inline std::string gzipped(const std::string& text) {
    z_stream stream{};
    constexpr int gzip_header = 16;
    constexpr int usual_memory = 8;
    deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, MAX_WBITS + gzip_header, usual_memory, Z_DEFAULT_STRATEGY);
    std::string out(deflateBound(&stream, static_cast<uLong>(text.size())) + 64, '\0');
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
    stream.avail_in = static_cast<uInt>(text.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = static_cast<uInt>(out.size());
    deflate(&stream, Z_FINISH);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

/// `window_log` 0: the usual one.
inline std::string xzed(const std::string& text, int window_log = 0) {
    lzma_options_lzma options;
    lzma_lzma_preset(&options, LZMA_PRESET_DEFAULT);
    options.dict_size = window_log == 0 ? std::uint32_t{1} << 20 : std::uint32_t{1} << window_log;
    lzma_filter filters[] = {{LZMA_FILTER_LZMA2, &options}, {LZMA_VLI_UNKNOWN, nullptr}};
    std::string out(lzma_stream_buffer_bound(text.size()), '\0');
    std::size_t size = 0;
    const lzma_ret done = lzma_stream_buffer_encode(filters, LZMA_CHECK_CRC64, nullptr,
                                                    reinterpret_cast<const std::uint8_t*>(text.data()), text.size(),
                                                    reinterpret_cast<std::uint8_t*>(out.data()), &size, out.size());
    if (done != LZMA_OK) throw std::runtime_error("xz: the text could not be packed");
    out.resize(size);
    return out;
}

inline std::string zstded(const std::string& text, int window_log = 0) {
    ZSTD_CCtx* context = ZSTD_createCCtx();
    ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, 1);
    if (window_log != 0) ZSTD_CCtx_setParameter(context, ZSTD_c_windowLog, window_log);
    std::string out(ZSTD_compressBound(text.size()) + 64, '\0');
    ZSTD_inBuffer in{text.data(), text.size(), 0};
    ZSTD_outBuffer to{out.data(), out.size(), 0};
    // In a stream, whose length the frame does not say, the window is as large as asked for.
    ZSTD_compressStream2(context, &to, &in, ZSTD_e_flush);
    ZSTD_compressStream2(context, &to, &in, ZSTD_e_end);
    out.resize(to.pos);
    ZSTD_freeCCtx(context);
    return out;
}

inline std::string packed(const std::string& text, Packer packer) {
    if (packer == Packer::gzip) return gzipped(text);
    if (packer == Packer::xz) return xzed(text);
    return packer == Packer::zstd ? zstded(text) : text;
}

inline std::string packed_with_window(const std::string& text, Packer packer, int window_log) {
    return packer == Packer::xz ? xzed(text, window_log) : zstded(text, window_log);
}

/// UTF-8 in UTF-16, high byte first or last, with a mark of the byte order or without.
inline std::string utf16(std::string_view text, bool big, bool mark) {
    std::string out;
    const auto put = [&](std::uint32_t unit) {
        const char high = static_cast<char>(unit >> 8), low = static_cast<char>(unit & 0xff);
        out += big ? high : low;
        out += big ? low : high;
    };
    if (mark) put(0xfeff);
    for (std::size_t i = 0; i < text.size();) {
        const auto first = static_cast<unsigned char>(text[i]);
        const std::size_t length = first < 0x80 ? 1 : first < 0xe0 ? 2 : first < 0xf0 ? 3 : 4;
        std::uint32_t c = length == 1 ? first : first & (0x7fU >> length);
        for (std::size_t k = 1; k < length; ++k) c = (c << 6) | (static_cast<unsigned char>(text[i + k]) & 0x3fU);
        i += length;
        if (c < 0x10000) {
            put(c);
        } else {
            put(0xd800 + ((c - 0x10000) >> 10));
            put(0xdc00 + ((c - 0x10000) & 0x3ff));
        }
    }
    return out;
}

}  // namespace ringlock::test
