#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "analysis/study/experiment.hpp"
#include "analysis/study/needs/room.hpp"
#include "analysis/study/result/result_file.hpp"
#include "engine/reader/latch.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::study {
namespace study_room_test {
namespace {

scenario::Scenario parsed(const std::string& text) { return scenario::parse_string(text, "room.toml", {}, complaints); }

/// What the results of a study hold of its gyros, sizes of what is allocated included.
std::uint64_t bytes_of(const Study& study) {
    std::uint64_t bytes = study.gyros.capacity() * sizeof(gyro::Setup);
    for (const ArmStatistics& arm : study.arms) {
        bytes += arm.gyros.capacity() * sizeof(GyroStatistics);
        for (const GyroStatistics& gyro : arm.gyros) {
            bytes += gyro.allan.capacity() * sizeof(allan::Point);
            bytes += gyro.angle_error_arcsec.capacity() * sizeof(double);
            bytes += gyro.noise.sinusoids.capacity() * sizeof(noise::Sinusoid);
        }
    }
    return bytes;
}

TEST(StudyRoom, TheDiskIsThatOfThePlan) {
    for (const std::string text :
         {"[ensemble]\ngyros = 5\nduration_s = 100\n",
          "[ensemble]\ngyros = 6\nturn_ons = 3\nduration_s = 100\n[output]\nangle_record = false\n",
          "[ensemble]\ngyros = 3\nduration_s = 60\n[input]\nrate_deg_h = 1\nsweep_points = 4\nsweep_stop_deg_h = 9\n",
          "[ensemble]\ngyros = 2\nduration_s = 60\n[output]\nangle_record = false\n[stop]\narw_relative = 0.1\n"
          "most_gyros = 50\n[design]\nkind = \"grid\"\n[[design.vary]]\nkey = \"gyro.lockin_threshold_deg_h\"\n"
          "values = [100, 200, 300]\n"}) {
        const scenario::Scenario scenario = parsed(text);
        EXPECT_EQ(expected_disk_bytes(scenario), expected_size_bytes(Experiment(scenario))) << text;
    }
}

TEST(StudyRoom, TheMemoryHasRoomForTheResults) {
    for (const std::string text :
         {"[ensemble]\ngyros = 8\nduration_s = 60\n[output]\ntau_s = [1, 3, 5]\nangle_after_s = [10, 20]\n",
          "[ensemble]\ngyros = 4\nduration_s = 60\n[input]\nrate_deg_h = 1\nsweep_points = 3\nsweep_stop_deg_h = "
          "9\n"}) {
        const scenario::Scenario scenario = parsed(text);
        const Experiment experiment = run(Experiment(scenario), 2);
        EXPECT_GE(expected_memory_bytes(scenario), bytes_of(experiment.points.front())) << text;
    }
}

TEST(StudyRoom, ReadersTakeRoom) {
    const std::string text = "[ensemble]\ngyros = 32\nduration_s = 600\n[reader]\noutput_hz = 100\n";
    const auto bytes = [&](const std::string& more) { return expected_memory_bytes(parsed(text + more), 2); };
    // Instants of 64 cycles, of both trajectories of a block on each thread.
    EXPECT_GT(bytes("latch_hz = 100000\n"), bytes("") + 2 * 2 * 16 * 51'000 * sizeof(reader::Instant));
    // 10001 taps, and as many angles, of five arms and sixteen gyros.
    const std::string filter = "latch_hz = 10000\nstripping = \"reference+fir\"\nfir_order = ";
    EXPECT_GT(bytes(filter + "10000\n"), bytes(filter + "2\n") + 2 * 5 * 16 * 2 * 8 * 9'900);
}

TEST(StudyRoom, MillionsOfGyrosAndYearsAreEstimatedWithoutBeingTaken) {
    const scenario::Scenario many = parsed("[ensemble]\ngyros = 10000000\n[output]\nangle_record = false\n");
    EXPECT_GT(expected_memory_bytes(many, 2), 50'000'000'000U);
    EXPECT_GT(expected_disk_bytes(many), 10'000'000'000U);
    // One gyro for thirty years needs next to no memory; its angle records are another matter.
    const scenario::Scenario years = parsed("[ensemble]\ngyros = 1\nduration_s = 1e9\n");
    EXPECT_LT(expected_memory_bytes(years, 2), 100'000'000U);
    EXPECT_GT(expected_disk_bytes(years), 8'000'000'000U);
}

}  // namespace
}  // namespace study_room_test
}  // namespace ringlock::study
