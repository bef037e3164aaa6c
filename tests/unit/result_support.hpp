#pragma once
#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <string>

#include "analysis/study/result/result_file.hpp"
#include "engine/core/error.hpp"

/// Result files of a small study for the tests of the format.
namespace ringlock::test {

/// Two arms, few gyros, few seconds; no two of the symbolic extents are alike.
inline scenario::Scenario small(bool angle_record, std::uint64_t seed = 5) {
    scenario::Scenario scenario;
    scenario.ensemble.gyros = 3;
    scenario.ensemble.duration_s = 45.0;
    scenario.ensemble.seed = seed;
    scenario.ensemble.lockin_threshold_sd_relative = 0.01;
    scenario.output.angle_record = angle_record;
    scenario.arms = scenario::parse_arms({"uncompensated", "noise_injected+compensated"});
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.001;
    return scenario;
}

/// Two points that differ in a key of the gyro.
inline scenario::Scenario small_design(bool angle_record) {
    scenario::Scenario scenario = small(angle_record);
    scenario.design.kind = scenario::DesignKind::list;
    scenario.design.vary = {{.key = "gyro.lockin_threshold_deg_h", .values = {200.0, 300.0}}};
    return scenario;
}

inline void write(const std::filesystem::path& path, const scenario::Scenario& scenario) {
    study::ResultWriter writer(path, study::Experiment(scenario));
    const study::Experiment experiment = study::run(
        study::Experiment(scenario), 2, [&](const study::SampledAngles& samples) { writer.write_samples(samples); });
    writer.finish(experiment, study::summarise(experiment), store::collect_provenance({}, 2, "small.toml"));
}

inline std::string bytes(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

class ResultFile : public testing::Test {
   protected:
    void SetUp() override {
        const auto* info = testing::UnitTest::GetInstance()->current_test_info();
        directory_ = std::filesystem::temp_directory_path() /
                     ("ringlock-result-" + std::string(info->name()) + "-" + std::to_string(::getpid()));
        std::filesystem::create_directories(directory_);
        path_ = directory_ / "out.h5";
    }
    void TearDown() override { std::filesystem::remove_all(directory_); }

    /// Names of what the directory holds.
    std::set<std::string> left() const {
        std::set<std::string> names;
        for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
            names.insert(entry.path().filename().string());
        }
        return names;
    }
    static std::string complaint_of(const std::filesystem::path& path) {
        try {
            (void)study::summarise(study::read_result(path));
        } catch (const InputError& error) {
            return error.what();
        }
        return "(accepted)";
    }

    std::filesystem::path directory_;
    std::filesystem::path path_;
};

}  // namespace ringlock::test
