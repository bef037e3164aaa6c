// The program in a terminal: version, help and its examples, manual pages, completion in shells, colours, and tables
// that fit a window.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <pty.h>
#include <unistd.h>

#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <string>
#include <vector>

#include "tests/cli/program.hpp"

namespace ringlock::test {
namespace terminal_test {
namespace {

namespace fs = std::filesystem;
using testing::AllOf;
using testing::Contains;
using testing::HasSubstr;
using testing::IsSupersetOf;
using testing::Not;
using testing::StartsWith;

constexpr std::size_t window_columns = 100;

std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> lines;
    std::istringstream in(text);
    for (std::string line; std::getline(in, line);) lines.push_back(line);
    return lines;
}

/// Lines that are wider than a window, in characters.
std::vector<std::string> wide_lines(const std::string& text) {
    std::vector<std::string> wide;
    for (const std::string& line : lines_of(text)) {
        const auto bytes_within = std::count_if(line.begin(), line.end(),
                                                [](char c) { return (static_cast<unsigned char>(c) & 0xc0) == 0x80; });
        if (line.size() - static_cast<std::size_t>(bytes_within) > window_columns) wide.push_back(line);
    }
    return wide;
}

class Terminal : public ProgramTest {
   protected:
    std::vector<std::string> commands() const {
        std::vector<std::string> names;
        bool listed = false;
        for (const std::string& line : lines_of(run({"--help"}).out)) {
            if (line == "Subcommands:") listed = true;
            if (listed && line.size() > 2 && line.starts_with("  ") && line[2] != ' ') {
                names.push_back(line.substr(2, line.find(' ', 2) - 2));
            }
        }
        EXPECT_THAT(names, IsSupersetOf({"run", "allan", "export", "man"}));
        return names;
    }
    /// Exit status of a command of a shell, in the test's folder, with the program in PATH; its output in told().
    int shell(const std::string& command) const {
        const std::string folder = fs::path(RINGLOCK_PROGRAM).parent_path().string();
        write("command.sh", command + "\n");
        const int status = std::system(
            fmt::format("cd '{}' && PATH='{}':\"$PATH\" sh command.sh >told 2>&1", directory_.string(), folder)
                .c_str());
        return WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    }
    std::string told() const { return read("told"); }
    bool has(const std::string& program) const { return shell("command -v " + program) == 0; }

    /// Standard error of the program on a terminal.
    std::string on_terminal(const Arguments& arguments, const std::string& no_color, const std::string& term) const {
        int mine = -1;
        int theirs = -1;
        if (openpty(&mine, &theirs, nullptr, nullptr, nullptr) != 0) return "no terminal";
        const pid_t child = start(arguments, [&] {
            dup2(theirs, STDERR_FILENO);
            setenv("NO_COLOR", no_color.c_str(), 1);
            setenv("TERM", term.c_str(), 1);
        });
        close(theirs);
        std::string out;
        char buffer[4096];
        for (ssize_t n = 0; (n = ::read(mine, buffer, sizeof buffer)) > 0;)
            out.append(buffer, static_cast<std::size_t>(n));
        close(mine);
        finish(child);
        return out;
    }
};

TEST_F(Terminal, VersionNamesBuildAndLibraries) {
    const Outcome r = run({"--version"});
    EXPECT_EQ(r.status, 0) << r.err;
    const auto lines = lines_of(r.out);
    EXPECT_THAT(lines[0], testing::MatchesRegex("ringlock [0-9]+\\.[0-9]+\\.[0-9]+ \\(.+\\)"));
    EXPECT_THAT(r.out, AllOf(HasSubstr("GCC "), HasSubstr("HDF5 1."), HasSubstr("oneTBB 202"), HasSubstr("Eigen 3."),
                             HasSubstr("instruction sets"), HasSubstr("(in use)"), HasSubstr("MPI"), HasSubstr("SVG")));
    EXPECT_THAT(wide_lines(r.out), testing::IsEmpty());
    // Without gnuplot in PATH it says so.
    const Outcome bare = run({"--version"}, [] { setenv("PATH", "/nonexistent", 1); });
    EXPECT_EQ(bare.status, 0);
    EXPECT_THAT(bare.out, HasSubstr("no gnuplot found"));
}

TEST_F(Terminal, HelpFitsAWindowAndHasExamples) {
    EXPECT_THAT(wide_lines(run({"--help"}).out), testing::IsEmpty());
    for (const std::string& command : commands()) {
        const Outcome r = run({command, "--help"});
        EXPECT_EQ(r.status, 0);
        EXPECT_THAT(wide_lines(r.out), testing::IsEmpty()) << command;
        EXPECT_THAT(r.out, HasSubstr("\n  ringlock " + command)) << command << " has no example";
        EXPECT_THAT(r.out, HasSubstr("\nExit status: ")) << command;
        EXPECT_THAT(r.out, Not(HasSubstr(" TEXT"))) << command << ": an option without a placeholder";
    }
}

class LongTerminal : public Terminal {};

TEST_F(LongTerminal, EveryExampleOfTheHelpRuns) {
    write("study.toml",
          "[ensemble]\nduration_s = 8\ngyros = 2\n[arms]\nnames = [\"uncompensated\", \"noise_injected\"]\n");
    std::string log = "t,gx,gy\n";
    for (int i = 0; i < 4000; ++i) {
        log += fmt::format("{},{},{}\n", i / 200.0, 1e-5 * std::sin(i * i), 1e-5 * std::cos(i * i));
    }
    write("log.csv", log);
    // What the examples of other commands make.
    for (const Arguments& before : {Arguments{"run", "study.toml", "-o", "out.h5", "-q"},
                                    {"record", "study.toml", "-o", "turns.h5"},
                                    {"record", "study.toml", "-o", "gyro.h5", "--set", "record.kind=samples"},
                                    {"run", "study.toml", "-o", "lot.h5", "--shard", "1/2", "-q"},
                                    {"run", "study.toml", "-o", "lot.h5", "--shard", "2/2", "-q"}}) {
        const Outcome r = run(before);
        ASSERT_EQ(r.status, 0) << before[0] << ": " << r.err;
    }
    int examples = 0;
    for (const std::string& command : commands()) {
        for (const std::string& line : lines_of(run({command, "--help"}).out)) {
            if (!line.starts_with("  ringlock ")) continue;
            ++examples;
            EXPECT_EQ(shell(line), 0) << line << "\n" << told();
        }
    }
    EXPECT_GT(examples, 25);
}

TEST_F(Terminal, ManualPagesAreWithoutFault) {
    ASSERT_EQ(run({"man", "--all", "pages"}).status, 0);
    std::set<std::string> names;
    for (const auto& entry : fs::directory_iterator(directory_ / "pages/man1")) {
        names.insert(entry.path().filename().string());
    }
    EXPECT_THAT(names, Contains("ringlock.1"));
    for (const std::string& command : commands()) {
        EXPECT_THAT(names, Contains("ringlock-" + command + ".1"));
        const Outcome r = run({"man", command});
        EXPECT_EQ(r.out, read("pages/man1/ringlock-" + command + ".1"));
        EXPECT_THAT(r.out, AllOf(HasSubstr(".SH NAME\nringlock\\-" + command + " \\- "), HasSubstr(".SH EXAMPLES\n")));
    }
    EXPECT_THAT(read("pages/man5/ringlock-scenario.5"), HasSubstr("lockin_threshold_deg_h"));
    EXPECT_EQ(run({"man", "nothing"}).status, 2);
    bool tried = false;
    if (has("mandoc")) {
        tried = true;
        EXPECT_EQ(shell("mandoc -Tlint -W warning pages/man1/* pages/man5/*"), 0) << told();
        EXPECT_EQ(told(), "");
    }
    if (has("man")) {
        tried = true;
        EXPECT_EQ(shell("for page in pages/man*/*; do LC_ALL=C.UTF-8 MANROFFSEQ='' MANWIDTH=80 "
                        "man --warnings -E UTF-8 -l -Tutf8 -Z \"./$page\" >/dev/null || exit; done"),
                  0);
        EXPECT_EQ(told(), "");
    }
    if (!tried) GTEST_SKIP() << "needs mandoc or man to try the pages";
}

TEST_F(Terminal, BashCompletes) {
    const Outcome script = run({"completion", "bash"});
    ASSERT_EQ(script.status, 0) << script.err;
    write("complete.bash", script.out);
    write("study.toml", "");
    write("out.h5", "");
    fs::create_directory(directory_ / "folder");
    if (!has("bash")) GTEST_SKIP() << "needs bash";
    // Words as bash divides them: "=" is one of its own.
    const auto completed = [&](const std::vector<std::string>& words) {
        std::string quoted;
        for (const std::string& word : words) quoted += " '" + word + "'";
        write("try.bash", fmt::format("set -u\nsource complete.bash\ncomplete -p ringlock >/dev/null\n"
                                      "COMP_WORDS=({})\nCOMP_CWORD={}\n_ringlock 2>/dev/null\n"
                                      "[[ ${{#COMPREPLY[@]}} -eq 0 ]] || printf '%s\\n' \"${{COMPREPLY[@]}}\"\n",
                                      quoted, words.size() - 1));
        EXPECT_EQ(shell("bash --norc try.bash"), 0) << told();
        return lines_of(told());
    };
    EXPECT_THAT(completed({"ringlock", "re"}), IsSupersetOf({"record", "replay"}));
    EXPECT_THAT(completed({"ringlock", "--v"}), testing::ElementsAre("--version"));
    EXPECT_THAT(completed({"ringlock", "run", "--ch"}), testing::ElementsAre("--checkpoint-every"));
    EXPECT_THAT(completed({"ringlock", "run", "s"}), testing::ElementsAre("study.toml"));
    EXPECT_THAT(completed({"ringlock", "analyze", ""}),
                AllOf(Contains("out.h5"), Contains("folder"), Not(Contains("study.toml"))));
    EXPECT_THAT(completed({"ringlock", "allan", "--kind", "i"}), testing::ElementsAre("increment"));
    EXPECT_THAT(completed({"ringlock", "allan", "--kind", "=", "p"}), testing::ElementsAre("phase"));
    EXPECT_THAT(completed({"ringlock", "allan", "--kind", "="}), IsSupersetOf({"phase", "increment", "rate"}));
    EXPECT_THAT(completed({"ringlock", "allan", "--dev", "ht"}), testing::ElementsAre("htotdev"));
    EXPECT_THAT(completed({"ringlock", "replay", "--arm", "noise_injected+compensated_t"}),
                testing::ElementsAre("noise_injected+compensated_two_train"));
    EXPECT_THAT(completed({"ringlock", "new", "triangle-5"}), testing::ElementsAre("triangle-51mm", "triangle-53mm"));
    EXPECT_THAT(completed({"ringlock", "run", "--set", "noise_injection.m"}),
                IsSupersetOf({"noise_injection.model=", "noise_injection.modulation_hz="}));
    EXPECT_THAT(completed({"ringlock", "run", "--set", "noise_injection.model", "=", "d"}),
                testing::ElementsAre("drive"));
    EXPECT_THAT(completed({"ringlock", "run", "--set", "output.angle_record", "="}),
                testing::ElementsAre("true", "false"));
    EXPECT_THAT(completed({"ringlock", "run", "--set", "device", "=", "square-5"}),
                testing::ElementsAre("square-50mm"));
    EXPECT_THAT(completed({"ringlock", "run", "--print-schema", "=", "j"}), testing::ElementsAre("json"));
    EXPECT_THAT(completed({"ringlock", "closure", "-o", "f"}), testing::ElementsAre("folder"));
    EXPECT_THAT(completed({"ringlock", "man", "sc"}), testing::ElementsAre("scenario"));
    if (has("shellcheck")) {
        EXPECT_EQ(shell("shellcheck complete.bash"), 0) << told();
    }
}

TEST_F(Terminal, ZshAndFishComplete) {
    for (const char* name : {"zsh", "fish"}) {
        const Outcome script = run({"completion", name});
        ASSERT_EQ(script.status, 0) << script.err;
        write(std::string("complete.") + name, script.out);
        for (const std::string& command : commands()) EXPECT_THAT(script.out, HasSubstr(command));
        EXPECT_THAT(script.out,
                    AllOf(HasSubstr("noise_injection.model"), HasSubstr("triangle-51mm"), HasSubstr("htotdev")));
    }
    EXPECT_EQ(run({"completion", "sh"}).status, 2);
    std::string missing;
    if (has("zsh")) {
        EXPECT_EQ(shell("zsh -n complete.zsh"), 0) << told();
    } else {
        missing += " zsh";
    }
    if (has("fish")) {
        const auto completed = [&](const std::string& line) {
            EXPECT_EQ(shell("HOME=. XDG_CONFIG_HOME=. XDG_DATA_HOME=. fish --no-config -c \"source complete.fish; "
                            "complete -C '" +
                            line + "'\""),
                      0)
                << told();
            return told();
        };
        EXPECT_THAT(completed("ringlock re"), AllOf(HasSubstr("record\t"), HasSubstr("replay\t")));
        EXPECT_THAT(completed("ringlock allan --kind i"), HasSubstr("increment"));
        EXPECT_THAT(completed("ringlock run --set noise_injection.model="), HasSubstr("noise_injection.model=drive"));
        EXPECT_THAT(completed("ringlock new triangle-5"), HasSubstr("triangle-53mm"));
    } else {
        missing += " fish";
    }
    if (!missing.empty()) GTEST_SKIP() << "not tried, since it is not installed:" << missing;
}

TEST_F(Terminal, ErrorsHaveAColourWhereItIsWanted) {
    const Arguments wrong = {"validate", "none.toml"};
    EXPECT_THAT(on_terminal(wrong, "", "xterm"), StartsWith("ringlock: \x1b[1;31merror:\x1b[0m none.toml"));
    EXPECT_THAT(on_terminal({"validate", "--nothing"}, "", "xterm"), StartsWith("ringlock: \x1b[1;31merror:\x1b[0m "));
    EXPECT_THAT(on_terminal(wrong, "1", "xterm"), StartsWith("ringlock: error: none.toml"));
    EXPECT_THAT(on_terminal(wrong, "", "dumb"), StartsWith("ringlock: error: none.toml"));
    EXPECT_THAT(run(wrong, [] { setenv("TERM", "xterm", 1); }).err, StartsWith("ringlock: error: none.toml"));
}

/// Lines of run, analyze and status that a window does not hold, of a scenario that is made short.
class Tables : public Terminal {
   protected:
    void look(const std::string& what, const Arguments& arguments) {
        const Outcome r = run(arguments);
        EXPECT_EQ(r.status, 0) << what << ": " << r.err;
        for (const std::string& line : wide_lines(r.out)) wide_.push_back(what + ": " + line);
    }
    void look_at_scenario(const std::string& name) {
        const std::string file = RINGLOCK_SOURCE_DIR "/scenarios/" + name + ".toml";
        Arguments command = {"run", file, "-o", name + ".h5", "-q"};
        // Averaging times of the file are too long for a short record.
        for (const char* setting :
             {"ensemble.gyros=2", "ensemble.duration_s=6", "output.sample_interval_s=0.1", "output.tau_s=[1.0]",
              "output.angle_after_s=[2.0]", "specification.at_s=1", "specification.after_s=2"}) {
            command.insert(command.end(), {"--set", setting});
        }
        if (contents(file).find("sweep_points") != std::string::npos) {
            command.insert(command.end(), {"--set", "input.sweep_points=5"});
        }
        look(name, command);
        look("analyze " + name, {"analyze", name + ".h5"});
        look("status " + name, {"status", name + ".h5"});
    }

    std::vector<std::string> wide_;
};
class LongTables : public Tables {};

TEST_F(Tables, OfDevicesAndASweepFitAWindow) {
    look("devices", {"devices"});
    look_at_scenario("gao-deng-2007-coefficients");
    look_at_scenario("gao-deng-2007");
    EXPECT_THAT(wide_, testing::IsEmpty());
}

TEST_F(LongTables, OfStandardScenariosFitAWindow) {
    // Designs of many points take minutes even when short; lot-yield prints the same kinds of tables.
    const std::set<std::string> many_points = {"how-much-noise", "how-much-noise-rates", "lot-yield-keys"};
    for (const auto& entry : fs::directory_iterator(RINGLOCK_SOURCE_DIR "/scenarios")) {
        const std::string name = entry.path().stem().string();
        if (entry.path().extension() == ".toml" && !many_points.contains(name)) look_at_scenario(name);
    }
    look("demo", {"run", RINGLOCK_SOURCE_DIR "/scenarios/gao-deng-2007.toml", "-o", "demo.h5", "-q"});
    EXPECT_THAT(wide_, testing::IsEmpty());
}

}  // namespace
}  // namespace terminal_test
}  // namespace ringlock::test
