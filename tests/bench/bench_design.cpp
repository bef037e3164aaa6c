// What the points of a design cost: 256 points of 16 gyros over one run of 4096 gyros, side by side in one program run.
//
//   bench_design [--duration S] [--pairs N] [--threads T]
//
// S is the simulated time of a gyro, 1800 s unless told; N the number of pairs of runs, 3 unless told, of which every
// other begins with the design; T is 0 for all cores. A pair takes two cores some minutes at the full duration, and a
// shorter one measures what is done once a point (tables, the prediction of the injected noise) rather than the turns.
//
// Points differ in the lock-in threshold, each a little, so that no two share tables; all gyros of a run turn alike.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "analysis/report/table.hpp"
#include "analysis/study/experiment.hpp"
#include "analysis/study/study.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/scenario.hpp"
#include "engine/simd/target.hpp"

namespace {

using namespace ringlock;

constexpr int points = 256;
constexpr std::int64_t gyros_of_a_point = 16;  // a block: fewer take as long
constexpr std::int64_t gyros_of_the_run = points * gyros_of_a_point;

struct Options {
    double duration_s = 1800.0;
    int pairs = 3;
    int threads = 0;
};

Options read_options(int argc, char** argv) {
    Options options;
    for (int i = 1; i < argc; i += 2) {
        const std::string name = argv[i];
        if (i + 1 == argc) throw std::invalid_argument(name + " needs a value");
        const std::string value = argv[i + 1];
        if (name == "--duration") {
            options.duration_s = std::stod(value);
        } else if (name == "--pairs") {
            options.pairs = std::stoi(value);
        } else if (name == "--threads") {
            options.threads = std::stoi(value);
        } else {
            throw std::invalid_argument(name + " is not known: --duration S, --pairs N, --threads T");
        }
    }
    if (!(options.duration_s >= 3.0) || options.pairs < 1 || options.threads < 0) {
        throw std::invalid_argument("give 3 s and more, a pair and more, and 0 threads for all cores");
    }
    if (options.threads == 0) options.threads = static_cast<int>(std::max(1U, std::thread::hardware_concurrency()));
    return options;
}

scenario::Scenario common(double duration_s) {
    scenario::Scenario scenario;
    scenario.ensemble.duration_s = duration_s;
    scenario.output.angle_record = false;
    scenario.arms = scenario::parse_arms({"noise_injected"});
    return scenario;
}

scenario::Scenario one_run(double duration_s) {
    scenario::Scenario scenario = common(duration_s);
    scenario.ensemble.gyros = gyros_of_the_run;
    return scenario;
}

scenario::Scenario design(double duration_s) {
    scenario::Scenario scenario = common(duration_s);
    scenario.ensemble.gyros = gyros_of_a_point;
    scenario::Variation threshold{.key = "gyro.lockin_threshold_deg_h"};
    constexpr double step_relative = 1e-4;
    for (int p = 0; p < points; ++p) {
        const double from_the_middle = p - 0.5 * (points - 1);
        threshold.values.push_back(scenario.gyro.lockin_threshold_deg_h * (1.0 + step_relative * from_the_middle));
    }
    scenario.design.kind = scenario::DesignKind::list;
    scenario.design.vary.push_back(std::move(threshold));
    return scenario;
}

struct Timed {
    double seconds = 0.0;
    std::int64_t turns = 0;
};

/// Runs what is planned already; what comes out is needed for its turns only.
template <class Plan, class Turns>
Timed timed(Plan plan, int threads, Turns&& turns) {
    const auto start = std::chrono::steady_clock::now();
    const Plan done = study::run(std::move(plan), threads);
    const std::chrono::duration<double> gone = std::chrono::steady_clock::now() - start;
    return {gone.count(), turns(done)};
}

double median(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    const std::size_t half = values.size() / 2;
    return values.size() % 2 == 1 ? values[half] : 0.5 * (values[half - 1] + values[half]);
}

void compare(const Options& options) {
    const auto run_design = [&] {
        return timed(study::Experiment(design(options.duration_s)), options.threads,
                     [](const study::Experiment& done) { return done.turns(); });
    };
    const auto run_one = [&] {
        return timed(study::Study(one_run(options.duration_s)), options.threads,
                     [](const study::Study& done) { return done.turns; });
    };
    report::Table table({{"pair", report::Align::right},
                         {"first", report::Align::left},
                         {"design [s]", report::Align::right},
                         {"one run [s]", report::Align::right},
                         {"design [turns/s]", report::Align::right},
                         {"one run [turns/s]", report::Align::right},
                         {"ratio of a turn", report::Align::right}});
    const auto rate = [](const Timed& run) {
        return fmt::format("{:.3g}", static_cast<double>(run.turns) / run.seconds);
    };
    std::vector<double> ratios;
    for (int pair = 0; pair < options.pairs; ++pair) {
        const bool design_first = pair % 2 == 0;
        Timed of_design, of_one;
        if (design_first) of_design = run_design();
        of_one = run_one();
        if (!design_first) of_design = run_design();
        // By the turn: gyros of other phases have a turn more or less in as much time.
        ratios.push_back(of_design.seconds / static_cast<double>(of_design.turns) /
                         (of_one.seconds / static_cast<double>(of_one.turns)));
        table.add_row({fmt::format("{}", pair + 1), design_first ? "design" : "one run",
                       fmt::format("{:.2f}", of_design.seconds), fmt::format("{:.2f}", of_one.seconds), rate(of_design),
                       rate(of_one), fmt::format("{:.4f}", ratios.back())});
        fmt::print(stderr, "pair {} of {}: {:.4f}\n", pair + 1, options.pairs, ratios.back());
    }
    fmt::print("{} points of {} gyros over one run of {} gyros, {:g} s each, arm noise_injected\n{}", points,
               gyros_of_a_point, gyros_of_the_run, options.duration_s, table.text());
    fmt::print("Median of the ratios: {:.4f}. {} threads, instruction set {}.\n", median(ratios), options.threads,
               simd::active_target());
}

}  // namespace

int main(int argc, char** argv) {
    try {
        compare(read_options(argc, argv));
    } catch (const std::exception& error) {
        fmt::print(stderr, "bench_design: {}\n", error.what());
        return 1;
    }
    return 0;
}
