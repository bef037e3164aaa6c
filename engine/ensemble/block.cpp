#include "engine/ensemble/block.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "engine/compensate/adaptive.hpp"
#include "engine/compensate/exact.hpp"
#include "engine/compensate/extrapolated.hpp"
#include "engine/compensate/first_order.hpp"
#include "engine/compensate/two_train.hpp"
#include "engine/dither/lane_dither.hpp"
#include "engine/effects/effect.hpp"
#include "engine/ensemble/calibration.hpp"
#include "engine/ensemble/changes.hpp"
#include "engine/ensemble/draw.hpp"
#include "engine/ensemble/output_counts.hpp"
#include "engine/ensemble/trajectory_kind.hpp"
#include "engine/propagate/lane_propagator.hpp"
#include "engine/readout/ellipse_correction.hpp"
#include "engine/readout/fraction_recovery.hpp"
#include "engine/readout/lane_readout.hpp"
#include "engine/readout/missed_counts.hpp"
#include "engine/scenario/injected_noise.hpp"
#include "engine/scenario/read_arms.hpp"

namespace ringlock::ensemble {

namespace {

/// An arm that reads a trajectory, with its compensator if it has one.
struct Listener {
    std::size_t arm;
    std::unique_ptr<compensate::LaneCompensator> compensator;
    compensate::LaneErrors errors;
    std::vector<simd::LaneCounts> counts;
    std::vector<simd::LaneCounts> turn_counts;  ///< at maxima, too, where requested
    std::vector<reader::Reader> readers;        ///< of each gyro, where requested
};

scenario::InjectedNoise noise_of(const scenario::Scenario& scenario, TrajectoryKind kind) {
    return kind == TrajectoryKind::noise_injected ? scenario::injected_noise(scenario) : scenario::InjectedNoise{};
}

dither::Wander wander_of(const scenario::Scenario& scenario) {
    return {scenario.dither.amplitude_wander_relative_rt_s, scenario.dither.amplitude_drift_relative_per_h / 3600.0};
}

/// Largest change of the amplitudes by drift and wander, for the scenario's device with an amplitude six standard
/// deviations above the mean. Tables depend on it, and a gyro's tables must not depend on the other gyros of its block.
double wander_margin_rad(const scenario::Scenario& scenario) {
    constexpr double sigmas = 6.0;
    const double largest = gyro::Device(nominal_setup(scenario)).dither_amplitude_rad *
                           (1.0 + sigmas * scenario.ensemble.dither_amplitude_sd_relative);
    return largest * scenario::amplitude_change_relative(scenario.dither, scenario::simulated_s(scenario));
}

/// How far noise, drift and wander take the amplitude of a half cycle from the device's.
double amplitude_margin_rad(const scenario::Scenario& scenario, TrajectoryKind kind) {
    return noise_of(scenario, kind).margin_rad + wander_margin_rad(scenario);
}

/// Their spread about it.
double amplitude_rms_rad(const scenario::Scenario& scenario, TrajectoryKind kind) {
    constexpr double sigmas = 6.0;  // that the margin of the wander stands for
    return std::hypot(noise_of(scenario, kind).amplitude_rms_rad, wander_margin_rad(scenario) / sigmas);
}

std::vector<gyro::Device> make_devices(const std::vector<gyro::Setup>& setups, TrajectoryKind kind) {
    std::vector<gyro::Device> devices;
    for (const gyro::Setup& setup : setups) {
        devices.emplace_back(setup);
        if (kind == TrajectoryKind::ideal) devices.back().coupling = {0.0, setup.coupling_phase_rad};
    }
    return devices;
}

std::vector<gyro::Ellipse> ellipses_of(const std::vector<gyro::Setup>& setups) {
    std::vector<gyro::Ellipse> ellipses;
    for (const gyro::Setup& setup : setups) ellipses.push_back(setup.ellipse);
    return ellipses;
}

std::unique_ptr<propagate::LanePropagator> make_propagator(const scenario::Scenario& scenario,
                                                           const std::vector<gyro::Device>& devices,
                                                           TrajectoryKind kind) {
    // Without lock-in too: the turn map would require the number of fringes that the direct method does not need.
    if (scenario.propagation.method == scenario::PropagationMethod::direct) {
        return std::make_unique<propagate::DirectPropagator>(devices, scenario.propagation.direct_tolerance_rad);
    }
    // Without lock-in there is nothing to tabulate; the map is that of the plain phase.
    propagate::AmplitudeRoom room;
    if (kind != TrajectoryKind::ideal) {
        room = {amplitude_margin_rad(scenario, kind), noise_of(scenario, kind).change_rad};
    }
    return propagate::make_turn_map(devices, room, scenario.propagation.turn_map_tolerance_rad);
}

std::unique_ptr<compensate::LaneCompensator> make_compensator(const scenario::Scenario& scenario,
                                                              const std::vector<gyro::Device>& devices,
                                                              const scenario::Arm& arm, TrajectoryKind kind) {
    compensate::Calibration calibration = calibration_of(scenario, devices, kind == TrajectoryKind::noise_injected);
    calibration.amplitude_margin_rad = amplitude_margin_rad(scenario, kind);
    calibration.amplitude_rms_rad = amplitude_rms_rad(scenario, kind);
    calibration.amplitude_change_rad = noise_of(scenario, kind).change_rad;
    calibration.amplitude_change_rms_rad = noise_of(scenario, kind).change_rms_rad;
    switch (arm.compensator) {
        case scenario::Compensator::published:
            return std::make_unique<compensate::FirstOrder>(calibration, compensate::FirstOrder::published);
        case scenario::Compensator::corrected:
            return std::make_unique<compensate::FirstOrder>(calibration, compensate::FirstOrder::corrected);
        case scenario::Compensator::exact:
            return std::make_unique<compensate::Exact>(calibration, scenario.propagation.turn_map_tolerance_rad);
        case scenario::Compensator::adaptive:
            return std::make_unique<compensate::Adaptive>(calibration, electronics_of(scenario),
                                                          scenario.propagation.turn_map_tolerance_rad);
        case scenario::Compensator::extrapolated:
            return std::make_unique<compensate::Extrapolated>(calibration, electronics_of(scenario));
        case scenario::Compensator::two_train:
            return std::make_unique<compensate::TwoTrain>(calibration);
        case scenario::Compensator::none:
            break;
    }
    return nullptr;
}

dither::LaneDither make_dither(const scenario::Scenario& scenario, const std::vector<gyro::Device>& devices,
                               const random::LaneIdentities& who, TrajectoryKind kind) {
    const double rms_rad = noise_of(scenario, kind).turn_rms_rad;
    if (scenario.noise_injection.model == scenario::NoiseModel::turns) {
        return {devices, rms_rad, who, wander_of(scenario)};
    }
    return {devices, scenario::drive_noise(scenario), rms_rad, who, wander_of(scenario)};
}

/// One physical trajectory of the block and the arms that read it.
class Branch {
   public:
    Branch(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms,
           const std::vector<gyro::Setup>& setups, const random::LaneIdentities& who, TrajectoryKind kind,
           bool phases_vary, Detail detail, const std::optional<ReaderPlan>& readers)
        : kind_(kind),
          devices_(make_devices(setups, kind)),
          dither_(make_dither(scenario, devices_, who, kind)),
          detailed_(detail != Detail::output),
          true_(detail == Detail::truth) {
        for (std::size_t i = 0; i < arms.size(); ++i) {
            if (kind_of(arms[i]) != kind) continue;
            listeners_.push_back({i, make_compensator(scenario, devices_, arms[i], kind), {}, {}, {}, {}});
            const auto& compensator = listeners_.back().compensator;
            compensated_ = compensated_ || compensator != nullptr;
            samples_wanted_ = samples_wanted_ || (compensator && compensator->wants_samples());
        }
        if (listeners_.empty()) return;
        propagator_ = make_propagator(scenario, devices_, kind);
        const readout::Electronics electronics = electronics_of(scenario);
        const bool instrument = scenario.readout.model == scenario::ReadoutModel::instrument;
        pulses_ = instrument || samples_wanted_;
        every_turn_ = compensated_ || instrument || scenario.readout.ellipse_correction || detailed_;
        readout_.emplace(devices_, ellipses_of(setups), electronics,
                         pulses_                     ? readout::Wanted::pulses
                         : compensated_ || detailed_ ? readout::Wanted::accelerations
                                                     : readout::Wanted::phase,
                         phases_vary);
        if (detailed_) readout_->keep_times();
        if (true_) readout_->keep_truth();
        if (readers) attach_readers(scenario, setups, who, electronics, *readers);
        interpolated_ = electronics.interpolate;
        if (scenario.readout.ellipse_correction) ellipse_.emplace(devices_.size());
        if (instrument && scenario.readout.phase_from == scenario::PhaseFrom::detectors_and_pulses) {
            std::vector<gyro::Device> calibrated = devices_;
            for (gyro::Device& device : calibrated) device.coupling.b_rad_s = calibrated_b_rad_s(scenario, device);
            recovery_.emplace(calibrated, electronics, amplitude_rms_rad(scenario, kind),
                              noise_of(scenario, kind).change_rms_rad);
        }
    }

    bool empty() const { return listeners_.empty(); }
    bool every_turn() const { return every_turn_; }

    void follow_between_turns(const reader::CaseRotation& rotation) { latch_->follow(rotation); }

    void advance(std::size_t turns, std::span<const simd::Lanes> angle_arcsec, const CouplingChanges& coupling,
                 const readout::ElectronicNoise& noise) {
        dither_.next(turns, angle_arcsec, coupling.threshold_factors(), drive_, coupling.phases_rad());
        if (kind_ == TrajectoryKind::noise_injected) add_changes();
        propagator_->step(drive_, turns_);
        readout_->read(drive_, turns_, noise, every_turn_ ? 1 : 2, readings_, angles_);
        if (detailed_) hardware_ = readings_;
        if (ellipse_) ellipse_->correct(readings_, angles_, interpolated_);
        if (samples_wanted_) samples_ = readings_;
        if (recovery_) recovery_->recover(readings_, &angles_);
        for (Listener& listener : listeners_) {
            if (listener.compensator) listener.compensator->observe(observed(listener), listener.errors);
            const compensate::LaneErrors* errors = listener.compensator ? &listener.errors : nullptr;
            output_counts(angles_, errors, turns, listener.counts);
            if (true_) output_counts(angles_, errors, turns, listener.turn_counts, 1);
        }
        if (latch_) read_ticks(turns, noise.count_errors);
    }

    std::int64_t tables_made() const {
        std::int64_t sum = propagator_->tables_made();
        for (const Listener& listener : listeners_) {
            if (listener.compensator) sum += listener.compensator->tables_made();
        }
        return sum;
    }
    std::int64_t contradictory_readings(std::size_t lane) const {
        return recovery_ ? recovery_->contradictions(lane) : 0;
    }
    TrajectoryKind kind() const { return kind_; }
    double change_per_cycle_rad(std::size_t lane) const {
        return changes_ > 0 ? std::sqrt(change_squares_[lane] / static_cast<double>(changes_)) : 0.0;
    }
    const std::vector<gyro::Device>& devices() const { return devices_; }
    const propagate::LanePropagator& propagator() const { return *propagator_; }
    const readout::LaneReadings& readings() const { return readings_; }
    const readout::LaneReadings& hardware() const { return hardware_; }
    const readout::LaneReadings& observed(const Listener& listener) const {
        return listener.compensator && listener.compensator->wants_samples() ? samples_ : readings_;
    }
    bool has_pulses() const { return pulses_; }
    const gyro::LaneDrive& drive() const { return drive_; }
    const readout::LaneAngles& angles() const { return angles_; }
    const Listener* listener(std::size_t arm) const {
        for (const Listener& listener : listeners_) {
            if (listener.arm == arm) return &listener;
        }
        return nullptr;
    }

   private:
    void attach_readers(const scenario::Scenario& scenario, const std::vector<gyro::Setup>& setups,
                        const random::LaneIdentities& who, const readout::Electronics& electronics,
                        const ReaderPlan& plan) {
        const reader::Settings& settings = scenario.reader;
        latch_.emplace(devices_, reader::latch_hz(settings, plan.output_hz), plan.first_turn);
        turns_.middles = true;
        for (Listener& listener : listeners_) {
            listener.errors.middles = true;
            for (std::size_t lane = 0; lane < setups.size(); ++lane) {
                const gyro::Setup& setup = setups[lane];
                listener.readers.emplace_back(
                    settings, plan.output_hz,
                    reader::Source{setup.scale_factor_arcsec, setup.dither_frequency_hz, setup.ellipse, electronics,
                                   random::Identity{who.seed, who.gyro[lane]}});
            }
        }
        if (listeners_.front().readers.front().stripper().wants_crossings()) {
            latch_->want_crossings(settings.reference_delay_s);
        }
    }

    void read_ticks(std::size_t turns, std::span<const simd::Lanes> count_errors) {
        latch_->read(drive_, turns_);
        std::vector<double> correction_fringes;
        std::vector<double> missed;
        for (std::size_t lane = 0; lane < devices_.size(); ++lane) {
            missed.clear();
            for (const simd::Lanes& row : count_errors) missed.push_back(row[lane]);
            for (Listener& listener : listeners_) {
                correction_fringes.clear();
                if (listener.compensator) {
                    for (std::size_t i = 0; i < turns; ++i) {
                        correction_fringes.push_back(listener.errors.whole[lane] +
                                                     listener.errors.middle_fringes[i][lane]);
                    }
                }
                listener.readers[lane].read(latch_->instants(lane), correction_fringes, missed);
            }
        }
    }

    /// Half cycles' amplitudes are means of their turns': from a turn to the next but one the amplitude changes by
    /// twice the change from half cycle to half cycle.
    void add_changes() {
        for (std::size_t i = 0; i < drive_.turns; ++i) {
            const simd::Lanes& before = drive_.amplitude_rad[i];
            const simd::Lanes& after = drive_.amplitude_rad[i + 1];
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                const double change = 2.0 * (after[lane] - before[lane]);
                change_squares_[lane] += change * change;
            }
        }
        changes_ += static_cast<std::int64_t>(drive_.turns);
    }

    TrajectoryKind kind_;
    std::vector<gyro::Device> devices_;
    dither::LaneDither dither_;
    std::unique_ptr<propagate::LanePropagator> propagator_;
    std::optional<readout::LaneReadout> readout_;
    std::vector<Listener> listeners_;
    std::optional<readout::EllipseCorrection> ellipse_;
    std::optional<readout::FractionRecovery> recovery_;
    std::optional<reader::Latch> latch_;
    bool interpolated_ = false;
    bool compensated_ = false;
    bool every_turn_ = false;
    bool samples_wanted_ = false;
    bool pulses_ = false;
    bool detailed_ = false;
    bool true_ = false;
    simd::Lanes change_squares_{};  ///< of the amplitude from a turn to the next but one
    std::int64_t changes_ = 0;
    gyro::LaneDrive drive_;
    gyro::LaneTurns turns_;
    readout::LaneReadings readings_;
    readout::LaneReadings samples_;   ///< as they were before the phase was recovered from pulses
    readout::LaneReadings hardware_;  ///< as the electronics have them, where requested
    readout::LaneAngles angles_;
};

random::LaneIdentities identities(const scenario::Scenario& scenario, std::int64_t first_gyro, std::size_t gyros) {
    random::LaneIdentities who;
    who.seed = scenario.ensemble.seed;
    for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
        who.gyro[lane] = identity(scenario, first_gyro + static_cast<std::int64_t>(std::min(lane, gyros - 1))).gyro;
    }
    return who;
}

}  // namespace

struct GyroBlock::State {
    State(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t first_gyro,
          std::vector<gyro::Setup> drawn, Detail detail, const std::optional<ReaderPlan>& readers)
        : setups(std::move(drawn)),
          who(identities(scenario, first_gyro, setups.size())),
          missed_counts(setups, who),
          coupling(scenario, setups) {
        for (const TrajectoryKind kind :
             {TrajectoryKind::ideal, TrajectoryKind::plain, TrajectoryKind::noise_injected}) {
            Branch branch(scenario, arms, setups, who, kind, coupling.phases_vary(), detail, readers);
            if (branch.empty()) continue;
            every_turn = every_turn || branch.every_turn();
            branches.push_back(std::move(branch));
        }
        noisy_detectors =
            scenario.readout.model != scenario::ReadoutModel::ideal && scenario.readout.detector_noise_relative > 0.0;
        noisy_comparators = scenario.readout.model == scenario::ReadoutModel::instrument &&
                            scenario.readout.comparator_noise_relative > 0.0;
        for (const scenario::ActiveEffect& active : scenario::active_effects(scenario)) {
            if (active.effect->adds_angle()) add(angle_of(active, scenario, setups));
            if (auto process = active.effect->lane_rate_process(*active.values, who, setups.size())) {
                processes.push_back(std::move(process));
            }
        }
        if (scenario::has_profile(scenario.input)) {
            add(angle_of_profile(scenario.input, setups));
        }
        if (readers) follow_between_turns(scenario);
        for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
            const gyro::Device device(setups[std::min(lane, setups.size() - 1)]);
            duration_s[0][lane] = device.positive_duration_s;
            duration_s[1][lane] = device.negative_duration_s;
        }
    }

    void add(AngleOver added) {
        processes.push_back(angles_of(added, setups.size()));
        steady.push_back(std::move(added));
    }

    /// A reader needs between turns the rotation that the turns have as a mean from half cycle to half cycle.
    void follow_between_turns(const scenario::Scenario& scenario) {
        reader::CaseRotation rotation;
        rotation.who = who;
        for (const auto& [effect, values] : scenario::active_effects(scenario)) {
            rotation.white_arcsec2_s += effect->rate_noise(*values).white_deg2_h2_s;
        }
        if (!steady.empty()) {
            rotation.angle_arcsec = [added = steady](std::size_t lane, double start_s, double for_s) {
                double sum_arcsec = 0.0;
                for (const AngleOver& angle : added) sum_arcsec += angle(lane, start_s, for_s);
                return sum_arcsec;
            };
        }
        for (Branch& branch : branches) branch.follow_between_turns(rotation);
    }

    double turn_time_s(std::int64_t number, std::size_t lane) const {
        return static_cast<double>(number / 2) * (duration_s[0][lane] + duration_s[1][lane]) +
               (number % 2 == 0 ? 0.0 : duration_s[0][lane]);
    }

    /// Angles that varying rates add over the half cycles that begin in the piece; none without such rates.
    std::span<const simd::Lanes> varying_angles(std::size_t turns) {
        if (processes.empty()) return {};
        interval_start_s.resize(turns);
        interval_s.resize(turns);
        angle_arcsec.assign(turns, simd::Lanes{});
        for (std::size_t i = 0; i < turns; ++i) {
            const std::int64_t number = turn + static_cast<std::int64_t>(i);
            const std::size_t side = number % 2 == 0 ? 0 : 1;
            for (std::size_t lane = 0; lane < simd::lanes; ++lane) {
                interval_start_s[i][lane] = turn_time_s(number, lane);
            }
            interval_s[i] = duration_s[side];
        }
        const effects::LaneIntervals intervals{setups.size(), static_cast<std::uint64_t>(turn), interval_start_s,
                                               interval_s};
        for (const auto& process : processes) process->add_angles(intervals, angle_arcsec);
        return angle_arcsec;
    }

    readout::ElectronicNoise electronic_noise(std::size_t turns) {
        readout::ElectronicNoise noise;
        if (noisy_detectors) {
            detectors.resize(2 * turns);
            random::normals(who, random::Purpose::detector_noise, 2 * static_cast<std::uint64_t>(turn), 2 * turns,
                            setups.size(), detectors.front().data(), every_turn ? 1 : 2);
            noise.detectors = detectors;
        }
        if (noisy_comparators) {
            constexpr std::size_t pulses = 2 * readout::kept_pulses;
            comparators.resize(pulses * turns);
            random::normals(who, random::Purpose::comparator_noise, pulses * static_cast<std::uint64_t>(turn),
                            pulses * turns, setups.size(), comparators.front().data());
            noise.comparators = comparators;
        }
        noise.count_errors = count_errors = missed_counts.next(turns);
        return noise;
    }

    const Branch& branch_of(std::size_t arm) const {
        return *std::find_if(branches.begin(), branches.end(),
                             [&](const Branch& branch) { return branch.listener(arm) != nullptr; });
    }

    std::vector<gyro::Setup> setups;
    random::LaneIdentities who;
    readout::MissedCounts missed_counts;
    CouplingChanges coupling;
    std::span<const simd::Lanes> count_errors;
    std::vector<Branch> branches;
    std::vector<std::unique_ptr<effects::LaneRateProcess>> processes;
    std::vector<AngleOver> steady;  ///< angles of the deterministic ones among the processes
    bool every_turn = false;        // some compensator needs the maxima, too
    bool noisy_detectors = false;
    bool noisy_comparators = false;
    std::array<simd::Lanes, 2> duration_s;
    std::int64_t turn = 0;
    std::vector<simd::Lanes> interval_start_s;
    std::vector<simd::Lanes> interval_s;
    std::vector<simd::Lanes> angle_arcsec;
    std::vector<simd::Lanes> detectors;
    std::vector<simd::Lanes> comparators;
};

namespace {

std::vector<gyro::Setup> drawn(const scenario::Scenario& scenario, std::int64_t first_gyro, std::size_t gyros) {
    std::vector<gyro::Setup> setups;
    for (std::size_t i = 0; i < gyros; ++i) {
        setups.push_back(draw_setup(scenario, first_gyro + static_cast<std::int64_t>(i)));
    }
    return setups;
}

}  // namespace

GyroBlock::GyroBlock(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t first_gyro,
                     std::size_t gyros, Detail detail, const std::optional<ReaderPlan>& readers)
    : GyroBlock(scenario, arms, first_gyro, drawn(scenario, first_gyro, gyros), detail, readers) {}
GyroBlock::GyroBlock(const scenario::Scenario& scenario, std::span<const scenario::Arm> arms, std::int64_t first_gyro,
                     std::vector<gyro::Setup> setups, Detail detail, const std::optional<ReaderPlan>& readers)
    : state_(std::make_unique<State>(scenario, arms, first_gyro, std::move(setups), detail, readers)) {}
GyroBlock::GyroBlock(GyroBlock&&) noexcept = default;
GyroBlock& GyroBlock::operator=(GyroBlock&&) noexcept = default;
GyroBlock::~GyroBlock() = default;

void GyroBlock::advance(std::size_t turns) {
    State& s = *state_;
    const auto angles = s.varying_angles(turns);
    s.coupling.evaluate(s.turn, turns);
    const auto noise = s.electronic_noise(turns);
    for (Branch& branch : s.branches) branch.advance(turns, angles, s.coupling, noise);
    s.turn += static_cast<std::int64_t>(turns);
}

std::span<const simd::LaneCounts> GyroBlock::counts(std::size_t arm) const {
    return state_->branch_of(arm).listener(arm)->counts;
}

const readout::LaneReadings& GyroBlock::readings(std::size_t arm) const { return state_->branch_of(arm).readings(); }

const readout::LaneReadings& GyroBlock::observed(std::size_t arm) const {
    const Branch& branch = state_->branch_of(arm);
    return branch.observed(*branch.listener(arm));
}

const readout::LaneReadings& GyroBlock::hardware(std::size_t arm) const { return state_->branch_of(arm).hardware(); }

std::int64_t GyroBlock::quarter_count(std::size_t arm, std::size_t turn, std::size_t lane) const {
    const readout::LaneReadings& readings = hardware(arm);
    const double off = count_errors().empty() ? 0.0 : count_errors()[turn][lane];
    return 4 * static_cast<std::int64_t>(readings.phase_whole[turn][lane]) +
           static_cast<std::int64_t>(readings.count[turn][lane] + off);
}

bool GyroBlock::has_pulses(std::size_t arm) const { return state_->branch_of(arm).has_pulses(); }

double GyroBlock::turn_time_s(std::int64_t turn, std::size_t lane) const { return state_->turn_time_s(turn, lane); }

const readout::LaneAngles& GyroBlock::angles(std::size_t arm) const { return state_->branch_of(arm).angles(); }

std::span<const simd::Lanes> GyroBlock::count_errors() const { return state_->count_errors; }

double GyroBlock::lockin_error_rad(std::size_t arm, std::size_t turn, std::size_t lane) const {
    const readout::LaneAngles& angles = state_->branch_of(arm).angles();
    return units::two_pi * (angles.lockin_whole[lane] + angles.lockin_fringes[turn][lane]);
}

const compensate::LaneErrors* GyroBlock::corrections(std::size_t arm) const {
    const Listener& listener = *state_->branch_of(arm).listener(arm);
    return listener.compensator ? &listener.errors : nullptr;
}

const gyro::LaneDrive& GyroBlock::drive(std::size_t arm) const { return state_->branch_of(arm).drive(); }

std::span<const simd::LaneCounts> GyroBlock::turn_counts(std::size_t arm) const {
    return state_->branch_of(arm).listener(arm)->turn_counts;
}

const reader::Reader& GyroBlock::reader(std::size_t arm, std::size_t lane) const {
    return state_->branch_of(arm).listener(arm)->readers[lane];
}

const std::vector<gyro::Setup>& GyroBlock::setups() const { return state_->setups; }

int GyroBlock::trajectories() const {
    return static_cast<int>(std::count_if(state_->branches.begin(), state_->branches.end(),
                                          [](const Branch& branch) { return branch.kind() != TrajectoryKind::ideal; }));
}

std::vector<double> GyroBlock::change_per_cycle_rad() const {
    std::vector<double> changes;
    for (const Branch& branch : state_->branches) {
        if (branch.kind() != TrajectoryKind::noise_injected) continue;
        for (std::size_t lane = 0; lane < state_->setups.size(); ++lane) {
            changes.push_back(branch.change_per_cycle_rad(lane));
        }
    }
    return changes;
}

double GyroBlock::table_error_rad() const {
    double worst = 0.0;
    for (const Branch& branch : state_->branches) {
        if (branch.kind() == TrajectoryKind::ideal) continue;
        for (std::size_t lane = 0; lane < state_->setups.size(); ++lane) {
            worst = std::max(worst, branch.propagator().table_error_rad(lane));
        }
    }
    return worst;
}

std::int64_t GyroBlock::contradictory_readings() const {
    std::int64_t sum = 0;
    for (const Branch& branch : state_->branches) {
        for (std::size_t lane = 0; lane < state_->setups.size(); ++lane) sum += branch.contradictory_readings(lane);
    }
    return sum;
}

std::int64_t GyroBlock::tables_remade() const {
    std::int64_t sum = 0;
    for (const Branch& branch : state_->branches) {
        if (branch.kind() == TrajectoryKind::ideal) continue;
        for (std::size_t lane = 0; lane < state_->setups.size(); ++lane) sum += branch.propagator().tables_remade(lane);
    }
    return sum;
}

std::int64_t GyroBlock::tables_made() const {
    std::int64_t sum = 0;
    for (const Branch& branch : state_->branches) sum += branch.tables_made();
    return sum;
}

}  // namespace ringlock::ensemble
