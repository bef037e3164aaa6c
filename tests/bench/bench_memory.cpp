// Compares the memory that `ringlock run` expects to take with the peak resident memory of its process, for lots of
// different shapes. Prints one line for each case, and the range of the ratios.
#include <fmt/format.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <stdexcept>
#include <string>
#include <vector>

#include "analysis/study/experiment.hpp"
#include "analysis/study/needs/room.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock {
namespace {

struct Case {
    std::string scenario;
    int threads;
};

/// Peak resident memory of `ringlock run` of this scenario on so many threads [bytes].
double peak_bytes(const std::string& scenario_text, int threads, const std::string& folder) {
    const std::string scenario_file = folder + "/case.toml";
    const std::string result = folder + "/case.h5";
    std::ofstream(scenario_file) << scenario_text;
    const std::string program = RINGLOCK_PROGRAM;
    const std::string thread_count = std::to_string(threads);
    const pid_t child = fork();
    if (child == 0) {
        if (std::freopen("/dev/null", "w", stdout) == nullptr) _exit(EXIT_FAILURE);
        execl(program.c_str(), program.c_str(), "run", scenario_file.c_str(), "-o", result.c_str(), "--threads",
              thread_count.c_str(), "--quiet", nullptr);
        _exit(EXIT_FAILURE);
    }
    int status = 0;
    rusage usage{};
    if (wait4(child, &status, 0, &usage) != child || !WIFEXITED(status) || WEXITSTATUS(status) != EXIT_SUCCESS) {
        std::fprintf(stderr, "bench_memory: %s failed\n", program.c_str());
        std::exit(EXIT_FAILURE);
    }
    std::filesystem::remove(result);
    return 1024.0 * static_cast<double>(usage.ru_maxrss);
}

std::string lot(int gyros, double duration_s, const std::string& arms, const std::string& more = "") {
    return fmt::format(
        "[ensemble]\ngyros = {}\nduration_s = {}\n[arms]\nnames = [{}]\n[output]\nangle_record = false\n"
        "sample_interval_s = {}\n{}",
        gyros, duration_s, arms, std::min(1.0, 0.25 * duration_s), more);
}

int run() {
    const std::string one = "\"noise_injected\"";
    const std::string four = "\"ideal\", \"uncompensated\", \"noise_injected\", \"noise_injected+compensated\"";
    const std::string design =
        "[design]\nkind = \"grid\"\n[[design.vary]]\nkey = \"gyro.lockin_threshold_deg_h\"\n"
        "from = 100.0\nto = 300.0\npoints = 8\n";
    const std::vector<Case> cases = {
        {lot(16000, 1.0, one), 2},         {lot(64000, 1.0, one), 2},  {lot(16000, 1.0, four), 2},
        {lot(8000, 4.0, one), 2},          {lot(2000, 20.0, four), 2}, {lot(128, 8192.0, one), 8},
        {lot(2000, 1.0, four, design), 2},
    };
    std::string name = (std::filesystem::temp_directory_path() / "bench_memory_XXXXXX").string();
    if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("cannot make a folder in " + name);
    const std::filesystem::path folder = name;
    double lowest = 1e9;
    double highest = 0.0;
    for (const Case& one_case : cases) {
        const scenario::Scenario scenario = scenario::parse_string(one_case.scenario, "case");
        const double peak = peak_bytes(one_case.scenario, one_case.threads, folder.string());
        const auto estimate = static_cast<double>(study::expected_memory_bytes(scenario, one_case.threads));
        lowest = std::min(lowest, estimate / peak);
        highest = std::max(highest, estimate / peak);
        fmt::print(
            "{:6} gyros x {:6} s, {} arms, {} point(s), {} threads: estimated {:6.1f} MB, taken {:6.1f} MB, ratio "
            "{:.2f}\n",
            scenario.ensemble.gyros, scenario.ensemble.duration_s, scenario.arms.size(),
            study::Experiment(scenario).points.size(), one_case.threads, estimate * 1e-6, peak * 1e-6, estimate / peak);
        std::fflush(stdout);
    }
    std::filesystem::remove_all(folder);
    fmt::print("estimate over peak: {:.2f} to {:.2f}\n", lowest, highest);
    return EXIT_SUCCESS;
}

}  // namespace
}  // namespace ringlock

int main() { return ringlock::run(); }
