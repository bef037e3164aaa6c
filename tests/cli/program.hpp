#pragma once
#include <fcntl.h>
#include <gtest/gtest.h>
#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <functional>
#include <set>
#include <string>
#include <thread>
#include <vector>

/// Drives the real program in a directory of its own.
namespace ringlock::test {

struct Outcome {
    int status = -1;  ///< exit status; -1 where a signal ended it
    int signal = 0;   ///< that signal
    std::string out;
    std::string err;
};

class ProgramTest : public testing::Test {
   protected:
    void SetUp() override {
        const auto* info = testing::UnitTest::GetInstance()->current_test_info();
        directory_ = std::filesystem::temp_directory_path() / ("ringlock-" + std::string(info->test_suite_name()) +
                                                               "-" + info->name() + "-" + std::to_string(::getpid()));
        streams_ = directory_.string() + ".streams";
        std::filesystem::create_directories(directory_);
        std::filesystem::create_directories(streams_);
    }
    void TearDown() override {
        std::filesystem::remove_all(directory_);
        std::filesystem::remove_all(streams_);
    }

    using Arguments = std::vector<std::string>;
    /// What the child does before it becomes the program.
    using Prepare = std::function<void()>;

    /// Starts the program with the test's directory as its own.
    pid_t start(const Arguments& arguments, const Prepare& prepare = {}) const {
        std::vector<char*> argv;
        for (const std::string& word : launcher_) argv.push_back(const_cast<char*>(word.c_str()));
        argv.push_back(const_cast<char*>(launcher_.empty() ? "ringlock" : RINGLOCK_PROGRAM));
        for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
        argv.push_back(nullptr);
        const std::string out = (streams_ / "out").string();
        const std::string err = (streams_ / "err").string();
        const pid_t child = fork();
        if (child != 0) return child;
        if (chdir(directory_.c_str()) != 0) _exit(125);
        dup2(open("/dev/null", O_RDONLY), STDIN_FILENO);
        dup2(open(out.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644), STDOUT_FILENO);
        dup2(open(err.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0644), STDERR_FILENO);
        if (prepare) prepare();
        execvp(launcher_.empty() ? RINGLOCK_PROGRAM : argv.front(), argv.data());
        _exit(126);
    }
    Outcome finish(pid_t child) const {
        int raw = 0;
        waitpid(child, &raw, 0);
        Outcome outcome;
        if (WIFEXITED(raw)) outcome.status = WEXITSTATUS(raw);
        if (WIFSIGNALED(raw)) outcome.signal = WTERMSIG(raw);
        outcome.out = contents(streams_ / "out");
        outcome.err = contents(streams_ / "err");
        return outcome;
    }
    Outcome run(const Arguments& arguments, const Prepare& prepare = {}) const {
        return finish(start(arguments, prepare));
    }

    void write(const std::string& name, const std::string& text) const {
        std::ofstream(directory_ / name, std::ios::binary) << text;
    }
    static std::string contents(const std::filesystem::path& path) {
        std::ifstream in(path, std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    std::string read(const std::string& name) const { return contents(directory_ / name); }
    /// Names of what the directory holds.
    std::set<std::string> left() const {
        std::set<std::string> names;
        for (const auto& entry : std::filesystem::directory_iterator(directory_)) {
            names.insert(entry.path().filename().string());
        }
        return names;
    }
    /// Whether two files are equal but for their provenance, by the program that comes with HDF5 (hdf5-tools).
    bool same_results(const std::string& a, const std::string& b) const { return h5diff(a, b, {"/provenance"}) == 0; }
    static bool has_h5diff() { return std::system("h5diff --version >/dev/null 2>&1") == 0; }
    /// Exit status of h5diff with these parts of the files left out.
    int h5diff(const std::string& a, const std::string& b, const std::vector<std::string>& without) const {
        std::string command = "cd '" + directory_.string() + "' && h5diff -q";
        for (const std::string& part : without) command += " --exclude-path " + part;
        return std::system((command + " " + a + " " + b).c_str());
    }
    /// Waits until the condition holds; false after ten seconds.
    template <class Condition>
    static bool soon(Condition condition) {
        for (int i = 0; i < 1000; ++i) {
            if (condition()) return true;
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
        return false;
    }

    std::filesystem::path directory_;
    std::filesystem::path streams_;
    Arguments launcher_;  ///< what starts the program, as `mpirun -n 2` does; empty: the test itself
};

}  // namespace ringlock::test
