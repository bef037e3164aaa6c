#pragma once
#include <stdexcept>
#include <string>

/// The failures of ringlock. Every exception that a function of the library throws on purpose is one of these; a lack
/// of memory is a std::bad_alloc.
namespace ringlock {

/// Base of all of them.
class Error : public std::runtime_error {
   public:
    using std::runtime_error::runtime_error;
};

/// Wrong input or command line: the program ends with exit status 2.
///
/// The message gives the error and its position (file, line, column, key or dataset), the value found, the allowed
/// values, and advice where there is any.
class InputError : public Error {
   public:
    using Error::Error;
};

/// The input was right but the run failed (disk, resource, a trajectory that could not be finished): exit status 1.
class RunError : public Error {
   public:
    using Error::Error;
};

/// The user asked to stop (Ctrl-C, or the `cancel` of the library's options); nothing half-written is left.
class Interrupted : public Error {
   public:
    Interrupted() : Error("interrupted") {}
    /// With a message that says more: which files remain, and how to go on.
    explicit Interrupted(const std::string& message) : Error(message), says_more_(true) {}
    bool says_more() const { return says_more_; }

   private:
    bool says_more_ = false;
};

}  // namespace ringlock
