// Turns per second of the ways to go from turn to turn, side by side in one run, on one thread.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "analysis/report/table.hpp"
#include "engine/compensate/first_order.hpp"
#include "engine/dither/drive.hpp"
#include "engine/dither/lane_dither.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/trajectory.hpp"
#include "engine/propagate/direct.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/turn_map.hpp"
#include "tests/bench/noisy_dither.hpp"
#include "tests/bench/reference_cost.hpp"
#include "tests/support/series_integrator.hpp"

namespace {

using namespace ringlock;

/// Goes through a number of turns and returns something that depends on all of them.
using Contender = std::function<double(int turns)>;

struct Entry {
    std::string name;
    int turns;  ///< of one round, chosen to take some tenths of a second
    Contender run;
    double worst_error_rad = 0.0;  ///< of a half cycle, against the direct integrator at 1e-13; 0: not asked for
    std::vector<double> seconds_per_turn = {};
};

/// The same noisy dither for all propagators.
Contender through(std::shared_ptr<propagate::Propagator> propagator, const gyro::Device& device) {
    return [propagator, device](int turns) { return bench::go_through(*propagator, device, turns); };
}

/// A block of gyros under the same noisy dither, each with its own noise; a turn of one gyro counts as one.
Contender through_block(const gyro::Device& device) {
    return [device](int turns) {
        const std::vector<gyro::Device> devices(simd::lanes, device);
        random::LaneIdentities who;
        who.seed = 1;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = lane;
        dither::LaneDither dither(devices, 3.0, who);
        propagate::DirectLanes direct(devices, 1e-8);
        gyro::LaneDrive drive;
        gyro::LaneTurns at_turns;
        dither.next(static_cast<std::size_t>(turns) / simd::lanes, {}, {}, drive);
        direct.step(drive, &at_turns);
        return at_turns.lockin_fringes.back()[0];
    };
}

Contender read_and_corrected(const scenario::Scenario& scenario) {
    return [scenario](int turns) {
        const gyro::Setup setup = ensemble::nominal_setup(scenario);
        ensemble::Trajectory trajectory(scenario, setup, {1, 0}, ensemble::Trajectory::Kind::noise_injected);
        compensate::Corrected compensator({gyro::Device(setup).coupling.b_rad_s});
        for (int turn = 0; turn < turns; ++turn) {
            compensator.observe(trajectory.read().reading);
            trajectory.advance();
        }
        return compensator.error_rad();
    };
}

}  // namespace

int main() {
    scenario::Scenario scenario;
    scenario.effects["quantum_noise"]["deg_rt_h"] = 0.0;
    const gyro::Device device(ensemble::nominal_setup(scenario));
    const double a = device.dither_amplitude_rad;
    const double margin = dither::Drive::amplitude_margin_rad(3.0);
    const auto map = std::make_shared<propagate::TurnMap>(
        device,
        propagate::HalfCycleRanges{{a - margin, a + margin},
                                   {device.input_rate_rad_s, device.input_rate_rad_s},
                                   {device.coupling.b_rad_s, device.coupling.b_rad_s}},
        1e-8);
    scenario::Scenario ideal = scenario;
    ideal.readout.model = scenario::ReadoutModel::ideal;

    const std::vector<bench::SolvedHalfCycle> truth = bench::solved_half_cycles(device);
    std::vector<Entry> entries;
    const auto add_propagator = [&](const std::string& name, int turns,
                                    std::shared_ptr<propagate::Propagator> propagator) {
        const double error = bench::worst_error_rad(*propagator, truth);
        entries.push_back({name, turns, through(std::move(propagator), device), error});
    };
    add_propagator("scalar Taylor series, 1e-8 rad", 60,
                   std::make_shared<test::SeriesIntegrator>(device.coupling, 1e-8));
    add_propagator("direct integrator, one gyro, 1e-8 rad", 120,
                   std::make_shared<propagate::DirectIntegrator>(device.coupling, 1e-8));
    entries.push_back({"direct integrator, 16 gyros, 1e-8 rad", 960, through_block(device)});
    for (bench::Reference& reference : bench::references(device)) {
        entries.push_back({fmt::format("{}, {:.1e} a step", reference.name, reference.tolerance_rad), 20,
                           through(std::move(reference.propagator), device), reference.worst_error_rad});
    }
    add_propagator("turn map, 1e-8 rad", 1000000, map);
    entries.push_back({"turn map, ideal readout, corrected", 300000, read_and_corrected(ideal)});
    entries.push_back({"turn map, instrument readout, corrected", 60000, read_and_corrected(scenario)});

    constexpr int rounds = 5;
    double sink = 0.0;
    for (int round = 0; round < rounds; ++round) {  // in turns, so that a machine that slows down slows all
        for (Entry& entry : entries) {
            const auto start = std::chrono::steady_clock::now();
            sink += entry.run(entry.turns);
            const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
            entry.seconds_per_turn.push_back(seconds / entry.turns);
        }
    }
    for (Entry& entry : entries) std::sort(entry.seconds_per_turn.begin(), entry.seconds_per_turn.end());
    const auto median = [](const Entry& entry) { return entry.seconds_per_turn[rounds / 2]; };

    report::Table table({{"one turn by", report::Align::left},
                         {"microseconds", report::Align::right},
                         {"turns per second", report::Align::right},
                         {"worst error [rad]", report::Align::right},
                         {"over the first", report::Align::right}});
    for (const Entry& entry : entries) {
        table.add_row({entry.name, fmt::format("{:.4g}", median(entry) * 1e6),
                       fmt::format("{:.3g}", 1.0 / median(entry)),
                       entry.worst_error_rad > 0.0 ? fmt::format("{:.1e}", entry.worst_error_rad) : "-",
                       fmt::format("{:.4g}", median(entries.front()) / median(entry))});
    }
    fmt::print("{}", table.text());
    fmt::print(
        "Of Boost.odeint and CVODE: the loosest tolerance of a step, by factors of sqrt(10), whose worst error is "
        "measured to be at most 1e-8 rad.\n");
    fmt::print("Median of {} rounds, one thread, noise-injected dither of Gao & Deng's device. (checksum {:.6f})\n",
               rounds, sink);
    return 0;
}
