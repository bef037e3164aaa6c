#include "engine/core/interrupt.hpp"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <memory>
#include <vector>

#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock {
namespace {

TEST(Interrupt, TheFirstSignalSetsTheFlag) {
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
        const InterruptGuard guard;
        EXPECT_FALSE(interrupted());
        EXPECT_NO_THROW(check_interrupt());
        raise(number);
        EXPECT_TRUE(interrupted());
        EXPECT_THROW(check_interrupt(), Interrupted);
    }
    EXPECT_FALSE(interrupted());
}

int handled = 0;

TEST(Interrupt, TheOldHandlerReturns) {
    auto* const before = signal(SIGINT, [](int) { ++handled; });
    { const InterruptGuard guard; }
    raise(SIGINT);
    EXPECT_EQ(handled, 1);
    signal(SIGINT, before);
}

TEST(Interrupt, NohupStaysInForce) {
    auto* const before = signal(SIGHUP, SIG_IGN);
    {
        const InterruptGuard guard;
        raise(SIGHUP);
        EXPECT_FALSE(interrupted());
    }
    signal(SIGHUP, before);
}

TEST(Interrupt, TheSecondSignalEndsTheProcessAndRemovesPartialFiles) {
    const test::TemporaryDirectory directory;
    const pid_t child = fork();
    if (child == 0) {
        const InterruptGuard guard;
        const AtomicPath first(directory / "first.h5");
        const AtomicPath second(directory / "second.h5");
        raise(SIGINT);
        if (directory.entries() != 2) _exit(1);
        raise(SIGINT);
        _exit(2);
    }
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "exit status " << WEXITSTATUS(status);
    EXPECT_EQ(WTERMSIG(status), SIGINT);
    EXPECT_EQ(directory.entries(), 0);
}

TEST(Interrupt, MoreFilesThanTheHandlerHoldsAreStillWritten) {
    const test::TemporaryDirectory directory;
    {
        std::vector<std::unique_ptr<AtomicPath>> paths;
        for (int i = 0; i < 20; ++i) paths.push_back(std::make_unique<AtomicPath>(directory / std::to_string(i)));
        for (const auto& path : paths) path->commit();
    }
    EXPECT_EQ(directory.entries(), 20);
}

}  // namespace
}  // namespace ringlock
