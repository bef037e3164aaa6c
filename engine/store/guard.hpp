#pragma once
#include <cstdint>
#include <filesystem>
#include <functional>
#include <type_traits>

/// Reading files that somebody names, with libraries that can crash, loop or run out of memory on damaged ones.
///
/// HDF5 1.10 copies a string by the length that the file's heap names, follows a list that leads back to itself, and
/// allocates what a header claims. So everything that is done with such a file is done in a process of its own first,
/// whose time and memory follow from the size of the file. What goes wrong there is an error here, and the file is not
/// touched by this process.
namespace ringlock::store {

/// Whether a file may lead to others: by external links, external raw data or virtual datasets over other files.
enum class Links { refuse, follow };

/// The permission to open a file with one of those libraries. Only guarded() gives it, so that no command can forget
/// the guard; File::open() takes nothing else.
class GuardedPath {
   public:
    const std::filesystem::path& path() const { return path_; }

   private:
    explicit GuardedPath(std::filesystem::path path) : path_(std::move(path)) {}
    friend void try_reading(const std::filesystem::path& path, Links links,
                            const std::function<void(const GuardedPath&)>& read);
    template <class Read>
    friend auto guarded(const std::filesystem::path& path, Links links, Read&& read);

    std::filesystem::path path_;
};

/// Reads in a process of its own. Throws what `read` throws there; InputError, naming the file, where that process
/// crashes, takes more time of the processor (2 s, and 1 s for each MB of the file) or more memory (200 MB above the
/// size of the file and what expect_memory() allows), or throws an exception of a library. `read` must not need other
/// threads.
void try_reading(const std::filesystem::path& path, Links links, const std::function<void(const GuardedPath&)>& read);

/// Sets, while it lives, whether files lead to others.
class LinksInForce {
   public:
    explicit LinksInForce(Links links);
    LinksInForce(const LinksInForce&) = delete;
    LinksInForce& operator=(const LinksInForce&) = delete;
    ~LinksInForce();

   private:
    Links before_;
};
Links links_in_force();

/// Whether this is the process in which reading is tried. Large blocks of plain numbers, which the library only copies
/// from the file, need not be read there: who leaves them out says so by note_left_out(), and whatever goes wrong
/// afterwards is found again when the file is read.
bool is_trial();
void note_left_out();

/// Allows the trial that much more memory, for data that check_storage() found the file to hold.
void expect_memory(double bytes);

/// What `read` returns of a file. It is called twice, the first time in a process of its own.
template <class Read>
auto guarded(const std::filesystem::path& path, Links links, Read&& read) {
    try_reading(path, links, [&](const GuardedPath& guarded_path) { static_cast<void>(read(guarded_path)); });
    const LinksInForce in_force(links);
    return read(GuardedPath(path));
}
template <class Read>
auto guarded(const std::filesystem::path& path, Read&& read) {
    return guarded(path, Links::refuse, std::forward<Read>(read));
}

}  // namespace ringlock::store
