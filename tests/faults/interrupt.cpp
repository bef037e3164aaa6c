#include "engine/core/interrupt.hpp"

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
#include <memory>
#include <string>
#include <vector>

#include "engine/core/atomic_path.hpp"
#include "engine/core/error.hpp"
#include "engine/core/waiting.hpp"
#include "tests/support/temporary_directory.hpp"

namespace ringlock {
namespace interrupt_test {
namespace {

TEST(Interrupt, TheFirstSignalSetsTheFlag) {
    for (const int number : {SIGINT, SIGTERM, SIGHUP}) {
        const InterruptGuard guard;
        const HoldEnd however_slow_the_machine;
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

/// Runs `action` in a child whose standard error is the file, and returns the signal that ended it; 0 where none did.
template <class Action>
int signal_that_ends(const std::filesystem::path& standard_error, Action action) {
    const pid_t child = fork();
    if (child == 0) {
        dup2(open(standard_error.c_str(), O_WRONLY | O_CREAT | O_TRUNC, 0600), STDERR_FILENO);
        const InterruptGuard guard;
        action();
        _exit(1);
    }
    int status = 0;
    waitpid(child, &status, 0);
    return WIFSIGNALED(status) ? WTERMSIG(status) : 0;
}

std::string read(const std::filesystem::path& path) {
    std::ifstream file(path);
    return {std::istreambuf_iterator<char>(file), {}};
}

TEST(Interrupt, WhatDoesNotLookAtTheFlagIsNotWaitedFor) {
    const test::TemporaryDirectory directory;
    const int number = signal_that_ends(directory / "err", [&] {
        const AtomicPath path(directory / "out.h5");
        raise(SIGTERM);
        for (;;) pause();
    });
    EXPECT_EQ(number, SIGTERM);
    EXPECT_EQ(read(directory / "err"), "ringlock: interrupted, nothing written\n");
    EXPECT_EQ(directory.entries(), 1) << "the partial file is gone";
}

TEST(Interrupt, WhatIsHeldIsFinishedFirst) {
    const test::TemporaryDirectory directory;
    const int number = signal_that_ends(directory / "err", [&] {
        {
            const HoldEnd hold;
            raise(SIGTERM);
            raise(SIGTERM);
            std::ofstream(directory / "finished") << "yes";
        }
        for (;;) pause();
    });
    EXPECT_EQ(number, SIGTERM);
    EXPECT_EQ(read(directory / "finished"), "yes");
}

TEST(Interrupt, WhatIsThereAlreadyIsNamed) {
    const test::TemporaryDirectory directory;
    const int number = signal_that_ends(directory / "err", [&] {
        write_text(directory / "a.txt", "whole");
        raise(SIGINT);
        for (;;) pause();
    });
    EXPECT_EQ(number, SIGINT);
    EXPECT_THAT(read(directory / "err"),
                testing::HasSubstr("these files were complete before: " + (directory / "a.txt").string()));
    EXPECT_EQ(read(directory / "a.txt"), "whole");
}

TEST(Interrupt, WhoWritesAfterTheSignalGetsHisFile) {
    const test::TemporaryDirectory directory;
    const InterruptGuard guard;
    const HoldEnd however_slow_the_machine;
    raise(SIGINT);
    AtomicPath path(directory / "kept.txt");
    ASSERT_EQ(write(path.descriptor(), "kept", 4), 4);
    EXPECT_NO_THROW(path.commit());
    EXPECT_EQ(read(directory / "kept.txt"), "kept");
}

TEST(Interrupt, NobodyWaitsForAnotherAfterTheSignal) {
    const InterruptGuard guard;
    const HoldEnd however_slow_the_machine;
    int ends[2];
    ASSERT_EQ(pipe(ends), 0);
    const Descriptor reading(ends[0]);
    const Descriptor writing(ends[1]);
    char byte = 0;
    ASSERT_EQ(write_all(writing.get(), "ab"), 0);
    EXPECT_EQ(read_some(reading.get(), &byte, 1), 1);
    EXPECT_EQ(byte, 'a');
    const pid_t child = fork();
    if (child == 0) {
        for (;;) pause();
    }
    raise(SIGTERM);
    EXPECT_THROW(read_some(reading.get(), &byte, 1), Interrupted);
    EXPECT_THROW(write_all(writing.get(), "c"), Interrupted);
    EXPECT_THROW(wait_for_child(child), Interrupted);
    EXPECT_EQ(waitpid(child, nullptr, 0), -1) << "the child was ended and waited for";
}

TEST(Waiting, AChildTellsItsStatus) {
    const pid_t child = fork();
    if (child == 0) _exit(7);
    EXPECT_EQ(WEXITSTATUS(wait_for_child(child)), 7);
}

TEST(Waiting, AFifoIsReadToTheEndOfItsWriter) {
    const test::TemporaryDirectory directory;
    const std::filesystem::path fifo = directory / "fifo";
    ASSERT_EQ(mkfifo(fifo.c_str(), 0600), 0);
    const Descriptor file = open_to_read(fifo);  // there is no writer yet
    ASSERT_TRUE(file.valid());
    const pid_t writer = fork();
    if (writer == 0) {
        const Descriptor out(open(fifo.c_str(), O_WRONLY));
        _exit(write_all(out.get(), std::string(100'000, 'x')));
    }
    std::string text;
    std::string piece(1000, '\0');
    while (const ssize_t got = read_some(file.get(), piece.data(), piece.size())) {
        ASSERT_GT(got, 0);
        text.append(piece, 0, static_cast<std::size_t>(got));
    }
    EXPECT_EQ(text, std::string(100'000, 'x'));
    EXPECT_EQ(wait_for_child(writer), 0);
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
}  // namespace interrupt_test
}  // namespace ringlock
