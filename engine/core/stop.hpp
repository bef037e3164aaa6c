#pragma once

/// Interruption by a program that uses the library, in place of a signal.
namespace ringlock {

/// While one lives, request() makes interrupted() true, on any thread of the process, as a signal does under an
/// InterruptGuard. One at a time in a process, and none together with an InterruptGuard.
class StopByRequest {
   public:
    StopByRequest();
    ~StopByRequest();
    StopByRequest(const StopByRequest&) = delete;
    StopByRequest& operator=(const StopByRequest&) = delete;

    /// From any thread.
    void request();
};

}  // namespace ringlock
