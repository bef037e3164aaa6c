#include "tests/closure/generator/samples.hpp"

#include <algorithm>
#include <cmath>
#include <complex>
#include <numbers>

#include "engine/core/error.hpp"

namespace ringlock::test::closure {
namespace {

constexpr double pi = std::numbers::pi;
constexpr double two_pi = 2.0 * pi;
constexpr double gravity_m_s2 = 9.80665;
constexpr double arcsec_per_rad = 648000.0 / pi;

/// x_k = a x_{k-1} - r2 x_{k-2} + e_k, a = 2 r cos(w), r2 = r^2: a pair of poles at r exp(+-i w), of the rms asked for.
struct Autoregression {
    double a, r2;
    double innovation;  ///< standard deviation of e
};

Autoregression autoregression(const CaseMotion& motion, double rate_hz) {
    const double r = std::exp(-pi * motion.width_hz / rate_hz);
    const double r2 = r * r;
    const double a = 2.0 * r * std::cos(two_pi * motion.centre_hz / rate_hz);
    // Variance of the process over that of e (Box & Jenkins, second-order autoregression)
    const double variance = (1.0 + r2) / ((1.0 - r2) * ((1.0 + r2) * (1.0 + r2) - a * a));
    return {a, r2, motion.rms_arcsec / std::sqrt(variance)};
}

/// Stationary.
std::vector<double> resonance(std::size_t size, double rate_hz, const CaseMotion& motion, Random& random) {
    const auto [a, r2, innovation] = autoregression(motion, rate_hz);
    const double correlation = a / (1.0 + r2);
    std::vector<double> x(size);
    for (std::size_t k = 0; k < size; ++k) {
        if (k == 0) {
            x[k] = motion.rms_arcsec * random.normal();
        } else if (k == 1) {
            x[k] =
                correlation * x[0] + motion.rms_arcsec * std::sqrt(1.0 - correlation * correlation) * random.normal();
        } else {
            x[k] = a * x[k - 1] - r2 * x[k - 2] + innovation * random.normal();
        }
    }
    return x;
}

/// Of values at i/from_hz, linear between.
double at_time(const std::vector<double>& values, double from_hz, double time_s) {
    const double place = std::clamp(time_s * from_hz, 0.0, static_cast<double>(values.size() - 1));
    const auto i = std::min(values.size() - 2, static_cast<std::size_t>(place));
    const double share = place - static_cast<double>(i);
    return values[i] + share * (values[i + 1] - values[i]);
}

/// At consecutive readings of the source, stationary.
std::vector<double> markov(const SlowAcceleration& of, std::size_t size, double rate_hz, Random random) {
    std::vector<double> x(size, 0.0);
    if (of.rms_m_s2 == 0.0) return x;
    const double kept = std::exp(-1.0 / (rate_hz * of.time_s));
    double now = of.rms_m_s2 * random.normal();
    for (double& value : x) {
        value = now;
        now = kept * now + of.rms_m_s2 * std::sqrt(1.0 - kept * kept) * random.normal();
    }
    return x;
}

void check(const SampleTruth& truth) {
    if (!(truth.rate_hz > 0.0)) throw InputError("truth: rate_hz must be positive");
    if (truth.size == 0) throw InputError("truth: size must be positive");
    if (!(truth.resampling.from_hz >= 0.0)) throw InputError("truth: resampling.from_hz must not be negative");
    if (!(truth.case_motion.coherence >= 0.0 && truth.case_motion.coherence <= 1.0)) {
        throw InputError("truth: case_motion.coherence must lie between 0 and 1");
    }
    if (!(std::abs(truth.noise_modulation.depth) <= 1.0)) {
        throw InputError("truth: noise_modulation.depth must lie between -1 and 1");
    }
    const std::string& witness = truth.case_motion.witness;
    if (witness != "accel_x" && witness != "accel_y" && witness != "accel_z") {
        throw InputError("truth: case_motion.witness must be accel_x, accel_y or accel_z, not " + witness);
    }
}

}  // namespace

double coherence_with_noise(const SampleTruth& truth) {
    constexpr int parts = 200;
    const CaseMotion& motion = truth.case_motion;
    const double nyquist_hz = 0.5 * truth.rate_hz;
    const double noise_arcsec2_hz = std::pow(truth.accelerometer_noise / gravity_m_s2 * arcsec_per_rad, 2) / nyquist_hz;
    const auto [a, r2, innovation] = autoregression(motion, truth.rate_hz);
    const double low_hz = std::max(0.0, motion.centre_hz - motion.width_hz);
    const double high_hz = std::min(nyquist_hz, motion.centre_hz + motion.width_hz);
    double coherent = 0.0;
    double all = 0.0;
    for (int k = 0; k < parts; ++k) {
        const double w = two_pi * (low_hz + (k + 0.5) / parts * (high_hz - low_hz)) / truth.rate_hz;
        const double power = innovation * innovation / nyquist_hz /
                             std::norm(1.0 - a * std::polar(1.0, -w) + r2 * std::polar(1.0, -2.0 * w));
        // As the mean of an interval's ends
        const double seen = power * std::pow(std::cos(0.5 * w), 2);
        coherent += motion.coherence * power * seen / (seen + noise_arcsec2_hz);
        all += power;
    }
    return coherent / all;
}

record::Record generate_samples(const SampleTruth& truth) {
    check(truth);
    const bool resampled = truth.resampling.from_hz > 0.0;
    const double source_hz = resampled ? truth.resampling.from_hz : truth.rate_hz;
    const double end_s = static_cast<double>(truth.size) / truth.rate_hz;
    // Some more than the record takes, for what is interpolated at its end
    const std::size_t intervals = resampled ? static_cast<std::size_t>(std::ceil(end_s * source_hz)) + 2 : truth.size;
    std::vector<double> time_s(intervals + 1);
    for (std::size_t i = 0; i <= intervals; ++i) time_s[i] = static_cast<double>(i) / source_hz;

    std::vector<double> rate = mean_rates(truth.rates, truth.seed, time_s);
    const std::vector<double> acceleration =
        markov(truth.slow_acceleration, intervals + 1, source_hz, {truth.seed, Purpose::slow_acceleration});
    const double followed = -std::expm1(-1.0 / (source_hz * truth.late_temperature.lag_s));
    double late_k = 0.0;
    for (std::size_t i = 0; i < intervals; ++i) {
        const double from = time_s[i];
        const double to = time_s[i + 1];
        rate[i] += truth.mean_rate_deg_h;
        rate[i] += truth.bias_temperature_deg_h_per_k * truth.temperature.mean_change_k(from, to);
        const double before_k = late_k;
        late_k += followed * (truth.temperature.mean_change_k(from, to) - late_k);
        rate[i] += truth.late_temperature.deg_h_per_k * 0.5 * (before_k + late_k);
        rate[i] += truth.slow_acceleration.deg_h_s2_per_m * 0.5 * (acceleration[i] + acceleration[i + 1]);
        for (const RateLine& line : truth.lines) rate[i] += mean_of(line, from, to);
        if (!truth.input_profile_deg_h.empty()) {
            // Simpson's rule: exact between the rows of the profile
            const record::Track& profile = truth.input_profile_deg_h;
            const double middle = 0.5 * (from + to);
            const auto mean = [&](auto&& of) {
                return (of(profile.at(from)) + 4.0 * of(profile.at(middle)) + of(profile.at(to))) / 6.0;
            };
            rate[i] += (1.0 + truth.scale_factor_error) * mean([](double x) { return x; });
            rate[i] += truth.bias_per_rate_squared_h_deg * mean([](double x) { return x * x; });
        }
        if (truth.null_shift_deg_h_per_k_h != 0.0) {
            rate[i] += 3600.0 * truth.null_shift_deg_h_per_k_h *
                       (truth.temperature.change_k(to) - truth.temperature.change_k(from)) / (to - from);
        }
        if (truth.swinging_line.rate_deg_h != 0.0) {
            const SwingingLine& line = truth.swinging_line;
            // Simpson's rule for a part of a cycle
            const auto at = [&](double t) {
                const double swing = line.deviation_hz * line.period_s / two_pi * std::sin(two_pi * t / line.period_s);
                const double turns = line.frequency_hz * t + swing;
                return line.rate_deg_h * std::sin(two_pi * (turns - std::floor(turns)));
            };
            rate[i] += (at(from) + 4.0 * at(0.5 * (from + to)) + at(to)) / 6.0;
        }
        const JumpingLine& jump = truth.jumping_line;
        const bool jumped = 0.5 * (from + to) >= jump.time_s;
        rate[i] += mean_of({jump.frequency_hz, jumped ? jump.rate_after_deg_h : jump.rate_before_deg_h, 0.0}, from, to);
    }

    // The angle: what the rates add up to, and what is on the reading of it.
    std::vector<double> case_angle(intervals + 1, 0.0);
    std::vector<double> other_angle(intervals + 1, 0.0);
    if (truth.case_motion.rms_arcsec != 0.0) {
        Random motion(truth.seed, Purpose::case_motion);
        case_angle = resonance(intervals + 1, source_hz, truth.case_motion, motion);
        other_angle = resonance(intervals + 1, source_hz, truth.case_motion, motion);
    }
    std::vector<double> angle(intervals + 1);
    Random white(truth.seed, Purpose::white_angle);
    const DitherResidue& residue = truth.dither_residue;
    Random walk(truth.seed, Purpose::residue_wander);
    const double walked_rad = std::sqrt(two_pi * residue.wander_hz / source_hz);
    double wandered_rad = residue.phase_rad;
    double rotated = 0.0;
    for (std::size_t i = 0; i <= intervals; ++i) {
        if (i > 0) rotated += rate[i - 1] / source_hz;
        const NoiseModulation& modulation = truth.noise_modulation;
        const double power = 1.0 + modulation.depth * std::sin(two_pi * time_s[i] / modulation.period_s);
        angle[i] = rotated + case_angle[i] + truth.white_angle_arcsec * std::sqrt(power) * white.normal();
        if (residue.amplitude_arcsec != 0.0) {
            const double since_middle = time_s[i] - 0.5 * end_s;
            const double settled = 1.0 - std::exp(-time_s[i] / residue.settling_s);
            const double turns = residue.frequency_hz * since_middle +
                                 0.5 * residue.drift_hz_per_s * since_middle * since_middle +
                                 residue.settles_hz * residue.settling_s * settled;
            angle[i] += residue.amplitude_arcsec * std::sin(two_pi * (turns - std::floor(turns)) + wandered_rad);
            if (walked_rad > 0.0) wandered_rad += walked_rad * walk.normal();
        }
    }
    if (truth.saturation_arcsec > 0.0) {
        double before = angle[0];
        double clipped = angle[0];
        for (std::size_t i = 1; i <= intervals; ++i) {
            const double increment = std::clamp(angle[i] - before, -truth.saturation_arcsec, truth.saturation_arcsec);
            before = angle[i];
            clipped += increment;
            angle[i] = clipped;
        }
    }
    if (truth.count_quantization_arcsec > 0.0) {
        const double step = truth.count_quantization_arcsec;
        for (double& a : angle) a = std::floor(a / step) * step;
    }

    // At the ends of the record's samples
    std::vector<double> ends(truth.size + 1);
    if (!resampled) {
        ends = angle;
    } else if (!truth.resampling.of_rate) {
        for (std::size_t k = 0; k <= truth.size; ++k) {
            ends[k] = at_time(angle, source_hz, static_cast<double>(k) / truth.rate_hz);
        }
    } else {
        std::vector<double> increments(intervals);
        for (std::size_t i = 0; i < intervals; ++i) increments[i] = angle[i + 1] - angle[i];
        ends[0] = angle[0];
        for (std::size_t k = 0; k < truth.size; ++k) {
            const double middle_s = (static_cast<double>(k) + 0.5) / truth.rate_hz;
            // Source increments stand for the rates in the middle of their intervals.
            ends[k + 1] =
                ends[k] + at_time(increments, source_hz, middle_s - 0.5 / source_hz) * source_hz / truth.rate_hz;
        }
    }

    record::Record record;
    record.title = "Synthetic record of a gyro's output";
    record.instrument = "simulated";
    record.source = "ringlock, tests/closure";
    record.licence = "as ringlock";
    record::Samples samples;
    samples.rate_hz = truth.rate_hz;
    samples.kind = truth.kind;
    samples.t0_s = 1.0 / truth.rate_hz;  // a sample belongs to the end of its interval
    for (std::size_t k = 0; k < truth.size; ++k) {
        switch (truth.kind) {
            case record::SampleKind::angle_increment_arcsec:
                samples.values.push_back(ends[k + 1] - ends[k]);
                break;
            case record::SampleKind::angle_arcsec:
                samples.values.push_back(ends[k + 1] - ends[0]);
                break;
            case record::SampleKind::quarter_count:
                samples.counts.push_back(static_cast<std::int64_t>(
                    std::floor((ends[k + 1] - ends[0]) / (0.25 * truth.scale_factor_arcsec))));
                break;
        }
    }
    if (truth.declared) {
        record.declared = *truth.declared;
    } else if (truth.kind == record::SampleKind::quarter_count) {
        record.declared.scale_factor_arcsec = truth.scale_factor_arcsec;
    }

    Random noise(truth.seed, Purpose::witness);
    const auto mean_of_ends = [&](const std::vector<double>& values, std::size_t k) {
        return 0.5 * (at_time(values, source_hz, static_cast<double>(k) / truth.rate_hz) +
                      at_time(values, source_hz, static_cast<double>(k + 1) / truth.rate_hz));
    };
    if (truth.accelerometers || truth.case_motion.rms_arcsec != 0.0 || truth.slow_acceleration.rms_m_s2 != 0.0) {
        for (const char* name : {"accel_x", "accel_y", "accel_z"}) {
            std::vector<double>& witness = samples.witnesses[name];
            const bool sees = truth.case_motion.rms_arcsec != 0.0 && truth.case_motion.witness == name;
            for (std::size_t k = 0; k < truth.size; ++k) {
                double value = truth.accelerometer_noise * noise.normal();
                if (name[6] == 'x') value += mean_of_ends(acceleration, k);
                if (name[6] == 'z') value += gravity_m_s2;
                if (sees) {
                    value += gravity_m_s2 / arcsec_per_rad *
                             (std::sqrt(truth.case_motion.coherence) * mean_of_ends(case_angle, k) +
                              std::sqrt(1.0 - truth.case_motion.coherence) * mean_of_ends(other_angle, k));
                }
                witness.push_back(value);
            }
        }
    }
    if (!truth.temperature.constant()) {
        std::vector<double>& witness = samples.witnesses["temperature_c"];
        for (std::size_t k = 0; k < truth.size; ++k) {
            const double from = static_cast<double>(k) / truth.rate_hz;
            const double to = static_cast<double>(k + 1) / truth.rate_hz;
            witness.push_back(truth.temperature.start_c + truth.temperature.mean_change_k(from, to) +
                              truth.thermometer_noise_k * noise.normal());
        }
    }
    record.samples = std::move(samples);
    record.input_rate_deg_h = truth.input_profile_deg_h;
    return record;
}

}  // namespace ringlock::test::closure
