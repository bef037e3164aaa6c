#include "tests/closure/suite/sample_suite.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <map>
#include <random>

#include "analysis/closure/closure.hpp"
#include "analysis/closure/decide/effect_queries.hpp"
#include "analysis/closure/samples/fit/fit.hpp"
#include "analysis/closure/samples/fit/motion.hpp"
#include "analysis/closure/samples/loop/loop.hpp"
#include "analysis/closure/samples/screen/screen.hpp"
#include "engine/core/units.hpp"
#include "engine/effects/effect.hpp"
#include "tests/closure/generator/keys.hpp"

namespace ringlock::test::closure {

using ringlock::closure::ActiveEffect;
using ringlock::closure::Closure;
using ringlock::closure::Estimate;
using ringlock::closure::Where;

namespace {

constexpr auto increments = record::SampleKind::angle_increment_arcsec;
constexpr auto angles = record::SampleKind::angle_arcsec;

}  // namespace

const std::vector<SampleCondition> sample_conditions = {
    {"increments", 0.3, 0.01, increments, false, false, false, 0.0, 0.0},
    {"angles, dither declared", 0.1, 0.02, angles, false, false, false, 0.0, 437.0},
    {"accelerometers", 0.3, 0.01, increments, true, false, false, 0.0, 0.0},
    {"warm", 0.2, 0.03, increments, false, true, false, 0.0, 0.0},
    {"moving, warm", 0.2, 0.01, increments, false, true, true, 0.0, 0.0},
    {"fine digits, accelerometers", 0.3, 0.02, increments, true, true, false, 0.005, 0.0},
};

std::vector<Added> SampleCase::added() const {
    std::vector<Added> all = truth;
    all.insert(all.end(), foreign.begin(), foreign.end());
    return all;
}

std::string SampleCase::truth_text() const { return text_of(added()); }

namespace {

SampleTruth truth_of(const SampleCase& of) {
    const SampleCondition& condition = *of.condition;
    std::mt19937_64 random(of.seed);
    const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    const double duration_s = of.duration_s();
    SampleTruth truth;
    truth.rate_hz = of.rate_hz;
    truth.size = of.size;
    truth.seed = of.seed;
    truth.kind = condition.kind;
    truth.mean_rate_deg_h = between(-30.0, 30.0);
    truth.white_angle_arcsec = condition.white_angle_arcsec * between(0.7, 1.4);
    truth.rates.quantum_noise_deg_rt_h = condition.white_rate_deg_rt_h * between(0.7, 1.4);
    truth.accelerometers = condition.accelerometers;
    truth.count_quantization_arcsec = condition.digits_arcsec;
    if (condition.dither_hz > 0.0) truth.declared.emplace().dither_frequency_hz = of.dither_hz();
    if (condition.warm) {
        truth.temperature.swing_k = between(0.5, 2.0);
        truth.temperature.period_s = between(0.3, 0.6) * duration_s;
        truth.temperature.ramp_k_per_h = between(-5.0, 5.0);
        truth.thermometer_noise_k = 0.01;
    }
    if (condition.moving) {
        double time_s = 0.0;
        double rate = between(-300.0, 300.0);
        while (time_s < duration_s + 2.0) {
            const double next = between(-300.0, 300.0);
            const double hold_s = between(0.1, 0.3) * duration_s;
            for (const double t : {time_s, time_s + hold_s}) {
                truth.input_profile_deg_h.time_s.push_back(t);
                truth.input_profile_deg_h.value.push_back(rate);
            }
            time_s += hold_s + 1.0;
            rate = next;
        }
    }
    for (const Added& added : of.added()) {
        for (const auto& [name, value] : added.values) {
            const std::string key = name.empty() ? added.effect : added.effect + "." + name;
            if (key == "case_motion.witness") {
                truth.case_motion.witness = std::string("accel_") + "xyz"[std::lround(value)];
            } else {
                set(truth, key, fmt::format("{:.17g}", value));
            }
        }
    }
    return truth;
}

constexpr double evident = 6.0;  // of the detection limit

/// The parameter that says how much there is of an effect.
const char* size_of(const std::string& effect) {
    static const std::map<std::string, const char*> sizes = {{"count_quantization", "step_arcsec"},
                                                             {"dither_residue", "amplitude_arcsec"},
                                                             {"resampling", "from_hz"},
                                                             {"case_motion", "rms_arcsec"},
                                                             {"bias_step", "step_deg_h"},
                                                             {"bias_ramp", "deg_h_per_h"},
                                                             {"bias_temperature", "deg_h_per_k"},
                                                             {"null_shift_ramp", "deg_h_per_k_h"},
                                                             {"bias_instability", "deg_h"},
                                                             {"rate_random_walk", "deg_h_rt_h"},
                                                             {"base_vibration", "rate_deg_h"},
                                                             {"scale_factor_error", "relative"}};
    return sizes.at(effect);
}

bool is_random(const std::string& effect) { return effect == "bias_instability" || effect == "rate_random_walk"; }

std::vector<ActiveEffect> known(const std::vector<Added>& truth) {
    std::vector<ActiveEffect> all;
    for (const Added& added : truth) {
        ActiveEffect& active = all.emplace_back(ActiveEffect{effects::find(added.effect), {}});
        for (const effects::Parameter& parameter : active.effect->parameters()) {
            active.values.emplace(parameter.name, parameter.default_value);
        }
        for (const auto& [name, value] : added.values) active.values[name] = value;
    }
    return all;
}

/// Size of a motion whose response, fitted by two numbers, has a standard error of a quarter.
double limit_of_motion(const SampleCase& of, std::size_t effect) {
    SampleCase at = of;
    double rms = 0.3 * of.condition->white_angle_arcsec;
    for (int round = 0; round < 2; ++round) {
        at.truth[effect].values.at("rms_arcsec") = rms;
        const record::Record record = make(at);
        const auto series = ringlock::closure::prepare_samples(record);
        const ringlock::closure::Rows rows(series.size(), 1);
        const ringlock::closure::SampleFit fit(series, {}, rows);
        const auto which = static_cast<std::size_t>(std::lround(at.truth[effect].values.at("witness")));
        const double chi2 = fit.score(ringlock::closure::motion_columns(series.witnesses.at(which).second)).chi2;
        rms *= std::clamp(4.0 / std::sqrt(std::max(1.0, chi2 - 2.0)), 0.1, 10.0);
    }
    return rms;
}

}  // namespace

record::Record make(const SampleCase& of) { return generate_samples(truth_of(of)); }

std::vector<std::string> effects_on_samples() {
    return {"count_quantization", "dither_residue", "resampling",         "case_motion",
            "bias_step",          "bias_ramp",      "bias_temperature",   "bias_instability",
            "rate_random_walk",   "base_vibration", "scale_factor_error", "null_shift_ramp"};
}

bool has_size(const std::string& effect) { return effect != "resampling"; }

bool shows(const std::string& effect, const SampleCondition& condition) {
    if (effect == "case_motion") return condition.accelerometers;
    if (effect == "bias_temperature" || effect == "null_shift_ramp") return condition.warm;
    if (effect == "scale_factor_error") return condition.moving;
    if (effect == "count_quantization") return condition.digits_arcsec == 0.0;
    return true;
}

Added draw_on_samples(const std::string& effect, const SampleCase& of) {
    std::mt19937_64 random(of.seed ^ 0x5eed);
    const auto between = [&](double a, double b) { return std::uniform_real_distribution<double>(a, b)(random); };
    const auto even = [&](double a, double b) { return std::exp(between(std::log(a), std::log(b))); };
    const double sign = between(0.0, 1.0) < 0.5 ? -1.0 : 1.0;
    const double duration_s = of.duration_s();
    const SampleCondition& condition = *of.condition;
    if (effect == "count_quantization") return {effect, {{"step_arcsec", 0.5 * condition.white_angle_arcsec}}};
    if (effect == "dither_residue") {
        const bool declared = condition.dither_hz > 0.0;
        const double hz =
            declared ? of.dither_hz() + between(-0.8, 0.8) : between(0.05 * of.rate_hz, 0.45 * of.rate_hz);
        const bool drifts = between(0.0, 1.0) < 0.5;
        const double cycles =
            sign * even(5.0, 50.0);  // that the drift makes over the record, half of them to the middle
        return {effect,
                {{"frequency_hz", hz},
                 {"drift_hz_per_s", drifts ? cycles / (duration_s * duration_s) : 0.0},
                 {"amplitude_arcsec", 0.1 * condition.white_angle_arcsec},
                 {"phase_rad", between(-3.0, 3.0)}}};
    }
    if (effect == "resampling") {
        double hz = 0.0;
        // Not at a simple ratio to the record's rate, of which there is little or nothing to see.
        do {
            hz = even(0.55 * of.rate_hz, 3.2 * of.rate_hz);
        } while (std::abs(6.0 * hz / of.rate_hz - std::round(6.0 * hz / of.rate_hz)) < 0.05);
        return {effect, {{"from_hz", hz}}};
    }
    if (effect == "case_motion") {
        return {effect,
                {{"witness", std::floor(between(0.0, 3.0))},
                 {"coherence", between(0.6, 0.98)},
                 {"rms_arcsec", condition.white_angle_arcsec},
                 {"centre_hz", even(1.0, 12.0)},
                 {"width_hz", even(0.5, 5.0)}}};
    }
    if (effect == "bias_step") {
        return {effect, {{"step_deg_h", sign}, {"time_s", between(0.2, 0.8) * duration_s}}};
    }
    if (effect == "bias_ramp") return {effect, {{"deg_h_per_h", 10.0 * sign}}};
    if (effect == "bias_temperature") return {effect, {{"deg_h_per_k", 0.3 * sign}}};
    if (effect == "null_shift_ramp") return {effect, {{"deg_h_per_k_h", 0.01 * sign}}};
    if (effect == "bias_instability") return {effect, {{"deg_h", 1.0}}};
    if (effect == "rate_random_walk") return {effect, {{"deg_h_rt_h", 5.0}}};
    if (effect == "base_vibration") {
        return {effect,
                {{"frequency_hz", even(std::max(0.3, 3.0 / duration_s), 29.0)},
                 {"rate_deg_h", 1.0},
                 {"phase_rad", between(-3.0, 3.0)}}};
    }
    return {effect, {{"relative", 1e-3 * sign}}};
}

/// The size that has four times its standard error, by the fit to a record that has it at `size`.
double size_at_limit(const std::string& effect, double size, const Closure& fitted, std::size_t step) {
    double limit = size;
    if (effect == "count_quantization") {
        for (const Estimate& e : fitted.base) {
            if (e.name == "white_angle_arcsec") limit = std::sqrt(12.0 * 4.0 * 2.0 * e.value * e.sd);
        }
        return limit;
    }
    for (const Estimate& e : fitted.steps.at(step).parameters) {
        if (e.name != size_of(effect) || !(e.sd > 0.0) || !std::isfinite(e.sd)) continue;
        // Of a variance the information hardly depends: its root goes with the root of size times error.
        limit = is_random(effect) ? std::sqrt(std::abs(size) * 4.0 * e.sd) : 4.0 * e.sd;
        limit = std::copysign(std::abs(size) * std::clamp(limit / std::abs(size), 0.2, 5.0), size);
    }
    return limit;
}

void settle(SampleCase& of) {
    // A random rate may by chance do next to nothing in one record: the middle one of three, of other noise.
    const bool random =
        std::any_of(of.truth.begin(), of.truth.end(), [](const Added& added) { return is_random(added.effect); });
    constexpr int rounds = 4;
    constexpr std::uint64_t other_noise = 7919;
    SampleCase at = of;
    at.foreign.clear();
    std::vector<std::vector<double>> last(of.truth.size());
    for (int round = 0; round < rounds; ++round) {
        double moved = 0.0;
        const Closure closure = ringlock::closure::fit_samples(make(at), known(at.truth));
        for (std::size_t k = 0; k < at.truth.size(); ++k) {
            const std::string& effect = at.truth[k].effect;
            if (!has_size(effect)) continue;
            double& size = at.truth[k].values.at(size_of(effect));
            const double before = size;
            if (effect != "case_motion") {
                size = size_at_limit(effect, before, closure, k);
            } else if (round == 0) {
                size = limit_of_motion(at, k);
            }
            moved = std::max(moved, std::abs(std::log(size / before)));
            if (round > 0) last[k].push_back(size);
        }
        if (random) at.seed += other_noise;
        if (!random && moved < 0.1) break;
    }
    for (std::size_t k = 0; k < at.truth.size() && random; ++k) {
        if (last[k].empty()) continue;
        std::sort(last[k].begin(), last[k].end());
        at.truth[k].values.at(size_of(at.truth[k].effect)) = last[k][last[k].size() / 2];
    }
    for (std::size_t k = 0; k < of.truth.size(); ++k) {
        if (!has_size(of.truth[k].effect)) continue;
        const char* name = size_of(of.truth[k].effect);
        of.truth[k].values.at(name) = of.multiple * at.truth[k].values.at(name);
    }
}

namespace {

/// Cases of effects outside the library, with seeds that follow one another.
class ForeignCases {
   public:
    ForeignCases(std::uint64_t first_seed, std::uint64_t of_draws) : first_seed_(first_seed), random_(of_draws) {}

    void add(std::size_t condition, Where where, Added added) {
        SampleCase of;
        of.kind = Kind::foreign;
        of.condition = &sample_conditions[condition];
        of.seed = first_seed_ + cases.size();
        of.where = where;
        of.foreign = {std::move(added)};
        cases.push_back(std::move(of));
    }
    double between(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random_); }
    /// From what shows itself well to what is evident: sizes are even in their logarithms.
    double even(double a, double b) { return std::exp(between(std::log(a), std::log(b))); }

    std::vector<SampleCase> cases;

   private:
    std::uint64_t first_seed_;
    std::mt19937_64 random_;
};

/// Rates that go with time, temperature or acceleration otherwise than the library has it.
std::vector<SampleCase> foreign_rates(std::size_t each, std::uint64_t series) {
    ForeignCases foreign(seeds_of_series * series + 65000, 79 + series);
    for (std::size_t k = 0; k < each; ++k) {
        const double sign = k % 2 == 0 ? 1.0 : -1.0;
        foreign.add(
            k % 3, Where::time,
            {"settling", {{"start_deg_h", sign * foreign.even(6.0, 60.0)}, {"constant_s", foreign.even(15.0, 75.0)}}});
        foreign.add(k % 3, Where::time,
                    {"slow_swing",
                     {{"frequency_hz", foreign.between(1.2, 6.0) / foreign.cases.back().duration_s()},
                      {"rate_deg_h", foreign.even(2.0, 20.0)},
                      {"phase_rad", foreign.between(-3.0, 3.0)}}});
        foreign.add(k % 2 == 0 ? 2 : 5, Where::frequency,
                    {"slow_acceleration",
                     {{"rms_m_s2", 0.01},
                      {"time_s", foreign.even(3.0, 60.0)},
                      {"deg_h_s2_per_m", sign * foreign.even(200.0, 2000.0)}}});
        foreign.add(k % 2 == 0 ? 3 : 5, Where::temperature,
                    {"late_temperature",
                     {{"deg_h_per_k", sign * foreign.even(1.5, 15.0)}, {"lag_s", foreign.even(10.0, 80.0)}}});
    }
    return foreign.cases;
}

}  // namespace

std::vector<SampleCase> foreign_sample_cases(std::size_t each, std::uint64_t series) {
    ForeignCases foreign(seeds_of_series * series + 60000, 78 + series);
    for (std::size_t k = 0; k < each; ++k) {
        const double sign = k % 2 == 0 ? 1.0 : -1.0;
        foreign.add(k % 3, Where::time,
                    {"telegraph_bias",
                     {{"step_deg_h", sign * foreign.even(1.5, 15.0)}, {"dwell_s", foreign.even(10.0, 60.0)}}});
        foreign.add(k % 3, Where::frequency,
                    {"swinging_line",
                     {{"frequency_hz", foreign.between(3.0, 25.0)},
                      {"rate_deg_h", foreign.even(10.0, 60.0)},
                      {"deviation_hz", foreign.even(0.05, 0.5)},
                      {"period_s", foreign.between(30.0, 100.0)}}});
        foreign.add(4, Where::rate, {"bias_per_rate_squared_h_deg", {{"", sign * foreign.even(2e-5, 4e-4)}}});
        foreign.add(3 + k % 2, Where::temperature,
                    {"null_shift_ramp", {{"deg_h_per_k_h", sign * foreign.even(50.0, 500.0) / 3600.0}}});
        foreign.add(
            k % 3, Where::time,
            {"noise_modulation", {{"depth", foreign.even(0.15, 0.7)}, {"period_s", foreign.between(25.0, 120.0)}}});
        foreign.add(0, Where::amplitude, {"saturation_arcsec", {{"", 0.3 * foreign.between(2.5, 4.0)}}});
    }
    for (SampleCase& of : foreign_rates(each, series)) foreign.cases.push_back(std::move(of));
    // The library has learned some of these effects since; their records keep their seeds.
    for (SampleCase& of : foreign.cases) {
        if (effects::find(of.foreign.front().effect) == nullptr) continue;
        of.kind = Kind::single;
        of.multiple = evident;
        of.truth = std::exchange(of.foreign, {});
    }
    return foreign.cases;
}

Outcome judge(const SampleCase& of, const record::Record& record) {
    Outcome outcome;
    const auto start = std::chrono::steady_clock::now();
    const Closure closure = ringlock::closure::close_samples(record);
    outcome.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - start).count();
    const bool foreign = !of.foreign.empty();
    compare(closure, foreign ? std::optional(of.where) : std::nullopt, of.truth, outcome);
    outcome.closed_fault = fault_of_closed(record, closure);
    if (foreign) return outcome;
    const Closure oracle = ringlock::closure::fit_samples(record, known(of.truth));
    outcome.oracle = oracle.heldout_after;
    outcome.truth_gain = oracle.log_likelihood_gain;
    outcome.asked_gain = gain_asked(outcome.missing, ringlock::closure::effects_on_samples());
    // Estimates of what has been named: a tie names it first.
    if (outcome.judged != Judged::right && outcome.judged != Judged::tie) return outcome;
    const SampleTruth truth = truth_of(of);
    const auto has = [&](const char* effect) {
        return std::any_of(of.truth.begin(), of.truth.end(), [&](const Added& a) { return a.effect == effect; });
    };
    std::map<std::string, double> base = {{"white_rate_deg_rt_h", truth.rates.quantum_noise_deg_rt_h}};
    double input = 0.0;
    if (!truth.input_profile_deg_h.empty()) {
        for (std::size_t i = 0; i < of.size; ++i) {
            input += truth.input_profile_deg_h.at((static_cast<double>(i) + 0.5) / of.rate_hz) /
                     static_cast<double>(of.size);
        }
    }
    // A flicker has no mean; a step of the values adds to the white noise of the angle.
    if (!has("bias_instability")) base["mean_rate_deg_h"] = truth.mean_rate_deg_h + input;
    if (!has("count_quantization")) base["white_angle_arcsec"] = truth.white_angle_arcsec;
    const auto off = [](const Estimate& estimate, double value) {
        double difference = estimate.value - value;
        if (estimate.name == "phase_rad") difference = std::remainder(difference, units::two_pi);
        return estimate.sd > 0.0 ? difference / estimate.sd : std::numeric_limits<double>::quiet_NaN();
    };
    // The base model beside an effect that is not there is another.
    const bool same = std::all_of(closure.steps.begin(), closure.steps.end(),
                                  [&](const auto& step) { return has(step.name().c_str()); });
    for (const Estimate& estimate : closure.base) {
        if (!same) break;
        const auto value = base.find(estimate.name);
        if (value == base.end()) continue;
        outcome.deviations.push_back({estimate.name, estimate.value, estimate.sd, off(estimate, value->second)});
    }
    for (const auto& step : closure.steps) {
        // Which of two steps of one name it is cannot be said.
        const auto named = std::count_if(closure.steps.begin(), closure.steps.end(),
                                         [&](const auto& other) { return other.effect == step.effect; });
        for (const Added& added : of.truth) {
            if (added.effect != step.name() || named > 1) continue;
            for (const Estimate& estimate : step.parameters) {
                const auto value = added.values.find(estimate.name);
                if (value == added.values.end() || !estimate.text.empty()) continue;
                // Nothing tells a witness that sees less of the motion from one with more noise.
                const double told = estimate.name == "coherence" ? coherence_with_noise(truth) : value->second;
                outcome.deviations.push_back(
                    {step.name() + "." + estimate.name, estimate.value, estimate.sd, off(estimate, told)});
            }
        }
    }
    return outcome;
}

}  // namespace ringlock::test::closure
