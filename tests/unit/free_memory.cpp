#include "engine/core/free_memory.hpp"

#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "tests/support/temporary_directory.hpp"

namespace ringlock {
namespace free_memory_test {
namespace {

namespace fs = std::filesystem;

constexpr std::uint64_t mib = std::uint64_t{1} << 20;

/// A machine made of files: 1000 MiB are available.
class FreeMemory : public testing::Test {
   protected:
    void SetUp() override {
        write("proc/meminfo", "MemTotal:       4096000 kB\nMemFree:         102400 kB\nMemAvailable:   1024000 kB\n");
    }
    void write(const std::string& name, const std::string& text) const {
        fs::create_directories((root_ / name).parent_path());
        std::ofstream(root_ / name) << text;
    }
    void group_2(const std::string& group, const std::string& most, std::uint64_t current, std::uint64_t cached) const {
        const std::string folder = "sys/fs/cgroup" + group;
        write(folder + "/memory.max", most + "\n");
        write(folder + "/memory.current", std::to_string(current) + "\n");
        write(folder + "/memory.stat", "anon 1\nfile 2\ninactive_file " + std::to_string(cached / 2) +
                                           "\nactive_file " + std::to_string(cached - cached / 2) + "\n");
    }
    std::uint64_t found() const { return free_memory_bytes(root_.path()); }

    const test::TemporaryDirectory root_;
};

TEST_F(FreeMemory, WithoutGroupsItIsWhatTheMachineHasAvailable) { EXPECT_EQ(found(), 1000 * mib); }

TEST_F(FreeMemory, AGroupOfVersion2LeavesItsLimitLessWhatItCannotDrop) {
    write("proc/self/cgroup", "0::/user/job\n");
    group_2("/user/job", std::to_string(500 * mib), 300 * mib, 100 * mib);
    EXPECT_EQ(found(), 300 * mib);
}

TEST_F(FreeMemory, GroupsAboveCountAndOnesWithoutALimitDoNot) {
    write("proc/self/cgroup", "0::/user/job\n");
    group_2("/user/job", "max", 300 * mib, 0);
    EXPECT_EQ(found(), 1000 * mib);
    group_2("/user", std::to_string(400 * mib), 350 * mib, 0);
    EXPECT_EQ(found(), 50 * mib);
    group_2("/user", std::to_string(400 * mib), 450 * mib, 0);
    EXPECT_EQ(found(), 0U);
}

TEST_F(FreeMemory, AContainerSeesItsOwnGroupAsTheTopmost) {
    write("proc/self/cgroup", "0::/../elsewhere\n");
    group_2("", std::to_string(200 * mib), 50 * mib, 0);
    EXPECT_EQ(found(), 150 * mib);
}

TEST_F(FreeMemory, AGroupOfVersion1IsFoundByItsController) {
    write("proc/self/cgroup", "12:pids:/a\n5:cpu,memory:/job\n0::/\n");
    write("sys/fs/cgroup/memory/job/memory.limit_in_bytes", std::to_string(600 * mib));
    write("sys/fs/cgroup/memory/job/memory.usage_in_bytes", std::to_string(200 * mib));
    write("sys/fs/cgroup/memory/job/memory.stat",
          "cache 7\ntotal_inactive_file " + std::to_string(10 * mib) + "\ntotal_active_file 0\n");
    write("sys/fs/cgroup/memory/memory.limit_in_bytes", "9223372036854771712");
    write("sys/fs/cgroup/memory/memory.usage_in_bytes", std::to_string(900 * mib));
    EXPECT_EQ(found(), 410 * mib);
}

TEST_F(FreeMemory, TheLimitOfTheProcessCounts) {
    write("proc/self/statm", "25600 10 10 1 0 10 0\n");
    const std::uint64_t taken = 25600 * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
    const pid_t child = fork();
    if (child == 0) {
        const rlimit limit{taken + 77 * mib, taken + 77 * mib};
        if (setrlimit(RLIMIT_AS, &limit) != 0) _exit(2);
        _exit(found() == 77 * mib ? 0 : 1);
    }
    int status = -1;
    waitpid(child, &status, 0);
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    EXPECT_EQ(status, 0);
#endif
}

TEST(FreeMemoryOfThisMachine, IsThereAndNotMoreThanTheMachineHas) {
    const auto all =
        static_cast<std::uint64_t>(sysconf(_SC_PHYS_PAGES)) * static_cast<std::uint64_t>(sysconf(_SC_PAGESIZE));
    EXPECT_GT(free_memory_bytes(), mib);
    EXPECT_LE(free_memory_bytes(), all);
}

}  // namespace
}  // namespace free_memory_test
}  // namespace ringlock
