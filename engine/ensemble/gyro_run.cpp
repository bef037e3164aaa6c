#include "engine/ensemble/gyro_run.hpp"

#include <algorithm>
#include <map>
#include <optional>

#include "engine/compensate/first_order.hpp"
#include "engine/core/error.hpp"
#include "engine/core/phase.hpp"
#include "engine/dither/drive.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/schedule.hpp"
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

readout::Electronics make_electronics(const scenario::Scenario& scenario, const gyro::Setup& setup) {
    const auto& readout = scenario.readout;
    return {readout.model == scenario::ReadoutModel::ideal, readout.angle_output == scenario::AngleOutput::interpolated,
            readout.clock_hz, readout.detector_noise_relative, setup.ellipse};
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
    return std::make_unique<propagate::TurnMap>(
        device.coupling, device.half_cycle(1.0, amplitude), device.half_cycle(-1.0, amplitude),
        propagate::TurnMap::Range{amplitude - margin, amplitude + margin}, scenario.propagation.turn_map_tolerance_rad);
}

}  // namespace

struct Trajectory::State {
    State(const scenario::Scenario& scenario, const gyro::Setup& setup, random::Identity who, Kind kind)
        : device(make_device(setup, kind)),
          drive(device, injected_rms_rad(scenario, kind), who),
          propagator(make_propagator(scenario, device, kind)),
          readout(make_electronics(scenario, setup), who),
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
    const gyro::HalfCycle half = s.drive.after();
    double angle_arcsec = 0.0;
    for (const auto& process : s.processes) angle_arcsec += process->angle_arcsec(s.drive.time_s(), half.duration_s);
    const double step = s.device.phase_per_arcsec * angle_arcsec;
    if (s.propagator) s.lockin_rad += s.propagator->lockin_gain_rad(s.phase().remainder_rad, half, step);
    s.rotation.add(half.rate_rad_s * half.duration_s);
    s.rotation.add(step);
    s.drive.advance();
}

const propagate::Propagator* Trajectory::propagator() const { return state_->propagator.get(); }

namespace {

/// An arm that reads a trajectory, with its compensator if it has one.
struct Listener {
    std::size_t arm;
    std::unique_ptr<compensate::Compensator> compensator;
};

std::unique_ptr<compensate::Compensator> make_compensator(scenario::Compensator kind, const gyro::Device& device) {
    const compensate::Calibration calibration{device.coupling.b_rad_s};
    switch (kind) {
        case scenario::Compensator::published:
            return std::make_unique<compensate::Published>(calibration);
        case scenario::Compensator::corrected:
            return std::make_unique<compensate::Corrected>(calibration);
        case scenario::Compensator::none:
            break;
    }
    return nullptr;
}

Kind kind_of(const scenario::Arm& arm) {
    return arm.ideal ? Kind::ideal : arm.noise_injected ? Kind::noise_injected : Kind::plain;
}

void follow(Trajectory& trajectory, std::vector<Listener>& listeners, const Schedule& schedule, GyroRecord& record,
            const Cancelled& cancelled) {
    const bool compensated =
        std::any_of(listeners.begin(), listeners.end(), [](const Listener& l) { return l.compensator != nullptr; });
    const std::int64_t turns = schedule.turns();
    const std::int64_t stride = 2 * schedule.cycles_per_sample;
    for (std::int64_t turn = 0;; ++turn) {
        const bool sample = turn % stride == 0;
        if (sample || compensated) {
            const readout::ReadTurn read = trajectory.read();
            for (Listener& listener : listeners) {
                if (listener.compensator) listener.compensator->observe(read.reading);
            }
            if (sample) {
                const double angle = trajectory.angle_arcsec(read);
                const double arcsec_per_rad = record.setup.scale_factor_arcsec / units::two_pi;
                for (const Listener& listener : listeners) {
                    const double correction =
                        listener.compensator ? listener.compensator->error_rad() * arcsec_per_rad : 0.0;
                    record.angle_arcsec[listener.arm].push_back(angle - correction);
                }
            }
        }
        if (turn + 1 == turns) return;
        if (turn % 1024 == 0 && cancelled && cancelled()) throw Interrupted();
        trajectory.advance();
    }
}

}  // namespace

GyroRecord simulate_gyro(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t gyro,
                         const Cancelled& cancelled) {
    const Schedule schedule(scenario);
    const auto who = identity(scenario, gyro);
    GyroRecord record;
    record.setup = draw_setup(scenario, gyro);
    record.angle_arcsec.resize(arms.size());
    for (auto& angles : record.angle_arcsec) angles.reserve(static_cast<std::size_t>(schedule.samples));

    for (const Kind kind : {Kind::ideal, Kind::plain, Kind::noise_injected}) {
        std::vector<Listener> listeners;
        for (std::size_t i = 0; i < arms.size(); ++i) {
            if (kind_of(arms[i]) == kind) {
                listeners.push_back({i, make_compensator(arms[i].compensator, gyro::Device(record.setup))});
            }
        }
        if (listeners.empty()) continue;
        Trajectory trajectory(scenario, record.setup, who, kind);
        follow(trajectory, listeners, schedule, record, cancelled);
        if (kind != Kind::ideal) record.turns += schedule.turns();
        if (const auto* map = dynamic_cast<const propagate::TurnMap*>(trajectory.propagator())) {
            record.turns_off_table += map->outside();
            record.turn_map_error_rad = std::max(record.turn_map_error_rad, map->measured_error_rad());
        }
    }
    return record;
}

}  // namespace ringlock::ensemble
