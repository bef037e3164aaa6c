#include "engine/ensemble/trajectory.hpp"

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "engine/core/phase.hpp"
#include "engine/dither/drive.hpp"
#include "engine/effects/effect.hpp"
#include "engine/propagate/direct.hpp"
#include "engine/propagate/turn_map.hpp"

namespace ringlock::ensemble {

namespace {

using Kind = Trajectory::Kind;

gyro::Device make_device(const gyro::Setup& setup, Kind kind) {
    gyro::Device device(setup);
    if (kind == Kind::ideal) device.coupling.b_rad_s = 0.0;
    return device;
}

readout::Electronics make_electronics(const scenario::Scenario& scenario) {
    const auto& readout = scenario.readout;
    return {readout.model == scenario::ReadoutModel::ideal, readout.angle_output == scenario::AngleOutput::interpolated,
            readout.clock_hz, readout.detector_noise_relative};
}

double injected_rms_rad(const scenario::Scenario& scenario, Kind kind) {
    return kind == Kind::noise_injected ? scenario.noise_injection.turn_phase_rms_rad : 0.0;
}

std::unique_ptr<propagate::Propagator> make_propagator(const scenario::Scenario& scenario, const gyro::Device& device,
                                                       Kind kind) {
    if (kind == Kind::ideal) return nullptr;
    if (scenario.propagation.method == scenario::PropagationMethod::direct) {
        return std::make_unique<propagate::DirectIntegrator>(device.coupling,
                                                             scenario.propagation.direct_tolerance_rad);
    }
    const double amplitude = device.dither_amplitude_rad;
    const double margin = dither::Drive::amplitude_margin_rad(injected_rms_rad(scenario, kind));
    const double slow = 100.0 * device.phase_per_arcsec;
    const propagate::HalfCycleRanges ranges{{amplitude - margin, amplitude + margin},
                                            {device.input_rate_rad_s - slow, device.input_rate_rad_s + slow},
                                            {device.coupling.b_rad_s, device.coupling.b_rad_s}};
    return std::make_unique<propagate::TurnMap>(device, ranges, scenario.propagation.turn_map_tolerance_rad);
}

}  // namespace

struct Trajectory::State {
    State(const scenario::Scenario& scenario, const gyro::Setup& setup, random::Identity who, Kind kind)
        : device(make_device(setup, kind)),
          drive(device, injected_rms_rad(scenario, kind), who),
          propagator(make_propagator(scenario, device, kind)),
          readout(make_electronics(scenario), setup.ellipse, who),
          start(device.initial_phase_rad) {
        for (const effects::Effect* effect : effects::registry()) {
            const auto values = scenario.effects.find(std::string(effect->name()));
            if (values == scenario.effects.end() || !effect->active(values->second)) continue;
            if (auto process = effect->rate_process(values->second, who)) processes.push_back(std::move(process));
        }
    }

    /// psi at the current turn of the dither. Summed anew each time from what is known exactly, so that nothing of the
    /// dither's thousands of radians rounds into it for good.
    Phase phase() const {
        Phase sum = rotation;
        sum.fringes += start.fringes;
        sum.add(start.remainder_rad);
        sum.add(drive.turn_phase_rad());
        sum.add(lockin_rad);
        return sum;
    }

    gyro::Device device;
    dither::Drive drive;
    std::unique_ptr<propagate::Propagator> propagator;  // null: no lock-in
    readout::Readout readout;
    std::vector<std::unique_ptr<effects::RateProcess>> processes;
    Phase start;
    Phase rotation;           // of case and rate processes, since the first turn
    double lockin_rad = 0.0;  // phase error at the dither's turn
    double lockin_at_zero_rate_rad = 0.0;
};

Trajectory::Trajectory(const scenario::Scenario& scenario, const gyro::Setup& setup, random::Identity who, Kind kind)
    : state_(std::make_unique<State>(scenario, setup, who, kind)) {}
Trajectory::Trajectory(Trajectory&&) noexcept = default;
Trajectory& Trajectory::operator=(Trajectory&&) noexcept = default;
Trajectory::~Trajectory() = default;

readout::ReadTurn Trajectory::read() {
    State& s = *state_;
    const Phase phase = s.phase();
    const readout::TurnPath path(s.drive.before(), s.drive.after(), s.device.coupling, phase.remainder_rad);
    s.lockin_at_zero_rate_rad =
        s.lockin_rad + (path.zero_rate_phase_rad() - phase.remainder_rad) - path.plain_gain_rad();
    return s.readout.read(path, phase, s.drive.turn(), s.drive.time_s(), s.drive.direction());
}

double Trajectory::angle_arcsec(const readout::ReadTurn& turn) const {
    const State& s = *state_;
    return (s.rotation.value_rad() + s.lockin_at_zero_rate_rad + turn.phase_error_rad) / s.device.phase_per_arcsec;
}

double Trajectory::lockin_error_rad() const { return state_->lockin_at_zero_rate_rad; }

void Trajectory::advance() {
    State& s = *state_;
    gyro::HalfCycle half = s.drive.after();
    double angle_arcsec = 0.0;
    for (const auto& process : s.processes) angle_arcsec += process->angle_arcsec(s.drive.time_s(), half.duration_s);
    half.rate_rad_s += s.device.phase_per_arcsec * angle_arcsec / half.duration_s;
    if (s.propagator) s.lockin_rad += s.propagator->lockin_gain_rad(s.phase().remainder_rad, half);
    s.rotation.add(half.rate_rad_s * half.duration_s);
    s.drive.advance();
}

const propagate::Propagator* Trajectory::propagator() const { return state_->propagator.get(); }

}  // namespace ringlock::ensemble
