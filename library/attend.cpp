#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <exception>
#include <thread>

#include "engine/core/error.hpp"
#include "library/detail.hpp"

namespace ringlock::library {

std::mutex& files() {
    static std::mutex mutex;
    return mutex;
}

void attend(const Attended& attended) {
    if (!(attended.interval_s > 0.0) || !std::isfinite(attended.interval_s)) {
        throw InputError(fmt::format("interval_s = {}: must be a positive number of seconds", attended.interval_s));
    }
    std::mutex mutex;
    std::condition_variable changed;
    bool done = false;
    std::exception_ptr of_work;
    std::thread worker([&] {
        try {
            attended.work();
        } catch (...) {
            of_work = std::current_exception();
        }
        const std::lock_guard lock(mutex);
        done = true;
        changed.notify_one();
    });
    std::exception_ptr of_callback;
    bool stopped = false;
    const auto look = [&] {
        try {
            if (attended.look) attended.look();
            if (attended.ended && attended.ended()) stopped = true;
        } catch (...) {
            of_callback = std::current_exception();
            stopped = true;
        }
        if (stopped) attended.stop();
    };
    // Longer waits than this overflow the clock.
    constexpr double longest_s = 3600.0;
    const std::chrono::duration<double> interval(std::min(attended.interval_s, longest_s));
    {
        std::unique_lock lock(mutex);
        while (!changed.wait_for(lock, interval, [&] { return done; })) {
            if (stopped) continue;
            lock.unlock();
            look();
            lock.lock();
        }
    }
    worker.join();
    if (!stopped && !of_work) {
        try {
            if (attended.look) attended.look();
        } catch (...) {
            of_callback = std::current_exception();
        }
    }
    if (of_callback) std::rethrow_exception(of_callback);
    if (of_work) std::rethrow_exception(of_work);
}

int threads_of(int asked) {
    constexpr int most = 4096;
    if (asked < 0 || asked > most) {
        throw InputError(fmt::format("threads = {}: must be between 1 and {}, or 0 for all cores", asked, most));
    }
    return asked > 0 ? asked : static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
}

}  // namespace ringlock::library
