#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <exception>
#include <iostream>
#include <new>
#include <string>
#include <string_view>

#include "app/command.hpp"
#include "app/output.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/version.hpp"

namespace {

constexpr int done = 0;
constexpr int run_failed = 1;
constexpr int input_wrong = 2;

int complain(int status, std::string_view what) {
    ringlock::app::tell(fmt::format("ringlock: error: {}\n", what));
    return status;
}

/// A mistyped command is named; CLI11 would only say that one is missing.
void refuse_unknown_command(const CLI::App& root, int argc, char** argv) {
    if (argc < 2 || std::string_view(argv[1]).starts_with('-')) return;
    std::string known;
    for (const CLI::App* command : root.get_subcommands({})) {
        if (command->get_name() == argv[1]) return;
        known += (known.empty() ? "" : ", ") + command->get_name();
    }
    throw ringlock::InputError(
        fmt::format("\"{}\" is no command; there are {}; ringlock --help says what they do", argv[1], known));
}

}  // namespace

int main(int argc, char** argv) {
    namespace app = ringlock::app;
    app::hold_standard_streams();
    // A file that outgrows its limit (ulimit -f) is an error of writing, told and cleaned up after like a full disk.
    std::signal(SIGXFSZ, SIG_IGN);
    CLI::App root{
        "ringlock: which cure for the lock-in of a dithered ring laser gyro, when and how well.\n"
        "Simulates ensembles of dithered gyros, compares uncompensated, noise-injected and compensated outputs, and\n"
        "computes Allan deviation and angle random walk.",
        "ringlock"};
    root.set_version_flag("--version", fmt::format("ringlock {} ({})", ringlock::version(), ringlock::git_hash()));
    root.require_subcommand(1);
    root.failure_message([](const CLI::App*, const CLI::Error& error) {
        return fmt::format("ringlock: error: {}; --help says what there is\n", error.what());
    });
    root.footer("Exit status: 0 done; 1 the run failed; 2 the input or the command line is wrong.");
    app::add_run(root, {argv, static_cast<std::size_t>(argc)});
    app::add_analyze(root);
    app::add_allan(root);
    app::add_validate(root);
    app::add_import(root);
    app::add_closure(root);
    app::add_record(root);
    app::add_devices(root);
    app::add_merge(root, {argv, static_cast<std::size_t>(argc)});
    app::add_status(root);
    app::add_replay(root, {argv, static_cast<std::size_t>(argc)});
    app::add_planned(root);
    try {
        const ringlock::InterruptGuard guard;
        refuse_unknown_command(root, argc, argv);
        root.parse(argc, argv);
        return done;
    } catch (const CLI::ParseError& error) {
        if (root.exit(error) != 0) return input_wrong;
        return std::cout.flush() ? done : complain(run_failed, "standard output cannot be written");  // help, version
    } catch (const ringlock::InputError& error) {
        return complain(input_wrong, error.what());
    } catch (const ringlock::RunError& error) {
        return complain(run_failed, error.what());
    } catch (const ringlock::Interrupted& interrupted) {
        app::tell(interrupted.says_more() ? fmt::format("ringlock: {}\n", interrupted.what())
                                          : std::string(ringlock::farewell()));
    } catch (const std::bad_alloc&) {
        return complain(run_failed, "out of memory; run fewer gyros at a time, or store fewer samples");
    } catch (const std::exception& error) {
        return complain(run_failed, error.what());
    }
    // End by the signal itself, as shells and batch systems expect of a program that was interrupted.
    std::signal(ringlock::interrupt_signal(), SIG_DFL);
    std::raise(ringlock::interrupt_signal());
    return run_failed;
}
