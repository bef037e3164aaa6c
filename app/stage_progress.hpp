#pragma once
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

namespace ringlock::app {

/// Shows the stage of the loop, the time since it began, and the time left where that can be told: one line that is
/// replaced on a terminal, a line for each stage elsewhere and one every ten seconds where shares are told.
///
/// How many effects a record needs, and how many models are tried for each, shows as the loop goes on: a time left is
/// told of the last stage alone, whose parts are counted and as long as each other.
class StageProgress {
   public:
    explicit StageProgress(bool quiet);
    ~StageProgress();
    StageProgress(const StageProgress&) = delete;
    StageProgress& operator=(const StageProgress&) = delete;

    void show(const std::string& stage);
    void show_share(double share);

   private:
    using Clock = std::chrono::steady_clock;
    struct Share {
        Clock::time_point at;
        double share;
    };

    std::optional<double> left_s() const;
    void draw();
    void tick(const std::stop_token& stop);

    bool quiet_;
    bool terminal_;
    std::mutex mutex_;
    std::condition_variable_any ticked_;
    bool shown_ = false;
    std::string stage_;
    double share_ = 0.0;
    std::optional<Share> first_;  ///< of the stage
    Clock::time_point start_ = Clock::now();
    Clock::time_point drawn_ = start_;
    std::jthread ticking_;  ///< last, so that it finds all of the above
};

}  // namespace ringlock::app
