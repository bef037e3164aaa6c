// What the solutions of one half cycle cost that a run makes once, or does without: medians of rounds side by side, on
// one thread. What a turn of a run costs is in bench_engine.
#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "analysis/report/table.hpp"
#include "engine/dither/lane_dither.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/half_turn.hpp"
#include "engine/propagate/lane_propagator.hpp"
#include "engine/propagate/phase_tables.hpp"
#include "engine/propagate/rotation.hpp"
#include "engine/propagate/turn_tables.hpp"
#include "engine/scenario/text/parse.hpp"
#include "engine/simd/target.hpp"
#include "tests/bench/noisy_dither.hpp"
#include "tests/support/drive.hpp"

namespace {

using namespace ringlock;

constexpr std::size_t piece = 128;
constexpr double tolerance_rad = scenario::Propagation{}.turn_map_tolerance_rad;

const char* const turn_of_a_run = "turn of a run, ideal readout, `turns`";

double sink = 0.0;  // so that nothing is left out as unused

struct Contender {
    std::string name;
    double pieces;  ///< of one call
    std::function<void()> run;
    std::vector<double> seconds = {};
    double median_s() {
        std::sort(seconds.begin(), seconds.end());
        return seconds[seconds.size() / 2] / pieces;
    }
};

/// The paper's device; with a second harmonic of the coupling where asked for.
gyro::Device device(bool second_harmonic) {
    gyro::Setup setup = ensemble::nominal_setup({});
    if (second_harmonic) setup.lockin_second_ratio = 0.1;
    return gyro::Device(setup);
}

/// A block of production gyros under injected noise, without readout.
class Block {
   public:
    explicit Block(bool second_harmonic)
        : devices_(simd::lanes, device(second_harmonic)),
          dither_(devices_, bench::turn_phase_rms_rad, identities()),
          map_(propagate::make_turn_map(devices_, {test::Drive::amplitude_margin_rad(bench::turn_phase_rms_rad)},
                                        tolerance_rad)) {
        advance();  // tables
    }
    void advance() {
        dither_.next(piece, {}, {}, drive_);
        map_->step(drive_, turns_);
        sink += turns_.lockin_fringes[1][0];
    }

   private:
    static random::LaneIdentities identities() {
        random::LaneIdentities who;
        who.seed = 1;
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = lane;
        return who;
    }
    std::vector<gyro::Device> devices_;
    dither::LaneDither dither_;
    std::unique_ptr<propagate::LanePropagator> map_;
    gyro::LaneDrive drive_;
    gyro::LaneTurns turns_;
};

/// A block of gyros of a device under injected noise, with an ideal readout: what a turn of a run costs.
class DeviceBlock {
   public:
    DeviceBlock(const std::string& device, const std::string& noise)
        : scenario_(scenario::parse_string(
              fmt::format("device = \"{}\"\n[readout]\nmodel = \"ideal\"\n[arms]\nnames = [\"noise_injected\"]\n"
                          "[noise_injection]\nturn_phase_rms_rad = 3.0\n{}",
                          device, noise),
              "case")),
          block_(scenario_, scenario_.arms, 0, simd::lanes) {
        advance();  // tables
    }
    void advance() {
        block_.advance(piece);
        sink += block_.lockin_error_rad(0, 0, 0);
    }

   private:
    scenario::Scenario scenario_;
    ensemble::GyroBlock block_;
};

/// Ranges of a table under injected noise.
propagate::HalfCycleRanges noisy_ranges(const gyro::Device& device) {
    const double a = device.dither_amplitude_rad;
    const double margin = test::Drive::amplitude_margin_rad(bench::turn_phase_rms_rad);
    return {{a - margin, a + margin},
            {device.input_rate_rad_s, device.input_rate_rad_s},
            {device.coupling.b_rad_s, device.coupling.b_rad_s}};
}

void integrate_half_cycles(const gyro::Device& device, std::size_t gyros) {
    std::vector<propagate::Stretch> stretches;
    for (std::size_t i = 0; i < gyros; ++i) {
        const gyro::HalfCycle half = device.half_cycle(1.0, device.dither_amplitude_rad);
        stretches.push_back({half, device.coupling, 0.1 * static_cast<double>(i), half.duration_s});
    }
    std::vector<propagate::StretchResult> results(gyros);
    propagate::integrate(stretches, scenario::Propagation{}.direct_tolerance_rad, results);
    sink += results[0].lockin_rad;
}

}  // namespace

int main() {
    const gyro::Device moebius = device(false);
    const gyro::Device series = device(true);
    Block moebius_block(false);
    Block series_block(true);
    const gyro::HalfCycle half = moebius.half_cycle(1.0, moebius.dither_amplitude_rad);
    const std::vector<propagate::HalfTurnProblem> problems(8 * simd::lanes,
                                                           propagate::beginning(half, moebius.coupling));
    std::vector<propagate::HalfTurn> half_turns(problems.size());
    const std::string drive = "model = \"drive\"\nresonator_q = 100.0\n";
    DeviceBlock device_blocks[] = {
        {"gao-deng-2007", ""}, {"gao-deng-2007", drive}, {"triangle-20mm", ""}, {"triangle-20mm", drive}};
    Contender contenders[] = {
        {"an exact half turn, many at once", static_cast<double>(problems.size()),
         [&] {
             propagate::exact_half_turns(problems, half_turns);
             sink += half_turns[0].shift_rad;
         }},
        {"the mean rate of a cycle in closed form", 1.0,
         [&] { sink += propagate::mean_rate_error_deg_h(propagate::exact_cycle(moebius), moebius); }},
        {"tables of a gyro, Moebius maps", 1.0,
         [&] {
             propagate::TurnTables tables(tolerance_rad);
             tables.make(0, moebius, noisy_ranges(moebius));
             sink += tables.measured_error_rad(0);
         }},
        {"tables of a gyro, second harmonic of the coupling", 1.0,
         [&] {
             propagate::PhaseTables tables(tolerance_rad);
             tables.make(0, series, noisy_ranges(series));
             sink += tables.measured_error_rad(0);
         }},
        {"drive and turn of a gyro, Moebius maps", 1.0 * piece * simd::lanes, [&] { moebius_block.advance(); }},
        {"drive and turn of a gyro, second harmonic", 1.0 * piece * simd::lanes, [&] { series_block.advance(); }},
        {turn_of_a_run, 1.0 * piece * simd::lanes, [&] { device_blocks[0].advance(); }},
        {"turn of a run, ideal readout, `drive`, held", 1.0 * piece * simd::lanes, [&] { device_blocks[1].advance(); }},
        {"turn of a run, 26 fringes, `turns`", 1.0 * piece * simd::lanes, [&] { device_blocks[2].advance(); }},
        {"turn of a run, 26 fringes, `drive`, held", 1.0 * piece * simd::lanes, [&] { device_blocks[3].advance(); }},
        {"half cycle by direct integration, in blocks", 1.0 * simd::lanes,
         [&] { integrate_half_cycles(moebius, simd::lanes); }},
        {"half cycle by direct integration, alone", 1.0, [&] { integrate_half_cycles(moebius, 1); }},
    };
    for (int round = 0; round < 15; ++round) {
        for (Contender& contender : contenders) {
            const auto start = std::chrono::steady_clock::now();
            contender.run();
            contender.seconds.push_back(
                std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
        }
    }
    report::Table table({{"injected noise of 3 rad, paper's device unless stated", report::Align::left},
                         {"us", report::Align::right},
                         {"over a turn of a run", report::Align::right}});
    double turn_s = 0.0;
    for (Contender& contender : contenders) {
        if (contender.name == turn_of_a_run) turn_s = contender.median_s();
    }
    for (Contender& contender : contenders) {
        const double seconds = contender.median_s();
        const bool is_turn = contender.name.find("turn of a") != std::string::npos;
        table.add_row({contender.name, fmt::format("{:.3g}", 1e6 * seconds),
                       is_turn ? fmt::format("{:.2f}", seconds / turn_s) : std::string()});
    }
    fmt::print("{}\nInstruction set {}. Direct integration to {:.0e} rad, tables to {:.0e} rad.\n", table.text(),
               simd::active_target(), scenario::Propagation{}.direct_tolerance_rad, tolerance_rad);
    fmt::print(stderr, "(checksum {:.6g})\n", sink);
    return 0;
}
