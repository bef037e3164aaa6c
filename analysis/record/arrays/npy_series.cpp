#include <archive.h>
#include <archive_entry.h>
#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <filesystem>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <system_error>
#include <utility>

#include "analysis/record/arrays/npy_column.hpp"
#include "analysis/record/readers.hpp"
#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/core/system_text.hpp"
#include "engine/core/waiting.hpp"
#include "engine/store/guard.hpp"

namespace ringlock::record {
namespace {

/// The name that numpy.savez gives to an array without one.
constexpr std::string_view unnamed_array = "arr_0";

class FileSource final : public ByteSource {
   public:
    explicit FileSource(const std::string& path) : file_(open_to_read(path)) {
        if (!file_.valid()) {
            throw InputError(fmt::format("{}: cannot be opened: {}", printable(path), system_text(errno)));
        }
    }
    bool read(std::uint64_t at, std::span<char> into) override {
        while (!into.empty()) {
            const ssize_t got = pread(file_.get(), into.data(), into.size(), static_cast<off_t>(at));
            if (got < 0 && errno == EINTR) continue;
            if (got <= 0) return false;
            into = into.subspan(static_cast<std::size_t>(got));
            at += static_cast<std::uint64_t>(got);
        }
        return true;
    }

   private:
    Descriptor file_;
};

NpyHeader header_of(ByteSource& source, const std::string& where) {
    std::string head(npy_preamble_bytes, '\0');
    if (!source.read(0, head)) throw InputError(fmt::format("{}: is cut off in its head", where));
    const std::size_t all = npy_header_bytes(head, where);
    const std::size_t there = head.size();
    head.resize(std::max(all, there));
    if (all > there && !source.read(there, std::span(head).subspan(there))) {
        throw InputError(fmt::format("{}: is cut off in its head", where));
    }
    return parse_npy_header(head, where);
}

/// A .npz file: a zip archive, whose entries are .npy files.
class Zip {
   public:
    explicit Zip(const std::string& path) : path_(path), archive_(archive_read_new(), archive_read_free) {
        archive_read_support_format_zip(archive_.get());
        constexpr std::size_t block_bytes = 65536;
        if (archive_read_open_filename(archive_.get(), path.c_str(), block_bytes) != ARCHIVE_OK) fail();
    }

    /// Goes to the next entry; false behind the last.
    bool next() {
        const int status = archive_read_next_header(archive_.get(), &entry_);
        if (status == ARCHIVE_EOF) return false;
        if (status < ARCHIVE_WARN) fail();
        ++number_;
        return true;
    }
    int number() const { return number_; }
    std::string name() const {
        const char* name = archive_entry_pathname(entry_);
        return name != nullptr ? name : "";
    }
    bool is_encrypted() const { return archive_entry_is_data_encrypted(entry_) != 0; }
    std::optional<std::uint64_t> bytes() const {
        if (archive_entry_size_is_set(entry_) == 0 || archive_entry_size(entry_) < 0) return std::nullopt;
        return static_cast<std::uint64_t>(archive_entry_size(entry_));
    }
    /// Bytes of the entry, one after the other; fewer than requested at its end.
    std::size_t read(std::span<char> into) {
        const la_ssize_t got = archive_read_data(archive_.get(), into.data(), into.size());
        if (got < 0) fail();
        return static_cast<std::size_t>(got);
    }

   private:
    [[noreturn]] void fail() const {
        const char* why = archive_error_string(archive_.get());
        throw InputError(fmt::format("{}: cannot be read as an archive of arrays (.npz): {}", printable(path_),
                                     why != nullptr ? printable(why) : "it is damaged"));
    }

    std::string path_;
    std::unique_ptr<archive, int (*)(archive*)> archive_;
    archive_entry* entry_ = nullptr;
    int number_ = 0;
};

class EntrySource final : public ByteSource {
   public:
    /// The entry that the archive stands at.
    explicit EntrySource(std::shared_ptr<Zip> zip) : zip_(std::move(zip)) {}
    EntrySource(const std::string& path, int number) : zip_(std::make_shared<Zip>(path)) {
        while (zip_->number() < number && zip_->next()) continue;
    }
    bool read(std::uint64_t at, std::span<char> into) override {
        std::array<char, 65536> skipped;
        while (at_ < at) {
            const auto most = static_cast<std::size_t>(std::min<std::uint64_t>(at - at_, skipped.size()));
            const std::size_t got = zip_->read(std::span(skipped).first(most));
            if (got == 0) return false;
            at_ += got;
        }
        while (!into.empty()) {
            const std::size_t got = zip_->read(into);
            if (got == 0) return false;
            into = into.subspan(got);
            at_ += got;
        }
        return true;
    }

   private:
    std::shared_ptr<Zip> zip_;
    std::uint64_t at_ = 0;
};

/// An array of an archive.
struct Entry {
    int number = 0;
    NpyHeader head;
};

/// Refuses, by its head, an array that would take minutes to unpack and is no measurement: noise does not pack so well.
void refuse_absurd_packing(const std::string& where, const NpyHeader& head, const std::string& path) {
    constexpr double small_bytes = 100e6;
    constexpr double most_ratio = 200.0;
    double bytes = static_cast<double>(head.element_bytes);
    for (const std::uint64_t side : head.shape) bytes *= static_cast<double>(side);
    std::error_code unknown;
    const auto there = static_cast<double>(std::filesystem::file_size(path, unknown));
    if (unknown || bytes <= std::max(small_bytes, most_ratio * there)) return;
    throw InputError(
        fmt::format("{}: unpacks to {:.4g} bytes, more than {:g} times the archive of {:.4g} bytes, which no measured "
                    "series does; if it is one, unpack it and give the array (.npy)",
                    where, bytes, most_ratio, there));
}

std::map<std::string, Entry> entries_of(const std::string& path, Contents& contents) {
    constexpr std::string_view ending = ".npy";
    std::map<std::string, Entry> entries;
    std::set<std::string> repeated;
    const auto zip = std::make_shared<Zip>(path);
    while (zip->next()) {
        std::string name = zip->name();
        if (!name.ends_with(ending)) continue;
        name = fmt::format("/{}", name.substr(0, name.size() - ending.size()));
        if (zip->is_encrypted()) {
            contents.others.push_back({name, "is encrypted"});
            continue;
        }
        EntrySource source(zip);
        const std::string where = fmt::format("{}: dataset {}", printable(path), printable(name));
        NpyHeader head = header_of(source, where);
        add_array(head, path, name, zip->bytes(), contents);
        refuse_absurd_packing(where, head, path);
        if (!entries.insert_or_assign(name, Entry{zip->number(), std::move(head)}).second) repeated.insert(name);
    }
    refuse_repeated(repeated, contents);
    return entries;
}

SeriesInfo stream_archive(const SeriesRequest& request, const TakePiece& take) {
    Contents contents;
    const std::map<std::string, Entry> entries = entries_of(request.path, contents);
    if (entries.empty() && contents.others.empty()) {
        throw InputError(fmt::format("{}: is a zip archive without arrays of NumPy (.npy); unpack it first",
                                     printable(request.path)));
    }
    const Choice choice = choose_datasets(request, contents);
    const auto open = [&](const Slice& slice) {
        const Entry& entry = entries.at(slice.of.dataset);
        return npy_column(request.path, slice, entry.head, std::make_unique<EntrySource>(request.path, entry.number));
    };
    return stream_choice(request, choice, open, take);
}

/// The array of a .npy file has no name of its own: a request may be brackets alone or begin with the name of the file.
std::optional<std::string> named_array(const std::optional<std::string>& asked, const std::string& path) {
    if (!asked) return asked;
    if (asked->starts_with('[')) return std::string(unnamed_array) + *asked;
    const std::string stem = std::filesystem::path(path).stem().string();
    if (*asked != stem && !asked->starts_with(stem + "[") && !asked->starts_with(stem + "/")) return asked;
    return std::string(unnamed_array) + asked->substr(stem.size());
}

}  // namespace

SeriesInfo stream_npy_series(const SeriesRequest& request, const TakePiece& take) {
    const std::string name = fmt::format("/{}", unnamed_array);
    const std::string where = printable(request.path);
    FileSource source(request.path);
    const NpyHeader head = header_of(source, where);
    Contents contents;
    std::error_code unknown;
    const auto bytes = std::filesystem::file_size(request.path, unknown);
    add_array(head, request.path, name, unknown ? std::nullopt : std::optional<std::uint64_t>(bytes), contents);
    SeriesRequest named = request;
    named.column = named_array(request.column, request.path);
    if (request.time) {
        named.time = "";
        for (const std::string& part : names_of_times(*request.time)) {
            *named.time += (named.time->empty() ? "" : ",") + *named_array(part, request.path);
        }
    }
    const Choice choice = choose_datasets(named, contents);
    const auto open = [&](const Slice& slice) {
        return npy_column(request.path, slice, head, std::make_unique<FileSource>(request.path));
    };
    return stream_choice(request, choice, open, take);
}

SeriesInfo stream_npz_series(const SeriesRequest& request, const TakePiece& take) {
    return store::guarded(request.path, [&](const store::GuardedPath&) {
        const TakePiece nowhere = [](const SeriesPiece&) {};
        return stream_archive(request, store::is_trial() ? nowhere : take);
    });
}

}  // namespace ringlock::record
