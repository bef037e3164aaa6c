#pragma once
#include <stdexcept>
#include <string>

namespace ringlock {

/// Wrong input or command line: the program ends with exit status 2.
///
/// The message says what is wrong and where (file, line, column, key or dataset), the value found, what is allowed,
/// and, where there is something to suggest, what to do.
class InputError : public std::runtime_error {
   public:
    using std::runtime_error::runtime_error;
};

/// The input was right but the run failed (disk, resource, a trajectory that could not be finished): exit status 1.
class RunError : public std::runtime_error {
   public:
    using std::runtime_error::runtime_error;
};

/// The user asked to stop (Ctrl-C); nothing half-written is left. The message says what is.
class Interrupted : public std::runtime_error {
   public:
    Interrupted() : Interrupted("interrupted, nothing written") {}
    explicit Interrupted(const std::string& what_is_left) : std::runtime_error(what_is_left) {}
};

}  // namespace ringlock
