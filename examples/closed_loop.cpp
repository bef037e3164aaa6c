// Lets the closed loop find an error source that was put into a simulated record: a lock-in threshold that is a fifth
// larger at the minima of the phase and smaller at its maxima.
#include <cstdio>
#include <cstdlib>
#include <ringlock/closure.hpp>
#include <ringlock/error.hpp>

int main() {
    try {
        const ringlock::Scenario gyro = ringlock::Scenario::from_text(R"(
            [ensemble]
            duration_s = 20
            dither_asymmetry_sd_ratio = 0
            [effects.lockin_turn_asymmetry]
            ratio = 0.2
        )");
        // A record of one's own is Record::from_file(), or of_turns() and of_samples() of data in memory.
        const ringlock::Record record = ringlock::simulate_record(gyro);

        const ringlock::Closure closure = ringlock::close_loop(record);
        const auto verdict = ringlock::name_of(closure.verdict);
        std::printf("%zu turns: %.*s\n", record.rows(), static_cast<int>(verdict.size()), verdict.data());
        for (const ringlock::Step& step : closure.steps) {
            std::printf("%s (by chance: p %.1e)\n", step.effect.c_str(), step.p_value);
            for (const ringlock::Estimate& parameter : step.parameters) {
                std::printf("  %s = %.4f +- %.4f\n", parameter.name.c_str(), parameter.value, parameter.std);
            }
        }
        std::printf("held-out error %.4f -> %.4f %s\n", closure.heldout_error_before, closure.heldout_error_after,
                    closure.error_unit.c_str());
    } catch (const ringlock::Error& error) {
        std::fprintf(stderr, "closed_loop: %s\n", error.what());
        return EXIT_FAILURE;
    }
}
