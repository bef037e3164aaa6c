// ringlock export: the files of the program as tables, JSON, MAT-files and arrays of NumPy.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <sys/resource.h>

#include <cmath>
#include <cstdlib>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "engine/store/contents.hpp"
#include "tests/cli/program.hpp"

namespace ringlock::test {
namespace export_test {
namespace {

using nlohmann::json;
using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;

constexpr const char* two_arms = R"([ensemble]
gyros = 3
duration_s = 4.0
[arms]
names = ["noise_injected+compensated", "ideal", "noise_injected"]
)";

/// Lines of a table, each a list of cells; no test here has cells with commas.
std::vector<std::vector<std::string>> rows_of(const std::string& csv) {
    std::vector<std::vector<std::string>> rows;
    std::istringstream lines(csv);
    for (std::string line; std::getline(lines, line);) {
        std::vector<std::string> cells(1);
        for (const char c : line) {
            if (c == ',') {
                cells.emplace_back();
            } else {
                cells.back() += c;
            }
        }
        rows.push_back(std::move(cells));
    }
    return rows;
}

class ExportCommand : public ProgramTest {
   protected:
    /// Makes a file of each kind that the program writes as HDF5, but for that of the closed loop, which takes long,
    /// and returns their names.
    std::vector<std::string> make_files() const {
        write("study.toml", two_arms);
        write("design.toml", std::string(two_arms) +
                                 "[reader]\noutput_hz = 40.0\n[output]\nsample_interval_s = 0.5\n"
                                 "[design]\nkind = \"list\"\n[[design.vary]]\n"
                                 "key = \"dither.peak_rate_deg_s\"\nvalues = [100.0, 110.0]\n");
        write("lot.toml",
              "[ensemble]\nduration_s = 4.0\n[arms]\nnames = [\"noise_injected\"]\n"
              "[output]\nangle_record = false\n[stop]\narw_relative = 0.5\nmost_gyros = 16\n");
        const std::vector<Arguments> commands = {
            {"run", "study.toml", "-o", "study.h5", "-q"},
            {"run", "design.toml", "-o", "design.h5", "-q"},
            {"run", "lot.toml", "-o", "lot.h5", "-q"},
            {"record", "study.toml", "-o", "turns.h5"},
            {"record", "study.toml", "-o", "samples.h5", "--set", "record.kind=samples", "--set",
             "environment.temperature_ramp_k_per_h=1"},
            {"replay", "study.h5", "--arm", "noise_injected", "--gyro", "1", "-o", "replay.h5", "-q"}};
        for (const Arguments& command : commands) {
            const Outcome r = run(command);
            EXPECT_EQ(r.status, 0) << command[0] << " " << command[1] << ": " << r.err;
        }
        return {"study.h5", "design.h5", "lot.h5", "turns.h5", "samples.h5", "replay.h5"};
    }
    void expect_labels(const std::string& file) const {
        store::guarded(directory_ / file, [&](const store::GuardedPath& path) {
            std::size_t datasets = 0;
            for (const store::ListedObject& object : store::contents_of(store::File::open(path))) {
                if (!object.is_dataset) continue;
                ++datasets;
                EXPECT_NE(object.description, "") << file << object.path;
                const bool is_text = object.kind == store::ElementKind::text;
                EXPECT_EQ(object.unit.empty(), is_text) << file << object.path << " has the unit " << object.unit;
            }
            EXPECT_GT(datasets, 0U) << file;
            return 0;
        });
    }
    /// Compares all forms of the file with the file itself; what is missing for that, or nothing.
    std::string compare_forms(const std::string& file) const {
        const std::string script = RINGLOCK_SOURCE_DIR "/tests/cli/export_round_trip.py";
        for (const std::string form : {"json", "npz", "mat"}) {
            const Outcome r = run({"export", file, form == "mat" ? "--matlab" : "--" + form, "-o", "all." + form});
            EXPECT_EQ(r.status, 0) << file << ": " << r.err;
        }
        const std::string command =
            fmt::format("cd '{}' && /usr/bin/python3 '{}' {} all.json all.npz all.mat >told 2>&1", directory_.string(),
                        script, file);
        const int status = WEXITSTATUS(std::system(command.c_str()));
        if (status == 77 || status == 127) {
            return "needs /usr/bin/python3 with h5py, NumPy and SciPy: " + read("told");
        }
        EXPECT_EQ(status, 0) << file << "\n" << read("told");
        return "";
    }
    void expect_refused(const Arguments& arguments, const testing::Matcher<std::string>& message) const {
        const auto before = left();
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 2) << r.err;
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, AllOf(StartsWith("ringlock: error: "), message));
        EXPECT_EQ(left(), before);
    }
    std::string csv(const std::string& file, const std::string& table) const {
        const Outcome r = run({"export", file, "--csv", "--table", table});
        EXPECT_EQ(r.status, 0) << r.err;
        return r.out;
    }
};

TEST_F(ExportCommand, EveryDatasetThatTheProgramWritesHasUnitAndDescription) {
    // Checkpoints and shards are no HDF5 (engine/store/part_file.hpp).
    for (const std::string& file : make_files()) expect_labels(file);
}

TEST_F(ExportCommand, OtherReadersFindTheSameInAllForms) {
    std::string missing;
    for (const std::string& file : make_files()) missing = compare_forms(file);
    if (!missing.empty()) GTEST_SKIP() << missing;
}

class LongExportCommand : public ExportCommand {};

TEST_F(LongExportCommand, TheFileOfTheClosedLoop) {
    write("long.toml", "[ensemble]\nduration_s = 8\ngyros = 1\ndither_asymmetry_sd_ratio = 0\n");
    ASSERT_EQ(run({"record", "long.toml", "-o", "turns.h5"}).status, 0);
    const Outcome closed = run({"closure", "turns.h5", "-o", "closed", "-q"});
    ASSERT_EQ(closed.status, 0) << closed.err;
    expect_labels("closed/closure.h5");
    EXPECT_THAT(run({"export", "closed/closure.h5", "--csv", "--table", "parameters"}).out,
                AllOf(StartsWith("name,std,unit,value\n"), HasSubstr("base.bias_deg_h,"), HasSubstr(",deg/h,")));
    const Outcome list = run({"export", "closed/closure.h5", "--tables"});
    EXPECT_THAT(list.out, AllOf(HasSubstr("residual"), HasSubstr("scores"), HasSubstr("attributes")));
    const std::string missing = compare_forms("closed/closure.h5");
    if (!missing.empty()) GTEST_SKIP() << missing;
}

TEST_F(ExportCommand, EachArmAndGyroIsARow) {
    write("study.toml", two_arms);
    ASSERT_EQ(run({"run", "study.toml", "-o", "study.h5", "-q"}).status, 0);
    const json all = json::parse(run({"export", "study.h5", "--json"}).out);
    const auto rows = rows_of(run({"export", "study.h5", "--csv"}).out);
    ASSERT_EQ(rows.size(), 1U + 3U * 3U);
    // Arms in the order of the scenario, not of their names.
    EXPECT_EQ(rows[1][0], "noise_injected+compensated");
    EXPECT_EQ(rows[4][0], "ideal");
    EXPECT_EQ(rows[9][0], "noise_injected");
    for (std::size_t row = 1; row < rows.size(); ++row) {
        ASSERT_EQ(rows[row].size(), rows[0].size());
        const std::size_t gyro = (row - 1) % 3;
        EXPECT_EQ(rows[row][1], std::to_string(gyro));
        const json& arm = all["arms"][rows[row][0]];
        std::map<std::string, std::string> cell;
        for (std::size_t i = 0; i < rows[0].size(); ++i) cell[rows[0][i]] = rows[row][i];
        EXPECT_EQ(std::stod(cell["rate_error_deg_h"]), arm["rate_error_deg_h"]["values"][gyro]);
        EXPECT_EQ(std::stod(cell["angle_error_arcsec_after_1_s"]), arm["angle_error_arcsec"]["values"][gyro][0]);
        // The record ends before 100 s: no number, so an empty cell and null.
        EXPECT_EQ(cell["angle_error_arcsec_after_100_s"], "");
        EXPECT_TRUE(arm["angle_error_arcsec"]["values"][gyro][2].is_null());
        EXPECT_EQ(std::stod(cell["dither_peak_rate_deg_s"]), all["gyros"]["dither_peak_rate_deg_s"]["values"][gyro]);
    }
}

TEST_F(ExportCommand, TablesOfAResult) {
    write("study.toml", two_arms);
    // Long enough for random walks to show.
    ASSERT_EQ(run({"run", "study.toml", "-o", "study.h5", "-q", "--set", "ensemble.duration_s=600"}).status, 0);
    const json all = json::parse(run({"export", "study.h5", "--json"}).out);
    const auto angle = rows_of(csv("study.h5", "angle"));
    const json& record = all["arms"]["ideal"]["angle_arcsec"]["values"];
    ASSERT_EQ(angle.size(), 1 + 3 * 3 * record[0].size());
    EXPECT_THAT(angle[0], ElementsAre("arm", "gyro", "time_s", "angle_arcsec"));
    const double interval_s = all["attributes"]["sample_interval_s"];
    const auto& last = angle[1 + 2 * 3 * record[0].size() - 1];  // of the second arm
    EXPECT_EQ(last[0], "ideal");
    EXPECT_EQ(last[1], "2");
    EXPECT_DOUBLE_EQ(std::stod(last[2]), interval_s * static_cast<double>(record[0].size() - 1));
    EXPECT_EQ(std::stod(last[3]), record[2].back());

    const auto pairs = rows_of(csv("study.h5", "pairs"));
    ASSERT_EQ(pairs.size(), 1U + 9U);
    EXPECT_EQ(pairs[0][0], "arm");
    EXPECT_EQ(pairs[0][1], "over_arm");
    const auto column = std::find(pairs[0].begin(), pairs[0].end(), "arw_ratio") - pairs[0].begin();
    ASSERT_LT(static_cast<std::size_t>(column), pairs[0].size());
    const std::vector<std::string> arms = {"noise_injected+compensated", "ideal", "noise_injected"};
    int numbers = 0;
    for (std::size_t k = 1; k < pairs.size(); ++k) {
        const auto first = std::find(arms.begin(), arms.end(), pairs[k][0]) - arms.begin();
        const auto second = std::find(arms.begin(), arms.end(), pairs[k][1]) - arms.begin();
        const json& ratio =
            all["pairs"]["arw_ratio"]["values"].at(static_cast<std::size_t>(first))[static_cast<std::size_t>(second)];
        const std::string& cell = pairs[k][static_cast<std::size_t>(column)];
        EXPECT_EQ(cell.empty() ? json(nullptr) : json(std::stod(cell)), ratio) << pairs[k][0] << " " << pairs[k][1];
        numbers += cell.empty() ? 0 : 1;
    }
    EXPECT_GT(numbers, 0);

    const auto taus = rows_of(csv("study.h5", "allan"));
    EXPECT_EQ(taus.size(), 1 + 3 * all["arms"]["ideal"]["allan"]["tau_s"]["values"].size());
    EXPECT_EQ(rows_of(csv("study.h5", "allan-gyros")).size(), 1 + 3 * (taus.size() - 1));
    EXPECT_EQ(rows_of(csv("study.h5", "arms")).size(), 1U + 3U);
    EXPECT_THAT(csv("study.h5", "attributes"), HasSubstr("/,format,ringlock-result\n"));
    EXPECT_THAT(csv("study.h5", "scenario"), HasSubstr("lockin_threshold_deg_h"));
}

TEST_F(ExportCommand, TablesOfADesignNumberPointsAndTheirGyros) {
    write("design.toml", std::string(two_arms) +
                             "[design]\nkind = \"list\"\n[[design.vary]]\nkey = \"dither.peak_rate_deg_s\"\n"
                             "values = [100.0, 110.0]\n");
    ASSERT_EQ(run({"run", "design.toml", "-o", "design.h5", "-q"}).status, 0);
    const json all = json::parse(run({"export", "design.h5", "--json"}).out);
    const auto gyros = rows_of(run({"export", "design.h5", "--csv"}).out);
    ASSERT_EQ(gyros.size(), 1U + 3U * 2U * 3U);
    EXPECT_THAT(std::vector(gyros[0].begin(), gyros[0].begin() + 3), ElementsAre("arm", "point", "gyro"));
    EXPECT_THAT(std::vector(gyros[4].begin(), gyros[4].begin() + 3),
                ElementsAre("noise_injected+compensated", "2", "0"));
    const auto points = rows_of(csv("design.h5", "points"));
    ASSERT_EQ(points.size(), 1U + 3U * 2U);
    EXPECT_THAT(csv("design.h5", "points"), HasSubstr("dither.peak_rate_deg_s"));
    const auto angle = rows_of(csv("design.h5", "angle"));
    const auto& last = angle.back();
    EXPECT_EQ(last[1], "2");
    const std::size_t samples = all["arms"]["ideal"]["angle_arcsec"]["values"][0].size();
    const double interval_s = all["design"]["sample_interval_s"]["values"][1];
    EXPECT_DOUBLE_EQ(std::stod(last[3]), interval_s * static_cast<double>(samples - 1));
    // Averaging times of gyros are those of their point.
    const auto deviations = rows_of(csv("design.h5", "allan-gyros"));
    const json& taus = all["arms"]["noise_injected"]["allan"]["tau_s"]["values"];
    EXPECT_EQ(std::stod(deviations[1 + 3 * taus[0].size()][3]), taus[1][0]);
}

TEST_F(ExportCommand, RecordsAndReplaysAreTablesOfTheirRows) {
    make_files();
    const auto turns = rows_of(run({"export", "turns.h5", "--csv"}).out);
    EXPECT_THAT(turns[0], testing::Contains("quarter_count"));
    EXPECT_GT(turns.size(), 900U);
    const auto samples = rows_of(run({"export", "samples.h5", "--csv", "--table", "samples"}).out);
    EXPECT_THAT(samples[0], testing::Contains("angle_increment_arcsec"));
    const auto replay = rows_of(run({"export", "replay.h5", "--csv"}).out);
    // Names that several parts of the gyro have say whose they are.
    EXPECT_THAT(replay[0], AllOf(testing::Contains("time_s"), testing::Contains("truth.zero_rate_s"),
                                 testing::Contains("hardware.zero_rate_s"), testing::Contains("angle_arcsec")));
}

TEST_F(ExportCommand, PartsOfAFile) {
    write("study.toml", two_arms);
    ASSERT_EQ(run({"run", "study.toml", "-o", "study.h5", "-q"}).status, 0);
    const json part =
        json::parse(run({"export", "study.h5", "--json", "--only", "arms/ideal/noise", "--only", "/scenario"}).out);
    EXPECT_EQ(part.size(), 2U);
    EXPECT_TRUE(part.contains("scenario"));
    EXPECT_EQ(part["arms"].size(), 1U);
    EXPECT_EQ(part["arms"]["ideal"].size(), 1U);
    EXPECT_GT(part["arms"]["ideal"]["noise"].size(), 10U);
    expect_refused({"export", "study.h5", "--json", "--only", "arms/real"},
                   AllOf(HasSubstr("--only arms/real"), HasSubstr("/arms/ideal")));
}

TEST_F(ExportCommand, SaysWhatIsWrong) {
    write("study.toml", two_arms);
    ASSERT_EQ(run({"run", "study.toml", "-o", "study.h5", "-q"}).status, 0);
    expect_refused({"export", "study.h5"}, HasSubstr("none of --csv, --json, --matlab and --npz"));
    expect_refused({"export", "study.h5", "--csv", "--json"}, HasSubstr("several of --csv"));
    expect_refused({"export", "study.h5", "--npz"}, HasSubstr("binary file"));
    expect_refused({"export", "study.h5", "--matlab"}, HasSubstr("-o FILE.mat"));
    expect_refused({"export", "study.h5", "--csv", "-o", "study.toml"}, HasSubstr("must end in .csv"));
    expect_refused({"export", "study.h5", "--csv", "--table", "gyro"}, HasSubstr("it has gyros, arms"));
    expect_refused({"export", "study.h5", "--json", "--table", "gyros"}, HasSubstr("--table chooses"));
    expect_refused({"export", "study.toml", "--csv"}, HasSubstr("study.toml: is not a readable HDF5 file"));
    expect_refused({"export", "none.h5", "--csv"}, HasSubstr("none.h5"));
    expect_refused({"export", "study.h5", "--csv", "-o", "none/g.csv"}, HasSubstr("none"));
    ASSERT_EQ(run({"run", "study.toml", "-o", "part.h5", "--shard", "1/1", "-q"}).status, 0);
    expect_refused({"export", "part.h5.shard-1-of-1", "--csv"}, HasSubstr("ringlock merge"));
}

TEST_F(ExportCommand, AFullDiskLeavesNothing) {
    write("study.toml", two_arms);
    ASSERT_EQ(run({"run", "study.toml", "-o", "study.h5", "-q"}).status, 0);
    const auto before = left();
    const auto small_files = [] {
        const rlimit limit{2000, 2000};
        setrlimit(RLIMIT_FSIZE, &limit);
    };
    for (const auto& [option, ending] :
         {std::pair{"--csv", "csv"}, {"--json", "json"}, {"--matlab", "mat"}, {"--npz", "npz"}}) {
        const Outcome r = run({"export", "study.h5", option, "-o", std::string("x.") + ending}, small_files);
        EXPECT_EQ(r.status, 1) << option << ": " << r.err;
        EXPECT_THAT(r.err, HasSubstr("cannot be written")) << option;
        EXPECT_EQ(left(), before) << option;
    }
}

TEST_F(ExportCommand, EqualFilesMakeEqualExports) {
    write("study.toml", two_arms);
    ASSERT_EQ(run({"run", "study.toml", "-o", "study.h5", "-q"}).status, 0);
    for (const auto& [option, ending] :
         {std::pair{"--csv", "csv"}, {"--json", "json"}, {"--matlab", "mat"}, {"--npz", "npz"}}) {
        for (const char* name : {"a.", "b."}) {
            ASSERT_EQ(run({"export", "study.h5", option, "-o", std::string(name) + ending}).status, 0);
        }
        EXPECT_EQ(read(std::string("a.") + ending), read(std::string("b.") + ending)) << option;
    }
}

/// The lines of a block of code of README.md that begin with this word.
std::string readme_block(const std::string& language) {
    std::ifstream page(RINGLOCK_SOURCE_DIR "/README.md");
    std::string out;
    bool inside = false;
    for (std::string line; std::getline(page, line);) {
        if (line == "```" && inside) break;
        if (inside) out += line + "\n";
        if (line == "```" + language) inside = true;
    }
    return out;
}

TEST_F(ExportCommand, ThePythonOfReadmeReadsAResult) {
    const std::string code = readme_block("python");
    ASSERT_THAT(code, HasSubstr("h5py.File(\"out.h5\")"));
    EXPECT_THAT(readme_block("matlab"), HasSubstr("h5read('out.h5'"));
    if (std::system("/usr/bin/python3 -c 'import h5py' 2>/dev/null") != 0) GTEST_SKIP() << "needs h5py";
    ASSERT_EQ(run({"new", "-o", "s.toml"}).status, 0);
    ASSERT_EQ(
        run({"run", "s.toml", "-o", "out.h5", "-q", "--set", "ensemble.gyros=4", "--set", "ensemble.duration_s=4"})
            .status,
        0);
    write("read.py", code);
    EXPECT_EQ(std::system(fmt::format("cd '{}' && /usr/bin/python3 read.py >told 2>&1", directory_.string()).c_str()),
              0)
        << read("told");
    EXPECT_THAT(read("told"), HasSubstr("deg/sqrt(h)"));
}

}  // namespace
}  // namespace export_test
}  // namespace ringlock::test
