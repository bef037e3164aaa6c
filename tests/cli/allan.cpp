#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/unit/allan_support.hpp"

namespace allan_test {
namespace {

using namespace ringlock;
using testing::HasSubstr;

struct Outcome {
    int status = -1;
    std::string out;
    std::string err;
};

class AllanCommand : public testing::Test {
   protected:
    void SetUp() override {
        const auto* info = testing::UnitTest::GetInstance()->current_test_info();
        directory_ = std::filesystem::temp_directory_path() /
                     ("ringlock-allan-cli-" + std::string(info->name()) + "-" + std::to_string(::getpid()));
        std::filesystem::create_directories(directory_);
    }
    void TearDown() override { std::filesystem::remove_all(directory_); }

    static std::string contents(const std::filesystem::path& path) {
        std::ifstream in(path);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    Outcome run(const std::string& arguments) {
        const std::string command = std::string("'") + RINGLOCK_PROGRAM + "' allan " + arguments + " >'" +
                                    (directory_ / "out").string() + "' 2>'" + (directory_ / "err").string() + "'";
        const int raw = std::system(command.c_str());
        return {WIFEXITED(raw) ? WEXITSTATUS(raw) : -1, contents(directory_ / "out"), contents(directory_ / "err")};
    }
    std::string write(const std::vector<double>& values, const std::string& before = "") {
        const auto path = directory_ / "data.txt";
        std::ofstream out(path);
        out.precision(17);
        out << before;
        for (const double v : values) out << v << '\n';
        return path.string();
    }

    std::string write_text(const std::string& text) {
        const auto path = directory_ / ("text-" + std::to_string(texts_++));
        std::ofstream(path, std::ios::binary) << text;
        return path.string();
    }

    std::filesystem::path directory_;
    int texts_ = 0;
};

TEST_F(AllanCommand, JsonHasTheFieldsAndPublishedFigures) {
    const Outcome r =
        run(write(test::sp1065_frequencies()) + " --rate 1 --kind rate --tau 1,10,100 --dev oadev,adev --json");
    ASSERT_EQ(r.status, 0) << r.err;
    EXPECT_EQ(r.err, "");
    const auto json = nlohmann::json::parse(r.out);
    EXPECT_EQ(json["n"], 1000);
    EXPECT_EQ(json["tau0_s"], 1.0);
    EXPECT_TRUE(json["noise"].is_null());
    const auto& points = json["deviations"]["oadev"];
    ASSERT_EQ(points.size(), 3u);
    EXPECT_NEAR(points[1]["dev"], 9.159953e-2, 5e-9);
    EXPECT_EQ(points[1]["m"], 10);
    EXPECT_EQ(points[1]["terms"], 1001 - 20);
    EXPECT_EQ(points[1]["alpha"], 0);
    EXPECT_LT(points[1]["lo"], points[1]["dev"]);
    EXPECT_GT(points[1]["hi"], points[1]["dev"]);
    EXPECT_GT(points[1]["edf"], 100.0);
    EXPECT_NEAR(json["deviations"]["adev"][2]["dev"], 3.897804e-2, 5e-9);
}

// All names of the family; errors of time carry the unit of the data, and what has no interval says null.
TEST_F(AllanCommand, EveryDeviationIsThere) {
    const std::string data = write(test::sp1065_frequencies());
    const std::string names = "adev,oadev,mdev,tdev,hdev,ohdev,totdev,mtotdev,ttotdev,htotdev,mtie,tierms";
    const Outcome r = run(data + " --rate 1 --kind rate --tau 1,10,100 --json --dev " + names);
    ASSERT_EQ(r.status, 0) << r.err;
    const auto json = nlohmann::json::parse(r.out)["deviations"];
    ASSERT_EQ(json.size(), 12u);
    for (const auto& [name, points] : json.items()) {
        ASSERT_EQ(points.size(), 3u) << name;
        const bool error = name == "mtie" || name == "tierms";
        for (const auto& p : points) {
            EXPECT_GT(p["dev"], 0.0);
            EXPECT_GT(p["terms"], 0);
            if (error) continue;
            EXPECT_LT(p["lo"], p["dev"]);
            EXPECT_GT(p["hi"], p["dev"]);
            for (const char* field : {"alpha", "edf", "lo", "hi"})
                EXPECT_EQ(p[field].is_null(), error) << name << field;
        }
    }
    EXPECT_NEAR(json["htotdev"][2]["dev"], 3.058103e-2, 5e-9);
    const auto raw = nlohmann::json::parse(
        run(data + " --rate 1 --kind rate --tau 1,10,100 --json --bias raw --dev " + names).out)["deviations"];
    EXPECT_NEAR(raw["mtotdev"][0]["dev"], 2.0664e-1, 5e-6);
    EXPECT_EQ(raw["mtotdev"][0]["bias"], 1.0);
    EXPECT_EQ(json["mtotdev"][0]["bias"], 0.73);
    const auto exact = nlohmann::json::parse(
        run(data + " --rate 1 --kind rate --tau 1,10,100 --json --bias exact --dev mtotdev").out)["deviations"];
    EXPECT_NEAR(exact["mtotdev"][0]["bias"], 0.5, 1e-9);
    const Outcome text = run(data + " --rate 1 --kind rate --unit deg/h --dev tdev,mtie --tau 1,10");
    EXPECT_THAT(text.out, HasSubstr("tdev [arcsec]"));
    EXPECT_THAT(text.out, HasSubstr("no interval"));
}

// Rows left out and values that are not there are the same gap, counted and not closed up.
TEST_F(AllanCommand, GapsAreCountedAndNotClosedUp) {
    const auto angle = test::simulate_angle({.n = 0.3}, 3000, 0.5, 2);
    const auto write_rows = [&](const char* name, bool stamps) {
        const auto path = directory_ / name;
        std::ofstream out(path);
        out.precision(12);
        for (std::size_t i = 0; i < angle.size(); ++i) {
            const bool missing = i % 301 == 7 || (i > 1200 && i < 1260);
            if (stamps && missing) continue;
            if (stamps) out << 100.0 + 0.5 * static_cast<double>(i) << ',';
            (missing ? out << "nan" : out << angle[i]) << '\n';
        }
        return path.string();
    };
    const std::string options = " --rate 2 --kind phase --unit arcsec --json --dev oadev,mdev";
    const Outcome by_value = run(write_rows("values.txt", false) + options);
    const Outcome by_time = run(write_rows("times.txt", true) + options + " --column 2 --time 1");
    ASSERT_EQ(by_value.status, 0) << by_value.err;
    ASSERT_EQ(by_time.status, 0) << by_time.err;
    const auto a = nlohmann::json::parse(by_value.out);
    const auto b = nlohmann::json::parse(by_time.out);
    EXPECT_EQ(a["missing"], 68);
    EXPECT_EQ(a["n"], 3001 - 68);
    EXPECT_EQ(a["deviations"], b["deviations"]);
    EXPECT_LT(a["deviations"]["oadev"][0]["terms"], 2999);
    EXPECT_GT(a["noise_fitted_points"], 250);
    const double dev = a["deviations"]["oadev"][5]["dev"];
    EXPECT_NEAR(dev, 0.3 / 4.0, 0.3 / 4.0 * 0.15);  // N/sqrt(tau) at 16 s
    EXPECT_THAT(run(write_rows("values.txt", false) + " --rate 2 --kind phase").out, HasSubstr("68 data are missing"));
}

TEST_F(AllanCommand, FactorsThatGapsLeaveNothingOfAreNamed) {
    const auto path = directory_ / "gaps.txt";
    std::ofstream(path) << "1\nnan\n2\nnan\n3\nnan\n4\n5\n7\n";
    const Outcome text = run(path.string() + " --rate 1 --kind rate --dev oadev,mdev");
    EXPECT_EQ(text.status, 0);
    EXPECT_THAT(text.out, HasSubstr("gaps leave no term to m = 2, 4"));
    const auto json = nlohmann::json::parse(run(path.string() + " --rate 1 --kind rate --tau 1,2 --json").out);
    EXPECT_EQ(json["deviations"]["oadev"].size(), 1u);
    EXPECT_EQ(json["factors_without_terms"]["oadev"], nlohmann::json::array({2}));
    std::ofstream(path) << "1\n2\n";
    EXPECT_THAT(run(path.string() + " --rate 1 --kind rate --dev hdev").out, HasSubstr("too short for a term"));
}

TEST_F(AllanCommand, StreamsAgreeWithRecords) {
    const auto angle = test::simulate_angle({.n = 0.3}, 40'000, 0.5, 3);
    std::vector<double> rates;
    for (std::size_t i = 0; i + 1 < angle.size(); ++i) rates.push_back((angle[i + 1] - angle[i]) / 0.5);
    const std::string data = write(rates);
    const std::string options = " --rate 2 --kind rate --unit deg/h --json --dev oadev,ohdev";
    const auto kept = nlohmann::json::parse(run(data + options).out);
    const Outcome piped = run("- --stream" + options + " < '" + data + "'");
    ASSERT_EQ(piped.status, 0) << piped.err;
    const auto streamed = nlohmann::json::parse(piped.out);
    EXPECT_EQ(streamed["stride"], "tau/8");
    EXPECT_EQ(streamed["n"], 40'000);
    EXPECT_EQ(streamed["noise_fitted_every"], 2);
    for (const char* name : {"oadev", "ohdev"}) {
        const auto& a = kept["deviations"][name];
        const auto& b = streamed["deviations"][name];
        ASSERT_EQ(a.size(), b.size());
        for (std::size_t i = 0; i < 4; ++i) {
            EXPECT_NEAR(a[i]["dev"], b[i]["dev"], 1e-9 * a[i]["dev"].get<double>());
        }
    }
    const double n = kept["noise"]["arw_deg_rt_h"]["value"];
    EXPECT_NEAR(streamed["noise"]["arw_deg_rt_h"]["value"], n, 0.03 * n);
    EXPECT_THAT(run(data + " --rate 2 --kind rate --stream --dev mdev").err, HasSubstr("oadev and ohdev only"));
    EXPECT_THAT(run(data + " --rate 2 --kind rate --stream --tau all").err, HasSubstr("octaves only"));
}

TEST_F(AllanCommand, DrawsTheDeviationsAndTheFit) {
    const std::string data = write(test::simulate_angle({.n = 0.3, .k = 0.01}, 5000, 1.0, 4));
    const auto figure = directory_ / "figure.svg";
    const Outcome r = run(data + " --rate 1 --kind phase --unit arcsec --plot '" + figure.string() + "'");
    ASSERT_EQ(r.status, 0) << r.err;
    const std::string svg = contents(figure);
    EXPECT_THAT(svg, HasSubstr("oadev"));
    EXPECT_THAT(svg, HasSubstr(">fit<"));
    EXPECT_EQ(run(data + " --rate 1 --kind phase --plot figure.gif").status, 2);
}

// One record in every kind and unit gives one answer.
TEST_F(AllanCommand, KindsAndUnitsAgree) {
    const auto angle = test::simulate_angle({.n = 0.3}, 1200, 0.5, 1);
    std::vector<double> increments;
    std::vector<double> rate_deg_s;
    std::vector<double> radians;
    for (std::size_t i = 0; i < angle.size(); ++i) {
        radians.push_back(angle[i] / 3600.0 * 3.14159265358979323846 / 180.0);
        if (i == 0) continue;
        increments.push_back(angle[i] - angle[i - 1]);
        rate_deg_s.push_back(increments.back() / 0.5 / 3600.0);
    }
    const auto a =
        nlohmann::json::parse(run(write(increments) + " --rate 2 --kind increment --unit arcsec --json").out);
    const auto b = nlohmann::json::parse(run(write(rate_deg_s) + " --rate 2 --kind rate --unit deg/s --json").out);
    const auto c = nlohmann::json::parse(run(write(radians) + " --rate 2 --kind phase --unit rad --json").out);
    EXPECT_EQ(a["n"], 1200);
    EXPECT_EQ(c["n"], 1201);
    EXPECT_EQ(a["unit"], "deg/h");
    const double dev = a["deviations"]["oadev"][3]["dev"];
    EXPECT_NEAR(dev, 0.3 / 2.0, 0.3 / 2.0 * 0.2);  // N/sqrt(tau) at 4 s, in deg/h
    for (const auto* other : {&b, &c}) {
        EXPECT_NEAR((*other)["deviations"]["oadev"][3]["dev"], dev, 1e-8 * dev);
        EXPECT_NEAR((*other)["noise"]["arw_deg_rt_h"]["value"], a["noise"]["arw_deg_rt_h"]["value"], 1e-6);
    }
    EXPECT_NEAR(a["noise"]["arw_deg_rt_h"]["value"], 0.005, 0.0005);
    for (const char* key : {"quantization_arcsec", "bias_instability_deg_h", "rrw_deg_h_rt_h", "rate_ramp_deg_h_h"}) {
        EXPECT_TRUE(a["noise"].contains(key)) << key;
        EXPECT_TRUE(a["noise"][key].is_null()) << key;
        EXPECT_GT(a["noise_upper_limits_95"][key], 0.0) << key;
    }
    const Outcome text = run(write(increments) + " --rate 2 --kind increment --unit arcsec");
    EXPECT_THAT(text.out, HasSubstr("bias instability B     not resolved, < "));
    EXPECT_THAT(text.out, HasSubstr("oadev [deg/h]"));
}

TEST_F(AllanCommand, WithholdsCoefficientsThatDoNotDescribeTheRecord) {
    auto angle = test::simulate_angle({.n = 0.3}, 4000, 1.0, 1);
    for (const double turn : {0.4, 1.1, 1.9, 2.5}) {  // one line more than are taken off
        for (std::size_t i = 0; i < angle.size(); ++i) angle[i] += 0.3 * std::sin(turn * static_cast<double>(i));
    }
    const auto json = nlohmann::json::parse(run(write(angle) + " --rate 1 --kind phase --unit arcsec --json").out);
    EXPECT_THAT(json["noise_withheld"].get<std::string>(), HasSubstr("line at 0.0636"));
    for (const auto& [key, value] : json["noise"].items()) EXPECT_TRUE(value.is_null()) << key;
    EXPECT_EQ(json["noise"].size(), 7u);
}

TEST_F(AllanCommand, WrongInputEndsWithTwoAndSaysWhy) {
    const std::string data = write({1, 2, 4, 3, 5, 9}, "# rate_hz = 10\n");
    const auto expect = [&](const std::string& arguments, const std::string& words) {
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 2) << arguments;
        EXPECT_EQ(r.out, "") << arguments;
        EXPECT_THAT(r.err, HasSubstr(words)) << arguments;
    };
    expect(data + " --rate 10", "never guessed");
    expect(data + " --rate 10 --kind freq", "'freq'");
    expect(data + " --rate 20 --kind rate", "contradicts --rate 20");
    expect(data + " --rate 0 --kind rate", "positive");
    expect(data + " --rate 10 --kind rate --unit arcsec", "deg/h, arcsec/s");
    expect(data + " --rate 10 --kind rate --unit counts", "needs --scale");
    expect(data + " --rate 10 --kind rate --unit counts --scale 2", "needs its unit");
    expect(data + " --rate 10 --kind rate --scale 2", "needs --unit");
    expect(data + " --rate 10 --kind rate --unit dps --scale 0", "positive");
    expect(data + " --rate 10 --kind rate --arw-unit 'deg/sqrt(h)'", "needs --unit");
    expect(data + " --rate 10 --kind rate --unit dps --arw-unit furlong", "deg/s/sqrt(Hz)");
    expect(data + " --rate 10 --kind rate --unit mg --arw-unit 'deg/sqrt(h)'", "accelerometer");
    expect(data + " --rate 10 --kind rate --unit furlong", "'furlong'");
    expect(data + " --rate 10 --kind rate --dev oadev,pdev", "'pdev' is not known; there are adev, oadev, mdev");
    expect(data + " --rate 10 --kind rate --bias maybe", "--bias");
    expect(data + " --rate 10 --kind rate --dev xdev", "not known");
    expect(data + " --rate 10 --kind rate --tau 1,9", "1 to 3");
    expect(data + " --rate 10 --kind rate --tau 0.5", "not seconds");
    expect(data + " --rate 10 --kind rate --confidence 2", "between 0 and 1");
    expect(data + " --kind rate", "--rate");
    expect("absent.txt --rate 10 --kind rate", "absent.txt");
    expect(write({1}) + " --rate 10 --kind rate", "at least 2");
}

// One record in the units of each instrument: the numbers differ by the factors of docs/units.md alone.
TEST_F(AllanCommand, InstrumentsHaveUnitsOfTheirOwn) {
    const std::string data = write(test::simulate_angle({.n = 0.3}, 4000, 0.5, 7));
    const auto json_of = [&](const std::string& options) {
        return nlohmann::json::parse(run(data + " --rate 2 --kind phase --json " + options).out);
    };
    const auto gyro = json_of("--unit arcsec --arw-unit 'deg/h/sqrt(Hz)'");
    const double n_deg_rt_h = gyro["noise"]["arw_deg_rt_h"]["value"];
    EXPECT_EQ(gyro["instrument"], "gyro");
    EXPECT_EQ(gyro["noise"]["arw_unit"], "deg/h/sqrt(Hz)");
    EXPECT_DOUBLE_EQ(gyro["noise"]["arw"]["value"], 60.0 * n_deg_rt_h);
    const auto accelerometer = json_of("--unit m/s --arw-unit 'm/s^2/sqrt(Hz)'");
    EXPECT_EQ(accelerometer["unit"], "m/s^2");
    EXPECT_NEAR(accelerometer["noise"]["vrw_m_s_rt_h"]["value"], 3600.0 * n_deg_rt_h, 1e-9);
    EXPECT_NEAR(accelerometer["noise"]["arw"]["value"], 60.0 * n_deg_rt_h, 1e-9);
    const auto clock = json_of("--unit s");
    EXPECT_TRUE(clock["unit"].is_null());
    EXPECT_EQ(clock["instrument"], "clock");
    EXPECT_NEAR(clock["noise"]["white_frequency_rt_s"]["value"], 60.0 * n_deg_rt_h, 1e-9);
    // The estimator does not depend on the unit.
    const auto nanoseconds = json_of("--unit ns");
    EXPECT_NEAR(nanoseconds["noise"]["white_frequency_rt_s"]["value"].get<double>() * 1e9, 60.0 * n_deg_rt_h, 1e-6);
    const auto counts = json_of("--unit counts --scale 2.5arcsec");
    EXPECT_NEAR(counts["noise"]["arw_deg_rt_h"]["value"], 2.5 * n_deg_rt_h, 1e-9);
}

// Coefficients are those of the record without what was found; the deviations are of the data as they are.
TEST_F(AllanCommand, FaultsAreFoundBeforeCoefficientsAreClaimed) {
    std::vector<double> values;
    std::mt19937_64 random(9);
    std::normal_distribution<double> noise;
    for (int i = 0; i < 2000; ++i) values.push_back(noise(random));
    const std::string options = " --rate 200 --kind rate --unit deg/s";
    const auto json_of = [&] { return nlohmann::json::parse(run(write(values) + options + " --json").out); };
    const auto clean = json_of();
    EXPECT_EQ(clean["findings"].size(), 0U);
    const double n = clean["noise"]["arw_deg_rt_h"]["value"];
    values[777] += 100.0;
    const auto glitch = json_of();
    ASSERT_EQ(glitch["findings"].size(), 1U);
    EXPECT_EQ(glitch["findings"][0]["kind"], "outlier");
    EXPECT_EQ(glitch["findings"][0]["row"], 778);
    EXPECT_NEAR(glitch["findings"][0]["size"], 100.0, 5.0);
    EXPECT_NEAR(glitch["noise"]["arw_deg_rt_h"]["value"], n, 0.005 * n);
    EXPECT_THAT(run(write(values) + options).out, HasSubstr("row 778 (line 778)     outlier"));
    values[777] -= 100.0;
    for (std::size_t i = 600; i < values.size(); ++i) values[i] += 2.0;
    const auto jump = json_of();
    ASSERT_EQ(jump["findings"].size(), 1U);
    EXPECT_EQ(jump["findings"][0]["kind"], "jump");
    EXPECT_EQ(jump["findings"][0]["of"], "rate");
    EXPECT_NEAR(jump["findings"][0]["time_s"], 3.0, 0.02);
    const double size = jump["findings"][0]["size"];
    EXPECT_NEAR(size, 2.0, 5.0 * size / jump["findings"][0]["size_sigma"].get<double>());
    EXPECT_NEAR(size, 2.0, 0.4);
    EXPECT_TRUE(jump["noise"]["rrw_deg_h_rt_h"].is_null());
}

TEST_F(AllanCommand, TheUnitOfAColumnMustAgree) {
    const auto path = directory_ / "named.csv";
    std::ofstream(path) << "rate_deg_h,w_rad_s\n1,2\n2,1\n1,3\n3,1\n";
    const std::string data = "'" + path.string() + "' --rate 10 --kind rate --tau 1";
    EXPECT_EQ(run(data + " --column rate_deg_h --unit deg/h").status, 0);
    const Outcome r = run(data + " --column w_rad_s --unit deg/s");
    EXPECT_EQ(r.status, 2);
    EXPECT_THAT(r.err, HasSubstr("w_rad_s"));
    EXPECT_THAT(r.err, HasSubstr("contradicts --unit deg/s"));
}

// The same numbers, as programs of the field write them.
TEST_F(AllanCommand, LogsOfTheFieldAreRead) {
    std::vector<double> values;
    std::string point, comma, stamped;
    for (int i = 0; i < 60; ++i) {
        values.push_back((i * 37 % 101) / 64.0);  // six decimals hold it
        const std::string text = std::to_string(values.back());
        point += "\"" + std::to_string(i) + "\",\"" + text + "\"\n";
        std::string with_comma = text;
        with_comma[with_comma.find('.')] = ',';
        comma += std::to_string(i) + ";" + with_comma + "\r\n";
        stamped += std::to_string(1403636579758555392 + i * 5000000LL) + "," + text + "\n";
    }
    const auto deviation = [&](const std::string& arguments) {
        const Outcome r = run(arguments + " --rate 200 --kind rate --tau 1,4 --json");
        EXPECT_EQ(r.status, 0) << arguments << r.err;
        return r.status == 0 ? nlohmann::json::parse(r.out)["deviations"].dump() : "";
    };
    const std::string expected = deviation(write(values));
    EXPECT_EQ(deviation(write_text("\"t\",\"gyroADC[0]\"\n" + point) + " --column 'gyroADC[0]'"), expected);
    EXPECT_EQ(deviation(write_text("Zeit [s];Gyro X (deg/s)\r\n" + comma) + " --column 'Gyro X'"), expected);
    EXPECT_EQ(deviation(write_text("a;b\r\n" + comma) + " --column 2 --delimiter semicolon --header 1"), expected);
    EXPECT_EQ(deviation(write_text("x\ny\n" + stamped) + " --column 2 --skip 2 --header no"), expected);
    std::string with_words = "%time,state,gx\n";
    for (std::size_t i = 0; i < values.size(); ++i) {
        with_words += std::to_string(0.005 * static_cast<double>(i)) + ",sensor #2," + std::to_string(values[i]) + "\n";
    }
    const std::string worded = write_text(with_words);
    EXPECT_EQ(deviation(worded + " --column gx --time %time"), expected);
    const std::string ns = write_text("t,gx\n" + stamped);
    EXPECT_EQ(deviation(ns + " --column gx --time t --time-unit ns"), expected);
    const auto refused = [&](const std::string& arguments, const std::string& words) {
        const Outcome r = run(arguments + " --rate 200 --kind rate");
        EXPECT_EQ(r.status, 2) << arguments;
        EXPECT_EQ(r.out, "") << arguments;
        EXPECT_THAT(r.err, HasSubstr(words)) << arguments;
    };
    refused(ns + " --column gx --time t", "say --time-unit ns");
    refused(ns + " --column gx --time-unit ns", "--time-unit ns: needs --time");
    refused(ns + " --column gx --time t --time-unit weeks",
            "--time-unit weeks: must be one of s, ms, us, ns, mjd, iso");
    refused(ns + " --column gy", "did you mean 'gx'");
    refused(ns + " --column gx --header perhaps", "--header perhaps");
    refused(ns + " --column gx --skip -1", "--skip");
    refused(ns + " --column gx --delimiter ab", "--delimiter ab");
    refused(write_text("PAR1 and more"), "is a Parquet table");
    const Outcome noted = run(write_text(",0,1\n0,0.5,1.5\n1,0.25,1.25\n2,0.5,1.5\n3,0.25,1.5\n") +
                              " --column 3 --rate 200 --kind rate --tau 1 --json");
    EXPECT_THAT(noted.err, HasSubstr("ringlock: note: "));
    EXPECT_THAT(noted.err, HasSubstr("line 1 is taken for the header"));
    EXPECT_EQ(nlohmann::json::parse(noted.out)["n"], 4);
    const Outcome named = run(write_text(",0,1,2\n0,0.5,1.5,2.5\n1,0.25,1.25,2.5\n2,0.5,1.5,1.5\n") +
                              " --column 2 --rate 200 --kind rate --tau 1");
    EXPECT_THAT(named.err, HasSubstr("2 is taken for the name of column 4, not for the number of column 2"));
    refused(write_text("Name,Value\nfoo,bar\n") + " --column Value", "holds no data");
}

// Rows and columns of a table are what they are in a file of their own, streamed or not.
TEST_F(AllanCommand, RowsAndColumnsOfATableOfHdf5) {
    const auto angle = test::simulate_angle({.n = 1.0}, 599, 1.0, 4);
    std::vector<double> log;
    for (std::size_t i = 0; i < angle.size(); ++i) {
        log.insert(log.end(), {100.0 + static_cast<double>(i), angle[i], -1.0});
    }
    const std::string data = (directory_ / "data.h5").string();
    const hid_t file = H5Fcreate(data.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const auto dataset = [&](const char* name, const std::vector<hsize_t>& sides) {
        const hid_t space = H5Screate_simple(static_cast<int>(sides.size()), sides.data(), nullptr);
        const hid_t made = H5Dcreate2(file, name, H5T_IEEE_F64LE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
        H5Dwrite(made, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, log.data());
        H5Dclose(made);
        H5Sclose(space);
    };
    dataset("log", {angle.size(), 3});
    dataset("gyros", {2, 900});
    dataset("x", {1800});
    H5Fclose(file);
    const std::string how = " --rate 1 --kind phase --json";
    const auto deviations = [&](const std::string& arguments) {
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 0) << r.err;
        return nlohmann::json::parse(r.out)["deviations"];
    };
    const auto expected = deviations(write(angle) + how);
    EXPECT_EQ(deviations(data + " --column 'log[:,1]'" + how), expected);
    EXPECT_EQ(deviations(data + " --column 'log[:,1]' --time '/log[:,0]'" + how), expected);
    EXPECT_EQ(deviations(data + " --column 'log[:,1]' --stream" + how), deviations(write(angle) + how + " --stream"));
    EXPECT_EQ(deviations(data + " --column 'gyros[1,:]'" + how),
              deviations(write({log.begin() + 900, log.end()}) + how));

    const auto expect = [&](const std::string& column, const std::vector<std::string>& words) {
        for (const char* streamed : {"", " --stream"}) {
            const Outcome r = run(data + column + how + streamed);
            EXPECT_EQ(r.status, 2) << column;
            EXPECT_EQ(r.out, "") << column;
            for (const std::string& word : words) EXPECT_THAT(r.err, HasSubstr(word)) << column;
        }
    };
    expect(" --column gyros", {"/gyros has 2 rows and 900 columns", "--column 'gyros[I,:]' for row I = 0 to 1"});
    expect(" --column 'gyros[2,:]'", {"has no row 2", "row I = 0 to 1"});
    expect(" --column 'log[:,3]'", {"has no column 3", "column J = 0 to 2"});
    expect(" --column 'log[1]'", {"'log[1]'", "[I,:] for row I or [:,J] for column J"});
    expect(" --column 'x[0,:]'", {"/x has one dimension", "leave the brackets out"});
    expect(" --column 'log[:,1]' --time log", {"/log has 600 rows and 3 columns", "--time 'log[I,:]'"});
}

// A constant record is all zeros and no noise: figures, not NaN, and null where there is none.
TEST_F(AllanCommand, ConstantRecordsHaveNoNan) {
    const Outcome r = run(write(std::vector<double>(100, 0.25)) + " --rate 1 --kind increment --unit arcsec --json");
    ASSERT_EQ(r.status, 0) << r.err;
    const auto json = nlohmann::json::parse(r.out);
    for (const auto& p : json["deviations"]["oadev"]) EXPECT_EQ(p["dev"], 0.0);
    EXPECT_TRUE(json["noise"]["arw_deg_rt_h"].is_null());
    EXPECT_THAT(json["noise_withheld"].get<std::string>(), HasSubstr("no noise"));
}

TEST_F(AllanCommand, MeasuredRecordIsNotGivenCoefficients) {
    const char* folder = std::getenv("RINGLOCK_TEST_DATA");
    const std::filesystem::path path =
        std::filesystem::path(folder != nullptr ? folder : RINGLOCK_SHARED_DATA) / "laser-gyro-triad-x.csv";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << path << " is not there; set RINGLOCK_TEST_DATA to its folder";
    const Outcome r = run(fmt::format(
        "'{}' --column angle_increment_arcsec --rate 100 --kind increment --unit arcsec --json", path.string()));
    ASSERT_EQ(r.status, 0) << r.err;
    const auto json = nlohmann::json::parse(r.out);
    EXPECT_EQ(json["n"], 184718);
    EXPECT_TRUE(json["noise"]["arw_deg_rt_h"].is_null());
    EXPECT_TRUE(json["noise"]["bias_instability_deg_h"].is_null());
    EXPECT_FALSE(json["noise_withheld"].is_null());
}

}  // namespace
}  // namespace allan_test
