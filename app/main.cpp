#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>

#include "app/allan.hpp"
#include "engine/core/error.hpp"

int main(int argc, char** argv) {
    CLI::App app{"ringlock"};
    app.require_subcommand(1);
    ringlock::app::add_allan(app);
    try {
        app.parse(argc, argv);
    } catch (const CLI::ParseError& e) {
        return app.exit(e) == 0 ? 0 : 2;
    } catch (const ringlock::InputError& e) {
        fmt::print(stderr, "ringlock: error: {}\n", e.what());
        return 2;
    } catch (const ringlock::RunError& e) {
        fmt::print(stderr, "ringlock: error: {}\n", e.what());
        return 1;
    }
    return 0;
}
