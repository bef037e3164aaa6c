#pragma once
// For the sources of the library. Its own headers must come after those of the engine and the analysis: they bring
// names, such as the function allan(), that are names of rooms there.
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <vector>

#include "engine/scenario/scenario.hpp"
#include "library/include/ringlock/closure.hpp"
#include "library/include/ringlock/study.hpp"

namespace ringlock {
inline namespace v1 {

struct Scenario::Data {
    std::string text;  ///< TOML, to which the settings are applied
    std::string name;
    std::vector<std::string> settings;
    bool own_device = false;
    scenario::Scenario parsed;
};

/// What the classes of the library show each other and nobody else.
class Library {
   public:
    static const scenario::Scenario& parsed(const Scenario& scenario) { return scenario.data_->parsed; }
    static Scenario scenario_of(const scenario::Scenario& parsed, const std::string& name);
    static Scenario parse(std::string text, std::string name, std::vector<std::string> settings, bool own_device);
    static Result run(const Scenario& scenario, const RunOptions& options);
    static Record simulate_record(const Scenario& scenario, std::int64_t gyro);
    static Closure close_loop(const Record& record, const CloseOptions& options);
};

}  // namespace v1

namespace library {

/// Held while files are read or written: the state of the guard of damaged files is that of the process.
std::mutex& files();

/// Work that takes long, with callbacks on the caller's thread.
struct Attended {
    std::function<void()> work;   ///< on a thread of its own
    std::function<void()> look;   ///< on the caller's, every interval and when the work is done; may throw
    std::function<bool()> ended;  ///< whether the caller wants an end; may throw, may be empty
    std::function<void()> stop;   ///< makes the work end soon with Interrupted; from the caller's thread
    double interval_s = 0.1;
};

/// Does the work. Throws what a callback throws, else what the work throws, after the work has ended.
void attend(const Attended& attended);

/// Threads that are meant by a number of an option; 0 means all cores. Throws InputError.
int threads_of(int asked);

}  // namespace library
}  // namespace ringlock
