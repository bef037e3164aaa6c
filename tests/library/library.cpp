// The library as its users see it: only its own headers, and the program to compare with.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <memory>
#include <random>
#include <ringlock/ringlock.hpp>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

namespace library_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

struct ClosePipe {
    void operator()(std::FILE* pipe) const { pclose(pipe); }
};

/// What a command prints on standard output.
std::string output_of(const std::string& command) {
    const std::unique_ptr<std::FILE, ClosePipe> pipe(popen(command.c_str(), "r"));
    std::string text;
    std::array<char, 4096> piece;
    for (std::size_t n = 0; (n = std::fread(piece.data(), 1, piece.size(), pipe.get())) > 0;) {
        text.append(piece.data(), n);
    }
    return text;
}

/// The message of the exception that `work` throws; fails where it throws none of that type.
template <class Exception, class Work>
std::string message_of(Work&& work) {
    try {
        work();
    } catch (const Exception& error) {
        return error.what();
    }
    ADD_FAILURE() << "nothing was thrown";
    return "";
}

class Library : public testing::Test {
   protected:
    void SetUp() override {
        folder_ = std::filesystem::temp_directory_path() / ("ringlock-library-" + std::to_string(::getpid()));
        std::filesystem::create_directories(folder_);
    }
    void TearDown() override { std::filesystem::remove_all(folder_); }

    std::string path(const std::string& name) const { return (folder_ / name).string(); }
    void write(const std::string& name, const std::string& text) const { std::ofstream(path(name)) << text; }
    std::string program(const std::string& arguments) const {
        return output_of("cd '" + folder_.string() + "' && '" RINGLOCK_PROGRAM "' " + arguments + " 2>/dev/null");
    }

    std::filesystem::path folder_;
};

/// White rate noise in deg/h, the same at every call.
std::vector<double> white_rates(std::size_t n) {
    std::mt19937_64 random(7);
    std::normal_distribution<double> noise(15.0, 3.0);
    std::vector<double> rates(n);
    for (double& rate : rates) rate = noise(random);
    return rates;
}

const ringlock::Settings small = {{"ensemble.gyros", 3},
                                  {"ensemble.duration_s", 30.0},
                                  {"ensemble.seed", 5},
                                  {"arms.names", std::vector<std::string>{"ideal", "noise_injected"}}};

/// A JSON text without the two fields that depend on the time that a run took, and without the name of the file.
std::string without_times(std::string json) {
    for (const std::string key : {"\"scenario\"", "\"wall_s\"", "\"turns_per_s\""}) {
        const std::size_t at = json.find(key);
        if (at == std::string::npos) continue;
        json.erase(at, json.find('\n', at) - at);
    }
    return json;
}

TEST_F(Library, VersionIsThatOfTheProgram) {
    EXPECT_THAT(program("--version"), testing::StartsWith("ringlock " + std::string(ringlock::version()) + " (" +
                                                          std::string(ringlock::git_hash()) + ")\n"));
}

TEST_F(Library, ScenarioTakesSettingsAllOrNone) {
    ringlock::Scenario scenario;
    EXPECT_EQ(scenario.number("ensemble.gyros"), 64);
    scenario.set(small);
    EXPECT_EQ(scenario.number("ensemble.gyros"), 3);
    const std::string message = message_of<ringlock::InputError>([&] {
        scenario.set({{"ensemble.gyros", 9}, {"gyro.lockin_threshold_deg_h", -1.0}});
    });
    EXPECT_THAT(message, AllOf(HasSubstr("setting gyro.lockin_threshold_deg_h = -1.0"), Not(HasSubstr("--set"))));
    EXPECT_EQ(scenario.number("ensemble.gyros"), 3);
    EXPECT_THAT(message_of<ringlock::InputError>([&] { scenario.set("ensemble.giros", 9); }),
                HasSubstr("did you mean \"gyros\"?"));
    EXPECT_EQ(ringlock::Scenario::from_text(scenario.to_toml()).to_toml(), scenario.to_toml());
    EXPECT_EQ(std::get<std::vector<std::string>>(scenario.value("arms.names")),
              (std::vector<std::string>{"ideal", "noise_injected"}));
}

TEST_F(Library, ScenarioErrorsNameThePlaceInTheFile) {
    write("s.toml", "[gyro]\nscale_factor_arcsec = -2\n");
    EXPECT_THAT(message_of<ringlock::InputError>([&] { ringlock::Scenario::from_file(path("s.toml")); }),
                HasSubstr("s.toml:2:"));
    EXPECT_THAT(message_of<ringlock::InputError>([&] { ringlock::Scenario::from_file(path("none.toml")); }),
                HasSubstr("cannot be read"));
}

TEST_F(Library, RunGivesTheJsonOfTheProgram) {
    const ringlock::Result result = ringlock::run(ringlock::Scenario::from_text("", small), {.threads = 1});
    write("s.toml",
          "[ensemble]\ngyros = 3\nduration_s = 30\nseed = 5\n[arms]\nnames = [\"ideal\", \"noise_injected\"]\n");
    const std::string printed = program("run s.toml -o r.h5 -q --json");
    EXPECT_EQ(without_times(result.to_json()) + "\n", without_times(printed));

    // The file of either is read by the other.
    result.write(path("own.h5"));
    EXPECT_EQ(without_times(program("analyze own.h5 --json")), without_times(printed));
    const ringlock::Result read = ringlock::Result::read(path("r.h5"));
    EXPECT_EQ(without_times(read.to_json()), without_times(result.to_json()));
    EXPECT_EQ(read.arm("noise_injected").each.rate_error_deg_h, result.arm("noise_injected").each.rate_error_deg_h);
    EXPECT_EQ(read.angle_record("ideal").samples, 30U) << "those at time 0 and 29 whole intervals";
    EXPECT_EQ(*read.angle_record("noise_injected").angle_arcsec, *result.angle_record("noise_injected").angle_arcsec);
    // A result that was read is written again with its samples.
    read.write(path("again.h5"));
    EXPECT_EQ(*ringlock::Result::read(path("again.h5")).angle_record("noise_injected").angle_arcsec,
              *result.angle_record("noise_injected").angle_arcsec);
}

TEST_F(Library, ArmsHaveFiguresOfEachGyro) {
    ringlock::Scenario scenario = ringlock::Scenario::from_text("", small);
    scenario.set("ensemble.duration_s", 120.0);
    const ringlock::Result result = ringlock::run(scenario);
    EXPECT_THAT(message_of<ringlock::InputError>([&] { result.arm("compensated"); }),
                HasSubstr("which has ideal, noise_injected"));
    const ringlock::Arm& arm = result.arm("noise_injected");
    ASSERT_EQ(arm.each.rate_error_deg_h.size(), 3U);
    ASSERT_EQ(arm.each.allan_dev_deg_h.size(), 3 * arm.each.allan_tau_s.size());
    double mean = 0.0;
    for (const double error : arm.each.rate_error_deg_h) mean += error / 3.0;
    EXPECT_NEAR(arm.rate_error_deg_h.mean, mean, 1e-12 * std::abs(mean) + 1e-15);
    ASSERT_TRUE(arm.arw_deg_rt_h.has_value() && arm.arw_deg_rt_h->median.has_value());
    // The records have 120 samples each, which give it to 6.5 % a gyro; the median of three is within four standard
    // errors.
    EXPECT_NEAR(*arm.arw_deg_rt_h->median / result.theory().arw_deg_rt_h, 1.0, 0.2);
    EXPECT_EQ(arm.allan.size(), result.arm("ideal").allan.size());
}

TEST_F(Library, ResultsWithoutSamplesSaySo) {
    ringlock::Scenario scenario = ringlock::Scenario::from_text("", small);
    scenario.set("output.angle_record", false);
    const ringlock::Result result = ringlock::run(scenario);
    EXPECT_THAT(message_of<ringlock::InputError>([&] { static_cast<void>(result.angle_record("ideal")); }),
                HasSubstr("output.angle_record = true"));
    result.write(path("r.h5"));
    EXPECT_EQ(ringlock::Result::read(path("r.h5")).turns(), result.turns());
}

TEST_F(Library, DesignsHaveOnePointEach) {
    ringlock::Scenario scenario = ringlock::Scenario::from_text(
        "[design]\nkind = \"grid\"\n[[design.vary]]\nkey = \"gyro.lockin_threshold_deg_h\"\nvalues = [100, 400]\n",
        small);
    scenario.set({{"output.angle_record", false}});
    const ringlock::Result result = ringlock::run(scenario);
    ASSERT_EQ(result.points().size(), 2U);
    EXPECT_EQ(result.points()[1].values.at("gyro.lockin_threshold_deg_h"), 400.0);
    // The random walk of theory is in proportion to the threshold.
    EXPECT_NEAR(result.theory(1).arw_deg_rt_h / result.theory(0).arw_deg_rt_h, 4.0, 0.05);
    EXPECT_THROW(static_cast<void>(result.arms(2)), ringlock::InputError);
}

TEST_F(Library, CallbacksComeOnTheThreadOfTheCaller) {
    const auto here = std::this_thread::get_id();
    int calls = 0;
    ringlock::Progress last;
    ringlock::RunOptions options;
    options.interval_s = 0.001;
    options.progress = [&](const ringlock::Progress& now) {
        EXPECT_EQ(std::this_thread::get_id(), here);
        ++calls;
        last = now;
    };
    const ringlock::Result result = ringlock::run(ringlock::Scenario::from_text("", small), options);
    EXPECT_GT(calls, 0);
    EXPECT_EQ(last.gyros, 3);
    EXPECT_EQ(last.all_gyros, 3);
    EXPECT_EQ(last.turns, result.turns());
}

TEST_F(Library, RunsEndWhenTheCallerWants) {
    ringlock::Scenario scenario;
    scenario.set({{"ensemble.duration_s", 360000.0}, {"output.angle_record", false}});
    ringlock::RunOptions options;
    options.interval_s = 0.01;
    int asked = 0;
    options.cancel = [&] { return ++asked > 2; };
    EXPECT_THROW(ringlock::run(scenario, options), ringlock::Interrupted);
    options.cancel = [] { return false; };
    options.progress = [](const ringlock::Progress&) { throw std::logic_error("of the caller"); };
    EXPECT_THROW(ringlock::run(scenario, options), std::logic_error);
}

TEST_F(Library, WrongOptionsAreRefused) {
    const ringlock::Scenario scenario = ringlock::Scenario::from_text("", small);
    EXPECT_THAT(message_of<ringlock::InputError>([&] { ringlock::run(scenario, {.threads = -1}); }),
                HasSubstr("threads = -1"));
    ringlock::RunOptions options;
    options.interval_s = 0.0;
    EXPECT_THAT(message_of<ringlock::InputError>([&] { ringlock::run(scenario, options); }),
                HasSubstr("interval_s = 0"));
}

TEST_F(Library, WritingKeepsTheFilesOfOthers) {
    const ringlock::Result result = ringlock::run(ringlock::Scenario::from_text("", small));
    write("notes.h5", "mine");
    EXPECT_THROW(result.write(path("notes.h5")), ringlock::InputError);
    EXPECT_EQ(std::filesystem::file_size(path("notes.h5")), 4U);
    EXPECT_THROW(result.write(path("none/r.h5")), ringlock::InputError);
    EXPECT_THROW(ringlock::Result::read(path("notes.h5")), ringlock::InputError);
}

TEST_F(Library, DevicesAreReadAndUsed) {
    write("mine.toml",
          "summary = \"A prototype\"\n[gyro]\nscale_factor_arcsec = 2\nlockin_threshold_deg_h = 90.5\n"
          "[dither]\nfrequency_hz = 410.0\npeak_rate_deg_s = 101.0\n[effects.scale_factor_error]\nrelative = 1e-6\n"
          "[source.gyro]\nscale_factor_arcsec = \"assumed\"\n");
    const ringlock::Device device = ringlock::Device::from_file(path("mine.toml"));
    EXPECT_EQ(device.name, "mine");
    EXPECT_EQ(device.summary, "A prototype");
    EXPECT_EQ(device.scale_factor_arcsec, 2.0);
    ringlock::Scenario scenario;
    scenario.set("device", std::string("triangle-51mm"));
    scenario.use(device);
    EXPECT_EQ(scenario.number("gyro.lockin_threshold_deg_h"), 90.5);
    EXPECT_EQ(scenario.number("effects.scale_factor_error.relative"), 1e-6);
    EXPECT_EQ(std::get<std::string>(scenario.value("device")), "") << "its constants are not those of the name";
    EXPECT_THAT(message_of<ringlock::InputError>([&] { scenario.set("device", std::string("triangle-51mm")); }),
                HasSubstr("begin with another scenario"));
    // Later settings replace values of the device.
    scenario.set("gyro.lockin_threshold_deg_h", 10);
    EXPECT_EQ(scenario.number("gyro.lockin_threshold_deg_h"), 10.0);

    ringlock::Device wrong;
    wrong.name = "wrong";
    wrong.dither_frequency_hz = -1.0;
    EXPECT_THAT(message_of<ringlock::InputError>([&] { ringlock::Scenario().use(wrong); }),
                AllOf(HasSubstr("device wrong: "), HasSubstr("dither.frequency_hz")));
    EXPECT_THAT(message_of<ringlock::InputError>([] { ringlock::Device::from_text("[gyro\n", "d.toml"); }),
                HasSubstr("d.toml:1:"));
    EXPECT_THAT(ringlock::known_devices(), testing::Contains("gao-deng-2007"));
}

TEST_F(Library, AllanGivesTheJsonOfTheProgram) {
    std::vector<double> rates = white_rates(2000);
    rates[100] = std::numeric_limits<double>::quiet_NaN();
    std::string text;
    for (const double rate : rates) {
        std::array<char, 40> digits;
        std::snprintf(digits.data(), digits.size(), "%.17g\n", rate);
        text += digits.data();
    }
    write("data.txt", text);
    ringlock::AllanOptions options;
    options.rate_hz = 50.0;
    options.kind = ringlock::Kind::rate;
    options.unit = "deg/h";
    options.deviations = {"oadev", "mdev", "mtie"};
    const ringlock::Allan analysis = ringlock::allan(rates, options);
    // Values have no lines as those of a file have, in which the missing one is a finding.
    std::string of_program = program("allan data.txt --rate 50 --kind rate --unit deg/h --dev oadev,mdev,mtie --json");
    const std::string line = "\"line\":101,";
    ASSERT_NE(of_program.find(line), std::string::npos) << of_program;
    of_program.replace(of_program.find(line), line.size(), "\"line\":null,");
    EXPECT_EQ(analysis.to_json() + "\n", of_program);
    EXPECT_EQ(analysis.n, 1999U);
    EXPECT_EQ(analysis.missing, 1U);
    EXPECT_TRUE(std::isnan(analysis.deviation("mtie").points.front().lo));
    const ringlock::NoiseCoefficient* arw = analysis.coefficient("arw_deg_rt_h");
    ASSERT_TRUE(arw != nullptr && arw->value.has_value());
    // 3 deg/h at 50 Hz; 2000 samples give it within 2 %, and four standard errors are allowed.
    EXPECT_NEAR(*arw->value, 3.0 / std::sqrt(50.0) / 60.0, 0.08 * 3.0 / std::sqrt(50.0) / 60.0);
}

TEST_F(Library, AllanOfCountsIsExact) {
    // A counter at 2^60 that gains 3 and 4 by turns: doubles would lose the difference.
    std::vector<std::int64_t> counts(64);
    std::int64_t count = std::int64_t{1} << 60;
    for (std::size_t i = 0; i < counts.size(); ++i) counts[i] = count += i % 2 == 0 ? 3 : 4;
    ringlock::AllanOptions options;
    options.tau0_s = 1.0;
    options.kind = ringlock::Kind::phase;
    options.taus = "1";
    // Second differences of the phase are +-1: the deviation is sqrt(1/2).
    EXPECT_NEAR(ringlock::allan(counts, options).deviation("oadev").points.at(0).dev, std::sqrt(0.5), 1e-12);
}

TEST_F(Library, AllanNamesTheOptionThatIsWrong) {
    const std::vector<double> rates = white_rates(100);
    const auto refused = [&](auto&& change) {
        ringlock::AllanOptions options;
        options.rate_hz = 1.0;
        options.kind = ringlock::Kind::rate;
        change(options);
        const std::string message =
            message_of<ringlock::InputError>([&] { static_cast<void>(ringlock::allan(rates, options)); });
        EXPECT_THAT(message, Not(HasSubstr("--")));
        return message;
    };
    using Options = ringlock::AllanOptions;
    EXPECT_THAT(refused([](Options& o) { o.kind.reset(); }), HasSubstr("kind: is required"));
    EXPECT_THAT(refused([](Options& o) { o.rate_hz = 0.0; }), HasSubstr("rate_hz: is required"));
    EXPECT_THAT(refused([](Options& o) { o.tau0_s = 1.0; }), HasSubstr("rate_hz and tau0_s"));
    EXPECT_THAT(refused([](Options& o) { o.rate_hz = -1.0; }), HasSubstr("rate_hz = -1"));
    EXPECT_THAT(refused([](Options& o) { o.unit = "furlong"; }), HasSubstr("unit"));
    EXPECT_THAT(refused([](Options& o) { o.scale = 2.0; }), HasSubstr("scale: needs unit"));
    EXPECT_THAT(refused([](Options& o) { o.clean = true; }), HasSubstr("clean: needs unit"));
    EXPECT_THAT(refused([](Options& o) { o.deviations = {"sdev"}; }), HasSubstr("deviations: 'sdev' is not known"));
    EXPECT_THAT(refused([](Options& o) { o.taus = "1000"; }), HasSubstr("taus 1000"));
    EXPECT_THAT(refused([](Options& o) { o.taus = "1.5"; }), HasSubstr("taus '1.5'"));
    EXPECT_THAT(refused([](Options& o) { o.wrap = "often"; }), HasSubstr("wrap often"));
    EXPECT_THAT(refused([](Options& o) { o.confidence = 1.0; }), HasSubstr("confidence = 1"));
    ringlock::AllanOptions options;
    options.rate_hz = 1.0;
    options.kind = ringlock::Kind::rate;
    const std::vector<double> infinite = {1.0, HUGE_VAL, 2.0};
    EXPECT_THAT(message_of<ringlock::InputError>([&] { static_cast<void>(ringlock::allan(infinite, options)); }),
                HasSubstr("row 1"));
    EXPECT_THROW(ringlock::allan(std::vector<double>{}, options), ringlock::InputError);
    EXPECT_THROW(ringlock::allan(std::vector<double>{1.0}, options), ringlock::InputError);
}

TEST_F(Library, RecordsAreMadeOfSpansAndChecked) {
    const std::vector<double> increments = white_rates(1200);
    ringlock::SamplesView samples;
    samples.rate_hz = 100.0;
    samples.angle_increment_arcsec = increments;
    ringlock::Surroundings around;
    around.declared.scale_factor_arcsec = 0.5;
    const ringlock::Record record = ringlock::Record::of_samples(samples, around, "mine");
    EXPECT_EQ(record.rows(), 1200U);
    record.write(path("r.h5"));
    EXPECT_EQ(ringlock::Record::from_file(path("r.h5")).rows(), 1200U);
    samples.angle_arcsec = increments;
    EXPECT_THAT(message_of<ringlock::InputError>([&] { ringlock::Record::of_samples(samples); }),
                HasSubstr("exactly one"));
    samples.angle_arcsec = {};
    samples.rate_hz = -1.0;
    EXPECT_THAT(message_of<ringlock::InputError>([&] { ringlock::Record::of_samples(samples, {}, "mine"); }),
                HasSubstr("mine"));
    ringlock::TurnsView turns;
    turns.time_s = increments;
    EXPECT_THROW(ringlock::Record::of_turns(turns), ringlock::InputError);
}

TEST_F(Library, ClosedLoopGivesTheJsonOfTheProgram) {
    write("s.toml", "[ensemble]\nduration_s = 8\ngyros = 1\ndither_asymmetry_sd_ratio = 0\n");
    program("record s.toml -o r.h5");
    const ringlock::Record own = ringlock::simulate_record(ringlock::Scenario::from_file(path("s.toml")));
    ringlock::CloseOptions options;
    options.threads = 2;
    const ringlock::Closure closure = ringlock::close_loop(own, options);
    EXPECT_EQ(closure.to_json() + "\n", program("closure r.h5 --json -q"));
    EXPECT_EQ(closure.verdict, ringlock::Verdict::nothing_missing);
    EXPECT_EQ(closure.error_unit, "rad");
    EXPECT_GT(closure.heldout_error_after, 0.0);
    EXPECT_GT(closure.closed_scenario().number("dither.frequency_hz"), 100.0);
    EXPECT_THAT(closure.to_text(), HasSubstr("nothing missing"));
}

TEST_F(Library, ClosedLoopsEndWhenTheCallerWants) {
    ringlock::Scenario scenario;
    scenario.set({{"ensemble.duration_s", 60.0}});
    const ringlock::Record record = ringlock::simulate_record(scenario);
    ringlock::CloseOptions options;
    options.interval_s = 0.01;
    std::string stage;
    options.progress = [&](const std::string& now, double share) {
        stage = now;
        EXPECT_TRUE(share >= 0.0 && share <= 1.0);
    };
    int asked = 0;
    options.cancel = [&] { return ++asked > 2; };
    EXPECT_THROW(ringlock::close_loop(record, options), ringlock::Interrupted);
    EXPECT_NE(stage, "");
    // The request to stop does not outlive the loop that it ended.
    scenario.set({{"ensemble.duration_s", 4.0}});
    EXPECT_NO_THROW(ringlock::close_loop(ringlock::simulate_record(scenario)));
}

TEST_F(Library, ShortRecordsAreRefusedByName) {
    ringlock::Scenario scenario;
    scenario.set({{"ensemble.duration_s", 1.0}, {"output.sample_interval_s", 0.1}});
    const ringlock::Record record = ringlock::simulate_record(scenario);
    EXPECT_THAT(message_of<ringlock::InputError>([&] { ringlock::close_loop(record); }), HasSubstr("scenario: "));
}

}  // namespace
}  // namespace library_test
