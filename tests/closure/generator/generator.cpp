#include "tests/closure/generator/generator.hpp"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <exception>
#include <mutex>
#include <numbers>
#include <numeric>
#include <string>
#include <thread>
#include <utility>

#include "engine/core/error.hpp"

namespace ringlock::test::closure {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double two_pi = 2.0 * pi;

/// Linear between the rows of a track, the value at its ends beyond.
double track_at(const record::Track& track, double time_s) {
    if (time_s <= track.time_s.front()) return track.value.front();
    if (time_s >= track.time_s.back()) return track.value.back();
    const auto after = std::upper_bound(track.time_s.begin(), track.time_s.end(), time_s) - track.time_s.begin();
    const auto i = static_cast<std::size_t>(after);
    const double share = (time_s - track.time_s[i - 1]) / (track.time_s[i] - track.time_s[i - 1]);
    return track.value[i - 1] + share * (track.value[i] - track.value[i - 1]);
}

/// Mean over an interval: trapezia between its ends and the rows within.
double track_mean(const record::Track& track, double from_s, double to_s) {
    double sum = 0.0;
    double time = from_s;
    double value = track_at(track, from_s);
    auto row = std::upper_bound(track.time_s.begin(), track.time_s.end(), from_s) - track.time_s.begin();
    for (; row < static_cast<std::ptrdiff_t>(track.time_s.size()); ++row) {
        const auto i = static_cast<std::size_t>(row);
        if (track.time_s[i] >= to_s) break;
        sum += 0.5 * (value + track.value[i]) * (track.time_s[i] - time);
        time = track.time_s[i];
        value = track.value[i];
    }
    sum += 0.5 * (value + track_at(track, to_s)) * (to_s - time);
    return sum / (to_s - from_s);
}

[[noreturn]] void refuse(const std::string& what) { throw InputError("truth: " + what); }

void check(const Truth& truth) {
    const auto positive = [](double x) { return std::isfinite(x) && x > 0.0; };
    if (!positive(truth.scale_factor_arcsec)) refuse("scale_factor_arcsec must be positive");
    if (!positive(truth.dither_frequency_hz)) refuse("dither_frequency_hz must be positive");
    if (!positive(truth.dither_peak_rate_deg_s)) refuse("dither_peak_rate_deg_s must be positive");
    if (!(truth.lockin_threshold_deg_h >= 0.0)) refuse("lockin_threshold_deg_h must not be negative");
    if (!(std::abs(truth.dither_asymmetry) < 0.9)) refuse("dither_asymmetry must lie between -0.9 and 0.9");
    if (!(std::abs(truth.dither_third_harmonic) < 0.2)) refuse("dither_third_harmonic must be below 0.2");
    if (!(std::abs(truth.dither_second_harmonic.ratio) < 0.5)) refuse("dither_second_harmonic.ratio must be below 0.5");
    if (!(truth.missed_counts_per_turn >= 0.0 && truth.missed_counts_per_turn <= 1.0)) {
        refuse("missed_counts_per_turn must lie between 0 and 1");
    }
    if (!(truth.clock_hz >= 0.0)) refuse("clock_hz must not be negative");
    if (truth.turns == 0) refuse("turns must be positive");
    if (!positive(truth.accuracy.phase_step_rad) || !positive(truth.accuracy.turn_step)) {
        refuse("steps must be positive");
    }
    const record::Track& profile = truth.input_profile_deg_h;
    if (profile.time_s.size() != profile.value.size()) refuse("input_profile_deg_h has times without values");
    if (std::adjacent_find(profile.time_s.begin(), profile.time_s.end(), std::greater_equal<>()) !=
        profile.time_s.end()) {
        refuse("times of input_profile_deg_h must increase");
    }
}

/// The drive of one record: half cycle j goes from turn j of the dither to turn j + 1; turn 0 is a maximum at time 0.
struct Drive {
    explicit Drive(const Truth& truth);

    static double direction(std::size_t turn) { return turn % 2 == 0 ? -1.0 : 1.0; }

    std::vector<double> turn_s;
    std::vector<double> amplitude_rad, duration_s, rate_rad_s, b_rad_s, coupling_phase_rad;
    std::vector<double> line_phase_rad;  ///< where the half cycle begins
    std::vector<double> line_rad;        ///< what it adds over it
};

Drive::Drive(const Truth& truth) {
    // Rows are turns 1 to n; what comes after the last one takes a half cycle more.
    const std::size_t halves = truth.turns + 1;
    const double period = 1.0 / truth.dither_frequency_hz;
    const double down = 0.5 * period * (1.0 + truth.dither_asymmetry);
    const double up = 0.5 * period * (1.0 - truth.dither_asymmetry);
    turn_s.resize(halves + 1);
    duration_s.resize(halves);
    for (std::size_t j = 0; j <= halves; ++j) {
        turn_s[j] = static_cast<double>(j / 2) * period + (j % 2 == 0 ? 0.0 : down);
        if (j < halves) duration_s[j] = j % 2 == 0 ? down : up;
    }

    // Peak rates Omega_D (1 +- r) over durations (1 -+ r)/(2 f): both swings are 2 Omega_D (1 - r^2)/w.
    const double phase_per_arcsec = two_pi / truth.scale_factor_arcsec;
    const double nominal = phase_per_arcsec * 3600.0 * truth.dither_peak_rate_deg_s *
                           (1.0 - truth.dither_asymmetry * truth.dither_asymmetry) /
                           (two_pi * truth.dither_frequency_hz);
    Random noise(truth.seed, Purpose::injected_noise);
    Random walk(truth.seed, Purpose::wander_walk);
    Random correlated(truth.seed, Purpose::wander_correlated);
    const auto injected = [&] {
        return truth.injected_noise_even == 0.0 ? noise.normal() : std::sqrt(3.0) * (2.0 * noise.uniform() - 1.0);
    };
    const AmplitudeWander& wander = truth.wander;
    const double decay = wander.correlation_s > 0.0 ? std::exp(-0.5 * period / wander.correlation_s) : 0.0;
    std::vector<double> angle(halves + 1);
    double walked = 0.0;
    double remembered = wander.rms * correlated.normal();
    for (std::size_t j = 0; j <= halves; ++j) {
        const double relative = walked + remembered + wander.drift_per_s * turn_s[j] +
                                wander.swing * std::sin(two_pi * turn_s[j] / wander.swing_period_s);
        angle[j] = -direction(j) * nominal * (1.0 + relative) + truth.injected_noise_rad * injected();
        walked += wander.walk_per_turn * walk.normal();
        remembered = decay * remembered + wander.rms * std::sqrt(1.0 - decay * decay) * correlated.normal();
    }
    amplitude_rad.resize(halves);
    for (std::size_t j = 0; j < halves; ++j) {
        amplitude_rad[j] = 0.5 * direction(j) * (angle[j + 1] - angle[j]);
        if (!(amplitude_rad[j] > 0.0)) refuse("noise or wander of the dither is as large as its amplitude");
    }

    // The line goes on within half cycles; the rest is their mean.
    RateTruth without_line = truth.rates;
    without_line.base_vibration = {};
    rate_rad_s = mean_rates(without_line, truth.seed, turn_s);
    line_phase_rad.resize(halves);
    line_rad.resize(halves);
    b_rad_s.resize(halves);
    for (std::size_t j = 0; j < halves; ++j) {
        const RateLine& line = truth.rates.base_vibration;
        if (line.rate_deg_h != 0.0) {
            const double turns = line.frequency_hz * turn_s[j];
            line_phase_rad[j] = two_pi * (turns - std::floor(turns)) + line.phase_rad;
            line_rad[j] = phase_per_arcsec * mean_of(line, turn_s[j], turn_s[j + 1]) * (turn_s[j + 1] - turn_s[j]);
        }
        double input = truth.input_rate_deg_h;
        if (!truth.input_profile_deg_h.empty())
            input += track_mean(truth.input_profile_deg_h, turn_s[j], turn_s[j + 1]);
        const double warmer = truth.temperature.mean_change_k(turn_s[j], turn_s[j + 1]);
        const double slope_k_per_h =
            3600.0 * (truth.temperature.change_k(turn_s[j + 1]) - truth.temperature.change_k(turn_s[j])) /
            (turn_s[j + 1] - turn_s[j]);
        const double rate = rate_rad_s[j] + input * (1.0 + truth.scale_factor_error) + truth.bias_deg_h +
                            truth.bias_temperature_deg_h_per_k * warmer +
                            truth.null_shift_deg_h_per_k_h * slope_k_per_h +
                            truth.bias_per_rate_squared_h_deg * input * input +
                            truth.bias_per_relative_amplitude_deg_h * (amplitude_rad[j] / nominal - 1.0);
        rate_rad_s[j] = phase_per_arcsec * rate;  // 1 deg/h is 1 arcsec/s
        const double middle_s = 0.5 * (turn_s[j] + turn_s[j + 1]);
        const SwingOfCoupling& swing = truth.lockin_swing;
        b_rad_s[j] = phase_per_arcsec * truth.lockin_threshold_deg_h * (1.0 + truth.lockin_temperature_per_k * warmer) *
                     (1.0 + swing.ratio * std::sin(two_pi * middle_s / swing.period_s));
        const ModeHop& hop = truth.mode_hop;
        if (hop.step_deg_h != 0.0) {
            const double after = std::clamp(turn_s[j + 1] - hop.time_s, 0.0, turn_s[j + 1] - turn_s[j]);
            rate_rad_s[j] += phase_per_arcsec * hop.step_deg_h * after / (turn_s[j + 1] - turn_s[j]);
        }
        if (middle_s >= hop.time_s) b_rad_s[j] *= 1.0 + hop.threshold_ratio;
        coupling_phase_rad.push_back(truth.detector_phase_offset_rad + (middle_s >= hop.time_s ? hop.phase_rad : 0.0));
    }
}

/// A phase as whole fringes and what is beyond them, in [0, 2 pi).
class Fringes {
   public:
    explicit Fringes(double phase_rad) { add(phase_rad); }
    void add(double phase_rad) {
        rest_rad_ += phase_rad;
        const double turns = std::floor(rest_rad_ / two_pi);
        // 2 pi in two parts; the first has 33 bits, so that the product is exact
        rest_rad_ = (rest_rad_ - turns * 6.28318530693650245668e+00) - turns * 2.43084020260247697972e-10;
        whole_ += static_cast<std::int64_t>(turns);
        while (rest_rad_ < 0.0) {
            rest_rad_ += two_pi;
            --whole_;
        }
        while (rest_rad_ >= two_pi) {
            rest_rad_ -= two_pi;
            ++whole_;
        }
    }
    std::int64_t whole() const { return whole_; }
    double rest_rad() const { return rest_rad_; }
    std::int64_t quarters() const {
        return 4 * whole_ + std::min<std::int64_t>(3, static_cast<std::int64_t>(std::floor(rest_rad_ / (0.5 * pi))));
    }

   private:
    std::int64_t whole_ = 0;
    double rest_rad_ = 0.0;
};

/// What the electronics make of the zero-rate points of one record.
class Instrument {
   public:
    explicit Instrument(const Truth& truth)
        : truth_(truth), noise_(truth.seed, Purpose::readout_noise), misses_(truth.seed, Purpose::missed_counts) {
        turns_.time_s.reserve(truth.turns);
    }

    void read(double turn_s, double s, const Fringes& phase, const LaneExtremum& extremum, std::size_t lane) {
        if (misses_.uniform() < truth_.missed_counts_per_turn) missed_ += s > 0.0 ? 1 : -1;
        turns_.time_s.push_back(tick(turn_s, extremum.time_s[lane]));
        turns_.direction.push_back(s > 0.0 ? 1 : -1);
        turns_.quarter_count.push_back(phase.quarters() + missed_);
        const ReadoutEllipse& ellipse = truth_.readout_ellipse;
        const double psi = phase.rest_rad();
        const double sine =
            (1.0 + ellipse.gain) * std::sin(psi) + ellipse.offset_sin + truth_.readout_noise * noise_.normal();
        const double cosine =
            std::cos(psi + ellipse.orthogonality_rad) + ellipse.offset_cos + truth_.readout_noise * noise_.normal();
        turns_.sine.push_back(sine);
        turns_.cosine.push_back(cosine);

        const double misread = std::remainder(std::atan2(sine, cosine) - psi, two_pi);
        for (std::size_t side = 0; side < 2; ++side) {
            const double first = tick(turn_s, extremum.pulse_s[side][0][lane]);
            const double second = tick(turn_s, extremum.pulse_s[side][1][lane]);
            const auto root = [&](std::size_t pulse) {
                return std::sqrt(2.0 * std::max(0.0, extremum.pulse_distance_rad[pulse][lane] - s * misread));
            };
            // Exact times: differences of small numbers, not of times since the start
            const double apart = truth_.clock_hz > 0.0
                                     ? std::abs(second - first)
                                     : std::abs(extremum.pulse_s[side][1][lane] - extremum.pulse_s[side][0][lane]);
            const double root_of_acceleration = apart > 0.0 ? (root(1) - root(0)) / apart : 0.0;
            (side == 0 ? turns_.accel_before_rad_s2 : turns_.accel_after_rad_s2)
                .push_back(root_of_acceleration * root_of_acceleration);
        }
    }

    record::Turns take() { return std::move(turns_); }

   private:
    double tick(double turn_s, double since_s) const {
        if (truth_.clock_hz <= 0.0) return turn_s + since_s;
        return std::floor((turn_s + since_s) * truth_.clock_hz) / truth_.clock_hz;
    }

    const Truth& truth_;
    Random noise_;
    Random misses_;
    std::int64_t missed_ = 0;
    record::Turns turns_;
};

bool has_extras(const Truth& truth) {
    return truth.lockin_second_harmonic.ratio != 0.0 || truth.lockin_third_harmonic.ratio != 0.0 ||
           truth.lockin_turn_asymmetry != 0.0 || truth.dither_second_harmonic.ratio != 0.0 ||
           truth.dither_third_harmonic != 0.0 || truth.rates.base_vibration.rate_deg_h != 0.0;
}

void describe(const Truth& truth, const Drive& drive, record::Record& record) {
    record.title = "Synthetic record of a mechanically dithered ring laser gyro";
    record.instrument = "simulated";
    record.source = "ringlock, tests/closure";
    record.licence = "as ringlock";
    if (truth.declared) {
        record.declared = *truth.declared;
    } else {
        record.declared.scale_factor_arcsec = truth.scale_factor_arcsec;
        record.declared.lockin_threshold_deg_h = truth.lockin_threshold_deg_h;
        record.declared.dither_frequency_hz = truth.dither_frequency_hz;
        record.declared.dither_peak_rate_deg_s = truth.dither_peak_rate_deg_s;
        record.declared.clock_hz = truth.clock_hz;
        record.declared.readout_noise_rad = truth.readout_noise;
        if (truth.input_profile_deg_h.empty()) record.declared.input_rate_deg_h = truth.input_rate_deg_h;
    }
    if (!truth.input_profile_deg_h.empty()) {
        record.input_rate_deg_h = truth.input_profile_deg_h;
        for (double& rate : record.input_rate_deg_h.value) rate += truth.input_rate_deg_h;
    }
    const Temperature& temperature = truth.temperature;
    if (!temperature.constant() && temperature.interval_s > 0.0) {
        const double end = drive.turn_s.back();
        for (std::size_t i = 0;; ++i) {
            const double time = temperature.interval_s * static_cast<double>(i);
            record.temperature_c.time_s.push_back(time);
            record.temperature_c.value.push_back(temperature.start_c + temperature.change_k(time));
            if (time >= end) break;
        }
    }
}

/// Up to eight records, `which` of the truths, in the lanes of one integration.
void run_group(std::span<const Truth> truths, std::span<const std::size_t> which, std::span<Generated> results) {
    std::vector<Drive> drives;
    std::vector<Instrument> instruments;
    std::vector<Fringes> phases;
    std::vector<double> lockin(which.size(), 0.0);
    std::vector<double> plain(which.size(), 0.0);
    LaneDevice device;
    std::size_t longest = 0;
    for (std::size_t lane = 0; lane < which.size(); ++lane) {
        const Truth& truth = truths[which[lane]];
        drives.emplace_back(truth);
        instruments.emplace_back(truth);
        phases.emplace_back(truth.initial_phase_rad);
        longest = std::max(longest, truth.turns);
    }
    device.extras = has_extras(truths[which.front()]);
    const Accuracy accuracy = truths[which.front()].accuracy;
    // Lanes without a record of their own repeat the first; lanes whose record is over repeat its last half cycle.
    const auto truth_of = [&](std::size_t lane) -> const Truth& {
        return truths[which[lane < which.size() ? lane : 0]];
    };
    for (std::size_t lane = 0; lane < lanes; ++lane) {
        const Truth& truth = truth_of(lane);
        device.second_ratio[lane] = truth.lockin_second_harmonic.ratio;
        device.second_phase_rad[lane] = truth.lockin_second_harmonic.phase_rad;
        device.third_ratio[lane] = truth.lockin_third_harmonic.ratio;
        device.third_phase_rad[lane] = truth.lockin_third_harmonic.phase_rad;
        device.turn_asymmetry[lane] = truth.lockin_turn_asymmetry;
        device.dither_ratio[lane] = truth.dither_second_harmonic.ratio;
        device.dither_phase_rad[lane] = truth.dither_second_harmonic.phase_rad;
        device.dither_third_ratio[lane] = truth.dither_third_harmonic;
        device.line_rad_s[lane] = two_pi / truth.scale_factor_arcsec * truth.rates.base_vibration.rate_deg_h;
        device.line_w_rad_s[lane] = two_pi * truth.rates.base_vibration.frequency_hz;
    }

    LaneHalf before, after;
    Lanes line_rad{};  // of the half cycle that was filled last
    Lanes mean_rate{};
    Lanes start{};
    Lanes delta{};
    LaneExtremum extremum;
    const auto swing_of_first = [&](std::size_t lane) { return 1.0 + truth_of(lane).dither_third_harmonic / 3.0; };
    const auto fill = [&](std::size_t j, LaneHalf& half) {
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const std::size_t from = lane < which.size() ? lane : 0;
            const Drive& drive = drives[from];
            // Of the same parity: durations of half cycles that go up and down differ.
            std::size_t k = j;
            if (k >= drive.amplitude_rad.size())
                k = drive.amplitude_rad.size() - 1 - (k + drive.amplitude_rad.size() + 1) % 2;
            // With its third harmonic the dither swings as far as without.
            half.amplitude_rad[lane] = drive.amplitude_rad[k] / swing_of_first(lane);
            half.duration_s[lane] = drive.duration_s[k];
            half.rate_rad_s[lane] = drive.rate_rad_s[k];
            half.b_rad_s[lane] = drive.b_rad_s[k];
            half.line_phase_rad[lane] = drive.line_phase_rad[k];
            line_rad[lane] = drive.line_rad[k];
        }
    };
    const auto phases_now = [&] {
        for (std::size_t lane = 0; lane < lanes; ++lane)
            start[lane] = phases[lane < which.size() ? lane : 0].rest_rad();
    };

    const auto set_coupling_phase = [&](std::size_t j) {
        for (std::size_t lane = 0; lane < lanes; ++lane) {
            const Drive& drive = drives[lane < which.size() ? lane : 0];
            device.coupling_phase_rad[lane] =
                drive.coupling_phase_rad[std::min(j, drive.coupling_phase_rad.size() - 1)];
        }
    };

    fill(0, before);
    set_coupling_phase(0);
    for (std::size_t turn = 1; turn <= longest; ++turn) {
        phases_now();
        integrate_half(device, before, Drive::direction(turn - 1), start, accuracy, delta);
        for (std::size_t lane = 0; lane < which.size(); ++lane) {
            mean_rate[lane] = before.rate_rad_s[lane] + line_rad[lane] / before.duration_s[lane];
            const double amplitude = before.amplitude_rad[lane] * swing_of_first(lane);
            const double swing =
                mean_rate[lane] * before.duration_s[lane] + 2.0 * Drive::direction(turn - 1) * amplitude;
            phases[lane].add(swing);
            phases[lane].add(delta[lane]);
            lockin[lane] += delta[lane];
            plain[lane] += swing;
        }
        phases_now();
        fill(turn, after);
        before.line_phase_rad = after.line_phase_rad;
        find_extremum(device, before, after, Drive::direction(turn), start, accuracy, extremum);
        for (std::size_t lane = 0; lane < which.size(); ++lane) {
            if (turn > truth_of(lane).turns) continue;
            Fringes at_extremum = phases[lane];
            at_extremum.add(extremum.phase_rad[lane]);
            instruments[lane].read(drives[lane].turn_s[turn], Drive::direction(turn), at_extremum, extremum, lane);
            Trajectory& trajectory = results[which[lane]].trajectory;
            trajectory.dither_turn_s.push_back(drives[lane].turn_s[turn]);
            trajectory.turn_phase_rad.push_back(phases[lane].rest_rad());
            trajectory.lockin_rad.push_back(lockin[lane]);
            trajectory.zero_rate_phase_rad.push_back(at_extremum.rest_rad());
            trajectory.plain_rad.push_back(plain[lane]);
            trajectory.amplitude_rad.push_back(before.amplitude_rad[lane] * swing_of_first(lane));
            trajectory.rate_rad_s.push_back(mean_rate[lane]);
            trajectory.b_rad_s.push_back(before.b_rad_s[lane]);
        }
        std::swap(before, after);
        set_coupling_phase(turn);
    }
    for (std::size_t lane = 0; lane < which.size(); ++lane) {
        record::Record& record = results[which[lane]].record;
        describe(truths[which[lane]], drives[lane], record);
        record.turns = instruments[lane].take();
    }
}

}  // namespace

double Temperature::change_k(double time_s) const {
    return ramp_k_per_h * time_s / 3600.0 + (swing_k == 0.0 ? 0.0 : swing_k * std::sin(two_pi * time_s / period_s));
}

double Temperature::mean_change_k(double from_s, double to_s) const {
    const double middle = 0.5 * (from_s + to_s);
    double change = ramp_k_per_h * middle / 3600.0;
    if (swing_k != 0.0) {
        const double half_angle = pi * (to_s - from_s) / period_s;
        change += swing_k * std::sin(two_pi * middle / period_s) * std::sin(half_angle) / half_angle;
    }
    return change;
}

std::vector<Generated> generate_with_trajectory(std::span<const Truth> truths) {
    for (const Truth& truth : truths) check(truth);
    // Records of one group take the same steps and the same code; alike in length and depth they wait little.
    const auto key = [&](std::size_t i) {
        const Truth& t = truths[i];
        return std::make_tuple(has_extras(t), t.accuracy.phase_step_rad, t.accuracy.turn_step, t.turns,
                               t.dither_peak_rate_deg_s / (t.scale_factor_arcsec * t.dither_frequency_hz));
    };
    const auto together = [&](std::size_t i, std::size_t j) {
        return has_extras(truths[i]) == has_extras(truths[j]) &&
               truths[i].accuracy.phase_step_rad == truths[j].accuracy.phase_step_rad &&
               truths[i].accuracy.turn_step == truths[j].accuracy.turn_step;
    };
    std::vector<std::size_t> order(truths.size());
    std::iota(order.begin(), order.end(), std::size_t{0});
    std::stable_sort(order.begin(), order.end(), [&](std::size_t i, std::size_t j) { return key(i) < key(j); });
    std::vector<std::span<const std::size_t>> groups;
    for (std::size_t first = 0; first < order.size();) {
        std::size_t last = first + 1;
        while (last < order.size() && last - first < lanes && together(order[first], order[last])) ++last;
        groups.push_back(std::span<const std::size_t>(order).subspan(first, last - first));
        first = last;
    }

    std::vector<Generated> results(truths.size());
    std::atomic<std::size_t> next = 0;
    std::exception_ptr failure;
    std::mutex failing;
    const auto work = [&] {
        for (std::size_t group = next++; group < groups.size(); group = next++) {
            try {
                run_group(truths, groups[group], results);
            } catch (...) {
                const std::lock_guard lock(failing);
                if (!failure) failure = std::current_exception();
            }
        }
    };
    {
        const std::size_t workers =
            std::min<std::size_t>(groups.size(), std::max(1U, std::thread::hardware_concurrency()));
        std::vector<std::jthread> threads;
        for (std::size_t i = 1; i < workers; ++i) threads.emplace_back(work);
        work();
    }
    if (failure) std::rethrow_exception(failure);
    return results;
}

std::vector<record::Record> generate(std::span<const Truth> truths) {
    std::vector<Generated> all = generate_with_trajectory(truths);
    std::vector<record::Record> records;
    records.reserve(all.size());
    for (Generated& one : all) records.push_back(std::move(one.record));
    return records;
}

}  // namespace ringlock::test::closure
