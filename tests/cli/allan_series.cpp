// Several series of `ringlock allan` in one call, sampling intervals and averaging times, and the files that it writes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>
#include <sstream>
#include <string>
#include <vector>

#include "tests/cli/program.hpp"
#include "tests/unit/allan_support.hpp"

namespace allan_series_test {
namespace {

using namespace ringlock;
using nlohmann::json;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

class AllanSeries : public test::ProgramTest {
   protected:
    /// Three axes of rates in deg/s at 100 Hz; y has a random walk, too.
    void write_axes(const std::string& name, std::size_t rows = 3000) const {
        std::vector<std::vector<double>> axes;
        const std::vector<test::Truth> truths = {{.n = 36.0}, {.n = 54.0, .k = 200.0}, {.n = 18.0}};
        for (std::size_t i = 0; i < 3; ++i) {
            const auto angle = test::simulate_angle(truths[i], rows, 0.01, i + 1);
            axes.emplace_back();
            for (std::size_t k = 1; k < angle.size(); ++k) axes[i].push_back((angle[k] - angle[k - 1]) / 36.0);
        }
        std::ostringstream text;
        text.precision(12);
        text << "# rate_hz = 100\nt,x,y,z,\"a,b\"\n";
        for (std::size_t k = 0; k < rows; ++k) {
            text << 0.01 * static_cast<double>(k) << ',' << axes[0][k] << ',' << axes[1][k] << ',' << axes[2][k] << ','
                 << axes[0][k] << '\n';
        }
        write(name, text.str());
    }
    test::Outcome allan(const std::string& file, const Arguments& more) const {
        Arguments arguments = {"allan", file};
        arguments.insert(arguments.end(), more.begin(), more.end());
        return run(arguments);
    }
    json json_of(const std::string& file, Arguments more) const {
        more.emplace_back("--json");
        const test::Outcome r = allan(file, more);
        EXPECT_EQ(r.status, 0) << r.err;
        return json::parse(r.out, nullptr, false);
    }
    void expect_refused(const std::string& file, const Arguments& more, const std::string& words) const {
        const test::Outcome r = allan(file, more);
        EXPECT_EQ(r.status, 2) << testing::PrintToString(more);
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, AllOf(StartsWith("ringlock: error: "), HasSubstr(words)));
    }
    /// Rows of a table, by the names of its columns; cells in quotes have no commas here.
    std::vector<std::map<std::string, std::string>> table(const std::string& name) const {
        std::istringstream text(read(name));
        std::vector<std::string> header;
        std::vector<std::map<std::string, std::string>> rows;
        for (std::string line; std::getline(text, line);) {
            std::istringstream cells(line + ",");
            std::vector<std::string> row;
            for (std::string cell; std::getline(cells, cell, ',');) row.push_back(cell);
            if (header.empty()) {
                header = row;
                continue;
            }
            EXPECT_EQ(row.size(), header.size()) << line;
            rows.emplace_back();
            for (std::size_t i = 0; i < std::min(row.size(), header.size()); ++i) rows.back()[header[i]] = row[i];
        }
        return rows;
    }

    const Arguments how_ = {"--rate", "100", "--kind", "rate", "--unit", "deg/s"};
    Arguments with(const Arguments& more) const {
        Arguments all = how_;
        all.insert(all.end(), more.begin(), more.end());
        return all;
    }
};

// Each member of `series` is the object of the series by itself, and its file.
TEST_F(AllanSeries, SeveralColumnsAreWhatEachIsByItself) {
    write_axes("imu.csv");
    const json all = json_of("imu.csv", with({"--column", "x,y,z"}));
    ASSERT_EQ(all["series"].size(), 3U);
    EXPECT_EQ(all.size(), 1U);
    const std::vector<std::string> names = {"x", "y", "z"};
    for (std::size_t i = 0; i < 3; ++i) {
        json one = all["series"][i];
        EXPECT_EQ(one["data"], "imu.csv");
        one.erase("data");
        EXPECT_EQ(one, json_of("imu.csv", with({"--column", names[i]})));
    }
    const std::string text = allan("imu.csv", with({"--column", "x,y,z"})).out;
    for (const std::string& name : names) {
        const std::string alone = allan("imu.csv", with({"--column", name})).out;
        EXPECT_THAT(text, HasSubstr(alone));
    }
    EXPECT_THAT(text, HasSubstr("Coefficients of all series"));
    EXPECT_THAT(allan("imu.csv", with({"--column", "x"})).out, Not(HasSubstr("Coefficients of all series")));
}

TEST_F(AllanSeries, ACommaInANameIsTheNamesOwn) {
    write_axes("imu.csv", 100);
    const auto columns = [&](const std::string& list) {
        std::vector<std::string> names;
        const json all = json_of("imu.csv", with({"--column", list}));
        for (const json& one : all.contains("series") ? all["series"] : json::array({all}))
            names.push_back(one["column"]);
        return names;
    };
    using Names = std::vector<std::string>;
    EXPECT_EQ(columns("a,b"), Names({"a,b"}));
    EXPECT_EQ(columns("\"a,b\""), Names({"a,b"}));
    EXPECT_EQ(columns("x,\"a,b\""), Names({"x", "a,b"}));
    EXPECT_EQ(columns("5, 2"), Names({"a,b", "x"}));
    expect_refused("imu.csv", with({"--column", "x,b"}), "has no column 'b'");
    expect_refused("imu.csv", with({"--column", "x,,y"}), "name in the list is empty");
    expect_refused("imu.csv", with({"--column", "x,\"y"}), "quote does not close");
    expect_refused("imu.csv", with({"--column", "x,y,x"}), "x is named twice");
    expect_refused("imu.csv", with({"--column", "x,y,2"}), "x and 2 are the same column of imu.csv");
}

// Commas within brackets choose rows and columns of arrays.
TEST_F(AllanSeries, ColumnsOfAnArrayAreAList) {
    std::string head = "{'descr': '<f8', 'fortran_order': False, 'shape': (50, 2), }";
    head.resize(117, ' ');
    head += '\n';
    std::string file("\x93NUMPY\x01\x00\x76\x00", 10);
    file += head;
    std::ostringstream text;
    text.precision(17);
    text << "p q\n";
    for (int i = 0; i < 50; ++i) {
        for (const double value : {std::sin(0.7 * i), std::cos(0.3 * i * i)}) {
            file.append(reinterpret_cast<const char*>(&value), sizeof value);
            text << value << ' ';
        }
        text << '\n';
    }
    write("a.npy", file);
    write("a.txt", text.str());
    const Arguments how = {"--rate", "1", "--kind", "rate", "--column"};
    const auto columns = [&](const std::string& name, const std::string& list) {
        Arguments more = how;
        more.push_back(list);
        return json_of(name, more)["series"];
    };
    const json array = columns("a.npy", "[:,0],[:,1]");
    const json plain = columns("a.txt", "p,q");
    ASSERT_EQ(array.size(), 2U);
    for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(array[i]["deviations"], plain[i]["deviations"]);
    expect_refused("a.npy", {"--rate", "1", "--kind", "rate", "--column", "[:,0],[:,2]"}, "has no column 2");
}

TEST_F(AllanSeries, SeveralFilesWithRatesOfTheirOwn) {
    write("fast.csv", "# rate_hz = 10\n1\n2\n4\n3\n5\n2\n1\n");
    write("slow.csv", "# rate_hz = 0.5\n1\n3\n2\n4\n");
    const json all = json_of("fast.csv", {"slow.csv", "--rate", "file", "--kind", "rate"});
    ASSERT_EQ(all["series"].size(), 2U);
    EXPECT_EQ(all["series"][0]["tau0_s"], 0.1);
    EXPECT_EQ(all["series"][1]["tau0_s"], 2.0);
    EXPECT_EQ(all["series"][1]["data"], "slow.csv");
    expect_refused("fast.csv", {"slow.csv", "--rate", "10", "--kind", "rate"}, "contradicts --rate 10");
    expect_refused("fast.csv", {"fast.csv", "--rate", "10", "--kind", "rate"}, "DATA fast.csv is named twice");
    write("none.csv", "1\n3\n2\n4\n");
    expect_refused("none.csv", {"--rate", "file", "--kind", "rate"}, "declares no rate_hz");
    expect_refused("fast.csv", {"slow.csv", "none.csv", "--rate", "file", "--kind", "rate", "--hat"},
                   "none.csv: declares no rate_hz");
}

TEST_F(AllanSeries, StandardInputIsReadForEachColumn) {
    write_axes("imu.csv", 200);
    const std::string command = "cd '" + directory_.string() + "' && cat imu.csv | '" + RINGLOCK_PROGRAM +
                                "' allan - --rate file --kind rate --column x,y --json >piped 2>&1";
    EXPECT_EQ(std::system(command.c_str()), 0) << read("piped");
    json piped = json::parse(read("piped"), nullptr, false);
    const json file = json_of("imu.csv", {"--rate", "100", "--kind", "rate", "--column", "x,y"});
    ASSERT_EQ(piped["series"].size(), 2U);
    for (std::size_t i = 0; i < 2; ++i) EXPECT_EQ(piped["series"][i]["deviations"], file["series"][i]["deviations"]);
}

TEST_F(AllanSeries, AveragingTimesAreWholeNumbersOfSamples) {
    write_axes("imu.csv", 1000);
    const Arguments x = with({"--column", "x", "--tau"});
    const auto asked = [&](const std::string& tau) {
        Arguments more = x;
        more.push_back(tau);
        return more;
    };
    std::vector<std::int64_t> factors;
    const json found = json_of("imu.csv", asked("0.5s,20ms,3,0.05min,30ms"));
    for (const json& p : found["deviations"]["oadev"]) factors.push_back(p["m"]);
    EXPECT_EQ(factors, (std::vector<std::int64_t>{2, 3, 50, 300}));
    expect_refused("imu.csv", asked("15ms"), "is 1.5 sampling intervals of 0.01 s");
    expect_refused("imu.csv", asked("15ms"), "nearest are 0.01s and 0.02s (averaging factors 1 and 2)");
    expect_refused("imu.csv", asked("10.0001ms"), "nearest are 0.01s and 0.02s");
    expect_refused("imu.csv", asked("1ms"), "the shortest averaging time is one, 0.01s");
    expect_refused("imu.csv", asked("1h"), "averaging factors 1 to 500, 0.01s to 5s");
    expect_refused("imu.csv", asked("1e300h"), "no record has as many samples");
    expect_refused("imu.csv", asked("5 parsecs"), "times with a unit");
    expect_refused("imu.csv", asked("0s"), "times with a unit");
    expect_refused("imu.csv", asked("-1s"), "times with a unit");
}

TEST_F(AllanSeries, SamplingIntervalsAreRatesFractionsOrTimes) {
    write("data.txt", "1\n3\n2\n4\n5\n");
    const auto tau0_s = [&](const Arguments& more) {
        Arguments all = {"--kind", "rate"};
        all.insert(all.end(), more.begin(), more.end());
        return json_of("data.txt", all)["tau0_s"].get<double>();
    };
    EXPECT_EQ(tau0_s({"--rate", "1/300"}), 300.0);
    EXPECT_EQ(tau0_s({"--rate", "100/3"}), 0.03);
    EXPECT_EQ(tau0_s({"--tau0", "300"}), 300.0);
    EXPECT_EQ(tau0_s({"--tau0", "5ms"}), 0.005);
    EXPECT_EQ(tau0_s({"--tau0", "5min"}), 300.0);
    EXPECT_EQ(tau0_s({"--tau0", "1/128"}), 0.0078125);
    for (const char* wrong : {"0", "-1", "1/0", "0/1", "1/2/3", "nan", "inf", "1e400", "ten", "/", "1/"}) {
        expect_refused("data.txt", {"--kind", "rate", "--rate", wrong}, "must be a positive number of samples");
        expect_refused("data.txt", {"--kind", "rate", "--tau0", wrong}, "must be the positive number of seconds");
    }
    expect_refused("data.txt", {"--kind", "rate"}, "--rate is required");
    expect_refused("data.txt", {"--kind", "rate", "--rate", "1", "--tau0", "1"}, "give one of them");
}

TEST_F(AllanSeries, TheResultIsExplainedInSentences) {
    write_axes("imu.csv");
    const test::Outcome y = allan("imu.csv", with({"--column", "y", "--explain"}));
    EXPECT_THAT(y.out, AllOf(HasSubstr("The angle random walk N is the strength of white noise of the rate"),
                             HasSubstr("largest part of the fitted"), HasSubstr("bias instability B is the strength")));
    const json sentences = json_of("imu.csv", with({"--column", "y", "--explain"}))["explanation"];
    const json found = json_of("imu.csv", with({"--column", "y"}));
    EXPECT_FALSE(found.contains("explanation"));
    ASSERT_FALSE(found["noise"]["rrw_deg_h_rt_h"].is_null());
    // Where N^2/tau = K^2 tau/3 the walk begins to lead: tau^2 = 3 N^2/K^2 in units of an hour.
    const double n = found["noise"]["arw_deg_rt_h"]["value"];
    const double k = found["noise"]["rrw_deg_h_rt_h"]["value"];
    const double crossing_s = 3600.0 * std::sqrt(3.0) * n / k;
    std::string walk;
    for (const std::string sentence : sentences) {
        if (sentence.find("rate random walk") != std::string::npos) walk = sentence;
    }
    double begin_s = 0.0;
    double end_s = 0.0;
    const std::size_t at = walk.find("from tau = ");
    ASSERT_NE(at, std::string::npos) << walk;
    ASSERT_EQ(std::sscanf(walk.c_str() + at, "from tau = %lf s to %lf s", &begin_s, &end_s), 2);
    EXPECT_NEAR(begin_s / crossing_s, 1.0, 0.05);  // fifty averaging times a decade
    EXPECT_NEAR(end_s, 15.0, 0.01);                // half of the record
    EXPECT_THAT(allan("imu.csv", {"--rate", "100", "--kind", "rate", "--column", "x", "--explain"}).out,
                HasSubstr("without --unit none are estimated"));
}

// The coefficients of --json times the factors of docs/units.md, which are written out here once more.
TEST_F(AllanSeries, ExportedCoefficientsHaveTheUnitsOfTheirPrograms) {
    write_axes("imu.csv");
    const test::Outcome r = allan("imu.csv", with({"--column", "x,y,z", "--export", "kalibr", "imu.yaml", "--export",
                                                   "toml", "imu.toml", "--export", "matlab", "imu.m", "--json"}));
    ASSERT_EQ(r.status, 0) << r.err;
    const json series = json::parse(r.out)["series"];
    const auto value = [](const std::string& text, const std::string& key) {
        const std::size_t at = text.find("\n" + key);
        EXPECT_NE(at, std::string::npos) << key << " in " << text;
        return at == std::string::npos ? 0.0 : std::stod(text.substr(at + 1 + key.size()));
    };
    const double rad_per_deg = std::numbers::pi / 180.0;
    const double n_y = series[1]["noise"]["arw_deg_rt_h"]["value"];
    const double k_y = series[1]["noise"]["rrw_deg_h_rt_h"]["value"];
    const std::string yaml = read("imu.yaml");
    EXPECT_NEAR(value(yaml, "gyroscope_noise_density: ") / (n_y * rad_per_deg / 60.0), 1.0, 1e-8);
    EXPECT_NEAR(value(yaml, "gyroscope_random_walk: ") / (k_y * rad_per_deg / 3600.0 / 60.0), 1.0, 1e-8);
    EXPECT_EQ(value(yaml, "update_rate: "), 100.0);
    // 54 arcsec/sqrt(s) = 54 pi/648000 rad/s/sqrt(Hz): the noise that was put in, within five of its errors of 1.3 %.
    EXPECT_NEAR(value(yaml, "gyroscope_noise_density: ") / (54.0 * std::numbers::pi / 648'000.0), 1.0, 0.07);
    EXPECT_THAT(yaml, HasSubstr("# x: not resolved, < "));
    const std::string matlab = read("imu.m");
    EXPECT_THAT(matlab, AllOf(HasSubstr("gyroparams('NoiseType', 'single-sided'"), HasSubstr("'RandomWalk', [0 ")));
    const std::string toml = read("imu.toml");
    EXPECT_THAT(toml, AllOf(HasSubstr("[series.arw_deg_rt_h]"), HasSubstr("unit = '(deg/h)/sqrt(h)'"),
                            HasSubstr("limit_95 = "), HasSubstr("value_rad_s2_rt_hz = ")));
}

TEST_F(AllanSeries, AccelerometersAreExportedInTheirUnits) {
    std::ostringstream text;
    for (const double v : test::simulate_angle({.n = 0.01, .k = 0.05}, 3000, 0.01, 8)) text << v << '\n';
    write("velocity.txt", text.str());
    const test::Outcome r = allan("velocity.txt", {"--rate", "100", "--kind", "phase", "--unit", "m/s", "--export",
                                                   "kalibr", "imu.yaml", "--json"});
    ASSERT_EQ(r.status, 0) << r.err;
    const json noise = json::parse(r.out)["noise"];
    const double n = noise["vrw_m_s_rt_h"]["value"].get<double>() / 60.0;
    const double k = noise["acceleration_random_walk_m_s2_rt_h"]["value"].get<double>() / 60.0;
    const std::string yaml = read("imu.yaml");
    double found_n = 0.0;
    double found_k = 0.0;
    std::sscanf(yaml.c_str() + yaml.find("\naccelerometer_noise_density"), "\naccelerometer_noise_density: %lf",
                &found_n);
    std::sscanf(yaml.c_str() + yaml.find("\naccelerometer_random_walk"), "\naccelerometer_random_walk: %lf", &found_k);
    EXPECT_NEAR(found_n / n, 1.0, 1e-8);
    EXPECT_NEAR(found_k / k, 1.0, 1e-8);
    EXPECT_NEAR(found_n, 0.01, 0.0007);  // m/s/sqrt(s), which is m/s^2/sqrt(Hz)
    expect_refused("velocity.txt", {"--rate", "1", "--kind", "phase", "--unit", "s", "--export", "kalibr", "c.yaml"},
                   "clock");
    expect_refused("velocity.txt", {"--rate", "1", "--kind", "phase", "--export", "kalibr", "c.yaml"}, "--unit");
    expect_refused("velocity.txt", {"--rate", "1", "--kind", "phase", "--export", "excel", "c.yaml"},
                   "must be kalibr, matlab or toml");
    write("constant.txt", "1\n2\n3\n4\n5\n");
    expect_refused("constant.txt", {"--rate", "1", "--kind", "phase", "--unit", "rad", "--export", "toml", "c.yaml"},
                   "are withheld");
    EXPECT_EQ(left().count("c.yaml"), 0U);
}

TEST_F(AllanSeries, TablesHaveTheFiguresOfJson) {
    write_axes("a,\"b\".csv", 500);
    const json all =
        json_of("a,\"b\".csv", with({"--column", "x,y", "--dev", "oadev,tdev", "--tau", "1,10", "--csv", "d.csv"}));
    EXPECT_THAT(read("d.csv"),
                StartsWith("file,column,deviation,m,tau_s,dev_deg_h,lo_deg_h,hi_deg_h,dev_arcsec,lo_arcsec,"
                           "hi_arcsec,terms,alpha,edf,bias\n\"a,\"\"b\"\".csv\",x,oadev,1,0.01,"));
    std::filesystem::rename(directory_ / "a,\"b\".csv", directory_ / "plain.csv");
    json_of("plain.csv", with({"--column", "x,y", "--dev", "oadev,tdev", "--tau", "1,10", "--csv", "d.csv"}));
    const auto rows = table("d.csv");
    ASSERT_EQ(rows.size(), 8U);
    const json& tdev = all["series"][1]["deviations"]["tdev"][1];
    EXPECT_EQ(rows[7].at("column"), "y");
    EXPECT_EQ(rows[7].at("deviation"), "tdev");
    EXPECT_EQ(rows[7].at("dev_deg_h"), "");
    EXPECT_EQ(std::stod(rows[7].at("dev_arcsec")), tdev["dev"].get<double>());
    EXPECT_EQ(std::stod(rows[7].at("hi_arcsec")), tdev["hi"].get<double>());
}

TEST_F(AllanSeries, SpectraSayTheirSidesAndTheirLevel) {
    write_axes("imu.csv");
    const auto mean = [&](const std::string& file, const std::string& column) {
        double sum = 0.0;
        double count = 0.0;
        for (const auto& row : table(file)) {
            const double weight = row.count("coefficients") != 0 ? std::stod(row.at("coefficients")) : 1.0;
            sum += weight * std::stod(row.at(column));
            count += weight;
        }
        return sum / count;
    };
    const Arguments x = {"--column", "x", "--psd", "p.csv"};
    ASSERT_EQ(allan("imu.csv", with(x)).status, 0);
    // 36 arcsec/sqrt(s): 1296 (deg/h)^2/Hz, two-sided. Of 3000 data the mean has an error of 2.6 %; four allowed.
    EXPECT_NEAR(mean("p.csv", "psd_two_sided_deg2_h2_per_hz") / 1296.0, 1.0, 0.11);
    EXPECT_NEAR(mean("p.csv", "model_two_sided_deg2_h2_per_hz") / 1296.0, 1.0, 0.11);
    EXPECT_THAT(read("p.csv"), HasSubstr("welch hann 256"));
    const double two_sided = mean("p.csv", "model_two_sided_deg2_h2_per_hz");
    ASSERT_EQ(
        allan("imu.csv", with({"--column", "x", "--psd", "p.csv", "--psd-method", "cosine", "--psd-sides", "one"}))
            .status,
        0);
    EXPECT_NEAR(mean("p.csv", "psd_one_sided_deg2_h2_per_hz") / 2592.0, 1.0, 0.11);
    EXPECT_NEAR(mean("p.csv", "model_one_sided_deg2_h2_per_hz") / (2.0 * two_sided), 1.0, 1e-6);
    expect_refused("imu.csv", with({"--column", "x", "--psd", "p.txt"}), "a table ends in .csv");
    expect_refused("imu.csv", with({"--column", "x", "--psd", "p.csv", "--psd-sides", "both"}), "must be two");
    expect_refused("imu.csv", with({"--column", "x", "--psd", "p.csv", "--psd-method", "fft"}), "must be welch");
    expect_refused("imu.csv", with({"--column", "x", "--psd", "p.csv", "--stream"}), "--stream does not keep");
    expect_refused("imu.csv", with({"--column", "x", "--psd", "imu.csv"}), "the same file");
    // Phase behind a missing rate has an origin of its own, and its step is no rate: the density stays that of the
    // noise.
    std::ostringstream gapped;
    const auto angle = test::simulate_angle({.n = 0.3}, 4096, 1.0, 6);
    for (std::size_t i = 1; i < angle.size(); ++i) {
        (i % 1000 == 0 ? gapped << "nan" : gapped << angle[i] - angle[i - 1] + 50.0) << '\n';
    }
    write("gapped.txt", gapped.str());
    for (const char* method : {"welch", "cosine"}) {
        ASSERT_EQ(allan("gapped.txt",
                        {"--rate", "1", "--kind", "rate", "--unit", "deg/h", "--psd", "p.csv", "--psd-method", method})
                      .status,
                  0);
        EXPECT_NEAR(mean("p.csv", "psd_two_sided_deg2_h2_per_hz") / 0.09, 1.0, 0.2) << method;
    }
    write("short.txt", "1\n2\n5\n3\n");
    expect_refused("short.txt", {"--rate", "1", "--kind", "rate", "--psd", "p2.csv"}, "a spectrum needs 8");
}

TEST_F(AllanSeries, DeviationsOverTimeWindowsAsATableAndAMap) {
    write_axes("imu.csv");
    ASSERT_EQ(allan("imu.csv", with({"--column", "x,z", "--dynamic", "5s", "--map", "m.csv", "--map", "m.svg"})).status,
              0);
    const auto rows = table("m.csv");
    EXPECT_EQ(rows.size(), 2U * 11U * 7U);  // windows of 5 s every 2.5 s in 30 s; m = 1 to 64
    EXPECT_EQ(rows[7].at("begin_s"), "2.5");
    EXPECT_EQ(rows[7].at("end_s"), "7.5");
    EXPECT_NEAR(std::stod(rows[0].at("dev_deg_h")), 360.0, 60.0);
    EXPECT_THAT(read("m.svg"), AllOf(HasSubstr("oadev in windows of 5 s"), HasSubstr("averaging time tau [s]")));
    expect_refused("imu.csv", with({"--column", "x", "--dynamic", "5s"}), "needs --map");
    expect_refused("imu.csv", with({"--column", "x", "--map", "m.csv"}), "needs --dynamic");
    expect_refused("imu.csv", with({"--column", "x", "--map", "m.csv", "--dynamic", "1h"}), "0.08s to 30s");
    expect_refused("imu.csv", with({"--column", "x", "--map", "m.csv", "--dynamic", "20ms"}), "0.08s to 30s");
    expect_refused("imu.csv", with({"--column", "x", "--map", "m.csv", "--dynamic", "500"}), "a time with its unit");
}

TEST_F(AllanSeries, TheThreeCorneredHatSeparatesThree) {
    write_axes("imu.csv");
    const json all = json_of("imu.csv", with({"--column", "x,y,z", "--hat", "--tau", "1"}));
    const json& point = all["hat"]["oadev"][0];
    const std::vector<double> truth = {360.0, 540.0, 180.0};  // N/sqrt(tau0) in deg/h
    for (std::size_t i = 0; i < 3; ++i) {
        const double variance = point["series"][i]["variance"];
        const double error = point["series"][i]["standard_error"];
        EXPECT_NEAR(variance, truth[i] * truth[i], 4.0 * error) << i;
        EXPECT_LT(error, 0.4 * variance);
        EXPECT_DOUBLE_EQ(point["series"][i]["dev"], std::sqrt(variance));
    }
    // One that is the mean of the others is no independent third, and its variance comes out below zero.
    write("tied.csv", "a,b,c\n1,2,1.5\n3,-1,1\n-2,5,1.5\n4,1,2.5\n0,3,1.5\n5,-2,1.5\n");
    const json tied =
        json_of("tied.csv", {"--rate", "1", "--kind", "rate", "--column", "a,b,c", "--hat", "--tau", "1"});
    EXPECT_LT(tied["hat"]["oadev"][0]["series"][2]["variance"].get<double>(), 0.0);
    EXPECT_TRUE(tied["hat"]["oadev"][0]["series"][2]["dev"].is_null());
    EXPECT_THAT(allan("tied.csv", {"--rate", "1", "--kind", "rate", "--column", "a,b,c", "--hat", "--tau", "1"}).out,
                HasSubstr("negative ("));
    expect_refused("imu.csv", with({"--column", "x,y", "--hat"}), "needs three series");
    expect_refused("imu.csv", with({"--column", "x,y,z", "--hat", "--dev", "mtie"}), "mtie is no variance");
    write("one.txt", "1\n2\n4\n3\n");
    write("two.txt", "1\n2\n4\n3\n5\n");
    write("three.txt", "# rate_hz = 2\n1\n2\n4\n3\n");
    write("four.txt", "# rate_hz = 4\n1\n2\n4\n3\n");
    write("five.txt", "# rate_hz = 2\n2\n2\n4\n3\n");
    expect_refused("one.txt", {"two.txt", "three.txt", "--rate", "2", "--kind", "rate", "--hat"},
                   "two.txt, column 1 has 5");
    expect_refused("three.txt", {"four.txt", "five.txt", "--rate", "file", "--kind", "rate", "--hat"},
                   "four.txt, column 1 of 0.25 s");
}

TEST_F(AllanSeries, FiguresOfSeveralSeriesAndOtherForms) {
    write_axes("imu.csv");
    ASSERT_EQ(allan("imu.csv", with({"--column", "x,y,z", "--plot", "f.svg"})).status, 0);
    const std::string svg = read("f.svg");
    EXPECT_THAT(svg, AllOf(HasSubstr(">imu.csv<"), HasSubstr(">x<"), HasSubstr(">y<"), HasSubstr(">z<"),
                           Not(HasSubstr(">fit<"))));
    const test::Outcome png = allan("imu.csv", with({"--column", "x", "--plot", "f.png"}));
    const test::Outcome pdf = allan("imu.csv", with({"--column", "x", "--plot", "f.PDF"}));
    if (png.status == 2) {
        EXPECT_THAT(png.err, AllOf(HasSubstr("librsvg2-dev"), HasSubstr("rsvg-convert")));
        GTEST_SKIP() << "librsvg is missing: pictures are SVG only";
    }
    ASSERT_EQ(png.status, 0) << png.err;
    ASSERT_EQ(pdf.status, 0) << pdf.err;
    EXPECT_THAT(read("f.png"), StartsWith("\x89PNG"));
    EXPECT_THAT(read("f.PDF"), StartsWith("%PDF-"));
    const std::string first = read("f.PDF");
    ASSERT_EQ(allan("imu.csv", with({"--column", "x", "--plot", "f.PDF"})).status, 0);
    EXPECT_EQ(read("f.PDF"), first);
}

}  // namespace
}  // namespace allan_series_test
