#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/cli/program.hpp"

// Names of files, columns and keys that hold what would control a terminal, break a line, or be markup.
namespace ringlock::test {
namespace hostile_names_test {
namespace {

using testing::HasSubstr;

const std::string hostile = "x\n\x1b[2J\"'<script>|`\xff\xe2\x80\xae";

class HostileNames : public ProgramTest {
   protected:
    static void expect_harmless(const std::string& text, const std::string& what) {
        for (const char c : text) {
            ASSERT_TRUE((static_cast<unsigned char>(c) >= 0x20 && c != 0x7f) || c == '\n' || c == '\t')
                << what << ": " << testing::PrintToString(text);
        }
        EXPECT_EQ(text.find("\xe2\x80\xae"), std::string::npos) << what;
        EXPECT_EQ(text.find('\xff'), std::string::npos) << what;
        // A line that begins with the rest of the name was forged by it.
        EXPECT_EQ(text.find("\n\\x1b"), std::string::npos) << what << ": " << text;
    }
    /// Runs a command, whose output must be harmless.
    Outcome harmless(const Arguments& arguments) const {
        const Outcome r = run(arguments);
        EXPECT_EQ(r.signal, 0) << testing::PrintToString(arguments);
        expect_harmless(r.out, testing::PrintToString(arguments));
        expect_harmless(r.err, testing::PrintToString(arguments));
        return r;
    }
    void write_data(const std::string& name) const {
        std::string text = "gyro other\n";
        for (int i = 0; i < 100; ++i) {
            text += std::to_string(std::sin(1.0 * i)) + " " + std::to_string(i % 7) + "\n";
        }
        write(name, text);
    }
};

TEST_F(HostileNames, EveryCommandNamesTheFileHarmlessly) {
    const std::vector<Arguments> commands = {
        {"validate"},
        {"analyze"},
        {"closure"},
        {"merge"},
        {"status"},
        {"run"},
        {"run", "--resume"},
        {"replay"},
        {"submit"},
        {"record"},
        {"import", "-o", "out.h5"},
        {"import", "-o", "out.h5", "--column", "1=rate", "--rate", "1", "--unit", "deg/h"},
        {"allan", "--rate", "1", "--kind", "rate"},
        {"allan", "--rate", "1", "--kind", "rate", "--column", hostile},
        {"allan", "--rate", "1", "--kind", "rate", "--plot", "a.txt"}};
    const auto try_all = [&](const std::string& name) {
        for (Arguments command : commands) {
            command.insert(command.begin() + 1, name);
            const Outcome r = harmless(command);
            if (command.front() == "status") continue;  // whatever is there is finished
            EXPECT_NE(r.status, 0);
            EXPECT_THAT(r.err, HasSubstr("ringlock: "));
        }
    };
    for (const char* ending : {"", ".h5", ".toml", ".csv"}) {
        write(hostile + ending, "nothing\n");
        try_all(hostile + ending);
    }
    for (const char* begin : {"\x89HDF\r\n\x1a\n nothing", "\x93NUMPY\1 nothing", "PK\3\4 nothing"}) {
        write(hostile + ".dat", begin);
        try_all(hostile + ".dat");
    }
    for (Arguments command : commands) {  // some of them succeed on a name that is not there
        command.insert(command.begin() + 1, hostile + ".gone");
        harmless(command);
    }
}

TEST_F(HostileNames, ANameWithALeadingDashIsGivenWithItsFolder) {
    write_data("-x.txt");
    EXPECT_EQ(harmless({"allan", "./-x.txt", "--rate", "1", "--kind", "rate", "--column", "gyro"}).status, 0);
    EXPECT_EQ(harmless({"allan", "-x.txt", "--rate", "1", "--kind", "rate", "--column", "gyro"}).status, 2);
}

TEST_F(HostileNames, JsonParsesWhateverTheNamesAre) {
    write_data(hostile);
    const Outcome allan = harmless({"allan", hostile, "--rate", "1", "--kind", "rate", "--column", "gyro", "--json"});
    ASSERT_EQ(allan.status, 0) << allan.err;
    EXPECT_EQ(nlohmann::json::parse(allan.out)["column"], "gyro");
    const std::string result = hostile + ".h5";
    std::ofstream(directory_ / "s.toml") << "[ensemble]\ngyros = 1\nduration_s = 5.0\n";
    ASSERT_EQ(harmless({"run", "s.toml", "-q", "-o", result}).status, 0);
    const Outcome status = harmless({"status", result, "--json"});
    ASSERT_EQ(status.status, 0) << status.err;
    EXPECT_FALSE(nlohmann::json::parse(status.out)["outputs"].empty());
    const std::string text = harmless({"allan", hostile, "--rate", "1", "--kind", "rate", "--column", "gyro"}).out;
    EXPECT_THAT(text, HasSubstr("x\\x0a\\x1b[2J"));
}

TEST_F(HostileNames, ARecordIsWrittenAndReadUnderSuchAName) {
    write_data("plain.txt");
    const std::string name = hostile + ".h5";
    ASSERT_EQ(harmless({"import", "plain.txt", "-o", name, "--column", "gyro=rate", "--rate", "100", "--unit", "deg/h"})
                  .status,
              0);
    EXPECT_EQ(harmless({"validate", name}).status, 0);
}

TEST_F(HostileNames, KeysAndValuesOfAScenarioAreShownWrittenOut) {
    write("s.toml",
          "title = \"a\\u001b[2Jb\\nc\"\n\"k\\u001b\\u202e\\n\" = 1\n[ensemble]\n\"x\\u009b\" = \"\\u2028\"\n");
    const Outcome r = harmless({"validate", "s.toml"});
    EXPECT_EQ(r.status, 2);
    EXPECT_THAT(r.err, HasSubstr("k\\x1b\\u202e\\x0a"));
    EXPECT_THAT(harmless({"run", "s.toml", "--set", "a\nb\x1b=1"}).err, HasSubstr("a\\x0ab\\x1b"));
}

TEST_F(HostileNames, ManyUnknownNamesAreSummedUp) {
    const hid_t h5 = H5Fcreate((directory_ / "r.h5").c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, H5P_DEFAULT);
    const hid_t scalar = H5Screate(H5S_SCALAR);
    const hid_t text = H5Tcopy(H5T_C_S1);
    H5Tset_size(text, 10);
    const hid_t format = H5Acreate2(h5, "format", text, scalar, H5P_DEFAULT, H5P_DEFAULT);
    H5Awrite(format, text, "rlg-record");
    H5Aclose(format);
    const auto number = [&](hid_t at, const char* name, double value) {
        const hid_t attribute = H5Acreate2(at, name, H5T_NATIVE_DOUBLE, scalar, H5P_DEFAULT, H5P_DEFAULT);
        H5Awrite(attribute, H5T_NATIVE_DOUBLE, &value);
        H5Aclose(attribute);
    };
    number(h5, "format_version", 1.0);
    const hid_t samples = H5Gcreate2(h5, "samples", H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    number(samples, "rate_hz", 100.0);
    const double values[] = {0.5, 0.25, 0.5, 0.75};
    const hsize_t size = std::size(values);
    const hid_t space = H5Screate_simple(1, &size, nullptr);
    const hid_t data =
        H5Dcreate2(samples, "angle_increment_arcsec", H5T_NATIVE_DOUBLE, space, H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT);
    H5Dwrite(data, H5T_NATIVE_DOUBLE, H5S_ALL, H5S_ALL, H5P_DEFAULT, values);
    H5Dclose(data);
    H5Sclose(space);
    H5Gclose(samples);
    for (int i = 0; i < 3000; ++i) {
        H5Gclose(H5Gcreate2(h5, ("unknown\x1b" + std::to_string(i)).c_str(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT));
    }
    H5Tclose(text);
    H5Sclose(scalar);
    H5Fclose(h5);
    const Outcome r = harmless({"validate", "r.h5"});
    EXPECT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.err, HasSubstr("each of 2980 more"));
    EXPECT_LT(std::count(r.err.begin(), r.err.end(), '\n'), 30);
}

}  // namespace
}  // namespace hostile_names_test
}  // namespace ringlock::test
