#include "engine/ensemble/gyro_run.hpp"

#include <algorithm>
#include <memory>
#include <utility>

#include "engine/compensate/first_order.hpp"
#include "engine/core/error.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/schedule.hpp"
#include "engine/ensemble/trajectory.hpp"
#include "engine/propagate/turn_map.hpp"

namespace ringlock::ensemble {

namespace {

using Kind = Trajectory::Kind;

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

/// Turns between two looks at the monitor: some milliseconds of work.
std::int64_t turns_between_looks(const scenario::Scenario& scenario) {
    return scenario.propagation.method == scenario::PropagationMethod::direct ? 8 : 4096;
}

void follow(Trajectory& trajectory, std::vector<Listener>& listeners, const Schedule& schedule, GyroRecord& record,
            std::int64_t look, const std::function<bool()>& cancelled,
            const std::function<void(std::int64_t)>& on_turns) {
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
        const bool last = turn + 1 == turns;
        if (last || (turn + 1) % look == 0) {
            if (on_turns) on_turns(last && turns % look != 0 ? turns % look : look);
            if (cancelled && cancelled()) throw Interrupted();
        }
        if (last) return;
        trajectory.advance();
    }
}

}  // namespace

std::int64_t expected_turns(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms) {
    const auto any = [&](Kind kind) {
        return std::any_of(arms.begin(), arms.end(), [&](const scenario::Arm& arm) { return kind_of(arm) == kind; });
    };
    const std::int64_t trajectories = (any(Kind::plain) ? 1 : 0) + (any(Kind::noise_injected) ? 1 : 0);
    return total_gyros(scenario) * trajectories * Schedule(scenario).turns();
}

GyroRecord simulate_gyro(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t gyro,
                         const Monitor& monitor) {
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
        follow(trajectory, listeners, schedule, record, turns_between_looks(scenario), monitor.cancelled,
               kind != Kind::ideal ? monitor.on_turns : nullptr);
        if (kind != Kind::ideal) record.turns += schedule.turns();
        if (const auto* map = dynamic_cast<const propagate::TurnMap*>(trajectory.propagator())) {
            record.turns_off_table += map->outside();
            record.turn_map_error_rad = std::max(record.turn_map_error_rad, map->measured_error_rad());
        }
    }
    return record;
}

}  // namespace ringlock::ensemble
