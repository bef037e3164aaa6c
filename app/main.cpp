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
#include "app/failure.hpp"
#include "app/output.hpp"
#include "app/terminal/command_line.hpp"
#include "app/terminal/versions.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/printable.hpp"

namespace {

int cannot_be_written() {
    return ringlock::app::tell_failure(
        std::make_exception_ptr(ringlock::RunError("standard output cannot be written")));
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
        fmt::format("\"{}\" is not a command; the commands are {}; "
                    "ringlock --help describes them",
                    ringlock::printable(argv[1]), known));
}

}  // namespace

int main(int argc, char** argv) {
    namespace app = ringlock::app;
    app::hold_standard_streams();
    app::remember_arguments({argv, static_cast<std::size_t>(argc)});
    // A file that outgrows its limit (ulimit -f) is an error of writing, reported and cleaned up like a full disk.
    std::signal(SIGXFSZ, SIG_IGN);
    CLI::App root{
        "ringlock: simulation and analysis of the lock-in of dithered ring laser gyros.\n"
        "Simulates ensembles of dithered gyros, compares uncompensated, noise-injected and compensated\n"
        "outputs, computes Allan deviation and angle random walk, and identifies error sources in measured\n"
        "records.",
        "ringlock"};
    root.set_version_flag(
        "--version",
        [] {
            std::string text = app::version_text();
            text.pop_back();  // CLI11 ends the line
            return text;
        },
        "Print the version, how the program was built, and its libraries, and end");
    root.require_subcommand(1);
    root.failure_message([](const CLI::App*, const CLI::Error& error) {
        return app::coloured(
            fmt::format("ringlock: error: {}; --help lists the options\n", ringlock::printable(error.what())));
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
    app::add_submit(root);
    app::add_replay(root, {argv, static_cast<std::size_t>(argc)});
    app::add_export(root);
    app::add_new(root);
    app::add_completion(root);
    app::add_man(root);
    app::add_report(root);
    app::finish_help(root);
    try {
        const ringlock::InterruptGuard guard;
        refuse_unknown_command(root, argc, argv);
        root.parse(argc, argv);
        return app::done;
    } catch (const CLI::ParseError& error) {
        if (root.exit(error) != 0) return app::input_wrong;
        return std::cout.flush() ? app::done : cannot_be_written();  // help, version
    } catch (...) {
        const int status = app::tell_failure(std::current_exception());
        if (status <= app::ended_by_signal) return status;
    }
    // End by the signal itself, as shells and batch systems expect of a program that was interrupted.
    std::signal(ringlock::interrupt_signal(), SIG_DFL);
    std::raise(ringlock::interrupt_signal());
    return app::run_failed;
}
