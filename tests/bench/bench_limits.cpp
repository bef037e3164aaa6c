// The figures of results/compensation/tables.md, one block of Markdown after another.
//
//   bench_limits [BLOCK [FIGURE.svg]]
//
// Without arguments every block; `--list` names them. With a file the block detector-noise also draws its picture.
// tools/limits puts them into the page.
#include <fmt/format.h>
#include <malloc.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "analysis/report/plot.hpp"
#include "engine/compensate/coupling_filter.hpp"
#include "engine/compensate/exact.hpp"
#include "engine/compensate/extrapolated.hpp"
#include "engine/compensate/first_order.hpp"
#include "engine/compensate/two_train.hpp"
#include "engine/core/units.hpp"
#include "engine/dither/lane_dither.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/ensemble/calibration.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/gyro/theory.hpp"
#include "engine/readout/fraction_recovery.hpp"
#include "engine/readout/pulse_tables.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/devices.hpp"
#include "engine/scenario/injected_noise.hpp"
#include "engine/scenario/text/parse.hpp"
#include "tests/bench/page.hpp"
#include "tests/support/limits.hpp"

namespace {

using namespace ringlock;
namespace li = ringlock::test::limits;
using li::Ratio;

void row(const std::vector<std::string>& cells) {
    for (const std::string& cell : cells) fmt::print("| {} ", cell);
    fmt::print("|\n");
}
void head(const std::vector<std::string>& cells) {
    row(cells);
    for (std::size_t i = 0; i < cells.size(); ++i) fmt::print("|---");
    fmt::print("|\n");
}

/// Three digits behind the point below 10, four digits from there on.
std::string number(double value) { return value < 10.0 ? fmt::format("{:.3f}", value) : fmt::format("{:#.4g}", value); }
std::string text(const Ratio& ratio) {
    return fmt::format("{} ({} .. {})", number(ratio.value), number(ratio.lo), number(ratio.hi));
}

std::string short_name(const std::string& arm) { return arm.substr(arm.find('+') + 1); }

/// The study of scenarios/what-limits.toml, with every compensator that there is.
scenario::Scenario base() {
    scenario::Scenario scenario = scenario::parse_file(RINGLOCK_SOURCE_DIR "/scenarios/what-limits.toml");
    scenario.arms = scenario::parse_arms(li::compensated_arms());
    return scenario;
}

/// Comparators want a hysteresis of several times their noise.
void set_noise(scenario::Scenario& scenario, double relative) {
    scenario.readout.detector_noise_relative = scenario.readout.comparator_noise_relative = relative;
    scenario.readout.comparator_hysteresis_relative = std::max(0.03, 6.0 * relative);
}

struct Point {
    std::string label;
    scenario::Scenario scenario;
    double x = 0.0;
};

std::vector<Point> detector_noise_points() {
    std::vector<Point> points;
    for (const double per_cent : {0.05, 0.1, 0.2, 0.5, 1.0, 2.0}) {
        points.push_back({fmt::format("{:g} %", per_cent), base(), per_cent});
        set_noise(points.back().scenario, 0.01 * per_cent);
    }
    return points;
}

std::vector<Point> converter_points() {
    std::vector<Point> points;
    for (const int bits : {6, 7, 8, 10, 12, 14, 16, 0}) {
        points.push_back({bits > 0 ? fmt::format("{} bits", bits) : "none", base()});
        points.back().scenario.readout.adc_bits = bits;
    }
    return points;
}

std::vector<Point> clock_points() {
    std::vector<Point> points;
    for (const double mhz : {1.0, 3.0, 10.0, 30.0, 100.0, 1000.0, 0.0}) {
        points.push_back({mhz > 0.0 ? fmt::format("{:g} MHz", mhz) : "none", base()});
        points.back().scenario.readout.clock_hz = 1e6 * mhz;
    }
    return points;
}

std::vector<Point> threshold_points() {
    std::vector<Point> points;
    for (const double per_cent : {0.0, 0.1, 1.0, 5.0, 10.0, 30.0}) {
        points.push_back({fmt::format("{:g} %", per_cent), base()});
        points.back().scenario.calibration.threshold_error_relative = 0.01 * per_cent;
    }
    return points;
}

std::vector<Point> injected_noise_points() {
    std::vector<Point> points;
    for (const double rad : {3.0, 5.0, 10.0, 20.0, 30.0}) {
        points.push_back({fmt::format("{:g} rad", rad), base()});
        points.back().scenario.noise_injection.turn_phase_rms_rad = rad;
    }
    return points;
}

std::vector<Point> coupling_phase_points() {
    std::vector<Point> points;
    for (const double rad : {0.0, 0.1, 0.5}) {
        points.push_back({fmt::format("{:g} rad", rad), base()});
        points.back().scenario.effects["detector_phase_offset"]["phase_rad"] = rad;
    }
    return points;
}

std::vector<Point> phase_from_points() {
    std::vector<Point> points;
    for (const bool pulses : {false, true}) {
        points.push_back({pulses ? "detectors and pulses" : "detectors", base()});
        points.back().scenario.readout.phase_from =
            pulses ? scenario::PhaseFrom::detectors_and_pulses : scenario::PhaseFrom::detectors;
    }
    return points;
}

/// With which point's exact arm the others are compared: their own, or that of the first, whose parameters are known.
enum class Reference { own, first, last };

struct Measured {
    li::Bounds bounds;
    li::Walks walks;
};

std::vector<Measured> table(const std::string& what, const std::vector<Point>& points, Reference reference) {
    std::vector<Measured> measured;
    for (const Point& point : points) {
        measured.push_back({li::bounds(point.scenario), li::walks(point.scenario)});
    }
    const std::vector<std::string>& arms = measured.front().walks.arms;
    std::vector<std::string> titles = {what, "bound [mrad]", "bound [1e-6 deg/sqrt(h)]"};
    for (const std::string& arm : arms) titles.push_back(short_name(arm));
    fmt::print("Random walk over the bound:\n\n");
    head(titles);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const double bound_rad = measured[i].bounds.known_rad;
        const double bound = li::walk_deg_rt_h(points[i].scenario, bound_rad);
        std::vector<std::string> cells = {points[i].label, fmt::format("{:.4f}", 1e3 * bound_rad),
                                          fmt::format("{:.4f}", 1e6 * bound)};
        for (const std::string& arm : arms) cells.push_back(text(li::over(measured[i].walks.of(arm), bound)));
        row(cells);
    }
    fmt::print("\nOver that of the exact compensator{}:\n\n", reference == Reference::own ? ""
                                                              : reference == Reference::first
                                                                  ? fmt::format(" at {}", points.front().label)
                                                                  : fmt::format(" with {}", points.back().label));
    std::vector<std::string> others = {what};
    for (const std::string& arm : arms) {
        if (reference != Reference::own || arm != li::exact_arm) others.push_back(short_name(arm));
    }
    head(others);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const std::size_t of = reference == Reference::own ? i : reference == Reference::first ? 0 : points.size() - 1;
        std::vector<std::string> cells = {points[i].label};
        for (const std::string& arm : arms) {
            if (reference == Reference::own && arm == li::exact_arm) continue;
            if (i == of && arm == li::exact_arm) {
                cells.push_back("1");
                continue;
            }
            cells.push_back(text(li::over(measured[i].walks.of(arm), measured[of].walks.of(li::exact_arm))));
        }
        row(cells);
    }
    return measured;
}

/// Rate that a coupling phase off by e leaves, over -sin e: (kappa^2/2) (K/2 pi) f_D.
double rate_per_phase_deg_h(const scenario::Scenario& scenario) {
    const gyro::Setup setup = ensemble::nominal_setup(scenario);
    const double kappa = gyro::turn_kick_rad(setup);
    return 0.5 * kappa * kappa * setup.scale_factor_arcsec / units::two_pi * setup.dither_frequency_hz;
}

/// What a coupling phase that is not told leaves of a rate, and what of it is expected.
void coupling_phase() {
    const std::vector<Point> points = coupling_phase_points();
    const std::vector<Measured> measured = table("coupling phase", points, Reference::first);
    const double per_sine_deg_h = rate_per_phase_deg_h(points.front().scenario);
    fmt::print("\nMean rate error over the gyros [1e-3 deg/h], +- its standard error:\n\n");
    const std::vector<std::string>& arms = measured.front().walks.arms;
    std::vector<std::string> titles = {"coupling phase", "-(kappa^2/2) sin e a cycle"};
    for (const std::string& arm : arms) titles.push_back(short_name(arm));
    head(titles);
    for (std::size_t i = 0; i < points.size(); ++i) {
        const double phase_rad = points[i].scenario.effects.at("detector_phase_offset").at("phase_rad");
        std::vector<std::string> cells = {
            points[i].label,
            phase_rad == 0.0 ? "0" : fmt::format("{:.2f}", -1e3 * per_sine_deg_h * std::sin(phase_rad))};
        for (const std::vector<double>& rates : measured[i].walks.rate_error_deg_h) {
            double mean = 0.0, square = 0.0;
            const auto n = static_cast<double>(rates.size());
            for (const double rate : rates) mean += rate / n;
            for (const double rate : rates) square += std::pow(rate - mean, 2) / (n - 1.0);
            cells.push_back(fmt::format("{:.2f} +- {:.2f}", 1e3 * mean, 1e3 * std::sqrt(square / n)));
        }
        row(cells);
    }
}

/// Allan deviation times the root of the averaging time over the bound: one figure where there is a walk alone.
void averaging_time(const scenario::Scenario& scenario) {
    const li::Walks walks = li::walks(scenario);
    const double bound = li::walk_deg_rt_h(scenario, li::bounds(scenario).known_rad);
    std::vector<std::string> titles = {"averaging time [s]"};
    for (const std::string& arm : walks.arms) titles.push_back(short_name(arm));
    head(titles);
    for (std::size_t i = 0; i < walks.tau_s.size(); ++i) {
        if (walks.tau_s[i] < 0.9 || i % 2 != 0) continue;
        std::vector<std::string> cells = {fmt::format("{:.1f}", walks.tau_s[i])};
        for (const auto& arm : walks.squared_at) cells.push_back(text(li::over(arm[i], bound)));
        row(cells);
    }
}

void averaging_times() {
    averaging_time(base());
    fmt::print("\nA record of 8000 s that begins after 4000 s:\n\n");
    scenario::Scenario scenario = base();
    scenario.arms = scenario::parse_arms({li::exact_arm, li::adaptive_arm});
    scenario.ensemble.settle_s = 4000.0;
    scenario.ensemble.duration_s = 8000.0;
    averaging_time(scenario);
}

/// How well turns show the coupling, and what they show in the mean, where the tables are those of the true one.
struct Shown {
    double by_a_turn = 0.0;  ///< error over the coupling, and of its phase [rad]: from the weights of the bends
    double size_off = 0.0;   ///< mean over the gyros
    double phase_off_rad = 0.0;
    double standard_error = 0.0;  ///< of either
};

Shown shown(scenario::Scenario scenario, std::size_t turns) {
    constexpr std::size_t first = 1024;
    constexpr std::size_t piece = 128;
    scenario.readout.phase_from = scenario::PhaseFrom::detectors;
    const std::vector<scenario::Arm> arms{scenario::parse_arm(li::exact_arm)};
    ensemble::GyroBlock block(scenario, arms, 0, simd::lanes);
    const std::vector<gyro::Device> devices(block.setups().begin(), block.setups().end());
    readout::FractionRecovery recovery(devices, ensemble::electronics_of(scenario),
                                       scenario::injected_noise(scenario).amplitude_rms_rad);
    recovery.learn();
    for (std::size_t done = 0; done < first + turns; done += piece) {
        for (std::size_t lane = 0; done == first && lane < simd::lanes; ++lane) recovery.forget_bends(lane);
        block.advance(piece);
        readout::LaneReadings readings = block.readings(0);
        recovery.recover(readings, nullptr);
    }
    Shown shown;
    double weight = 0.0;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        const auto bends = recovery.bends(lane);
        weight += bends.yy / simd::lanes;
        shown.size_off += bends.x / bends.xx / simd::lanes;
        shown.phase_off_rad += bends.y / bends.yy / simd::lanes;
    }
    shown.by_a_turn = std::sqrt(static_cast<double>(turns) / weight);
    shown.standard_error = 1.0 / std::sqrt(simd::lanes * weight);
    return shown;
}

/// Of the size of the coupling that the adaptive compensator learns, in the long run (docs/dev/compensation.md).
struct SizeMemory {
    double seconds = 0.0;
    double known_to = 0.0;  ///< relative
};
SizeMemory size_memory(const scenario::Scenario& scenario) {
    const double second = shown(scenario, 4096).by_a_turn / std::sqrt(2.0 * scenario.dither.frequency_hz);
    const double memory_s = std::sqrt(second / compensate::CouplingFilter::slope_walk_s_rt_s);
    return {memory_s, second * std::sqrt(std::numbers::sqrt2 / memory_s)};
}

/// The gyros of scenarios/devices: the bounds both ways, and what compensators leave over the one that holds for them,
/// that of a processor that corrects a turn before it has seen the next.
void devices() {
    head({"device", "fringes", "parabola wrong by, pi/2 and 2 pi from the extremum [mrad]", "kick [rad]",
          "bound, psi'' known [mrad]", "psi'' as known at the turn [mrad]", "exact over the latter", "first order",
          "size learnt to, over the latter", "adaptive over exact", "expected of that size",
          "exact, ideal readout, lowers the walk by"});
    for (const scenario::DeviceFile& file : scenario::device_files()) {
        const scenario::NamedDevice device = scenario::read_device(file);
        scenario::Scenario scenario = base();
        scenario.device = device.name;
        scenario.gyro = device.scenario.gyro;
        scenario.dither = device.scenario.dither;
        scenario.ensemble.duration_s = 600.0;
        // Learning is over after some memories of the size.
        const SizeMemory memory = size_memory(scenario);
        scenario.ensemble.settle_s = std::max(200.0, 4.0 * memory.seconds);
        scenario.arms = scenario::parse_arms({li::exact_arm, li::adaptive_arm, "noise_injected+compensated"});
        const li::Bounds bounds = li::bounds(scenario);
        const li::Walks walks = li::walks(scenario);
        const double bound = li::walk_deg_rt_h(scenario, bounds.learnt_rad);
        scenario::Scenario ideal = scenario;
        ideal.readout = {};
        ideal.readout.model = scenario::ReadoutModel::ideal;
        ideal.ensemble.gyros = 16;
        ideal.ensemble.settle_s = 0.0;
        ideal.arms = scenario::parse_arms({"noise_injected", li::exact_arm});
        const li::Walks lowered = li::walks(ideal);
        const gyro::Setup setup = ensemble::nominal_setup(scenario);
        const auto parabola_mrad = [&setup](double distance_rad) {
            const double factor =
                readout::PulseTables::sinusoid_factor(distance_rad / gyro::modulation_depth_rad(setup));
            return 1e3 * distance_rad * (factor * factor - 1.0);
        };
        row({device.name, fmt::format("{:.0f}", gyro::modulation_depth_rad(setup) / units::pi),
             fmt::format("{:.3g}, {:.3g}", parabola_mrad(0.5 * units::pi), parabola_mrad(units::two_pi)),
             fmt::format("{:.3f}", gyro::turn_kick_rad(setup)), fmt::format("{:.3f}", 1e3 * bounds.known_rad),
             fmt::format("{:.3f}", 1e3 * bounds.learnt_rad), text(li::over(walks.of(li::exact_arm), bound)),
             text(li::over(walks.of("noise_injected+compensated"), bound)),
             fmt::format("{:.2f}", memory.known_to / bounds.learnt_rad),
             text(li::over(walks.of(li::adaptive_arm), walks.of(li::exact_arm))),
             fmt::format("{:.3f}", std::hypot(1.0, memory.known_to / bounds.learnt_rad)),
             fmt::format("{:.2g}", li::over(lowered.of("noise_injected"), lowered.of(li::exact_arm)).value)});
        std::fflush(stdout);
    }
}

/// What the filter of the coupling makes of its turns in the long run, see docs/dev/compensation.md.
void learning() {
    using Filter = compensate::CouplingFilter;
    head({"", "shown by a turn", "memory of the size [s]", "size known to [1e-3]", "memory of the phase [h]",
          "phase known to [1e-3 rad]", "rate left by it [1e-6 deg/h]", "its walk beyond that memory, over the bound",
          "a tenth over the bound from [h]", "after a time t, from"});
    const auto line = [](const std::string& label, const scenario::Scenario& scenario) {
        const double second = shown(scenario, 4096).by_a_turn / std::sqrt(2.0 * scenario.dither.frequency_hz);
        const double memory_s = std::sqrt(second / Filter::slope_walk_s_rt_s);
        const double size = second * std::sqrt(std::numbers::sqrt2 / memory_s);
        const double phase_memory_s = second / Filter::phase_walk_rad_rt_s;
        const double phase_rad = std::sqrt(second * Filter::phase_walk_rad_rt_s);
        const double per_radian = rate_per_phase_deg_h(scenario);
        const double bound = li::walk_deg_rt_h(scenario, li::bounds(scenario).known_rad);
        const double walk = per_radian * second * units::deg_rt_h_per_arcsec_rt_s / bound;
        const double share = std::sqrt(3.0 * (1.1 * 1.1 - 1.0)) / walk;
        row({label, fmt::format("{:.4f}", second * std::sqrt(2.0 * scenario.dither.frequency_hz)),
             fmt::format("{:.0f}", memory_s), fmt::format("{:.2f}", 1e3 * size),
             fmt::format("{:.1f}", phase_memory_s / 3600.0), fmt::format("{:.3f}", 1e3 * phase_rad),
             fmt::format("{:.1f}", 1e6 * per_radian * phase_rad), fmt::format("{:.2f}", walk),
             fmt::format("{:.1f}", share * phase_memory_s / 3600.0), fmt::format("{:.2f} t", share)});
    };
    for (const Point& point : detector_noise_points()) line("noise " + point.label, point.scenario);
    for (const Point& point : clock_points()) line("clock " + point.label, point.scenario);
    line("injected 30 rad", injected_noise_points().back().scenario);
    fmt::print("\nEstimate from the bends less the true coupling, mean over 16 gyros and 262144 turns:\n\n");
    head({"clock", "size [1e-3]", "phase [1e-3 rad]"});
    for (const Point& point : clock_points()) {
        if (point.label != "1 MHz" && point.label != "3 MHz" && point.label != "100 MHz") continue;
        const Shown of = shown(point.scenario, 262144);
        row({point.label, fmt::format("{:.2f} +- {:.2f}", 1e3 * of.size_off, 1e3 * of.standard_error),
             fmt::format("{:.2f} +- {:.2f}", 1e3 * of.phase_off_rad, 1e3 * of.standard_error)});
    }
}

void draw(const std::vector<Point>& points, const std::vector<Measured>& measured, const std::string& file) {
    report::Figure figure;
    figure.title = "What is left of the random walk, over the noise of detectors and comparators";
    figure.x_label = "noise over the amplitude of the fringe [%]";
    figure.y_label = "angle random walk [deg/√h]";
    figure.log_x = figure.log_y = true;
    for (const std::string& arm : measured.front().walks.arms) {
        report::Curve curve{.label = short_name(arm)};
        for (std::size_t i = 0; i < points.size(); ++i) {
            const Ratio walk = li::over(measured[i].walks.of(arm), 1.0);
            curve.x.push_back(points[i].x);
            curve.y.push_back(walk.value);
            curve.lo.push_back(walk.lo);
            curve.hi.push_back(walk.hi);
        }
        figure.curves.push_back(curve);
    }
    const auto bound = [&](const std::string& label, double li::Bounds::*which) {
        report::Curve curve{.label = label, .style = report::Curve::Style::dashed};
        for (int i = 0; i <= 80; ++i) {
            const double x = points.front().x * std::pow(points.back().x / points.front().x, i / 80.0);
            scenario::Scenario scenario = points.front().scenario;
            set_noise(scenario, 0.01 * x);
            curve.x.push_back(x);
            curve.y.push_back(li::walk_deg_rt_h(scenario, li::bounds(scenario).*which));
        }
        figure.curves.push_back(curve);
    };
    bound("bound", &li::Bounds::known_rad);
    bound("bound without a look ahead", &li::Bounds::learnt_rad);
    bound("detectors alone", &li::Bounds::detectors_rad);
    report::write_svg(file, figure);
}

void bounds() {
    head({"", "bound, psi'' known [mrad]", "psi'' as known at the turn [mrad]", "detectors alone [mrad]",
          "bound, psi'' known [1e-6 deg/sqrt(h)]", "psi'' as known at the turn", "detectors alone"});
    const auto line = [](const std::string& label, const scenario::Scenario& scenario) {
        const li::Bounds of = li::bounds(scenario);
        std::vector<std::string> cells = {label};
        const auto all = {of.known_rad, of.learnt_rad, of.detectors_rad};
        for (const double phase : all) cells.push_back(fmt::format("{:.4f}", 1e3 * phase));
        for (const double phase : all) {
            cells.push_back(fmt::format("{:.4f}", 1e6 * li::walk_deg_rt_h(scenario, phase)));
        }
        row(cells);
    };
    line("0.5 %, 12 bits, 100 MHz, 3 rad", base());
    for (const Point& point : detector_noise_points()) line("noise " + point.label, point.scenario);
    for (const Point& point : converter_points()) line("converter " + point.label, point.scenario);
    for (const Point& point : clock_points()) line("clock " + point.label, point.scenario);
    for (const Point& point : injected_noise_points()) line("injected " + point.label, point.scenario);
}

/// Time and memory that an arm adds to a block, measured in rounds in which all take turns.
void cost() {
    constexpr std::size_t piece = 128;
    constexpr int rounds = 2000;
    scenario::Scenario scenario = base();
    scenario::Scenario detectors = scenario;
    detectors.readout.phase_from = scenario::PhaseFrom::detectors;
    struct Contender {
        std::string name;
        std::optional<ensemble::GyroBlock> block = {};
        double bytes = 0.0;
        std::vector<double> seconds = {};
        double nanoseconds() {
            std::nth_element(seconds.begin(), seconds.begin() + rounds / 2, seconds.end());
            return 1e9 * seconds[rounds / 2] / (1.0 * piece * simd::lanes);
        }
    };
    std::vector<Contender> contenders;
    const auto add = [&](const std::string& name, const scenario::Scenario& of, const std::vector<std::string>& arms) {
        std::vector<scenario::Arm> parsed;
        for (const std::string& arm : arms) parsed.push_back(scenario::parse_arm(arm));
        const auto used = [] {
            const struct mallinfo2 info = mallinfo2();
            return static_cast<double>(info.uordblks + info.hblkhd);
        };
        Contender& contender = contenders.emplace_back(Contender{name});
        const double before = used();
        contender.block.emplace(of, parsed, 0, simd::lanes);
        contender.bytes = (used() - before) / simd::lanes;
        contender.block->advance(piece);
    };
    add("", detectors, {"noise_injected"});
    add("", scenario, {"noise_injected"});
    for (const std::string& arm : li::compensated_arms()) add(short_name(arm), scenario, {"noise_injected", arm});
    for (int round = 0; round < rounds; ++round) {
        for (Contender& contender : contenders) {
            const auto start = std::chrono::steady_clock::now();
            contender.block->advance(piece);
            contender.seconds.push_back(
                std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count());
        }
    }
    const auto state = [](const std::string& name) -> std::string {
        const auto per_gyro = [](std::size_t bytes) { return fmt::format("{}", bytes / simd::lanes); };
        if (name == "compensated") return per_gyro(sizeof(compensate::FirstOrder::State));
        if (name == "compensated_exact") return per_gyro(sizeof(compensate::Exact::State));
        if (name == "compensated_adaptive") {
            return per_gyro(sizeof(compensate::Exact::State) + sizeof(readout::FractionRecovery::State) +
                            simd::lanes * sizeof(compensate::CouplingFilter));
        }
        if (name == "compensated_extrapolated") return per_gyro(sizeof(compensate::Extrapolated::State));
        if (name == "compensated_two_train") return per_gyro(sizeof(compensate::TwoTrain::State));
        return "-";
    };
    head({"", "ns a turn and gyro", "state, bytes a gyro", "with tables, kB a gyro"});
    const double plain = contenders[0].nanoseconds();
    const double recovered = contenders[1].nanoseconds();
    row({"drive, turn map, readout without recovery, one output", fmt::format("{:.1f}", plain), "", ""});
    row({"recovery of the phase from the pulses", fmt::format("{:.1f}", recovered - plain),
         fmt::format("{}", sizeof(readout::FractionRecovery::State) / simd::lanes),
         fmt::format("{:.1f}", 1e-3 * sizeof(readout::FractionRecovery) / simd::lanes)});
    for (std::size_t i = 2; i < contenders.size(); ++i) {
        row({contenders[i].name, fmt::format("{:.1f}", contenders[i].nanoseconds() - recovered),
             state(contenders[i].name), fmt::format("{:.1f}", 1e-3 * (contenders[i].bytes - contenders[1].bytes))});
    }
}

std::string figure_file;

const std::pair<const char*, std::function<void()>> blocks[] = {
    {"bounds", bounds},
    {"detector-noise",
     [] {
         const std::vector<Point> points = detector_noise_points();
         const std::vector<Measured> measured = table("noise", points, Reference::own);
         if (!figure_file.empty()) draw(points, measured, figure_file);
     }},
    {"converter", [] { table("converter", converter_points(), Reference::own); }},
    {"clock", [] { table("clock", clock_points(), Reference::own); }},
    {"threshold", [] { table("threshold too large by", threshold_points(), Reference::first); }},
    {"injected-noise", [] { table("injected noise", injected_noise_points(), Reference::own); }},
    {"coupling-phase", coupling_phase},
    {"phase-from", [] { table("phase from", phase_from_points(), Reference::last); }},
    {"averaging-time", averaging_times},
    {"learning", learning},
    {"devices", devices},
    {"cost", cost},
};

}  // namespace

int main(int argc, char** argv) {
    if (argc > 2) figure_file = argv[2];
    return bench::print_blocks("bench_limits", argc > 1 ? argv[1] : "", blocks);
}
