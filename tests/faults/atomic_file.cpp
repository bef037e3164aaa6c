#include "engine/store/atomic_file.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <fstream>

#include "engine/core/error.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/open_file.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock::store {
namespace atomic_file_test {
namespace {

using test::message_of;
using testing::AllOf;
using testing::HasSubstr;

const Label angle_label{"arcsec", "angle"};

TEST(AtomicFile, AppearsUnderItsNameOnCommitOnly) {
    const test::TemporaryDirectory directory;
    AtomicFile output(directory / "out.h5");
    output.file().write("angle", std::vector{1.0}, angle_label);
    EXPECT_FALSE(std::filesystem::exists(directory / "out.h5"));
    output.commit();
    EXPECT_EQ(directory.entries(), 1);
    EXPECT_EQ(test::open_file(directory / "out.h5").dataset("angle").read<double>().at(0), 1.0);
}

TEST(AtomicFile, WithoutCommitLeavesNothing) {
    const test::TemporaryDirectory directory;
    {
        AtomicFile output(directory / "out.h5");
        output.file().write("angle", std::vector{1.0}, angle_label);
        EXPECT_EQ(directory.entries(), 1);
    }
    EXPECT_EQ(directory.entries(), 0);
}

TEST(AtomicFile, AnOlderResultStaysUntilCommit) {
    const test::TemporaryDirectory directory;
    std::ofstream(directory / "out.h5") << "old";
    { const AtomicFile output(directory / "out.h5"); }
    EXPECT_EQ(std::filesystem::file_size(directory / "out.h5"), 3);
    AtomicFile(directory / "out.h5").commit();
    EXPECT_NO_THROW(test::open_file(directory / "out.h5"));
}

TEST(AtomicFile, OfTwoWritersOfOneTargetTheFirstWinsAndNothingIsLost) {
    const test::TemporaryDirectory directory;
    AtomicFile first(directory / "out.h5");
    AtomicFile second(directory / "out.h5");
    first.file().set_attribute("writer", 1);
    second.file().set_attribute("writer", 2);
    first.commit();
    EXPECT_THAT(message_of<RunError>([&] { second.commit(); }),
                AllOf(HasSubstr("out.h5: somebody has made it"), HasSubstr("it is kept"), HasSubstr(".ringlock-1")));
    EXPECT_EQ(test::open_file(directory / "out.h5").int_attribute("writer"), 1);
    EXPECT_EQ(test::open_file(directory / "out.h5.ringlock-1").int_attribute("writer"), 2);
    EXPECT_EQ(directory.entries(), 2);
}

TEST(AtomicFile, FollowsASymbolicLink) {
    const test::TemporaryDirectory directory;
    std::filesystem::create_directory(directory / "disk");
    std::filesystem::create_symlink(directory / "disk/out.h5", directory / "link.h5");
    AtomicFile(directory / "link.h5").commit();
    EXPECT_TRUE(std::filesystem::is_symlink(directory / "link.h5"));
    EXPECT_NO_THROW(test::open_file(directory / "disk/out.h5"));
}

TEST(AtomicFile, TargetsThatCannotBeWrittenAreRefusedAtOnce) {
    const test::TemporaryDirectory directory;
    EXPECT_THAT(message_of<InputError>([&] { AtomicFile(directory / "none/out.h5"); }),
                AllOf(HasSubstr("none/out.h5"), HasSubstr("No such file or directory"), HasSubstr("mkdir -p")));
    EXPECT_THAT(message_of<InputError>([&] { AtomicFile(directory.path()); }), HasSubstr("it is a directory"));
    EXPECT_THAT(message_of<InputError>([&] { AtomicFile("/dev/full"); }), HasSubstr("not a regular file"));
    EXPECT_THAT(message_of<InputError>([&] { AtomicFile(""); }), HasSubstr("empty"));
    std::ofstream(directory / "file") << "x";
    EXPECT_THAT(message_of<InputError>([&] { AtomicFile(directory / "file/out.h5"); }), HasSubstr("Not a directory"));
    EXPECT_THAT(message_of<InputError>([&] { AtomicFile(directory / std::string(300, 'x')); }),
                HasSubstr("shorter name"));
    EXPECT_EQ(directory.entries(), 1);
}

TEST(AtomicFile, ADirectoryWithoutPermissionIsRefused) {
    const test::TemporaryDirectory directory;
    namespace fs = std::filesystem;
    fs::permissions(directory.path(), fs::perms::owner_read | fs::perms::owner_exec | fs::perms::others_exec);
    const pid_t child = fork();
    if (child == 0) {
        // Root may write everywhere: be nobody.
        constexpr uid_t nobody = 65534;
        if (geteuid() == 0 && setuid(nobody) != 0) _exit(2);
        try {
            AtomicFile(directory / "out.h5");
            _exit(3);
        } catch (const InputError& error) {
            _exit(std::string(error.what()).find("Permission denied") != std::string::npos ? 0 : 4);
        }
    }
    int status = -1;
    waitpid(child, &status, 0);
    EXPECT_EQ(status, 0);
    fs::permissions(directory.path(), fs::perms::owner_all);
    EXPECT_EQ(directory.entries(), 0);
}

/// Runs `action` in a child process whose files may not grow beyond `bytes`; returns the child's wait status, where the
/// exit status is 0 if RunError was thrown with the system's reason.
template <class Action>
int with_full_disk(rlim_t bytes, Action action) {
    const pid_t child = fork();
    if (child == 0) {
        signal(SIGXFSZ, SIG_IGN);
        const rlimit limit{bytes, bytes};
        setrlimit(RLIMIT_FSIZE, &limit);
        int status = 1;
        try {
            action();
        } catch (const RunError& error) {
            status = std::string(error.what()).find("File too large") != std::string::npos ? 0 : 2;
        } catch (...) {
            status = 3;
        }
        exit(status);  // not _exit: HDF5's own end must survive the full disk too
    }
    int status = -1;
    waitpid(child, &status, 0);
    return status;
}

TEST(AtomicFile, AFullDiskIsARunErrorAndLeavesNothing) {
    const test::TemporaryDirectory directory;
    EXPECT_EQ(with_full_disk(100'000,
                             [&] {
                                 AtomicFile output(directory / "out.h5");
                                 output.file().write("angle", std::vector<double>(100'000), angle_label);
                                 output.commit();
                             }),
              0);
    EXPECT_EQ(directory.entries(), 0);
}

TEST(AtomicFile, AFullDiskShowsWhenSpaceIsReserved) {
    const test::TemporaryDirectory directory;
    EXPECT_EQ(with_full_disk(100'000,
                             [&] {
                                 AtomicFile output(directory / "out.h5");
                                 output.file().create_dataset<double>("angle", {1000, 1000}, angle_label);
                             }),
              0);
    EXPECT_EQ(directory.entries(), 0);
}

TEST(AtomicFile, AFullDiskShowsAtCommitAtTheLatest) {
    const test::TemporaryDirectory directory;
    EXPECT_EQ(with_full_disk(1'000,
                             [&] {
                                 AtomicFile output(directory / "out.h5");
                                 output.file().write("angle", std::vector<double>(10), angle_label);
                                 output.commit();
                             }),
              0);
    EXPECT_EQ(directory.entries(), 0);
}

}  // namespace
}  // namespace atomic_file_test
}  // namespace ringlock::store
