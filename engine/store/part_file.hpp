#pragma once
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <span>
#include <string>
#include <vector>

/// Files of records whose completeness can be checked: checkpoints and shards of a run.
///
/// A file is 8 bytes that name the format, then records, then one that counts them. A record is its kind (4 bytes), the
/// length of its content (8 bytes), the content, and the CRC-32 of all three (4 bytes), in the byte order of x86. A
/// file that was cut off, or in which any bit has changed, is detected.
namespace ringlock::store {

/// The program above defines the content of each kind; 0 is the record at the end.
using RecordKind = std::uint32_t;

/// Writes a file of records. From one thread at a time.
class PartWriter {
   public:
    /// Called where the disk refuses, with the problem and its errno. Returns to try again, throws to give up.
    using OnRefusal = std::function<void(const std::string& problem, int error)>;

    enum class Open { new_file, existing };

    /// Begins the file; with Open::new_file it must not be there, not even as a symbolic link.
    PartWriter(const std::filesystem::path& path, Open open, OnRefusal on_refusal);
    ~PartWriter();
    PartWriter(const PartWriter&) = delete;
    PartWriter& operator=(const PartWriter&) = delete;

    /// Adds a record; kind is not 0.
    void add(RecordKind kind, std::span<const std::byte> content);
    /// Adds the record at the end and hands everything to the system, which need not have brought it to the disk.
    /// Nothing can be added after.
    void close();

   private:
    void append(RecordKind kind, std::span<const std::byte> content);
    void put(std::span<const std::byte> bytes);
    void drain();

    std::filesystem::path path_;
    OnRefusal on_refusal_;
    int fd_ = -1;
    std::uint64_t records_ = 0;
    std::vector<std::byte> waiting_;
};

/// Called with each record, in the order of the file; returns whether to read on.
using OnRecord = std::function<bool(RecordKind kind, std::span<const std::byte> content)>;

/// Reads a file of records from its beginning to its end. Throws InputError where the file cannot be read or is not
/// whole: records before the damage have been handed to the caller by then, so a caller that must not use a part of a
/// file checks the file first.
void read_part(const std::filesystem::path& path, const OnRecord& on_record);

/// Throws InputError unless the file is whole.
void check_part(const std::filesystem::path& path);

/// Whether the file begins as files of records do.
bool is_part(const std::filesystem::path& path);

}  // namespace ringlock::store
