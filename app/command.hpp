#pragma once
#include <span>

namespace CLI {
class App;
}

/// The subcommands. Each adds itself to the program; its callback runs it and throws InputError (exit status 2),
/// RunError (1) or Interrupted.
namespace ringlock::app {

/// `command_line` begins with the program's name and must outlive the program's options.
void add_run(CLI::App& root, std::span<const char* const> command_line);
void add_analyze(CLI::App& root);
void add_allan(CLI::App& root);
void add_validate(CLI::App& root);
void add_import(CLI::App& root);
void add_closure(CLI::App& root);
void add_record(CLI::App& root);
void add_devices(CLI::App& root);
void add_merge(CLI::App& root, std::span<const char* const> command_line);
void add_status(CLI::App& root);
void add_submit(CLI::App& root);
/// `command_line` as for add_run().
void add_replay(CLI::App& root, std::span<const char* const> command_line);
void add_export(CLI::App& root);
void add_new(CLI::App& root);
void add_completion(CLI::App& root);
void add_man(CLI::App& root);
void add_report(CLI::App& root);

}  // namespace ringlock::app
