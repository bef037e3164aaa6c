#pragma once

namespace CLI {
class App;
}

namespace ringlock::app {

/// Adds the subcommand `allan`. Its callback prints to standard output and throws InputError for wrong input.
void add_allan(CLI::App& root);

}  // namespace ringlock::app
