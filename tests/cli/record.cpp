// ringlock validate and import on measured data, from outside.
#include "analysis/record/record.hpp"

#include <gmock/gmock.h>
#include <sys/resource.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <random>

#include "tests/cli/program.hpp"
#include "tests/unit/record_support.hpp"

namespace ringlock::test {
namespace record_test {
namespace {

using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class RecordProgram : public ProgramTest {
   protected:
    void expect_refused(const Arguments& arguments, const testing::Matcher<std::string>& message) const {
        const auto before = left();
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 2) << r.err;
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, message);
        EXPECT_EQ(left(), before);
    }
};

TEST_F(RecordProgram, ValidatesBothForms) {
    record::write_record((directory_ / "r.h5").string(), full_record());
    Outcome r = run({"validate", "r.h5"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, AllOf(HasSubstr("r.h5: a valid record: 50 turns"),
                             HasSubstr("too short for `ringlock closure`, which needs 400 turns"),
                             HasSubstr("40 angle increments at 100 Hz"), HasSubstr("accel_x"), HasSubstr("temperature"),
                             HasSubstr("reference")));
    EXPECT_EQ(r.err, "");
    write("r.csv", "# rate_hz = 10\n# sensor = 3\nquarter_count\n1\n2\n4\n");
    r = run({"validate", "r.csv"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("3 counts of quarter fringes at 10 Hz"));
    EXPECT_THAT(r.err, AllOf(HasSubstr("warning"), HasSubstr("line 2: sensor")));
}

// A log of any layout: a column of rates in deg/s becomes increments in arcsec, witnesses stay as they are.
TEST_F(RecordProgram, ImportsColumnsOfALog) {
    write("log.csv", "t,gyro x,acc,n\n0.0,0.5,1.0,7\n0.01,-0.25,2.0,9\n0.02,1.0,3.0,8\n");
    Outcome r = run({"import", "log.csv", "-o", "r.h5", "--column", "gyro x=rate", "--column", "acc=accel_z", "--unit",
                     "deg/s", "--rate", "100", "--time", "t", "--declare", "dither_frequency_hz=400", "--declare",
                     "scale_factor_arcsec=0.6"});
    ASSERT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("3 angle increments at 100 Hz"));
    record::Record record = record::read_record((directory_ / "r.h5").string());
    ASSERT_TRUE(record.samples);
    EXPECT_THAT(record.samples->values, testing::ElementsAre(18.0, -9.0, 36.0));
    EXPECT_THAT(record.samples->witnesses.at("accel_z"), testing::ElementsAre(1.0, 2.0, 3.0));
    EXPECT_EQ(record.declared.dither_frequency_hz, 400.0);
    EXPECT_EQ(record.declared.scale_factor_arcsec, 0.6);

    r = run({"import", "log.csv", "-o", "r.h5", "--column", "4=quarter_count", "--rate", "100"});
    ASSERT_EQ(r.status, 0) << r.err;
    record = record::read_record((directory_ / "r.h5").string());
    EXPECT_EQ(record.samples->kind, record::SampleKind::quarter_count);
    EXPECT_THAT(record.samples->counts, testing::ElementsAre(7, 9, 8));

    r = run({"import", "log.csv", "-o", "r.h5", "--column", "gyro x=angle_arcsec", "--unit", "deg", "--rate", "100"});
    ASSERT_EQ(r.status, 0) << r.err;
    record = record::read_record((directory_ / "r.h5").string());
    EXPECT_THAT(record.samples->values, testing::ElementsAre(1800.0, -900.0, 3600.0));
}

TEST_F(RecordProgram, SaysWhyColumnsCannotBeImported) {
    write("log.csv", "t,gyro,acc,n\n0.0,0.5,1.0,7.5\n0.01,nan,2.0,9\n0.03,1.0,3.0,8\n");
    const auto refused = [&](Arguments more, const testing::Matcher<std::string>& message) {
        Arguments all{"import", "log.csv", "-o", "o.h5"};
        all.insert(all.end(), more.begin(), more.end());
        expect_refused(all, message);
    };
    refused({"--column", "gyro", "--rate", "100"}, HasSubstr("must be NAME=QUANTITY"));
    refused({"--column", "gyro=speed", "--rate", "100"}, AllOf(HasSubstr("gyro=speed"), HasSubstr("quarter_count")));
    refused({"--column", "gyro=rate", "--rate", "100"}, AllOf(HasSubstr("--unit is missing"), HasSubstr("deg/s")));
    refused({"--column", "gyro=rate", "--rate", "100", "--unit", "arcsec"}, HasSubstr("is a unit of angles"));
    refused({"--column", "gyro=rate", "--unit", "deg/s"}, HasSubstr("--rate 0"));
    refused({"--column", "acc=accel_x", "--rate", "100"}, HasSubstr("no column becomes samples"));
    refused({"--column", "acc=rate", "--column", "n=angle_arcsec", "--unit", "deg/s", "--rate", "100"},
            HasSubstr("are all samples"));
    refused({"--column", "n=quarter_count", "--rate", "100"}, HasSubstr("holds 7.5"));
    write("counts.csv", "t,n\n0.0,1\n0.01,2\n0.03,3\n");
    expect_refused(
        {"import", "counts.csv", "-o", "o.h5", "--column", "n=quarter_count", "--rate", "100", "--time", "t"},
        AllOf(HasSubstr("column n: 1 of 4 values are missing"), HasSubstr("sample 3")));
    refused({"--rate", "100"}, HasSubstr("--rate: needs --column"));
    refused({"--skip", "1"}, HasSubstr("--skip: needs --column"));
    refused({"--column", "acc=rate", "--unit", "deg/s", "--rate", "100", "--time-unit", "ms"},
            HasSubstr("--time-unit ms: needs --time"));
    refused({"--column", "acc=rate", "--unit", "deg/s", "--rate", "100", "--time", "t", "--time-unit", "ns"},
            HasSubstr("say --time-unit s"));
    refused({"--column", "acc=rate", "--unit", "deg/s", "--rate", "100", "--declare", "colour=3"},
            AllOf(HasSubstr("--declare colour"), HasSubstr("dither_frequency_hz")));
    refused({"--column", "acc=rate", "--unit", "deg/s", "--rate", "100", "--declare", "dither_frequency_hz"},
            HasSubstr("must be KEY=NUMBER"));
}

TEST_F(RecordProgram, ClosureLeavesGapsOut) {
    std::mt19937_64 random(3);
    std::normal_distribution<double> noise;
    std::string text = "# rate_hz = 100\ntime_s,angle_increment_arcsec\n";
    for (int i = 0; i < 2000; ++i) {
        const std::string row = std::to_string(0.01 * i) + "," + std::to_string(noise(random)) + "\n";
        if (i < 700 || i >= 720) text += row;
    }
    write("noise.csv", text);
    const Outcome r = run({"closure", "noise.csv", "--json"});
    EXPECT_EQ(r.status, 0) << r.err;
    const auto json = nlohmann::json::parse(r.out);
    EXPECT_EQ(json["verdict"], "nothing_missing");
    ASSERT_EQ(json["gaps"].size(), 1U);
    EXPECT_NEAR(json["gaps"][0]["from_s"], 6.99, 1e-9);
    EXPECT_NEAR(json["gaps"][0]["to_s"], 7.19, 1e-9);
}

// What is left out stays out: NaN in the record, counted by whoever reads it.
TEST_F(RecordProgram, GapsStayGaps) {
    std::string text = "# rate_hz = 100\ntime_s,angle_increment_arcsec,accel_x\n";
    for (int i = 0; i < 1000; ++i) {
        if (i < 700 || i >= 720) text += std::to_string(0.01 * i) + "," + std::to_string(i % 7) + ",1\n";
    }
    write("gap.csv", text);
    const auto named = AllOf(HasSubstr("warning: gap.csv: /samples/angle_increment_arcsec, line 703: 20 samples are "
                                       "missing between 6.99 s and 7.2 s"),
                             HasSubstr("rows 700 to 719"));
    Outcome r = run({"validate", "gap.csv"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.err, named);
    r = run({"import", "gap.csv", "-o", "gap.h5"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, AllOf(HasSubstr("1000 angle increments"), HasSubstr("20 of them missing")));
    EXPECT_THAT(r.err, named);
    record::Record record = record::read_record((directory_ / "gap.h5").string());
    ASSERT_EQ(record.samples->size(), 1000U);
    EXPECT_TRUE(std::isnan(record.samples->values[700]) && std::isnan(record.samples->witnesses.at("accel_x")[719]));
    EXPECT_EQ(record.samples->values[720], 720 % 7);
    r = run({"import", "gap.csv", "-o", "mapped.h5", "--column", "angle_increment_arcsec=angle_increment_arcsec",
             "--unit", "arcsec", "--rate", "100", "--time", "time_s"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("20 of them missing"));
    record = record::read_record((directory_ / "mapped.h5").string());
    EXPECT_TRUE(std::isnan(record.samples->values[719]) && !std::isnan(record.samples->values[720]));
    write("counts.csv", "# rate_hz = 100\nt,quarter_count\n0,1\n0.01,2\n0.04,3\n");
    expect_refused(
        {"validate", "counts.csv"},
        AllOf(HasSubstr("counts.csv:5: column quarter_count: 2 samples are missing"), HasSubstr("0.01 s and 0.04 s")));
    for (const char* name : {"time_ms", "t_ms", "Timestamp_ms", "timestamp [ms]"}) {
        write("named.csv", std::string("# rate_hz = 100\n") + name + ",angle_arcsec\n0,1\n10,2\n40,3\n50,3\n60,4\n");
        r = run({"validate", "named.csv"});
        EXPECT_EQ(r.status, 0) << r.err;
        EXPECT_THAT(r.err, HasSubstr("2 samples are missing between 10 ms and 40 ms")) << name;
    }
    for (const char* name : {"T_s", "t_min", "runtime_ms"}) {
        write("named.csv", std::string("# rate_hz = 100\n") + name + ",angle_arcsec\n0,1\n10,2\n40,3\n");
        r = run({"validate", "named.csv"});
        EXPECT_EQ(r.status, 0) << r.err;
        EXPECT_THAT(r.err, HasSubstr("has no meaning in a record and is ignored")) << name;
    }
    write("ms.csv", "# rate_hz = 100\ntime,angle_arcsec\n0,1\n10,2\n20,3\n");
    expect_refused({"validate", "ms.csv"}, HasSubstr("declare them in the header, as in \"time [ms]\""));
    write("ms.csv", "# rate_hz = 100\ntime [ms];angle_arcsec\n0;1,5\n10;2,5\n20;3,5\n");
    EXPECT_EQ(run({"validate", "ms.csv"}).status, 0);
}

TEST_F(RecordProgram, SaysWhatIsWrongAndWhere) {
    record::Record damaged = full_record();
    damaged.turns->sine[5] = std::nan("");
    damaged.turns->time_s[9] = damaged.turns->time_s[8];
    record::write_record((directory_ / "r.h5").string(), damaged);
    for (const Arguments& arguments : std::vector<Arguments>{{"validate", "r.h5"}, {"import", "r.h5", "-o", "o.h5"}}) {
        expect_refused(arguments, AllOf(HasSubstr("r.h5: /turns/sin, row 5"), HasSubstr("r.h5: /turns/time_s, row 9")));
    }
    write("r.csv", "# rate_hz = 10\nangle_arcsec\n1\ninf\n");
    expect_refused({"validate", "r.csv"}, AllOf(HasSubstr("r.csv:4: column angle_arcsec"), Not(HasSubstr(".toml"))));
    // What is called neither a table nor a scenario may be either.
    write("r", "# rate_hz = 10\nangle_arcsec\n1\ninf\n");
    expect_refused({"validate", "r"},
                   AllOf(HasSubstr("r:4: column angle_arcsec"), HasSubstr("scenarios end in .toml")));
    expect_refused({"import", "r.csv", "-o", "o.h5"}, HasSubstr("r.csv:4:"));
    expect_refused({"validate", "missing.csv"}, HasSubstr("missing.csv"));
    expect_refused({"validate", "."}, HasSubstr("directory"));
    const std::string bytes = read("r.h5");
    write("cut.h5", bytes.substr(0, bytes.size() / 2));
    expect_refused({"validate", "cut.h5"}, HasSubstr("cut.h5"));
}

TEST_F(RecordProgram, ImportsText) {
    write("r.csv", "# rate_hz = 10\n# title = bench\nangle_arcsec,accel_y\n1,5\n2,6\n4,7\n");
    const Outcome r = run({"import", "r.csv", "-o", "r.h5"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("3 angles at 10 Hz"));
    const record::Record back = record::read_record((directory_ / "r.h5").string());
    EXPECT_EQ(back.title, "bench");
    EXPECT_EQ(back.samples->values, (std::vector<double>{1.0, 2.0, 4.0}));
    EXPECT_EQ(back.samples->witnesses.at("accel_y"), (std::vector<double>{5.0, 6.0, 7.0}));
    EXPECT_EQ(run({"import", "r.csv", "-o", "r.h5"}).status, 0) << "a record is replaced";

    expect_refused({"import", "r.csv"}, HasSubstr("output"));
    expect_refused({"import", "r.csv", "-o", "no/r.h5"}, HasSubstr("no/r.h5"));
    const std::string before = read("r.csv");
    expect_refused({"import", "r.csv", "-o", "r.csv"}, HasSubstr("are the same file"));
    write("notes.csv", "mine");
    expect_refused({"import", "r.csv", "-o", "notes.csv"}, HasSubstr("move it away"));
    EXPECT_EQ(read("notes.csv"), "mine");
    EXPECT_EQ(read("r.csv"), before);
}

TEST_F(RecordProgram, RecordsAGyroOfAScenario) {
    write("s.toml", "[ensemble]\nduration_s = 3.5\ngyros = 4\n");
    Outcome r = run({"record", "s.toml", "-o", "r.h5"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, AllOf(HasSubstr("r.h5: gyro 0, seed 1:"), HasSubstr("turns over")));
    EXPECT_EQ(run({"validate", "r.h5"}).status, 0);
    r = run({"record", "s.toml", "-o", "again.h5", "--seed", "1", "--gyro", "0", "--json"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, AllOf(testing::StartsWith("{"), HasSubstr("\"kind\": \"turns\""), HasSubstr("\"rows\": ")));
    EXPECT_EQ(read("again.h5"), read("r.h5")) << "the same scenario, seed and gyro are the same bytes";
    ASSERT_EQ(run({"record", "s.toml", "-o", "again.h5", "--seed", "2"}).status, 0);
    EXPECT_NE(read("again.h5"), read("r.h5"));

    write("samples.toml", "[ensemble]\nduration_s = 3.5\n[record]\nkind = \"samples\"\nrate_hz = 50\n");
    r = run({"record", "samples.toml", "-o", "samples.h5"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("175 angle increments at 50 Hz"));
}

TEST_F(RecordProgram, RefusesRecordsThatCannotBe) {
    write("s.toml", "[ensemble]\nduration_s = 3.5\ngyros = 4\n");
    expect_refused({"record", "s.toml"}, HasSubstr("output"));
    expect_refused({"record", "s.toml", "-o", "s.toml"}, HasSubstr("are the same file"));
    expect_refused({"record", "s.toml", "-o", "no/r.h5"}, HasSubstr("no/r.h5"));
    expect_refused({"record", "s.toml", "-o", "r.h5", "--gyro", "4"}, HasSubstr("0 to 3"));
    expect_refused({"record", "s.toml", "-o", "r.h5", "--gyro", "-1"}, HasSubstr("--gyro"));
    expect_refused({"record", "s.toml", "-o", "r.h5", "--seed", "x"}, HasSubstr("--seed"));
    expect_refused({"record", "none.toml", "-o", "r.h5"}, HasSubstr("none.toml"));
    write("bad.toml", "[record]\nkind = \"turn\"\n[input]\nprofile_time_s = [0, \"x\"]\n");
    expect_refused({"record", "bad.toml", "-o", "r.h5"},
                   AllOf(HasSubstr("bad.toml:2:8: key \"record.kind\""), HasSubstr("did you mean \"turns\"?"),
                         HasSubstr("bad.toml:4:22: key \"input.profile_time_s\"")));
}

TEST_F(RecordProgram, AFullDiskLeavesNothing) {
    std::string text = "# rate_hz = 10\nangle_arcsec\n";
    for (int i = 0; i < 20000; ++i) text += std::to_string(i * i) + "\n";
    write("r.csv", text);
    const Outcome r = run({"import", "r.csv", "-o", "r.h5"}, [] {
        const rlimit small{20000, 20000};
        setrlimit(RLIMIT_FSIZE, &small);
    });
    EXPECT_EQ(r.status, 1) << r.err;
    EXPECT_THAT(r.err, HasSubstr("r.h5"));
    EXPECT_EQ(left(), std::set<std::string>{"r.csv"});
}

}  // namespace
}  // namespace record_test
}  // namespace ringlock::test
