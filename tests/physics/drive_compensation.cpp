// Compensators behind the noise of a drive, whose amplitude changes over every half cycle.
#include <algorithm>
#include <cstdio>
#include <map>

#include "analysis/study/study.hpp"
#include "analysis/study/summary.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/physics/support.hpp"

namespace ringlock::test {
namespace drive_compensation_test {
namespace {

const std::string exact = "noise_injected+compensated_exact";
const std::string adaptive = "noise_injected+compensated_adaptive";

/// Allan deviations [deg/h] of all arms at the first averaging time from `tau_s` on.
std::map<std::string, double> deviations_deg_h(const std::string& device, const std::string& readout,
                                               const std::string& noise, double tau_s) {
    const scenario::Scenario scenario = scenario::parse_string(
        "device = \"" + device + "\"\n[input]\nrate_deg_h = 5.0\n[readout]\nmodel = \"" + readout +
            "\"\n[ensemble]\ngyros = 16\nduration_s = 60.0\n[effects.quantum_noise]\ndeg_rt_h = 0.0\n[arms]\nnames = "
            "[" +
            "\"noise_injected\", \"" + exact + "\", \"" + adaptive + "\"]\n[noise_injection]\nmodel = \"" + noise +
            "\"\nturn_phase_rms_rad = 3.0\n",
        "case");
    std::map<std::string, double> out;
    for (const study::ArmSummary& arm : study::summarise(study::run(study::Study(scenario), 2)).arms) {
        const auto point = std::find_if(arm.allan.begin(), arm.allan.end(),
                                        [&](const study::EnsemblePoint& p) { return p.tau_s >= tau_s; });
        out[arm.name] = point->dev_deg_h;
        std::printf("%s, %s, %s: %s %.3g deg/h at %.3g s\n", device.c_str(), readout.c_str(), noise.c_str(),
                    arm.name.c_str(), point->dev_deg_h, point->tau_s);
    }
    return out;
}

TEST(LongDriveCompensation, TheTurnMapIsInvertedWhileTheAmplitudeChanges) {
    // From the first turn on, at which neither amplitude nor rate is known.
    for (const char* device : {"triangle-20mm", "triangle-51mm"}) {
        auto deviation = deviations_deg_h(device, "ideal", "drive", 8.0);
        EXPECT_LT(deviation[exact], 5e-4 * deviation["noise_injected"]);
        EXPECT_LT(deviation[adaptive], 0.03 * deviation["noise_injected"]);
    }
}

TEST(LongDriveCompensation, TheAccelerationAfterTheTurnIsKnownThere) {
    // Independent turns leave the next half cycle's amplitude to chance; a resonator's goes on from where it is. Of the
    // adaptive compensator the size of the coupling that it has learnt says more than the phase does.
    for (const char* device : {"triangle-20mm", "triangle-51mm"}) {
        auto independent = deviations_deg_h(device, "instrument", "turns", 0.1);
        auto driven = deviations_deg_h(device, "instrument", "drive", 0.1);
        EXPECT_LT(driven[exact], 0.8 * independent[exact]);
    }
}

}  // namespace
}  // namespace drive_compensation_test
}  // namespace ringlock::test
