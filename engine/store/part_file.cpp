#include "engine/store/part_file.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <array>
#include <bit>
#include <boost/crc.hpp>
#include <cerrno>
#include <cstring>
#include <fstream>
#include <stdexcept>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/system_text.hpp"

namespace ringlock::store {

namespace {

static_assert(std::endian::native == std::endian::little, "files of records are in the byte order of x86");

constexpr std::array<char, 8> magic = {'R', 'L', 'P', 'A', 'R', 'T', '1', '\n'};
constexpr RecordKind at_the_end = 0;
constexpr std::size_t most_waiting_bytes = 1 << 20;

struct Header {
    RecordKind kind = 0;
    std::uint64_t length = 0;
};
constexpr std::size_t header_bytes = sizeof(RecordKind) + sizeof(std::uint64_t);
using HeaderBytes = std::array<std::byte, header_bytes>;

HeaderBytes bytes_of(const Header& header) {
    HeaderBytes bytes;
    std::memcpy(bytes.data(), &header.kind, sizeof header.kind);
    std::memcpy(bytes.data() + sizeof header.kind, &header.length, sizeof header.length);
    return bytes;
}

Header header_of(const HeaderBytes& bytes) {
    Header header;
    std::memcpy(&header.kind, bytes.data(), sizeof header.kind);
    std::memcpy(&header.length, bytes.data() + sizeof header.kind, sizeof header.length);
    return header;
}

std::uint32_t checksum(const HeaderBytes& header, std::span<const std::byte> content) {
    boost::crc_32_type crc;
    crc.process_bytes(header.data(), header.size());
    crc.process_bytes(content.data(), content.size());
    return crc.checksum();
}

}  // namespace

PartWriter::PartWriter(const std::filesystem::path& path, Open open_as, OnRefusal on_refusal)
    : path_(path), on_refusal_(std::move(on_refusal)) {
    const int flags = O_WRONLY | O_CLOEXEC | O_NOFOLLOW | (open_as == Open::new_file ? O_CREAT | O_EXCL : O_TRUNC);
    while ((fd_ = ::open(path_.c_str(), flags, 0666)) < 0) {
        const int error = errno;
        on_refusal_(fmt::format("{}: cannot be made: {}", printable(path_), system_text(error)), error);
    }
    waiting_.reserve(most_waiting_bytes);
    put(std::as_bytes(std::span(magic)));
}

PartWriter::~PartWriter() {
    if (fd_ >= 0) ::close(fd_);
}

void PartWriter::add(RecordKind kind, std::span<const std::byte> content) {
    if (kind == at_the_end) throw std::invalid_argument("records of kind 0 end a file");
    append(kind, content);
    ++records_;
}

void PartWriter::close() {
    append(at_the_end, std::as_bytes(std::span(&records_, 1)));
    drain();
    ::close(fd_);
    fd_ = -1;
}

void PartWriter::append(RecordKind kind, std::span<const std::byte> content) {
    const HeaderBytes header = bytes_of({kind, content.size()});
    const std::uint32_t crc = checksum(header, content);
    put(header);
    put(content);
    put(std::as_bytes(std::span(&crc, 1)));
}

void PartWriter::put(std::span<const std::byte> bytes) {
    waiting_.insert(waiting_.end(), bytes.begin(), bytes.end());
    if (waiting_.size() >= most_waiting_bytes) drain();
}

void PartWriter::drain() {
    std::size_t written = 0;
    while (written < waiting_.size()) {
        const ssize_t now = ::write(fd_, waiting_.data() + written, waiting_.size() - written);
        if (now >= 0) {
            written += static_cast<std::size_t>(now);
        } else if (const int error = errno; error != EINTR) {
            on_refusal_(fmt::format("{}: cannot be written: {}", printable(path_), system_text(error)), error);
        }
    }
    waiting_.clear();
}

namespace {

class PartReader {
   public:
    explicit PartReader(const std::filesystem::path& path) : path_(path), in_(path, std::ios::binary) {
        std::error_code unknown;
        size_ = std::filesystem::file_size(path, unknown);
        if (!in_ || unknown)
            throw InputError(fmt::format("{}: cannot be read: {}", printable(path), system_text(errno)));
        std::array<char, magic.size()> begin;
        take(begin.data(), begin.size());
        if (begin != magic) damaged("it does not begin as checkpoints and shards of ringlock do");
    }

    void read(const OnRecord& on_record) {
        std::vector<std::byte> content;
        for (std::uint64_t records = 0;; ++records) {
            HeaderBytes bytes;
            take(bytes.data(), bytes.size());
            const Header header = header_of(bytes);
            if (header.length > size_ - position_) damaged("it is cut off");
            content.resize(header.length);
            take(content.data(), content.size());
            std::uint32_t crc = 0;
            take(&crc, sizeof crc);
            if (crc != checksum(bytes, content)) damaged(fmt::format("the checksum of record {} differs", records + 1));
            if (header.kind == at_the_end) return check_end(content, records);
            if (!on_record(header.kind, content)) return;
        }
    }

   private:
    void check_end(std::span<const std::byte> content, std::uint64_t records) const {
        std::uint64_t counted = 0;
        if (content.size() != sizeof counted) damaged("its last record is not one");
        std::memcpy(&counted, content.data(), sizeof counted);
        if (counted != records) damaged(fmt::format("it has {} records in place of {}", records, counted));
        if (position_ != size_) damaged("it goes on after its end");
    }

    void take(void* to, std::size_t bytes) {
        if (bytes > size_ - position_) damaged("it is cut off");
        if (!in_.read(static_cast<char*>(to), static_cast<std::streamsize>(bytes))) {
            throw InputError(fmt::format("{}: cannot be read at byte {}", printable(path_), position_));
        }
        position_ += bytes;
    }

    [[noreturn]] void damaged(const std::string& how) const {
        throw InputError(fmt::format("{}: is damaged: {}", printable(path_), how));
    }

    std::filesystem::path path_;
    std::ifstream in_;
    std::uint64_t size_ = 0;
    std::uint64_t position_ = 0;
};

}  // namespace

void read_part(const std::filesystem::path& path, const OnRecord& on_record) { PartReader(path).read(on_record); }

void check_part(const std::filesystem::path& path) {
    read_part(path, [](RecordKind, std::span<const std::byte>) { return true; });
}

bool is_part(const std::filesystem::path& path) {
    std::error_code unknown;
    if (!std::filesystem::is_regular_file(path, unknown)) return false;
    std::ifstream in(path, std::ios::binary);
    std::array<char, magic.size()> begin{};
    in.read(begin.data(), begin.size());
    return in && begin == magic;
}

}  // namespace ringlock::store
