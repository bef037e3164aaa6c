#pragma once
#include <chrono>
#include <condition_variable>
#include <mutex>
#include <optional>
#include <stop_token>
#include <string>
#include <thread>

namespace ringlock::app {

/// Shows the stage of the loop, the time since it began, and the time left where it can be estimated: one line that is
/// replaced on a terminal; elsewhere a line for each stage, and one every ten seconds where the share that is done is
/// known.
///
/// The number of effects that a record needs, and the number of models that are tried for each, are not known
/// beforehand. A time left is therefore given for the last stage alone, whose parts are counted and take equal times.
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
