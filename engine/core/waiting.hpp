#pragma once
#include <sys/types.h>

#include <cstddef>
#include <filesystem>
#include <string_view>

/// Operations that may wait for another process: pipes, terminals, child processes. All of them end with Interrupted
/// when the user asks to stop (interrupt.hpp), even if the other side sends nothing.
namespace ringlock {

/// A descriptor that is closed on destruction.
class Descriptor {
   public:
    Descriptor() = default;
    explicit Descriptor(int number) : number_(number) {}
    Descriptor(Descriptor&& other) noexcept;
    Descriptor& operator=(Descriptor&& other) noexcept;
    ~Descriptor();

    int get() const { return number_; }
    bool valid() const { return number_ >= 0; }

   private:
    int number_ = -1;
};

/// Opens a file for reading. A FIFO without a writer is opened at once; read_some() waits for the writer. Not valid,
/// with errno, where it cannot be opened.
Descriptor open_to_read(const std::filesystem::path& path);

/// Reads the available bytes, at most `size`; waits for the first of them. Returns 0 at the end and -1, with errno,
/// where the file cannot be read. Throws Interrupted.
ssize_t read_some(int descriptor, char* data, std::size_t size);

/// Writes all of a text. Returns 0, or errno where it cannot be written. Throws Interrupted between its parts.
int write_all(int descriptor, std::string_view text);

/// Waits for the end of a child and returns its status as of waitpid(), or -1 with errno. Where the user asks to stop,
/// the child is killed first and Interrupted thrown.
int wait_for_child(pid_t child);

}  // namespace ringlock
