// Loaded before the C library (LD_PRELOAD): makes system calls on chosen files fail, as a bad disk would.
//
// RINGLOCK_FAULTS is a list of CALL:ERRNO:PART:SKIP:COUNT, separated by semicolons. CALL is write (pwrite as well),
// fsync, open, mkdir or rename; the call fails where the path of the file contains PART, after SKIP such calls that
// succeed, COUNT times (0: for ever). PART may be A!B: the path contains A and not B. RINGLOCK_CLOCK_BACK_S sets the
// clock of the day back by so many seconds after its hundredth reading. RINGLOCK_SLOW_RMDIR_MS makes rmdir take so
// many milliseconds, and RINGLOCK_SLOW_CREATE_MS does so with open where it may make a file.
#include <dlfcn.h>
#include <fcntl.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

#include <atomic>
#include <cerrno>
#include <climits>
#include <cstdarg>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <mutex>
#include <string>
#include <vector>

namespace {

struct Fault {
    std::string call;
    int error;
    std::string has;
    std::string has_not;
    long skip;
    long count;  // left; negative: for ever
};

std::vector<Fault> read_faults() {
    std::vector<Fault> faults;
    const char* text = std::getenv("RINGLOCK_FAULTS");
    while (text != nullptr && *text != '\0') {
        char call[16];
        char part[64];
        int error = 0;
        long skip = 0;
        long count = 0;
        if (std::sscanf(text, "%15[^:]:%d:%63[^:]:%ld:%ld", call, &error, part, &skip, &count) != 5) {
            std::fprintf(stderr, "disk_faults: not understood: %s\n", text);
            std::abort();
        }
        const std::string both = part;
        const std::size_t mark = both.find('!');
        faults.push_back({call, error, both.substr(0, mark), mark == std::string::npos ? "" : both.substr(mark + 1),
                          skip, count == 0 ? -1 : count});
        text = std::strchr(text, ';');
        if (text != nullptr) ++text;
    }
    return faults;
}

/// The error that the call must end with, or 0.
int fault(const std::string& call, const std::string& path) {
    static std::mutex mutex;
    const std::lock_guard lock(mutex);
    static std::vector<Fault> faults = read_faults();
    for (Fault& one : faults) {
        if (one.call != call || path.find(one.has) == std::string::npos) continue;
        if (!one.has_not.empty() && path.find(one.has_not) != std::string::npos) continue;
        if (one.skip > 0) {
            --one.skip;
        } else if (one.count != 0) {
            if (one.count > 0) --one.count;
            return one.error;
        }
    }
    return 0;
}

int fault_of(const std::string& call, int fd) {
    char path[PATH_MAX];
    const ssize_t length = readlink(("/proc/self/fd/" + std::to_string(fd)).c_str(), path, sizeof path);
    return length < 0 ? 0 : fault(call, std::string(path, static_cast<std::size_t>(length)));
}

/// Sets errno; true where the call must fail.
bool fails(int error) {
    if (error != 0) errno = error;
    return error != 0;
}

template <class Function>
Function* next(const char* name) {
    return reinterpret_cast<Function*>(dlsym(RTLD_NEXT, name));
}

/// Waits as many milliseconds as the variable says; signals do not shorten the wait.
void wait_as_in(const char* variable) {
    const char* ms = std::getenv(variable);
    if (ms == nullptr) return;
    const long wait_ms = std::atol(ms);
    timespec left{wait_ms / 1000, wait_ms % 1000 * 1000000};
    while (nanosleep(&left, &left) != 0 && errno == EINTR) {
    }
}

template <class Function>
int create_or_open(Function* real, const char* path, int flags, mode_t mode) {
    if ((flags & O_CREAT) == 0) return real(path, flags, mode);
    if (fails(fault("open", path))) return -1;
    const int file = real(path, flags, mode);
    const int error = errno;
    wait_as_in("RINGLOCK_SLOW_CREATE_MS");
    errno = error;
    return file;
}

time_t set_back() {
    static std::atomic<long> readings = 0;
    const char* back = std::getenv("RINGLOCK_CLOCK_BACK_S");
    return back != nullptr && ++readings > 100 ? std::atol(back) : 0;
}

}  // namespace

extern "C" {

ssize_t write(int fd, const void* data, size_t bytes) {
    static auto* real = next<ssize_t(int, const void*, size_t)>("write");
    return fails(fault_of("write", fd)) ? -1 : real(fd, data, bytes);
}

ssize_t pwrite(int fd, const void* data, size_t bytes, off_t at) {
    static auto* real = next<ssize_t(int, const void*, size_t, off_t)>("pwrite");
    return fails(fault_of("write", fd)) ? -1 : real(fd, data, bytes, at);
}

ssize_t pwrite64(int fd, const void* data, size_t bytes, off64_t at) {
    static auto* real = next<ssize_t(int, const void*, size_t, off64_t)>("pwrite64");
    return fails(fault_of("write", fd)) ? -1 : real(fd, data, bytes, at);
}

int fsync(int fd) {
    static auto* real = next<int(int)>("fsync");
    return fails(fault_of("fsync", fd)) ? -1 : real(fd);
}

int open(const char* path, int flags, ...) {
    static auto* real = next<int(const char*, int, ...)>("open");
    va_list rest;
    va_start(rest, flags);
    const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
    va_end(rest);
    return create_or_open(real, path, flags, mode);
}

int open64(const char* path, int flags, ...) {
    static auto* real = next<int(const char*, int, ...)>("open64");
    va_list rest;
    va_start(rest, flags);
    const mode_t mode = (flags & O_CREAT) != 0 ? va_arg(rest, mode_t) : 0;
    va_end(rest);
    return create_or_open(real, path, flags, mode);
}

int mkdir(const char* path, mode_t mode) noexcept {
    static auto* real = next<int(const char*, mode_t)>("mkdir");
    return fails(fault("mkdir", path)) ? -1 : real(path, mode);
}

int rmdir(const char* path) noexcept {
    static auto* real = next<int(const char*)>("rmdir");
    wait_as_in("RINGLOCK_SLOW_RMDIR_MS");
    return real(path);
}

int rename(const char* from, const char* to) noexcept {
    static auto* real = next<int(const char*, const char*)>("rename");
    return fails(fault("rename", to)) ? -1 : real(from, to);
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned int flags) noexcept {
    static auto* real = next<int(int, const char*, int, const char*, unsigned int)>("renameat2");
    return fails(fault("rename", to)) ? -1 : real(from_folder, from, to_folder, to, flags);
}

int clock_gettime(clockid_t clock, timespec* now) noexcept {
    static auto* real = next<int(clockid_t, timespec*)>("clock_gettime");
    const int result = real(clock, now);
    if (result == 0 && clock == CLOCK_REALTIME) now->tv_sec -= set_back();
    return result;
}

time_t time(time_t* out) noexcept {
    timespec now{};
    clock_gettime(CLOCK_REALTIME, &now);
    if (out != nullptr) *out = now.tv_sec;
    return now.tv_sec;
}

}  // extern "C"
