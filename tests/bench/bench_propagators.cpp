// Turns per second of the ways to go from turn to turn, side by side in one run, on one thread.
#include <fmt/format.h>

#include <algorithm>
#include <boost/numeric/odeint/integrate/integrate_adaptive.hpp>
#include <boost/numeric/odeint/stepper/generation.hpp>
#include <boost/numeric/odeint/stepper/runge_kutta_fehlberg78.hpp>
#include <chrono>
#include <cmath>
#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "analysis/report/table.hpp"
#include "engine/compensate/first_order.hpp"
#include "engine/core/phase.hpp"
#include "engine/dither/drive.hpp"
#include "engine/dither/lane_dither.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/trajectory.hpp"
#include "engine/propagate/direct.hpp"
#include "engine/propagate/direct_lanes.hpp"
#include "engine/propagate/phase_kernel.hpp"
#include "engine/propagate/turn_kernel.hpp"
#include "engine/propagate/turn_map.hpp"
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
    return [propagator, device](int turns) {
        dither::Drive drive(device, 3.0, {1, 0});
        Phase input(device.initial_phase_rad);
        double lockin = 0.0;
        for (int turn = 0; turn < turns; ++turn) {
            const gyro::HalfCycle half = drive.after();
            Phase phase = input;
            phase.add(drive.turn_phase_rad() + lockin);
            lockin += propagator->lockin_gain_rad(phase.remainder_rad, half);
            input.add(half.rate_rad_s * half.duration_s);
            drive.advance();
        }
        return lockin;
    };
}

/// A block of gyros under the same noisy dither, each with its own noise; a turn of one gyro counts as one.
using Step = std::function<void(const gyro::LaneDrive&, gyro::LaneTurns*)>;
Contender through_block(const gyro::Device& device, const Step& step) {
    const std::vector<gyro::Device> devices(simd::lanes, device);
    random::LaneIdentities who;
    who.seed = 1;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) who.gyro[lane] = lane;
    auto dither = std::make_shared<dither::LaneDither>(devices, 3.0, who);
    return [step, dither](int turns) {
        gyro::LaneDrive drive;
        gyro::LaneTurns at_turns;
        constexpr int piece = 512;
        for (int left = turns / static_cast<int>(simd::lanes); left > 0; left -= piece) {
            dither->next(static_cast<std::size_t>(std::min(left, piece)), {}, {}, drive);
            step(drive, &at_turns);
        }
        return at_turns.lockin_fringes.back()[0];
    };
}

propagate::HalfCycleRanges ranges_of(const gyro::Device& device) {
    const double a = device.dither_amplitude_rad;
    const double margin = dither::LaneDither::amplitude_margin_rad(3.0);
    return {{a - margin, a + margin},
            {device.input_rate_rad_s, device.input_rate_rad_s},
            {device.coupling.b_rad_s, device.coupling.b_rad_s}};
}

Contender integrated(const gyro::Device& device) {
    const std::vector<gyro::Device> devices(simd::lanes, device);
    auto direct = std::make_shared<propagate::DirectLanes>(devices, 1e-8);
    return through_block(
        device, [direct](const gyro::LaneDrive& drive, gyro::LaneTurns* turns) { direct->step(drive, turns); });
}

/// By the kernel of `Tables` and `State`.
template <class Tables, class State>
Contender mapped(const gyro::Device& device,
                 void (*kernel)(const Tables&, const gyro::LaneDrive&, std::size_t, State&, gyro::LaneTurns*)) {
    auto tables = std::make_shared<Tables>(1e-8);
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) tables->make(lane, device, ranges_of(device));
    auto state = std::make_shared<State>();
    return through_block(device, [tables, state, kernel](const gyro::LaneDrive& drive, gyro::LaneTurns* turns) {
        kernel(*tables, drive, simd::lanes, *state, turns);
    });
}

/// Worst error of some half cycles of the noisy dither against the direct integrator at a tolerance of 1e-13 rad.
double worst_error_rad(propagate::Propagator& propagator, const gyro::Device& device) {
    propagate::DirectIntegrator reference(device.coupling, 1e-13);
    dither::Drive drive(device, 3.0, {2, 0});
    double worst = 0.0;
    for (int turn = 0; turn < 40; ++turn) {
        const double phase_rad = -3.0 + 0.15 * turn;
        worst = std::max(worst, std::abs(propagator.lockin_gain_rad(phase_rad, drive.after()) -
                                         reference.lockin_gain_rad(phase_rad, drive.after())));
        drive.advance();
    }
    return worst;
}

/// Boost.odeint's Fehlberg 7(8) on the deviation from the plain phase.
class Odeint final : public propagate::Propagator {
   public:
    Odeint(gyro::Coupling coupling, double tolerance_rad) : coupling_(coupling), tolerance_rad_(tolerance_rad) {}
    double lockin_gain_rad(double phase_rad, const gyro::HalfCycle& half) override {
        using Stepper = boost::numeric::odeint::runge_kutta_fehlberg78<double>;
        double deviation = 0.0;
        boost::numeric::odeint::integrate_adaptive(
            boost::numeric::odeint::make_controlled<Stepper>(tolerance_rad_, tolerance_rad_),
            [&](const double& x, double& rate, double t) {
                rate = coupling_.b_rad_s * std::sin(phase_rad + half.plain_phase_rad(t) + x + coupling_.phase_rad);
            },
            deviation, 0.0, half.duration_s, 1e-8);
        return deviation;
    }

   private:
    gyro::Coupling coupling_;
    double tolerance_rad_;
};

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

    std::vector<Entry> entries;
    const auto add_propagator = [&](const std::string& name, int turns,
                                    std::shared_ptr<propagate::Propagator> propagator) {
        const double error = worst_error_rad(*propagator, device);
        entries.push_back({name, turns, through(std::move(propagator), device), error});
    };
    add_propagator("scalar Taylor series, 1e-8 rad", 60,
                   std::make_shared<test::SeriesIntegrator>(device.coupling, 1e-8));
    add_propagator("direct integrator, one gyro, 1e-8 rad", 120,
                   std::make_shared<propagate::DirectIntegrator>(device.coupling, 1e-8));
    entries.push_back({"direct integrator, 16 gyros, 1e-8 rad", 960, integrated(device)});
    add_propagator("Boost.odeint Fehlberg 7(8), 1e-8 a step", 60, std::make_shared<Odeint>(device.coupling, 1e-8));
    add_propagator("Boost.odeint Fehlberg 7(8), 1e-11 a step", 60, std::make_shared<Odeint>(device.coupling, 1e-11));
    add_propagator("turn map, 1e-8 rad", 1000000, map);
    entries.push_back({"turn map, 16 gyros, 1e-8 rad", 4000000, mapped(device, propagate::step_turns)});
    gyro::Device harmonic = device;
    harmonic.coupling.second_ratio = 0.1;
    entries.push_back({"same, second harmonic of 0.1", 1000000, mapped(harmonic, propagate::step_phases)});
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
    fmt::print("Median of {} rounds, one thread, noise-injected dither of Gao & Deng's device. (checksum {:.6f})\n",
               rounds, sink);
    return 0;
}
