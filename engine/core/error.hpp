#pragma once
#include <stdexcept>
#include <string>

namespace ringlock {

/// Wrong input or command line: the program ends with exit status 2.
///
/// The message gives the error and its position (file, line, column, key or dataset), the value found, the allowed
/// values, and advice where there is any.
class InputError : public std::runtime_error {
   public:
    using std::runtime_error::runtime_error;
};

/// The input was right but the run failed (disk, resource, a trajectory that could not be finished): exit status 1.
class RunError : public std::runtime_error {
   public:
    using std::runtime_error::runtime_error;
};

/// The user asked to stop (Ctrl-C); nothing half-written is left.
class Interrupted : public std::runtime_error {
   public:
    Interrupted() : std::runtime_error("interrupted") {}
    /// With a message that says more: which files remain, and how to go on.
    explicit Interrupted(const std::string& message) : std::runtime_error(message), says_more_(true) {}
    bool says_more() const { return says_more_; }

   private:
    bool says_more_ = false;
};

}  // namespace ringlock
