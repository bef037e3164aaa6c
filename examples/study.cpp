// Simulates sixteen gyros for five minutes without and with injected noise and compensation, and prints the angle
// random walk of each arm next to that of theory.
#include <cstdio>
#include <cstdlib>
#include <ringlock/error.hpp>
#include <ringlock/study.hpp>

int main() {
    try {
        ringlock::Scenario scenario;  // the device of Gao and Deng (2007)
        scenario.set({{"ensemble.gyros", 16}, {"ensemble.duration_s", 300.0}, {"ensemble.seed", 2007}});

        ringlock::RunOptions options;
        options.progress = [](const ringlock::Progress& now) {
            std::fprintf(stderr, "\r%s: %lld of %lld gyros", now.stage.c_str(), static_cast<long long>(now.gyros),
                         static_cast<long long>(now.all_gyros));
        };
        const ringlock::Result result = ringlock::run(scenario, options);
        std::fputc('\n', stderr);

        const double theory = result.theory().arw_deg_rt_h;
        std::printf("theory, turns at random phases: %.4g deg/sqrt(h)\n", theory);
        for (const ringlock::Arm& arm : result.arms()) {
            if (arm.arw_deg_rt_h && arm.arw_deg_rt_h->median) {
                std::printf("%-38s %.4g deg/sqrt(h), %.4f of theory\n", arm.name.c_str(), *arm.arw_deg_rt_h->median,
                            *arm.arw_deg_rt_h->median / theory);
            } else {
                std::printf("%-38s no random walk: %s\n", arm.name.c_str(), arm.arw_reason.c_str());
            }
        }
        result.write("study.h5");
    } catch (const ringlock::Error& error) {
        std::fprintf(stderr, "study: %s\n", error.what());
        return EXIT_FAILURE;
    }
}
