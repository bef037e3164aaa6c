#include "engine/store/library.hpp"

#include <fmt/format.h>
#include <unistd.h>

#include <new>
#include <string_view>
#include <utility>

#include "engine/core/error.hpp"
#include "engine/core/printable.hpp"
#include "engine/store/links.hpp"

namespace ringlock::store {
namespace detail {
namespace {

std::recursive_mutex library_mutex;

constexpr std::string_view system_mark = "error message = '";

/// HDF5 1.10 crashes when it closes a file that the disk has refused to take, at the latest when the process ends.
/// So after such a failure, which ends the run anyway, nothing is closed any more.
bool abandoned = false;

herr_t keep_first(unsigned /*n*/, const H5E_error2_t* error, void* text) {
    *static_cast<std::string*>(text) = error->desc != nullptr ? error->desc : "";
    return 1;
}

}  // namespace

Lock::Lock() : lock_(library_mutex) {
    [[maybe_unused]] static const bool prepared = [] {
        H5dont_atexit();  // the library would print that objects of a damaged file do not close
        take_over_external_links();
        return true;
    }();
    H5Eset_auto2(H5E_DEFAULT, nullptr, nullptr);
    H5Eclear2(H5E_DEFAULT);
}

pid_t fork_with_library() {
    std::unique_lock lock(library_mutex);  // no other thread is in the middle of a call
    const pid_t child = fork();
    if (child == 0) {
        // The child's only thread has another number than the one that holds the lock, and could never free it.
        new (&library_mutex) std::recursive_mutex;
        lock.release();
    }
    return child;
}

std::string last_error() {
    std::string text;
    H5Ewalk2(H5E_DEFAULT, H5E_WALK_UPWARD, keep_first, &text);
    // The library reports a failed system call with the time and addresses of buffers; only the system's own message is
    // kept.
    if (const auto start = text.find(system_mark); start != std::string::npos) {
        const auto message = start + system_mark.size();
        return printable(text.substr(message, text.find('\'', message) - message));
    }
    return text.empty() ? "no reason given by HDF5" : printable(text);
}

void fail_input(const std::string& file, const std::string& where, const std::string& problem) {
    throw InputError(where.empty() ? fmt::format("{}: {}", printable(file), problem)
                                   : fmt::format("{}: {}: {}", printable(file), printable(where), problem));
}

void fail_run(const std::string& file, const std::string& where, const std::string& problem) {
    abandoned = true;
    throw RunError(fmt::format("{}: {}: {} ({})", printable(file), printable(where), problem, last_error()));
}

Id string_type() {
    Id type(H5Tcopy(H5T_C_S1));
    H5Tset_size(type.get(), H5T_VARIABLE);
    H5Tset_cset(type.get(), H5T_CSET_UTF8);
    return type;
}

}  // namespace detail

Id::Id(Id&& other) noexcept : value_(std::exchange(other.value_, -1)) {}

Id& Id::operator=(Id&& other) noexcept {
    std::swap(value_, other.value_);
    return *this;
}

Id::~Id() {
    if (!valid()) return;
    const detail::Lock lock;
    if (detail::abandoned) return;
    // Closing a file closes the objects that were open in it: the identifier may be invalid by now.
    if (H5Iis_valid(value_) > 0) H5Idec_ref(value_);
}

}  // namespace ringlock::store
