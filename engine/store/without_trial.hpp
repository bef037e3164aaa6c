#pragma once

namespace ringlock::store {

/// While it lives, guarded() reads files in this process alone, without a trial before. It is for programs that search
/// the readers for faults, or measure what the trial costs; with it a damaged file can end the program.
class WithoutTrial {
   public:
    WithoutTrial();
    WithoutTrial(const WithoutTrial&) = delete;
    WithoutTrial& operator=(const WithoutTrial&) = delete;
    ~WithoutTrial();

   private:
    bool before_;
};

bool is_without_trial();

}  // namespace ringlock::store
