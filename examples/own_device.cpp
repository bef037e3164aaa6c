// Compares two sizes of a gyro of one's own: how much random walk the lock-in leaves when the dither randomises the
// turns.
#include <cstdio>
#include <cstdlib>
#include <ringlock/device.hpp>
#include <ringlock/error.hpp>
#include <ringlock/study.hpp>

int main() {
    try {
        ringlock::Device gyro;
        gyro.name = "prototype";
        gyro.scale_factor_arcsec = 1.8;
        gyro.lockin_threshold_deg_h = 200.0;
        gyro.dither_frequency_hz = 400.0;
        gyro.dither_peak_rate_deg_s = 120.0;

        ringlock::Device better = gyro;
        better.name = "prototype with better mirrors";
        better.lockin_threshold_deg_h = 50.0;

        for (const ringlock::Device& device : {gyro, better}) {
            ringlock::Scenario scenario;
            scenario.use(device);
            scenario.set({{"ensemble.gyros", 16},
                          {"ensemble.duration_s", 60.0},
                          {"output.angle_record", false},
                          {"arms.names", std::vector<std::string>{"noise_injected"}}});
            const ringlock::Result result = ringlock::run(scenario);
            const ringlock::Figure& arw = result.arm("noise_injected").arw_deg_rt_h.value();
            std::printf("%-30s %.5f deg/sqrt(h), theory %.5f\n", device.name.c_str(), arw.median.value(),
                        result.theory().arw_deg_rt_h);
        }
    } catch (const ringlock::Error& error) {
        std::fprintf(stderr, "own_device: %s\n", error.what());
        return EXIT_FAILURE;
    }
}
