#pragma once
#include <sys/types.h>

namespace ringlock::app {

/// Standard input that can be read several times.
class RepeatedInput {
   public:
    /// \param needed  whether standard input is read at all, and more than once; else nothing is done
    ///
    /// A pipe is copied first, to a temporary file without a name that takes its place. Throws RunError where that
    /// cannot be written, and InputError where standard input cannot be read.
    explicit RepeatedInput(bool needed);

    /// Goes back to the beginning.
    void rewind() const;

   private:
    bool needed_;
    off_t begin_ = 0;
};

}  // namespace ringlock::app
