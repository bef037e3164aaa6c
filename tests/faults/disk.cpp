#include <gmock/gmock.h>
#include <signal.h>
#include <stdlib.h>

#include <cerrno>
#include <chrono>
#include <filesystem>
#include <fstream>
#include <set>
#include <string>
#include <thread>

#include "tests/cli/program.hpp"

// Disks that refuse while a run goes on, clocks that are set, files that rot. Calls of the system fail as they would
// then (tests/support/disk_faults.cpp), so that no privileges are needed. Nothing that was finished may be lost without
// a word, and whatever is written is what an undisturbed run writes.
namespace ringlock {
namespace disk_test {
namespace {

namespace fs = std::filesystem;
using test::Outcome;
using testing::AllOf;
using testing::HasSubstr;
using testing::Not;

class Disk : public test::ProgramTest {
   protected:
    void SetUp() override {
        ProgramTest::SetUp();
        make_studies("5", "[arms]\nnames = [\"uncompensated\"]\n");
    }

    /// Two studies and their results; with 20 s of the usual arms they run long enough to be interrupted.
    void make_studies(const std::string& duration_s, const std::string& arms = "") {
        const std::string ensemble = arms + "[ensemble]\ngyros = 70\nduration_s = " + duration_s + "\n";
        write("records.toml", ensemble);
        write("statistics.toml", ensemble + "[output]\nangle_record = false\n");
        fs::remove(directory_ / "records.h5");
        fs::remove(directory_ / "statistics.h5");
        ASSERT_EQ(run({"run", "records.toml", "-o", "records.h5", "--checkpoint-every", "never"}).status, 0);
        ASSERT_EQ(run({"run", "statistics.toml", "-o", "statistics.h5", "--checkpoint-every", "never"}).status, 0);
    }

    static Prepare with(const std::string& faults) {
        return [faults] {
            setenv("LD_PRELOAD", RINGLOCK_DISK_FAULTS, 1);
            setenv("RINGLOCK_FAULTS", faults.c_str(), 1);
        };
    }
    static std::string fault(const std::string& call, int error, const std::string& part, int skip, int count) {
        return call + ":" + std::to_string(error) + ":" + part + ":" + std::to_string(skip) + ":" +
               std::to_string(count) + ";";
    }
    Arguments command(const std::string& what, const std::string& more = "-q") const {
        return {"run", what + ".toml", "-o", "out.h5", "--checkpoint-every", "0", more};
    }
    void expect_right(const std::string& what) {
        EXPECT_TRUE(same_results(what + ".h5", "out.h5"));
        EXPECT_FALSE(fs::exists(directory_ / "out.h5.parts"));
        EXPECT_FALSE(has_partial());
        fs::remove(directory_ / "out.h5");
    }
    bool has_partial() const {
        for (const std::string& name : left()) {
            if (name.find(".partial") != std::string::npos) return true;
        }
        return false;
    }
    void resume_and_expect_right(const std::string& what) {
        const Outcome r = run(command(what, "--resume"));
        EXPECT_EQ(r.status, 0) << r.err;
        expect_right(what);
    }
};

TEST_F(Disk, ThatIsFullForAWhileMakesTheRunWait) {
    for (const char* const what : {"records", "statistics"}) {
        for (const int error : {ENOSPC, EIO}) {
            for (const int skip : {0, 3}) {
                SCOPED_TRACE(std::string(what) + " " + std::to_string(error) + " " + std::to_string(skip));
                const Outcome r = run(command(what), with(fault("write", error, ".part.partial", skip, 1)));
                EXPECT_EQ(r.status, 0) << r.err;
                EXPECT_THAT(r.err, AllOf(HasSubstr("cannot be written"), HasSubstr("the run waits")));
                expect_right(what);
            }
        }
    }
}

TEST_F(Disk, ThatDoesNotSyncOnceIsWrittenToAgain) {
    for (const char* const what : {"records", "statistics"}) {
        const Outcome r = run(command(what), with(fault("fsync", EIO, ".part.partial", 1, 1)));
        EXPECT_EQ(r.status, 0) << r.err;
        EXPECT_THAT(r.err, HasSubstr("cannot be brought to the disk"));
        expect_right(what);
    }
}

TEST_F(Disk, ThatDoesNotRenameOrOpenForAWhileMakesTheRunWait) {
    for (const char* const what : {"records", "statistics"}) {
        EXPECT_EQ(run(command(what), with(fault("rename", EIO, ".part", 1, 1))).status, 0);
        expect_right(what);
        EXPECT_EQ(run(command(what), with(fault("open", ENOSPC, ".part.partial", 1, 1))).status, 0);
        expect_right(what);
    }
}

TEST_F(Disk, ThatStaysFullCanBeLeftAndTheRunResumed) {
    for (const char* const what : {"records", "statistics"}) {
        // Two blocks are kept, then nothing more. Statistics alone are all in memory, and make a result in the end.
        const pid_t child = start(command(what), with(fault("write", ENOSPC, ".part.partial", 2, 0)));
        EXPECT_TRUE(soon([&] { return contents(streams_ / "err").find("the run waits") != std::string::npos; }));
        kill(child, SIGTERM);
        const Outcome r = finish(child);
        EXPECT_EQ(r.signal, SIGTERM) << r.err;
        EXPECT_THAT(r.err, HasSubstr("--resume goes on from"));
        EXPECT_FALSE(fs::exists(directory_ / "out.h5"));
        resume_and_expect_right(what);
    }
}

TEST_F(Disk, ThatIsFullAtTheEndTakesNeitherTheTableNorWhatIsFinished) {
    for (const char* const what : {"records", "statistics"}) {
        for (const std::string& faults :
             {fault("write", ENOSPC, "/out.h5.!.parts", 0, 0), fault("write", ENOSPC, "/out.h5.!.parts", 3, 0),
              fault("fsync", EIO, "/out.h5.!.parts", 0, 0), fault("rename", EIO, "/out.h5!.parts", 0, 0)}) {
            const Outcome r = run({"run", std::string(what) + ".toml", "-o", "out.h5"}, with(faults));
            EXPECT_EQ(r.status, 1) << faults << r.err;
            EXPECT_THAT(r.out, HasSubstr("Angle random walk")) << faults << r.err;
            EXPECT_FALSE(fs::exists(directory_ / "out.h5"));
            resume_and_expect_right(what);
        }
    }
}

TEST_F(Disk, ThatIsReadOnlyIsToldBeforeTheRun) {
    for (const std::string& faults :
         {fault("mkdir", EROFS, "out.h5.parts", 0, 0), fault("open", EROFS, "out.h5", 0, 0)}) {
        const Outcome r = run(command("statistics"), with(faults));
        EXPECT_EQ(r.status, 2) << faults;
        EXPECT_EQ(r.out, "");
        EXPECT_THAT(r.err, HasSubstr("Read-only file system"));
        EXPECT_FALSE(fs::exists(directory_ / "out.h5"));
        EXPECT_FALSE(fs::exists(directory_ / "out.h5.parts"));
    }
}

TEST_F(Disk, AFolderThatVanishesCostsNoMoreThanIsToldOf) {
    make_studies("20");
    for (const char* const what : {"records", "statistics"}) {
        const pid_t child = start(command(what));
        const fs::path folder = directory_ / "out.h5.parts";
        EXPECT_TRUE(soon([&] { return fs::exists(folder / "000001.part"); }));
        std::error_code error;
        fs::remove_all(folder, error);
        const Outcome r = finish(child);
        if (r.status == 0) {
            expect_right(what);  // all that it needed was in memory
        } else {
            EXPECT_EQ(r.status, 1);
            EXPECT_THAT(r.err, HasSubstr("out.h5.parts"));
            EXPECT_FALSE(fs::exists(directory_ / "out.h5"));
            resume_and_expect_right(what);
        }
    }
}

TEST_F(Disk, AClockThatIsSetBackChangesNothing) {
    make_studies("20");
    for (const char* const what : {"records", "statistics"}) {
        const Outcome r = run({"run", std::string(what) + ".toml", "-o", "out.h5", "--checkpoint-every", "0.05"}, [] {
            setenv("LD_PRELOAD", RINGLOCK_DISK_FAULTS, 1);
            setenv("RINGLOCK_CLOCK_BACK_S", "86400", 1);
        });
        EXPECT_EQ(r.status, 0) << r.err;
        expect_right(what);
    }
}

// The thread that writes checkpoints has ended before the folder of a finished run is removed: here it would have time
// to write the last blocks into the emptied folder.
TEST_F(Disk, ThatRemovesSlowlyLeavesNoFolder) {
    make_studies("20");
    for (const char* const what : {"records", "statistics"}) {
        const Outcome r = run({"run", std::string(what) + ".toml", "-o", "out.h5", "--checkpoint-every", "0.2"}, [] {
            setenv("LD_PRELOAD", RINGLOCK_DISK_FAULTS, 1);
            setenv("RINGLOCK_SLOW_RMDIR_MS", "700", 1);
        });
        EXPECT_EQ(r.status, 0) << r.err;
        expect_right(what);
    }
}

TEST_F(Disk, PartsThatRotAreToldOfAndSimulatedAgain) {
    make_studies("20");
    for (const char* const what : {"records", "statistics"}) {
        for (const bool cut : {false, true}) {
            const pid_t child = start(command(what));
            const fs::path part = directory_ / "out.h5.parts" / "000001.part";
            EXPECT_TRUE(soon([&] { return fs::exists(part); }));
            kill(child, SIGKILL);
            finish(child);
            ASSERT_TRUE(fs::exists(part));
            const auto size = fs::file_size(part);
            if (cut) {
                fs::resize_file(part, size / 2);
            } else {
                std::fstream file(part, std::ios::binary | std::ios::in | std::ios::out);
                file.seekg(static_cast<std::streamoff>(size / 2));
                const char bit = static_cast<char>(file.get() ^ 1);
                file.seekp(static_cast<std::streamoff>(size / 2));
                file.put(bit);
            }
            const Outcome r = run(command(what, "--resume"));
            EXPECT_EQ(r.status, 0);
            EXPECT_THAT(r.err, AllOf(HasSubstr("000001.part: is damaged"), HasSubstr("simulated again")));
            expect_right(what);
        }
    }
}

}  // namespace
}  // namespace disk_test
}  // namespace ringlock
