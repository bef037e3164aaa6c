#include "engine/core/waiting.hpp"

#include <fcntl.h>
#include <poll.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <csignal>
#include <utility>

#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"

namespace ringlock {
namespace {

/// Waits until a descriptor is ready or the time is up; -1 as descriptor waits for the signal and the time alone, -1
/// as time waits without end. Throws Interrupted.
void wait_until_ready(int descriptor, short events, int milliseconds) {
    std::array<pollfd, 2> both{{{descriptor, events, 0}, {interrupt_descriptor(), POLLIN, 0}}};
    for (;;) {
        check_interrupt();
        const int ready = poll(both.data(), both.size(), milliseconds);
        if (ready < 0 && errno == EINTR) continue;
        check_interrupt();
        return;  // an error of poll() itself occurs again, and is reported, in the caller's next system call
    }
}

}  // namespace

Descriptor::Descriptor(Descriptor&& other) noexcept : number_(std::exchange(other.number_, -1)) {}

Descriptor& Descriptor::operator=(Descriptor&& other) noexcept {
    std::swap(number_, other.number_);
    return *this;
}

Descriptor::~Descriptor() {
    if (valid()) close(number_);
}

Descriptor open_to_read(const std::filesystem::path& path) {
    return Descriptor(open(path.c_str(), O_RDONLY | O_NONBLOCK | O_CLOEXEC | O_NOCTTY));
}

ssize_t read_some(int descriptor, char* data, std::size_t size) {
    for (;;) {
        // Before the first writer of a FIFO comes, read() would report its end; poll() waits for him.
        wait_until_ready(descriptor, POLLIN, -1);
        const ssize_t got = read(descriptor, data, size);
        if (got >= 0 || (errno != EINTR && errno != EAGAIN)) return got;
    }
}

int write_all(int descriptor, std::string_view text) {
    // A pipe that is ready takes as much without blocking (PIPE_BUF of Linux).
    constexpr std::size_t at_once = 4096;
    while (!text.empty()) {
        wait_until_ready(descriptor, POLLOUT, -1);
        const ssize_t taken = write(descriptor, text.data(), std::min(at_once, text.size()));
        if (taken >= 0) {
            text.remove_prefix(static_cast<std::size_t>(taken));
        } else if (errno != EINTR && errno != EAGAIN) {
            return errno;
        }
    }
    return 0;
}

int wait_for_child(pid_t child) {
    // Ready when the child has ended. Where the kernel has no such descriptor, the child is polled now and then.
    const Descriptor end(static_cast<int>(syscall(SYS_pidfd_open, child, 0)));
    const int milliseconds = end.valid() ? -1 : 10;
    for (;;) {
        int status = 0;
        const pid_t ended = waitpid(child, &status, WNOHANG);
        if (ended == child) return status;
        if (ended < 0 && errno != EINTR) return -1;
        try {
            wait_until_ready(end.get(), POLLIN, milliseconds);
        } catch (const Interrupted&) {
            kill(child, SIGKILL);
            while (waitpid(child, &status, 0) < 0 && errno == EINTR) continue;
            throw;
        }
    }
}

}  // namespace ringlock
