// What the engine is held to: errors, speeds and memory, measured side by side in one run.
//
//   bench_engine [--quick] [--markdown]
//
// --quick measures the accuracy over fewer turns; --markdown prints a table for docs/dev/performance.md.
#include <fmt/format.h>
#include <oneapi/tbb/blocked_range.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <spawn.h>
#include <sys/resource.h>
#include <sys/wait.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstring>
#include <fstream>
#include <functional>
#include <limits>
#include <memory>
#include <numeric>
#include <random>
#include <string>
#include <thread>
#include <vector>

#include "analysis/allan/octave_stream.hpp"
#include "analysis/report/table.hpp"
#include "engine/compensate/exact.hpp"
#include "engine/compensate/first_order.hpp"
#include "engine/core/error.hpp"
#include "engine/dither/lane_dither.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/ensemble.hpp"
#include "engine/ensemble/output_counts.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/lane_propagator.hpp"
#include "engine/propagate/turn_kernel.hpp"
#include "engine/readout/lane_readout.hpp"
#include "engine/simd/target.hpp"
#include "tests/bench/noisy_dither.hpp"
#include "tests/bench/random_and_sincos.hpp"
#include "tests/bench/reference_cost.hpp"
#include "tests/support/direct.hpp"
#include "tests/support/drive.hpp"
#include "tests/support/long_drive.hpp"
#include "tests/support/temporary_directory.hpp"
#include "tests/support/turn_map.hpp"

extern char** environ;

namespace {

using namespace ringlock;

/// The tolerance of every row: that of a production run by default.
constexpr double table_tolerance_rad = scenario::Propagation{}.turn_map_tolerance_rad;
constexpr std::size_t piece = 128;

double seconds_of(const std::function<void()>& work) {
    const auto start = std::chrono::steady_clock::now();
    work();
    return std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
}

double median_of(std::vector<double> values) {
    std::sort(values.begin(), values.end());
    return values[values.size() / 2];
}

/// Something to be timed, in rounds with the others.
struct Contender {
    std::string name;
    double turns;  ///< of one round, all gyros together
    std::function<void()> run;
    std::vector<double> seconds = {};
    double per_turn_s() const { return median_of(seconds) / turns; }
};

/// Contenders take turns, so that a machine that slows down slows all.
void race(std::vector<Contender*> contenders, int rounds) {
    for (int round = 0; round < rounds; ++round) {
        for (Contender* contender : contenders) contender->seconds.push_back(seconds_of(contender->run));
    }
}

double sink = 0.0;  // so that nothing is left out as unused

scenario::Scenario paper() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    scenario.noise_injection.turn_phase_rms_rad = bench::turn_phase_rms_rad;
    return scenario;
}

std::vector<scenario::Arm> arms_of(const std::vector<std::string>& names) {
    std::vector<scenario::Arm> arms;
    for (const std::string& name : names) arms.push_back(scenario::parse_arm(name));
    return arms;
}

/// Worst difference [rad] of a half cycle by the production turn map from the direct integrator at 1e-12 rad, over
/// random half cycles: +-5 % of amplitude, +-50 000 deg/h, +-5 % asymmetry.
double worst_turn_error_rad(int turns) {
    struct Case {
        gyro::Device device;
        gyro::HalfCycle half;
        double phase_rad;
    };
    std::mt19937_64 engine(20070301);
    const auto uniform = [&](double low, double high) {
        return low + (high - low) * static_cast<double>(engine() >> 11) * 0x1p-53;
    };
    std::vector<Case> cases;
    for (int i = 0; i < turns; ++i) {
        gyro::Setup setup = ensemble::nominal_setup(paper());
        setup.dither_asymmetry_ratio = uniform(-0.05, 0.05);
        setup.input_rate_deg_h = uniform(-50000.0, 50000.0);
        const gyro::Device device(setup);
        const double amplitude = device.dither_amplitude_rad * uniform(0.95, 1.05);
        cases.push_back({device, device.half_cycle(i % 2 == 0 ? 1.0 : -1.0, amplitude), uniform(-3.14, 3.14)});
    }
    std::vector<double> errors(cases.size());
    oneapi::tbb::parallel_for(std::size_t{0}, cases.size(), [&](std::size_t i) {
        const Case& c = cases[i];
        const double a = c.device.dither_amplitude_rad;
        const double rate = c.device.input_rate_rad_s;
        const double b = c.device.coupling.b_rad_s;
        test::TurnMap map(c.device, {{0.95 * a, 1.05 * a}, {rate, rate}, {b, b}}, table_tolerance_rad);
        test::DirectIntegrator direct(c.device.coupling, 1e-12);
        errors[i] = std::abs(map.lockin_gain_rad(c.phase_rad, c.half) - direct.lockin_gain_rad(c.phase_rad, c.half));
    });
    return *std::max_element(errors.begin(), errors.end());
}

/// A block of production gyros under injected noise, without readout.
class Trajectories {
   public:
    Trajectories() {
        scenario::Scenario scenario = paper();
        scenario.ensemble.gyros = simd::lanes;
        random::LaneIdentities who;
        who.seed = scenario.ensemble.seed;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            devices_.emplace_back(ensemble::draw_setup(scenario, static_cast<std::int64_t>(lane)));
            who.gyro[lane] = lane;
        }
        dither_ = std::make_unique<dither::LaneDither>(devices_, bench::turn_phase_rms_rad, who);
        const double margin = test::Drive::amplitude_margin_rad(bench::turn_phase_rms_rad);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const gyro::Device& device = devices_[lane];
            const double a = device.dither_amplitude_rad;
            const double rate = device.input_rate_rad_s;
            const double b = device.coupling.b_rad_s;
            tables_.make(lane, device, {{a - margin, a + margin}, {rate, rate}, {b, b}});
        }
    }
    void advance(int pieces) {
        for (int i = 0; i < pieces; ++i) {
            dither_->next(piece, {}, {}, drive_);
            propagate::step_turns(tables_, drive_, simd::lanes, state_, nullptr);
        }
        sink += state_.lockin_fringes[0];
    }
    const std::vector<gyro::Device>& devices() const { return devices_; }

   private:
    std::vector<gyro::Device> devices_;
    std::unique_ptr<dither::LaneDither> dither_;
    propagate::TurnTables tables_{table_tolerance_rad};
    propagate::TurnState state_;
    gyro::LaneDrive drive_;
};

/// The vectorised direct integrator over the same drive.
class DirectTrajectories {
   public:
    explicit DirectTrajectories(const std::vector<gyro::Device>& devices) : direct_(devices, 1e-8) {
        random::LaneIdentities who;
        who.seed = 1;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = lane;
        dither_ = std::make_unique<dither::LaneDither>(devices, bench::turn_phase_rms_rad, who);
    }
    void advance(std::size_t turns) {
        dither_->next(turns, {}, {}, drive_);
        direct_.step(drive_, &turns_);
        sink += turns_.lockin_fringes[0][0];
    }

   private:
    propagate::DirectLanes direct_;
    std::unique_ptr<dither::LaneDither> dither_;
    gyro::LaneDrive drive_;
    gyro::LaneTurns turns_;
};

/// A block of production gyros with readout, compensators and streaming Allan deviations of every arm.
class Study {
   public:
    Study(scenario::ReadoutModel model, const std::vector<std::string>& arms) : arms_(arms_of(arms)) {
        scenario::Scenario scenario = paper();
        scenario.readout.model = model;
        scenario.ensemble.gyros = simd::lanes;
        block_ = std::make_unique<ensemble::GyroBlock>(scenario, arms_, 0, simd::lanes);
        streams_.resize(arms_.size());
        advance(1);  // tables
    }
    void advance(int pieces) {
        for (int i = 0; i < pieces; ++i) {
            block_->advance(piece);
            for (std::size_t arm = 0; arm < arms_.size(); ++arm) streams_[arm].add(block_->counts(arm), simd::lanes);
        }
        sink += static_cast<double>(streams_.back().samples());
    }

   private:
    std::vector<scenario::Arm> arms_;
    std::unique_ptr<ensemble::GyroBlock> block_;
    std::vector<allan::OctaveStream> streams_;
};

/// Independent multiply-adds, the arithmetic that two threads cannot get into each other's way with.
void multiply_adds(int threads) {
    const auto work = [] {
        double x[16];
        std::iota(std::begin(x), std::end(x), 0.5);
        for (int i = 0; i < 10'000'000; ++i) {
            for (double& value : x) value = value * 0.999999 + 1e-7;
        }
        return std::accumulate(std::begin(x), std::end(x), 0.0);
    };
    std::vector<double> results(static_cast<std::size_t>(threads));
    std::vector<std::thread> others;
    for (int t = 1; t < threads; ++t) others.emplace_back([&, t] { results[static_cast<std::size_t>(t)] = work(); });
    results[0] = work();
    for (std::thread& other : others) other.join();
    sink += std::accumulate(results.begin(), results.end(), 0.0);
}

/// A whole study through the engine's schedule, output left aside.
void ensemble_run(std::int64_t gyros, int threads) {
    struct Nothing final : ensemble::BlockSink {
        void angles(std::size_t, std::span<const simd::LaneCounts> counts) override { last = counts.back()[0]; }
        void finish(const ensemble::BlockResult&) override {}
        std::int64_t last = 0;
    };
    scenario::Scenario scenario = paper();
    scenario.ensemble.gyros = gyros;
    scenario.ensemble.duration_s = 60.0;
    const auto arms = arms_of({"noise_injected", "noise_injected+compensated"});
    const ensemble::Job job{&scenario, arms, 0, gyros,
                            [](std::int64_t, std::size_t) { return std::make_unique<Nothing>(); }};
    ensemble::run({&job, 1}, threads, {});
}

/// Peak memory [MB] of `ringlock run` over a study of so many hours.
double peak_memory_mb(double hours) {
    const test::TemporaryDirectory directory;
    const std::string scenario = (directory.path() / "hours.toml").string();
    const std::string result = (directory.path() / "hours.h5").string();
    std::ofstream(scenario) << fmt::format(
        "[ensemble]\ngyros = 32\nduration_s = {}\n[output]\nangle_record = false\n[arms]\n"
        "names = [\"noise_injected\", \"noise_injected+compensated\", \"noise_injected+compensated_exact\"]\n",
        hours * 3600.0);
    const std::string program = RINGLOCK_PROGRAM;
    std::vector<std::string> words{program, "run", scenario, "-o", result, "--quiet", "--json"};
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, 1, "/dev/null", 1, 0);
    pid_t child = 0;
    if (posix_spawn(&child, program.c_str(), &actions, nullptr, arguments.data(), environ) != 0) {
        throw RunError("cannot start " + program);
    }
    posix_spawn_file_actions_destroy(&actions);
    int status = 0;
    rusage usage{};
    wait4(child, &status, 0, &usage);
    if (status != 0) throw RunError(program + " run failed");
    return static_cast<double>(usage.ru_maxrss) / 1024.0;
}

/// Median time of each stage of a turn with latched readout and both compensators [s a turn].
std::vector<std::pair<std::string, double>> stages() {
    scenario::Scenario scenario = paper();
    scenario.ensemble.gyros = simd::lanes;
    random::LaneIdentities who;
    std::vector<gyro::Device> devices;
    compensate::Calibration calibration;
    calibration.amplitude_margin_rad = test::Drive::amplitude_margin_rad(bench::turn_phase_rms_rad);
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const gyro::Device& device =
            devices.emplace_back(ensemble::draw_setup(scenario, static_cast<std::int64_t>(lane)));
        who.gyro[lane] = lane;
        calibration.b_rad_s[lane] = device.coupling.b_rad_s;
        calibration.dither_amplitude_rad[lane] = device.dither_amplitude_rad;
        calibration.positive_duration_s[lane] = device.positive_duration_s;
        calibration.negative_duration_s[lane] = device.negative_duration_s;
    }
    const auto map = propagate::make_turn_map(devices, {calibration.amplitude_margin_rad}, table_tolerance_rad);
    const std::vector<gyro::Ellipse> ellipses(simd::lanes);
    const readout::LaneReadout readout(devices, ellipses, {false, true, 100e6, 0.005}, readout::Wanted::accelerations);
    dither::LaneDither dither(devices, bench::turn_phase_rms_rad, who);
    compensate::FirstOrder corrected(calibration, compensate::FirstOrder::corrected);
    compensate::Exact exact(calibration, table_tolerance_rad);
    gyro::LaneDrive drive;
    gyro::LaneTurns turns;
    readout::LaneReadings readings;
    readout::LaneAngles angles;
    std::vector<simd::Lanes> noise(2 * piece);
    compensate::LaneErrors errors[2];
    std::vector<simd::LaneCounts> counts[3];
    allan::OctaveStream streams[3];
    const std::vector<std::pair<std::string, std::function<void()>>> work = {
        {"drive: one deviate, amplitude, phase", [&] { dither.next(piece, {}, {}, drive); }},
        {"turn map, with the phase at the turn", [&] { map->step(drive, turns); }},
        {"two deviates of detector noise",
         [&] {
             random::normals(who, random::Purpose::detector_noise, 2 * static_cast<std::uint64_t>(drive.first_turn),
                             2 * piece, simd::lanes, noise.front().data());
         }},
        {"readout: zero-rate point, quadrature, four pulses",
         [&] { readout.read(drive, turns, {noise}, 1, readings, angles); }},
        {"corrected compensator", [&] { corrected.observe(readings, errors[0]); }},
        {"exact compensator", [&] { exact.observe(readings, errors[1]); }},
        {"output counts of three arms",
         [&] {
             for (int arm = 0; arm < 3; ++arm) {
                 ensemble::output_counts(angles, arm == 0 ? nullptr : &errors[arm - 1], piece, counts[arm]);
             }
         }},
        {"Allan sums of three arms", [&] {
             for (int arm = 0; arm < 3; ++arm) streams[arm].add(counts[arm], simd::lanes);
         }}};
    std::vector<std::vector<double>> seconds(work.size());
    for (int round = 0; round < 3000; ++round) {
        for (std::size_t i = 0; i < work.size(); ++i) seconds[i].push_back(seconds_of(work[i].second));
    }
    std::vector<std::pair<std::string, double>> medians;
    for (std::size_t i = 0; i < work.size(); ++i) {
        std::sort(seconds[i].begin(), seconds[i].end());
        medians.emplace_back(work[i].first, seconds[i][seconds[i].size() / 2] / (1.0 * piece * simd::lanes));
    }
    return medians;
}

struct Row {
    std::string figure;
    std::string wanted;
    std::string reached;
    std::string verdict;
};

std::string verdict(bool reached) { return reached ? "reached" : "MISSED"; }

std::string processor() {
    std::ifstream cpuinfo("/proc/cpuinfo");
    std::string name = "unknown processor";
    std::string family;
    std::string model;
    for (std::string line; std::getline(cpuinfo, line) && !line.empty();) {
        const auto value = line.substr(std::min(line.size(), line.find(':') + 2));
        if (line.starts_with("model name")) name = value;
        if (line.starts_with("cpu family")) family = value;
        if (line.starts_with("model\t")) model = value;
    }
    return fmt::format("{} (family {}, model {}), {} hardware threads", name, family, model,
                       std::thread::hardware_concurrency());
}

}  // namespace

int main(int argc, char** argv) {
    bool quick = false;
    bool markdown = false;
    for (int i = 1; i < argc; ++i) {
        quick = quick || std::strcmp(argv[i], "--quick") == 0;
        markdown = markdown || std::strcmp(argv[i], "--markdown") == 0;
    }
    const bool avx512 = simd::active_target() == "AVX3";
    std::vector<Row> rows;

    // Speed first, while nothing else of this program has run.
    Trajectories trajectories;
    DirectTrajectories direct(trajectories.devices());
    Study ideal(scenario::ReadoutModel::ideal,
                {"noise_injected", "noise_injected+compensated", "noise_injected+compensated_exact"});
    Study latched(scenario::ReadoutModel::latched,
                  {"noise_injected", "noise_injected+compensated", "noise_injected+compensated_exact"});
    Study instrument(scenario::ReadoutModel::instrument,
                     {"noise_injected", "noise_injected+compensated", "noise_injected+compensated_exact"});
    Study plain(scenario::ReadoutModel::latched, {"noise_injected"});
    constexpr int pieces = 400;
    constexpr double turns = 1.0 * pieces * piece * simd::lanes;
    std::int64_t drawn = 0;
    Contender kernel{"one normal deviate, one sine-cosine pair", turns, [&] {
                         for (int i = 0; i < pieces; ++i) {
                             sink += bench::normal_and_sincos(1, drawn, piece);
                             drawn += piece;
                         }
                     }};
    Contender map{"noise-injected turns, no readout", turns, [&] { trajectories.advance(pieces); }};
    Contender with_ideal{"with ideal readout, both compensators, Allan", turns, [&] { ideal.advance(pieces); }};
    Contender with_latched{"with latched readout, both compensators, Allan", turns, [&] { latched.advance(pieces); }};
    Contender with_instrument{"with the instrument, both compensators, Allan", turns,
                              [&] { instrument.advance(pieces); }};
    Contender with_plain{"with latched readout and Allan", turns, [&] { plain.advance(pieces); }};
    Contender integrated{"vectorised direct integrator, 1e-8 rad", 16.0 * simd::lanes, [&] { direct.advance(16); }};
    race({&kernel, &map, &with_ideal, &with_latched, &with_instrument, &with_plain, &integrated}, 9);

    const auto profile = stages();

    const gyro::Device device(ensemble::nominal_setup(paper()));
    const std::vector<bench::ReferenceCost> references = bench::reference_costs(device);
    const auto best = *std::min_element(references.begin(), references.end(), [](const auto& a, const auto& b) {
        return a.seconds_per_turn < b.seconds_per_turn;
    });
    race({&map}, 3);  // again beside the references
    const double ratio = best.seconds_per_turn / map.per_turn_s();

    constexpr std::int64_t gyros = 256;
    Contender one{"one thread", 1.0, [&] { ensemble_run(gyros, 1); }};
    Contender two{"two threads", 1.0, [&] { ensemble_run(gyros, 2); }};
    Contender one_loop{"one thread of multiply-adds", 1.0, [&] { multiply_adds(1); }};
    Contender two_loops{"two threads of multiply-adds", 1.0, [&] { multiply_adds(2); }};
    race({&one, &one_loop, &two, &two_loops}, 25);
    const double gain = one.per_turn_s() / two.per_turn_s();
    const double loop_gain = 2.0 * one_loop.per_turn_s() / two_loops.per_turn_s();
    // Round by round: a neighbour that takes a processor away for some seconds takes it from study and loop alike.
    std::vector<double> shares;
    for (std::size_t i = 0; i < one.seconds.size(); ++i) {
        shares.push_back(one.seconds[i] / two.seconds[i] / (2.0 * one_loop.seconds[i] / two_loops.seconds[i]));
    }
    const double share = median_of(shares);

    const double memory_one = peak_memory_mb(1.0);
    const double memory_ten = peak_memory_mb(10.0);

    const int error_turns = quick ? 400 : 10000;
    const double error = worst_turn_error_rad(error_turns);
    const test::LongDrive long_drive{.turns = quick ? 10000 : 1000000, .table_tolerance_rad = table_tolerance_rad};
    const std::size_t long_gyros = quick ? 16 : 64;
    auto differences = test::drive_differences(test::long_drive_setups(long_gyros, 15.0, 2007), long_drive);
    std::vector<double> finals;
    double largest = 0.0;
    for (const test::DriveDifference& difference : differences) {
        finals.push_back(std::abs(difference.final_rad));
        largest = std::max(largest, difference.largest_rad);
    }
    std::sort(finals.begin(), finals.end());
    const double median = 0.5 * (finals[finals.size() / 2] + finals[(finals.size() - 1) / 2]);

    rows.push_back({fmt::format("error of a production turn against the direct integrator at 1e-12 rad, worst of {} "
                                "(+-5 % amplitude, +-50 000 deg/h, +-5 % asymmetry)",
                                error_turns),
                    "<= 1e-9 rad", fmt::format("{:.1e} rad", error), verdict(error <= 1e-9)});
    rows.push_back({fmt::format("difference of the final angle after {} turns of the same noise-injected drive from "
                                "half cycles solved one by one, median of {} gyros",
                                long_drive.turns, long_gyros),
                    "<= 1e-6 rad", fmt::format("{:.1e} rad (largest on the way {:.1e} rad)", median, largest),
                    verdict(median <= 1e-6)});
    rows.push_back({fmt::format("time a turn at 1e-8 rad, {} (the faster of Boost.odeint and CVODE), over a "
                                "production turn",
                                best.name),
                    ">= 250 000", fmt::format("{:.0f}", ratio), verdict(ratio >= 250000.0)});
    rows.push_back({"the same of ringlock's own vectorised direct integrator", "reported",
                    fmt::format("{:.0f}", integrated.per_turn_s() / map.per_turn_s()), "-"});
    rows.push_back({"turns a second and core, noise-injected, no readout", avx512 ? ">= 1e8 (AVX-512)" : "reported",
                    fmt::format("{:.3g}", 1.0 / map.per_turn_s()), avx512 ? verdict(map.per_turn_s() <= 1e-8) : "-"});
    rows.push_back({"time of such a turn over one normal deviate and one sine-cosine pair", "<= 3",
                    fmt::format("{:.2f}", map.per_turn_s() / kernel.per_turn_s()),
                    verdict(map.per_turn_s() <= 3.0 * kernel.per_turn_s())});
    rows.push_back(
        {"turns a second and core with ideal readout, corrected and exact compensator, Allan deviations of "
         "three arms",
         avx512 ? ">= 3e7" : "reported", fmt::format("{:.3g}", 1.0 / with_ideal.per_turn_s()),
         avx512 ? verdict(with_ideal.per_turn_s() <= 1.0 / 3e7) : "-"});
    rows.push_back({"the same with latched readout: detector noise, pulses on a clock", avx512 ? ">= 3e7" : "reported",
                    fmt::format("{:.3g}", 1.0 / with_latched.per_turn_s()),
                    avx512 ? verdict(with_latched.per_turn_s() <= 1.0 / 3e7) : "-"});
    rows.push_back({"the same with the instrument: noisy comparators, converter, phase recovered from eight pulses",
                    "reported", fmt::format("{:.3g}", 1.0 / with_instrument.per_turn_s()), "-"});
    rows.push_back({"the same with latched readout, no compensator", "reported",
                    fmt::format("{:.3g}", 1.0 / with_plain.per_turn_s()), "-"});
    rows.push_back({"two threads over one, of what independent multiply-adds gain", ">= 0.95",
                    fmt::format("{:.3f} ({:.2f} of {:.2f})", share, gain, loop_gain), verdict(share >= 0.95)});
    rows.push_back({"peak memory of a study, 10 h over 1 h", "within 5 %",
                    fmt::format("{:.3f} ({:.1f} and {:.1f} MB)", memory_ten / memory_one, memory_ten, memory_one),
                    verdict(std::abs(memory_ten / memory_one - 1.0) <= 0.05)});

    report::Table table({{"figure", report::Align::left},
                         {"to reach", report::Align::right},
                         {"reached", report::Align::right},
                         {"", report::Align::left}});
    if (markdown) fmt::print("| figure | to reach | reached | |\n|---|---|---|---|\n");
    for (const Row& row : rows) {
        if (markdown) {
            fmt::print("| {} | {} | {} | {} |\n", row.figure, row.wanted, row.reached, row.verdict);
        } else {
            table.add_row({row.figure, row.wanted, row.reached, row.verdict});
        }
    }
    if (!markdown) fmt::print("{}", table.text());

    fmt::print("\n");
    if (markdown) fmt::print("| one turn by | nanoseconds | worst error [rad] |\n|---|---|---|\n");
    const auto line = [&](const std::string& name, double seconds, const std::string& worst) {
        if (markdown) {
            fmt::print("| {} | {:.4g} | {} |\n", name, seconds * 1e9, worst);
        } else {
            fmt::print("{:<60} {:>12.4g} ns  {}\n", name, seconds * 1e9, worst);
        }
    };
    for (const Contender* each :
         {&kernel, &map, &with_plain, &with_ideal, &with_latched, &with_instrument, &integrated}) {
        line(each->name, each->per_turn_s(), "");
    }
    for (const bench::ReferenceCost& reference : references) {
        line(fmt::format("{}, {:.1e} a step", reference.name, reference.tolerance_rad), reference.seconds_per_turn,
             fmt::format("{:.1e}", reference.worst_error_rad));
    }
    fmt::print("\n");
    if (markdown) fmt::print("| stage of a turn with latched readout | nanoseconds |\n|---|---|\n");
    for (const auto& [stage, seconds] : profile) {
        if (markdown) {
            fmt::print("| {} | {:.2f} |\n", stage, seconds * 1e9);
        } else {
            fmt::print("{:<60} {:>12.2f} ns\n", stage, seconds * 1e9);
        }
    }
    fmt::print(
        "\nMachine: {}; instruction set {}; {}; tables to {:.0e} rad a turn. Times are medians of rounds in which "
        "all methods take turns, a gyro at a time on one thread.\n",
        processor(), simd::active_target(), "GCC " __VERSION__, table_tolerance_rad);
    fmt::print(stderr, "(checksum {:.6g})\n", sink);
    return 0;
}
