// What validates, runs: scenarios from the corners of the schema are refused before they run, with the place of what is
// wrong, or run to their end.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <random>
#include <stdexcept>
#include <string>
#include <vector>

#include "analysis/study/study.hpp"
#include "analysis/study/summary.hpp"
#include "engine/core/error.hpp"
#include "engine/core/units.hpp"
#include "engine/ensemble/block.hpp"
#include "engine/scenario/active_effects.hpp"
#include "engine/scenario/arm.hpp"
#include "engine/scenario/devices.hpp"
#include "engine/scenario/keys/schema.hpp"
#include "engine/scenario/read_arms.hpp"
#include "engine/scenario/text/parse.hpp"

namespace ringlock::test {
namespace validated_runs_test {
namespace {

using scenario::Key;
using scenario::Scenario;
using scenario::Section;
using scenario::Type;

constexpr const char* file_name = "corner.toml";

/// One line of a scenario: `key = value` in its section, as text.
struct Setting {
    std::string section;
    std::string key;
    std::string value;
};

std::string to_text(const std::string& device, const std::vector<Setting>& settings) {
    std::map<std::string, std::string> sections;
    for (const Setting& one : settings) sections[one.section] += one.key + " = " + one.value + "\n";
    std::string text = device.empty() ? "" : "device = \"" + device + "\"\n";
    for (const auto& [name, lines] : sections) text += "[" + name + "]\n" + lines;
    return text;
}

/// Draws scenarios: each from a seed of its own, so that a failure comes back.
class Corners {
   public:
    explicit Corners(std::uint64_t seed) : engine_(seed) {}

    std::string device;
    std::vector<Setting> settings;

    void draw() {
        if (chance(0.3)) {
            const auto files = scenario::device_files();
            device = files[below(files.size())].name;
        }
        // Many keys at corners at once contradict each other nearly always: few of them are what finds the most.
        const double density = log_uniform(0.01, 0.4);
        for (const Section& section : scenario::schema()) {
            if (section.name == "ensemble" || section.name == "output" || section.name == "input") continue;
            if (section.name.starts_with("effects.") || section.name.starts_with("design")) continue;
            for (const Key& key : section.keys) {
                if (key.path() == "reader.output_hz") continue;  // by the length of the run, below
                if (key.type != Type::arms && chance(density)) set(key, value(key));
            }
        }
        draw_noise();
        draw_readout();
        draw_effects();
        draw_input(density);
        draw_arms();
        for (const Key& key : section("ensemble").keys) {
            const bool short_run = key.name == "gyros" || key.name == "settle_s" || key.name == "duration_s";
            if (!short_run && chance(density)) set(key, value(key));
        }
        draw_length();
        std::shuffle(settings.begin(), settings.end(), engine_);
        draw_outputs();
    }

    void shuffle() { std::shuffle(settings.begin(), settings.end(), engine_); }

   private:
    std::size_t below(std::size_t n) { return engine_() % n; }
    double unit() { return std::ldexp(static_cast<double>(engine_() >> 11), -53); }
    bool chance(double p) { return unit() < p; }
    double log_uniform(double lo, double hi) { return lo * std::pow(hi / lo, unit()); }

    static const Section& section(std::string_view name) {
        const auto& all = scenario::schema();
        return *std::find_if(all.begin(), all.end(), [&](const Section& s) { return s.name == name; });
    }
    static const Key& key(std::string_view section_name, std::string_view name) {
        const auto& keys = section(section_name).keys;
        return *std::find_if(keys.begin(), keys.end(), [&](const Key& k) { return k.name == name; });
    }

    void set(const Key& key, const std::string& value) {
        std::erase_if(settings, [&](const Setting& one) { return one.section == key.section && one.key == key.name; });
        settings.push_back({key.section, key.name, value});
    }
    void set(std::string_view section_name, std::string_view name, const scenario::Value& value) {
        set(key(section_name, name), scenario::to_toml(value));
    }
    /// What has been set so far, or the default: of numbers.
    double now(std::string_view section_name, std::string_view name) const {
        for (const Setting& one : settings) {
            if (one.section == section_name && one.key == name) return std::strtod(one.value.c_str(), nullptr);
        }
        if (!device.empty()) {
            const Scenario of = scenario::read_device(*scenario::find_device(device)).scenario;
            return std::get<double>(key(section_name, name).get(of));
        }
        return std::get<double>(key(section_name, name).default_value());
    }

    double real(const Key& key) {
        const double min = std::get<double>(key.bounds.min);
        const double max = std::get<double>(key.bounds.max);
        const double standard = key.type == Type::real ? std::get<double>(key.default_value()) : 0.0;
        const double least = min > 0.0 ? min : 1e-9 * max;
        double drawn = 0.0;
        switch (below(12)) {
            case 0:
                drawn = key.bounds.min_excluded ? 1e-300 : min;
                break;
            case 1:
                drawn = max;
                break;
            case 2:
                drawn = min + 1e-3 * (max - min);
                break;
            case 3:
                drawn = max - 1e-3 * (max - min);
                break;
            case 4:
                drawn = 0.0;
                break;
            case 5:
                drawn = standard;
                break;
            case 6:
                drawn = key.bounds.min_excluded || min == 0.0 ? 5e-324 : min * (1.0 + 1e-15);
                break;
            case 7:
            case 8:
                drawn = standard * log_uniform(0.1, 10.0);
                break;
            default:
                drawn = log_uniform(least, max);
        }
        if (min < 0.0 && chance(0.5)) drawn = -drawn;
        if (chance(0.003)) drawn = max * 1.001;  // out of bounds: refused by the key alone
        return drawn;
    }

    std::string value(const Key& key) {
        switch (key.type) {
            case Type::boolean:
                return chance(0.5) ? "true" : "false";
            case Type::word:
                return scenario::to_toml(key.words[below(key.words.size())]);
            case Type::integer: {
                const auto min = std::get<std::int64_t>(key.bounds.min);
                const auto max = std::get<std::int64_t>(key.bounds.max);
                const auto inside = static_cast<std::int64_t>(log_uniform(1.0, static_cast<double>(max)));
                const std::int64_t choices[] = {min, max, 0, inside, std::get<std::int64_t>(key.default_value())};
                return scenario::to_toml(choices[below(5)]);
            }
            default:
                return scenario::to_toml(real(key));
        }
    }

    void draw_noise() {
        const Section& noise = section("noise_injection");
        if (chance(0.5)) return;
        const bool drive = chance(0.6);
        set("noise_injection", "model", std::string(drive ? "drive" : "turns"));
        if (drive) {
            for (const char* name : {"form", "distribution"}) {
                set(key("noise_injection", name), value(key("noise_injection", name)));
            }
            for (const Key& key : noise.keys) {
                if (key.name == "resonator_q" || key.name == "hold_half_cycles" || key.name == "modulation_hz" ||
                    key.name == "amplitude_loop_hz") {
                    if (chance(0.4)) set(key, value(key));
                }
            }
        }
        if (drive && chance(0.5)) {
            std::erase_if(settings, [](const Setting& one) { return one.key == "turn_phase_rms_rad"; });
            set("noise_injection", "drive_noise_relative", chance(0.5) ? log_uniform(1e-4, 1.0) : unit());
        } else {
            set("noise_injection", "turn_phase_rms_rad", chance(0.7) ? log_uniform(0.01, 300.0) : 0.0);
        }
    }

    void draw_readout() {
        if (chance(0.4)) return;
        set("readout", "model", std::string(chance(0.7) ? "instrument" : "ideal"));
        for (const Key& key : section("readout").keys) {
            if (key.name != "model" && chance(0.2)) set(key, value(key));
        }
    }

    void draw_effects() {
        std::vector<const Section*> effects;
        for (const Section& section : scenario::schema()) {
            if (section.name.starts_with("effects.")) effects.push_back(&section);
        }
        for (std::size_t n = chance(0.3) ? 0 : 1 + below(5); n > 0; --n) {
            for (const Key& key : effects[below(effects.size())]->keys) {
                if (chance(0.8)) set(key, value(key));
            }
        }
        for (const Key& key : section("environment").keys) {
            if (chance(0.3)) set(key, value(key));
        }
    }

    void draw_input(double density) {
        const double half_peak_deg_h = 0.5 * 3600.0 * now("dither", "peak_rate_deg_s");
        const auto rate = [&] {
            if (chance(density)) return real(key("input", "rate_deg_h"));
            const double most = std::min(0.9 * half_peak_deg_h, 1e7);
            return (chance(0.5) ? 1.0 : -1.0) * (chance(0.5) ? most * unit() : log_uniform(1e-9 * most, most));
        };
        if (chance(0.6)) set("input", "rate_deg_h", rate());
        if (chance(0.15)) {
            set("input", "sweep_points", static_cast<std::int64_t>(2 + below(2)));
            set("input", "sweep_stop_deg_h", rate());
        } else if (chance(0.2)) {
            std::vector<double> times;
            std::vector<double> rates;
            double time = chance(0.5) ? 0.0 : -log_uniform(1e-3, 1e9);
            for (std::size_t n = 1 + below(5); n > 0; --n) {
                times.push_back(time);
                rates.push_back(rate());
                time += log_uniform(1e-6, 10.0);
            }
            set("input", "profile_time_s", times);
            set("input", "profile_rate_deg_h", rates);
        }
    }

    void draw_arms() {
        if (chance(0.2)) return;
        std::vector<std::string> names = scenario::arm_names();
        const bool latched = std::none_of(settings.begin(), settings.end(), [](const Setting& one) {
            return one.section == "readout" && one.key == "model" && one.value != "\"latched\"";
        });
        if (latched && !chance(0.05)) {
            std::erase_if(names, [](const std::string& name) {
                const scenario::Compensator compensator = scenario::parse_arm(name).compensator;
                return compensator == scenario::Compensator::extrapolated ||
                       compensator == scenario::Compensator::adaptive;
            });
        }
        std::shuffle(names.begin(), names.end(), engine_);
        names.resize(1 + below(std::min<std::size_t>(names.size(), 5)));
        set("arms", "names", scenario::parse_arms(names));
    }

    /// At most 10 s and some hundred cycles; a dither too slow for three samples in that time is refused.
    void draw_length() {
        const double cycle_s = 1.0 / now("dither", "frequency_hz");
        const double duration_s = std::min(10.0, std::floor(log_uniform(8.0, 400.0)) * cycle_s);
        set("ensemble", "gyros", static_cast<std::int64_t>(1 + below(4)));
        set("ensemble", "duration_s", duration_s);
        if (chance(0.2)) set("ensemble", "settle_s", std::min(10.0, log_uniform(0.1, 100.0) * cycle_s));
        set("output", "sample_interval_s", std::max(1.001 * cycle_s, duration_s / log_uniform(3.0, 50.0)));
    }

    /// Arms that are read: some outputs a dither cycle, or one in some cycles, and ticks that fit them more often than
    /// not. Last, so that the rest of the scenario is what it is without.
    void draw_outputs() {
        if (!chance(0.2)) return;
        const double output_hz = log_uniform(0.05, 5.0) * now("dither", "frequency_hz");
        set("reader", "output_hz", output_hz);
        if (chance(0.7)) set("reader", "latch_hz", static_cast<double>(below(20)) * output_hz);
        if (chance(0.7)) set(key("reader", "stripping"), value(key("reader", "stripping")));
    }

    std::mt19937_64 engine_;
};

/// Fringes that a run goes through one by one: those of the direct integrator, and those of the nodes of tables in the
/// phase; as many stand for the memory of resonator and amplitude loop that noise must fill. It is time alone that such
/// a run needs, and here there is little.
double fringes_one_by_one(const Scenario& s) {
    const double fringes = 2.0 * s.dither.peak_rate_deg_s * units::deg_h_per_deg_s /
                           (s.gyro.scale_factor_arcsec * units::two_pi * s.dither.frequency_hz);
    const auto gyros = static_cast<double>(s.ensemble.gyros * s.input.sweep_points);
    const double simulated_s = scenario::simulated_s(s) * gyros;
    const double half_cycles = 2.0 * s.dither.frequency_hz * simulated_s;
    // A tick takes as long as some fringes do, and a tap of a filter at each output a thousandth of one.
    const scenario::StudyReader reader = scenario::study_reader(s);
    const double taps = 2.0 * reader.delay_s * reader.latch_hz;
    double all =
        (4.0 * reader.latch_hz + 1e-3 * taps * s.reader.output_hz) * simulated_s * static_cast<double>(s.arms.size());
    const scenario::NoiseInjection& noise = s.noise_injection;
    if (noise.model == scenario::NoiseModel::drive) {
        if (noise.form == gyro::NoiseForm::white) all += 60.0 * noise.resonator_q;
        if (noise.amplitude_loop_hz > 0.0) {
            all += 60.0 * std::max(noise.resonator_q, s.dither.frequency_hz / noise.amplitude_loop_hz);
        }
    }
    if (s.propagation.method == scenario::PropagationMethod::direct) return all + fringes * half_cycles;
    const bool series = scenario::configured_setup(s).lockin_second_ratio != 0.0;
    return all + (series ? 2000.0 * fringes * gyros : 0.0);
}

constexpr double most_fringes = 1e6;

/// More than an arm's angle can be away from that of the input [arcsec]: by the effects and all their chance, by the
/// lock-in of a gyro that stands still, and by readings and corrections that are wrong by two fringes at every turn.
double largest_error_arcsec(const Scenario& s, double duration_s, double turns) {
    double rate = s.gyro.lockin_threshold_deg_h * (1.0 + 6.0 * s.ensemble.lockin_threshold_sd_relative) * 3.0 *
                  (1.0 + scenario::threshold_change_relative(s));
    double angle = 2.0 * s.gyro.scale_factor_arcsec * (turns + 10.0);
    for (const scenario::EffectBounds& bounds : scenario::bounds_of_effects(s)) {
        rate += bounds.certain.rate_deg_h + 10.0 * bounds.rate_sd_deg_h;
    }
    const double swings = 6.0 * s.dither.peak_rate_deg_s * units::arcsec_per_deg / s.dither.frequency_hz;
    // A reader leaves as much as all of the dither, and adds its reference's noise, at both ends of a record.
    const double of_reader = scenario::reads_arms(s) ? swings + 20.0 * s.reader.reference_noise_arcsec : 0.0;
    return rate * (duration_s + 1.0 / s.dither.frequency_hz) + angle + 1e-3 * swings + of_reader;
}

/// The angles of the block's first piece are numbers.
void check_first_angles(const Scenario& s) {
    ensemble::GyroBlock block(s, s.arms, 0, 1);
    const std::int64_t all = ensemble::Schedule(s).turns();
    const auto turns = static_cast<std::size_t>(std::min<std::int64_t>(all, 8));
    block.advance(turns);
    const gyro::Setup& setup = block.setups().front();
    for (const double value : {setup.scale_factor_arcsec, setup.lockin_threshold_deg_h, setup.coupling_phase_rad,
                               setup.dither_frequency_hz, setup.dither_peak_rate_deg_s, setup.dither_asymmetry_ratio,
                               setup.input_rate_deg_h, setup.initial_phase_rad}) {
        if (!std::isfinite(value)) throw std::runtime_error("a constant of the gyro is no number");
    }
    for (std::size_t arm = 0; arm < s.arms.size(); ++arm) {
        for (std::size_t i = 0; i < turns; i += 2) {
            if (std::isfinite(block.angles(arm).angle_fringes[i][0]) &&
                std::isfinite(block.lockin_error_rad(arm, i, 0)))
                continue;
            throw std::runtime_error("arm " + s.arms[arm].name + ": an angle is no number");
        }
    }
}

/// Throws where a rate error is none that the gyro can have.
void check_rate_error(const Scenario& s, const scenario::Arm& arm, const ensemble::Schedule& schedule,
                      double rate_error_deg_h) {
    const double duration_s = schedule.sample_interval_s * static_cast<double>(schedule.samples - 1);
    const double most = largest_error_arcsec(s, duration_s, static_cast<double>(schedule.turns())) / duration_s;
    // Written so that what is no number fails as well.
    if (std::abs(rate_error_deg_h) <= most) return;
    throw std::runtime_error("arm " + arm.name + ": a rate error of " + std::to_string(rate_error_deg_h) +
                             " deg/h, where effects and lock-in make " + std::to_string(most) + " deg/h at most");
}

/// Runs the scenario to its end; throws where it cannot, or where what comes out is no angle of a gyro.
void run_to_the_end(const Scenario& s) {
    check_first_angles(s);
    const study::Study study = study::run(study::Study(s), 1);
    const study::Summary summary = study::summarise(study);
    if (summary.arms.size() != s.arms.size()) throw std::runtime_error("the summary lacks arms");
    for (const study::ArmStatistics& arm : study.arms) {
        for (const study::GyroStatistics& gyro : arm.gyros) {
            check_rate_error(s, arm.arm, study.schedule, gyro.rate_error_deg_h);
        }
    }
}

/// A message that says where: file, line and column, or at least file and key.
bool says_where(const std::string& message) {
    const std::string file = std::string(file_name) + ":";
    for (std::size_t from = 0; from < message.size();) {
        const std::size_t end = std::min(message.find('\n', from), message.size());
        const std::string line = message.substr(from, end - from);
        if (!line.starts_with(file)) return false;
        if (line.find("key \"") == std::string::npos && line.find("section [") == std::string::npos) return false;
        from = end + 1;
    }
    return !message.empty();
}

struct Tally {
    int refused = 0;
    int ran = 0;
    int failed = 0;
    int too_long = 0;
};

enum class Outcome { refused, ran, failed, too_long };

Outcome try_one(std::uint64_t seed, const std::string& text, Tally& tally) {
    const auto fail = [&](const std::string& what) {
        ADD_FAILURE() << "seed " << seed << ": " << what << "\n" << text;
        ++tally.failed;
        return Outcome::failed;
    };
    Scenario s;
    try {
        s = scenario::parse_string(text, file_name);
    } catch (const InputError& error) {
        if (!says_where(error.what())) return fail(std::string("refused without a place: ") + error.what());
        ++tally.refused;
        return Outcome::refused;
    } catch (const std::exception& error) {
        return fail(std::string("neither read nor refused: ") + error.what());
    }
    if (fringes_one_by_one(s) > most_fringes) {
        ++tally.too_long;
        return Outcome::too_long;
    }
    try {
        run_to_the_end(s);
    } catch (const std::exception& error) {
        return fail(std::string("was not refused and does not run: ") + error.what());
    }
    ++tally.ran;
    return Outcome::ran;
}

/// Key by key, in that order, as long as the rules let it pass.
std::string without_what_is_refused(const std::string& device, const std::vector<Setting>& settings) {
    std::vector<Setting> kept;
    std::string text = to_text(device, kept);
    // What keeps the run short comes first, and settings that need each other get a second chance.
    for (const int pass : {0, 1, 2}) {
        for (const Setting& one : settings) {
            const bool length = one.key == "duration_s" || one.key == "sample_interval_s" || one.key == "gyros" ||
                                one.key == "frequency_hz" || one.key == "settle_s";
            const bool there = std::any_of(kept.begin(), kept.end(), [&](const Setting& other) {
                return other.section == one.section && other.key == one.key;
            });
            if (there || (pass == 0) != (length && !one.section.starts_with("effects."))) continue;
            kept.push_back(one);
            const std::string longer = to_text(device, kept);
            // The length of the run is of one piece.
            if (pass == 0) {
                text = longer;
                continue;
            }
            try {
                scenario::parse_string(longer, file_name);
                text = longer;
            } catch (const InputError&) {
                kept.pop_back();
            }
        }
    }
    return text;
}

/// Each seed stands for a scenario as drawn, and where that is refused for one more, of its keys as far as they go
/// together.
void corners_are_refused_or_run(std::uint64_t first, std::uint64_t last) {
    Tally tally;
    Tally mended;
    for (std::uint64_t seed = first; seed < last; ++seed) {
        Corners corners(seed);
        corners.draw();
        const std::string text = to_text(corners.device, corners.settings);
        if (try_one(seed, text, tally) == Outcome::refused) {
            try_one(seed, without_what_is_refused(corners.device, corners.settings), mended);
        }
    }
    std::printf("as drawn: %d refused, %d ran, %d failed, %d too long for a test\n", tally.refused, tally.ran,
                tally.failed, tally.too_long);
    std::printf("made to pass: %d refused, %d ran, %d failed, %d too long for a test\n", mended.refused, mended.ran,
                mended.failed, mended.too_long);
    const auto all = static_cast<int>(last - first);
    EXPECT_GT(tally.refused, all / 10) << "the rules are hardly tried";
    EXPECT_GT(tally.ran + mended.ran, all / 2) << "little runs: the test says little";
}

/// Refused at a key that the text names, with its line; nothing where it runs.
std::string refused_or_run(const std::string& text) {
    Scenario s;
    try {
        s = scenario::parse_string(text, file_name);
    } catch (const InputError& error) {
        EXPECT_TRUE(says_where(error.what())) << error.what();
        EXPECT_NE(std::string(error.what()).find(std::string(file_name) + ":"), std::string::npos);
        EXPECT_TRUE(std::isdigit(static_cast<unsigned char>(error.what()[std::string(file_name).size() + 1])))
            << "no line: " << error.what();
        return error.what();
    }
    EXPECT_NO_THROW(run_to_the_end(s)) << text;
    return "";
}

const std::string short_output = "[output]\nsample_interval_s = 10\nangle_record = false\n";
const std::string long_run = "[ensemble]\ngyros = 1\nduration_s = 3000\n" + short_output;
const std::string one_arm = "[arms]\nnames = [\"uncompensated\"]\n";
const std::string two_arms = "[arms]\nnames = [\"uncompensated\", \"compensated_exact\"]\n";

TEST(ValidatedRuns, ABiasThatFollowsALongRampOfTheTemperature) {
    // 1000 K/h are 833 K in 3000 s.
    const std::string ramp = "[environment]\ntemperature_ramp_k_per_h = 1000\n[dither]\npeak_rate_deg_s = 20\n" +
                             long_run + one_arm + "[effects.bias_temperature]\ndeg_h_per_k = ";
    for (const char* method : {"", "\n[propagation]\nmethod = \"direct\"\n"}) {
        const std::string refused = refused_or_run(ramp + "100" + method);
        EXPECT_NE(refused.find("key \"effects.bias_temperature.deg_h_per_k\" = 100.0"), std::string::npos) << refused;
    }
    EXPECT_EQ(refused_or_run(ramp + "10"), "");
}

TEST(ValidatedRuns, ARampOfTheBias) {
    for (const char* slope : {"-1e5", "1e4"}) {
        refused_or_run("[dither]\npeak_rate_deg_s = 20\n" + long_run + one_arm +
                       "[effects.bias_ramp]\ndeg_h_per_h = " + slope);
    }
}

TEST(ValidatedRuns, AScaleFactorErrorUnderAFastProfile) {
    for (const char* relative : {"-0.1", "0.1"}) {
        for (const char* profile : {"profile_time_s = [0, 10, 20]\nprofile_rate_deg_h = [-3e4, 3e4, 0]\n",
                                    "profile_time_s = [0, 1, 1.001]\nprofile_rate_deg_h = [0, 190000, -190000]\n",
                                    "profile_time_s = [0, 20]\nprofile_rate_deg_h = [0, 1e7]\n"}) {
            for (const char* peak : {"20", "109.1", "10000"}) {
                refused_or_run(std::string("[input]\n") + profile + "[dither]\npeak_rate_deg_s = " + peak +
                               "\n[effects.scale_factor_error]\nrelative = " + relative +
                               "\n[ensemble]\ngyros = 1\nduration_s = 30\n" + two_arms);
            }
        }
    }
}

TEST(ValidatedRuns, CornersOfTheSchemaAreRefusedOrRun) { corners_are_refused_or_run(0, 25); }
TEST(LongValidatedRuns, MoreCornersOfTheSchemaAreRefusedOrRun) { corners_are_refused_or_run(25, 150); }
TEST(LongValidatedRuns, CornersOfTheSchemaAreRefusedOrRun) { corners_are_refused_or_run(1000, 3000); }

}  // namespace
}  // namespace validated_runs_test
}  // namespace ringlock::test
