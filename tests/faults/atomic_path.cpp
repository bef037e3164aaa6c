#include "engine/core/atomic_path.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>
#include <vector>

#include "engine/core/error.hpp"
#include "engine/core/notice.hpp"
#include "tests/support/expect_throw.hpp"
#include "tests/support/temporary_directory.hpp"

// Files of somebody else: made, changed or left behind by others, they are not lost.
namespace ringlock {
namespace atomic_path_test {
namespace {

namespace fs = std::filesystem;
using test::message_of;
using testing::AllOf;
using testing::HasSubstr;

std::string read(const fs::path& path) {
    std::ifstream file(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(file), {}};
}

void write(const fs::path& path, const std::string& text) { std::ofstream(path, std::ios::binary) << text; }

mode_t mode_of(const fs::path& path) {
    struct stat status = {};
    EXPECT_EQ(stat(path.c_str(), &status), 0) << path;
    return status.st_mode & 07777;
}

/// Takes the notices as long as it lives.
class Notices {
   public:
    Notices() {
        set_notice_sink([this](std::string_view text) { taken_.emplace_back(text); });
    }
    ~Notices() { set_notice_sink({}); }
    Notices(const Notices&) = delete;
    Notices& operator=(const Notices&) = delete;
    const std::vector<std::string>& taken() const { return taken_; }

   private:
    std::vector<std::string> taken_;
};

class AtomicPathTest : public testing::Test {
   protected:
    const test::TemporaryDirectory directory_;
    const fs::path target_ = directory_ / "out.txt";

    /// Commits "new" and returns what it is told where that is refused.
    std::string refusal_of(AtomicPath& path) const {
        return message_of<RunError>([&] { write_text(path, "new"); });
    }
    /// The partial file that a process leaves that is killed; it has been waited for.
    fs::path partial_of_a_killed_process() const {
        const pid_t child = fork();
        if (child == 0) {
            const AtomicPath path(target_);
            if (write_all(path.descriptor(), "half") != 0) _exit(1);
            _exit(0);  // no destructor runs
        }
        int status = -1;
        waitpid(child, &status, 0);
        EXPECT_EQ(status, 0);
        for (const auto& entry : fs::directory_iterator(directory_.path())) {
            if (entry.path().string().find(std::to_string(child)) != std::string::npos) return entry.path();
        }
        ADD_FAILURE() << "no partial file of " << child;
        return {};
    }
};

TEST_F(AtomicPathTest, AFileMadeMeanwhileIsKept) {
    AtomicPath path(target_);
    write(target_, "theirs");
    EXPECT_THAT(refusal_of(path), AllOf(HasSubstr(target_.string()), HasSubstr("somebody has made it"),
                                        HasSubstr(target_.string() + ".ringlock-1")));
    EXPECT_EQ(read(target_), "theirs");
    EXPECT_EQ(read(target_.string() + ".ringlock-1"), "new");
    EXPECT_EQ(directory_.entries(), 2);
}

TEST_F(AtomicPathTest, AFileChangedMeanwhileIsKept) {
    write(target_, "old");
    AtomicPath path(target_);
    write(target_, "theirs");
    EXPECT_THAT(refusal_of(path), HasSubstr("changed or replaced it"));
    EXPECT_EQ(read(target_), "theirs");
    EXPECT_EQ(read(target_.string() + ".ringlock-1"), "new");
}

TEST_F(AtomicPathTest, AFileReplacedMeanwhileIsKept) {
    write(target_, "old");
    AtomicPath path(target_);
    write(directory_ / "other", "old");
    fs::rename(directory_ / "other", target_);
    write(target_.string() + ".ringlock-1", "somebody's too");
    EXPECT_THAT(refusal_of(path), HasSubstr(".ringlock-2"));
    EXPECT_EQ(read(target_), "old");
    EXPECT_EQ(read(target_.string() + ".ringlock-1"), "somebody's too");
    EXPECT_EQ(read(target_.string() + ".ringlock-2"), "new");
    EXPECT_EQ(directory_.entries(), 3);
}

TEST_F(AtomicPathTest, AFileRemovedMeanwhileIsNobodys) {
    write(target_, "old");
    AtomicPath path(target_);
    fs::remove(target_);
    write_text(path, "new");
    EXPECT_EQ(read(target_), "new");
    EXPECT_EQ(directory_.entries(), 1);
}

TEST_F(AtomicPathTest, AFileThatStayedAsItWasIsReplaced) {
    write(target_, "old");
    AtomicPath path(target_);
    write_text(path, "new");
    EXPECT_EQ(read(target_), "new");
    EXPECT_EQ(directory_.entries(), 1);
}

TEST_F(AtomicPathTest, TheModeOfAReplacedFileStays) {
    for (const mode_t mode : {0600, 0640, 0666, 0755}) {
        write(target_, "old");
        ASSERT_EQ(chmod(target_.c_str(), mode), 0);
        AtomicPath path(target_);
        EXPECT_EQ(mode_of(path.partial()), 0600U) << "others may not read it before its mode is known";
        write_text(path, "new");
        EXPECT_EQ(mode_of(target_), mode);
        EXPECT_EQ(read(target_), "new");
    }
}

TEST_F(AtomicPathTest, ANewFileHasTheModeThatTheUserAsksFor) {
    const mode_t before = umask(027);
    write_text(target_, "new");
    umask(before);
    EXPECT_EQ(mode_of(target_), 0640U);
}

TEST_F(AtomicPathTest, TheOwnerOfAReplacedFileStaysWherePermitted) {
    if (geteuid() != 0) GTEST_SKIP() << "only root may give files away";
    write(target_, "old");
    ASSERT_EQ(chown(target_.c_str(), 4321, 1234), 0);
    write_text(target_, "new");
    struct stat status = {};
    ASSERT_EQ(stat(target_.c_str(), &status), 0);
    EXPECT_EQ(status.st_uid, 4321U);
    EXPECT_EQ(status.st_gid, 1234U);
}

TEST_F(AtomicPathTest, ALinkInThePlaceOfThePartialFileIsNotFollowed) {
    const fs::path partial = AtomicPath(target_).partial();
    write(directory_ / "victim", "precious");
    fs::create_symlink(directory_ / "victim", partial);
    {
        AtomicPath path(target_);
        EXPECT_NE(path.partial(), partial);
        write_text(path, "new");
    }
    EXPECT_EQ(read(directory_ / "victim"), "precious");
    EXPECT_EQ(read(target_), "new");
}

TEST_F(AtomicPathTest, APartialFileThatSomebodyReplacedIsNotTaken) {
    write(directory_ / "victim", "precious");
    fs::path partial;
    {
        AtomicPath path(target_);
        partial = path.partial();
        fs::remove(partial);
        fs::create_symlink(directory_ / "victim", partial);
        EXPECT_THAT(refusal_of(path), HasSubstr("removed or replaced"));
    }
    EXPECT_FALSE(fs::exists(target_));
    EXPECT_EQ(read(directory_ / "victim"), "precious");
    EXPECT_TRUE(fs::is_symlink(partial)) << "it is somebody else's";
}

TEST_F(AtomicPathTest, WhatAKilledRunLeftIsRemovedAndTold) {
    const fs::path left = partial_of_a_killed_process();
    ASSERT_TRUE(fs::exists(left));
    const Notices notices;
    const AtomicPath path(target_);
    EXPECT_FALSE(fs::exists(left));
    EXPECT_THAT(notices.taken(), testing::ElementsAre(AllOf(HasSubstr("removed"), HasSubstr(left.string()))));
}

TEST_F(AtomicPathTest, PartialFilesOfOthersStay) {
    const std::string dead = partial_of_a_killed_process().string();
    const std::string name = dead.substr(target_.string().size());  // ".PID-0@HOST.partial"
    const std::string at_host = name.substr(name.find('@'));
    fs::remove(dead);
    const std::vector<fs::path> others = {
        directory_ / ("other.txt" + name),                                    // of another target
        target_.string() + name.substr(0, name.find('@')) + "@else.partial",  // of another machine
        target_.string() + "." + std::to_string(getpid()) + "-77" + at_host,  // of a process that lives
        target_.string() + ".x" + name,                                       // of a target whose name is longer
        target_.string() + ".12x-0" + at_host,                                // of nobody
        target_.string() + ".-12-0" + at_host};
    for (const fs::path& other : others) write(other, "theirs");
    fs::create_directory(dead);  // a folder by that name
    const Notices notices;
    const AtomicPath path(target_);
    for (const fs::path& other : others) EXPECT_EQ(read(other), "theirs") << other;
    EXPECT_TRUE(fs::is_directory(dead));
    EXPECT_THAT(notices.taken(), testing::IsEmpty());
}

// Another container has another process of that number: it is the lock that shows that it lives.
TEST_F(AtomicPathTest, APartialFileThatSomebodyHoldsStays) {
    const fs::path left = partial_of_a_killed_process();
    const Descriptor held(open(left.c_str(), O_RDWR | O_CLOEXEC));
    struct flock whole = {};
    whole.l_type = F_WRLCK;
    whole.l_whence = SEEK_SET;
    if (fcntl(held.get(), F_OFD_SETLK, &whole) != 0) GTEST_SKIP() << "no locks on this file system";
    const Notices notices;
    const AtomicPath path(target_);
    EXPECT_TRUE(fs::exists(left));
    EXPECT_THAT(notices.taken(), testing::IsEmpty());
}

TEST_F(AtomicPathTest, ALinkByTheNameOfAPartialFileStays) {
    const fs::path left = partial_of_a_killed_process();
    fs::remove(left);
    write(directory_ / "victim", "precious");
    fs::create_symlink(directory_ / "victim", left);
    const AtomicPath path(target_);
    EXPECT_TRUE(fs::is_symlink(left));
    EXPECT_EQ(read(directory_ / "victim"), "precious");
}

}  // namespace
}  // namespace atomic_path_test
}  // namespace ringlock
