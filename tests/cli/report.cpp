// `ringlock report`: a page of each kind of input, and inputs that it refuses.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <string>

#include "tests/cli/program.hpp"

namespace ringlock {
namespace report_test {
namespace {

using test::Outcome;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::Not;

/// A study of some seconds of a few gyros; its question holds what a page must not take for markup.
constexpr const char* small = R"(# Question: does <script>alert(1)</script> noise help?
# Answer: not part of the question.
[ensemble]
gyros = 4
duration_s = 100.0
[specification]
arw_deg_rt_h = 0.0025
[arms]
names = ["ideal", "uncompensated", "noise_injected", "noise_injected+compensated"]
)";

class ReportCommand : public test::ProgramTest {
   protected:
    void made(const Arguments& arguments) const {
        const Outcome r = run(arguments);
        ASSERT_EQ(r.status, 0) << r.err;
    }
    /// Status 2, the message, nothing on standard output and no file left.
    void expect_refused(const Arguments& arguments, const testing::Matcher<std::string>& message) const {
        const auto before = left();
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 2) << r.err;
        EXPECT_THAT(r.err, message);
        EXPECT_EQ(r.out, "");
        EXPECT_EQ(left(), before);
    }
};

TEST_F(ReportCommand, MakesAPageOfAStudy) {
    write("s.toml", small);
    made({"run", "s.toml", "-o", "o u t.h5", "--seed", "7"});
    const Outcome r = run({"report", "o u t.h5"});
    ASSERT_EQ(r.status, 0) << r.err;
    EXPECT_THAT(r.out, HasSubstr("o u t.report.html"));
    const std::string page = read("o u t.report.html");
    EXPECT_THAT(page, HasSubstr("does &lt;script&gt;alert(1)&lt;/script&gt; noise help?"));
    EXPECT_THAT(page, AllOf(Not(HasSubstr("<script>alert")), Not(HasSubstr("not part of the question"))));
    EXPECT_THAT(page, HasSubstr("ensemble.seed: "));  // the run differs from the file
    // Of the compensated arm the random walk is the smallest by far.
    EXPECT_THAT(page, HasSubstr("noise_injected+compensated has the smallest angle random walk"));
    EXPECT_THAT(page, HasSubstr("The specification is met by"));
    EXPECT_THAT(page, HasSubstr("run s.toml -o &#39;o u t.h5&#39; --seed 7"));
    EXPECT_THAT(page, HasSubstr("[noise_injection]"));  // the full scenario
    EXPECT_THAT(page, HasSubstr("Angle random walk over the gyros"));
    EXPECT_THAT(page, Not(HasSubstr("http://")));

    // The same input gives the same page, and a page replaces a page.
    made({"report", "o u t.h5"});
    EXPECT_EQ(read("o u t.report.html"), page);
    made({"report", "o u t.h5", "-o", "other.html"});
    EXPECT_EQ(read("other.html"), page);
}

TEST_F(ReportCommand, HasTheNumbersOfAnalyze) {
    write("s.toml", small);
    made({"run", "s.toml", "-o", "s.h5"});
    made({"report", "s.h5"});
    const std::string page = read("s.report.html");
    // Each line of the table of random walks, cell by cell.
    const std::string table = run({"analyze", "s.h5"}).out;
    const std::size_t begin = table.find("noise_injected ");
    ASSERT_NE(begin, std::string::npos);
    const std::string line = table.substr(begin, table.find('\n', begin) - begin);
    std::size_t from = line.find_first_of("0123456789");
    const std::string walk = line.substr(from, line.find(' ', from) - from);
    EXPECT_THAT(page, HasSubstr("<td>noise_injected</td><td class=\"n\">" + walk + "</td>"));
}

TEST_F(ReportCommand, MakesAPageOfADesignAndOfASweep) {
    write("d.toml", std::string(small) + R"([output]
angle_record = false
[design]
kind = "list"
[[design.vary]]
key = "gyro.lockin_threshold_deg_h"
values = [150, 300, 450]
)");
    made({"run", "d.toml", "-o", "d.h5"});
    made({"report", "d.h5"});
    EXPECT_THAT(read("d.report.html"), AllOf(HasSubstr("Among 3 points the smallest angle random walk is that of"),
                                             HasSubstr("gyro.lockin_threshold_deg_h [deg/h]"),
                                             HasSubstr("Gyros that meet the specification")));
    write(
        "w.toml",
        "[ensemble]\ngyros = 1\nduration_s = 5.0\n[input]\nrate_deg_h = 0.0\nsweep_stop_deg_h = 9.0\nsweep_points = 4\n"
        "[arms]\nnames = [\"uncompensated\"]\n");
    made({"run", "w.toml", "-o", "w.h5"});
    made({"report", "w.h5"});
    EXPECT_THAT(read("w.report.html"), HasSubstr("The mean rate of uncompensated is off by at most"));
}

TEST_F(ReportCommand, MakesAPageOfABatch) {
    write("a.toml", small);
    write("b.toml", small);
    write("c.toml", "[ensemble]\ngyros = -1\n");
    EXPECT_EQ(run({"run", "a.toml", "b.toml", "c.toml", "-o", "results"}).status, 1);
    made({"report", "results/"});
    const std::string page = read("results.report.html");
    EXPECT_THAT(page, AllOf(HasSubstr("Batch of 3 scenarios"), HasSubstr("failed"), HasSubstr("a.toml"),
                            HasSubstr("ringlock run a.toml b.toml c.toml -o results")));
    made({"report", "results/a.h5", "results/b.h5", "-o", "two.html"});
    EXPECT_THAT(read("two.html"), HasSubstr("2 studies"));
    std::filesystem::remove(directory_ / "results/batch.json");
    made({"report", "results", "-o", "folder.html"});
    EXPECT_THAT(read("folder.html"), AllOf(HasSubstr("a.toml"), HasSubstr("b.toml")));
}

TEST_F(ReportCommand, MakesAPageOfAnAllanAnalysis) {
    std::string data;
    unsigned state = 1;
    for (int i = 0; i < 2000; ++i) {
        state = state * 1664525U + 1013904223U;
        data += std::to_string((state >> 16U) % 1000U + (i == 700 ? 40000U : 0U)) + "\n";
    }
    write("log.txt", data);
    const Outcome printed = run({"allan", "log.txt", "--rate", "100", "--kind", "rate", "--unit", "deg/h", "--json"});
    ASSERT_EQ(printed.status, 0) << printed.err;
    write("a.json", printed.out);
    made({"report", "a.json"});
    EXPECT_THAT(read("a.report.html"),
                AllOf(HasSubstr("outlier"), HasSubstr("<td class=\"n\">701</td>"), HasSubstr("angle random walk N"),
                      HasSubstr("ringlock allan DATA --tau0 0.01s --kind rate")));
    const Outcome without = run({"allan", "log.txt", "--rate", "100", "--kind", "rate", "--json"});
    write("b.json", without.out);
    made({"report", "b.json"});
    EXPECT_THAT(read("b.report.html"), HasSubstr("no unit was given"));
}

/// What `ringlock closure -o` writes, in the least that makes a page.
constexpr const char* closure_json = R"({"verdict": "closed", "base": {"bias_deg_h": {"value": 1.5, "std": 0.1}},
"steps": [{"effect": "bias_step", "parameters": {"step_deg_h": {"value": 4.0, "std": 0.5}, "time_s": {"value": 9.0, "std": null}},
"heldout_error_before": 0.25, "heldout_error_after": 0.125, "heldout_log_score_gain": 40.0, "p_value": 1e-9}],
"heldout_error": {"unit": "<b>rad", "before": 0.25, "after": 0.125, "noise_floor": 0.12},
"unexplained": {"present": false, "where": null, "detail": ""},
"tests": [], "gaps": [], "family_wise_level": 0.01, "notes": ["<i>note"]})";

TEST_F(ReportCommand, RefusesADamagedFolderOfTheClosedLoop) {
    std::filesystem::create_directory(directory_ / "closed");
    write("closed/closure.json", closure_json);
    expect_refused({"report", "closed"}, HasSubstr("closure.h5"));
    write("closed/closure.json", "{\"verdict\": \"maybe\"}");
    expect_refused({"report", "closed"}, AllOf(HasSubstr("closure.json"), HasSubstr("\"maybe\"")));
    write("closed/closure.json", "{\"verdict\": ");
    expect_refused({"report", "closed"}, AllOf(HasSubstr("closure.json"), HasSubstr("no JSON")));
    write("closed/closure.json", "[]");
    expect_refused({"report", "closed"}, HasSubstr("closure.json"));
}

TEST_F(ReportCommand, RefusesWhatItCannotRead) {
    expect_refused({"report"}, HasSubstr("INPUT"));
    expect_refused({"report", "missing.h5"}, AllOf(HasSubstr("missing.h5"), HasSubstr("no such file")));
    write("text.txt", "1 2 3\n");
    expect_refused({"report", "text.txt"}, AllOf(HasSubstr("text.txt"), HasSubstr("ringlock allan --json")));
    write("foreign.json", "{\"a\": 1}");
    expect_refused({"report", "foreign.json"}, AllOf(HasSubstr("foreign.json"), HasSubstr("ringlock allan --json")));
    write("cut.json", "{\"deviations\": {\"oadev\": [{\"m\": 1}]}}");
    expect_refused({"report", "cut.json"}, HasSubstr("cut.json"));
    write("odd.json", "{\"deviations\": 3, \"series\": []}");
    expect_refused({"report", "odd.json"}, HasSubstr("odd.json"));
    write("broken.h5", std::string("\x89HDF\r\n\x1a\n", 8) + std::string(500, 'x'));
    expect_refused({"report", "broken.h5"}, HasSubstr("broken.h5"));
    std::filesystem::create_directory(directory_ / "empty");
    expect_refused({"report", "empty"}, AllOf(HasSubstr("empty"), HasSubstr("closure.json")));
}

TEST_F(ReportCommand, RefusesOutputsThatWouldLoseSomething) {
    write("s.toml", small);
    made({"run", "s.toml", "-o", "s.h5"});
    expect_refused({"report", "s.h5", "-o", "missing/page.html"}, HasSubstr("missing"));
    expect_refused({"report", "s.h5", "-o", "page.txt"}, HasSubstr(".html"));
    write("mine.html", "<p>my own</p>");
    expect_refused({"report", "s.h5", "-o", "mine.html"}, AllOf(HasSubstr("mine.html"), HasSubstr("kept")));
    EXPECT_EQ(read("mine.html"), "<p>my own</p>");
    // A result that is cut off leaves an earlier page as it is.
    made({"report", "s.h5"});
    const std::string page = read("s.report.html");
    write("s.h5", read("s.h5").substr(0, 3000));
    expect_refused({"report", "s.h5"}, HasSubstr("s.h5"));
    EXPECT_EQ(read("s.report.html"), page);
    EXPECT_THAT(left(), Contains("s.report.html"));
}

}  // namespace
}  // namespace report_test
}  // namespace ringlock
