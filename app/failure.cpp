#include "app/failure.hpp"

#include <fmt/format.h>

#include <new>
#include <string>
#include <string_view>
#include <system_error>

#include "app/output.hpp"
#include "engine/core/error.hpp"
#include "engine/core/interrupt.hpp"
#include "engine/core/printable.hpp"

namespace ringlock::app {

namespace {

int complain(int status, std::string_view what) {
    tell(fmt::format("ringlock: error: {}\n", what));
    return status;
}

}  // namespace

void name_file_of_failure(const std::string& file, const std::function<void()>& work) {
    try {
        work();
    } catch (const InputError&) {
        throw;
    } catch (const RunError&) {
        throw;
    } catch (const Interrupted&) {
        throw;
    } catch (const std::bad_alloc&) {
        throw RunError(
            fmt::format("{}: out of memory; run fewer gyros at a time, store fewer samples, or take a shorter record",
                        printable(file)));
    } catch (const std::system_error& error) {
        throw RunError(fmt::format("{}: the system refused something: {}", printable(file), printable(error.what())));
    } catch (const std::exception& error) {
        throw InputError(
            fmt::format("{}: holds a value that cannot be evaluated ({}); it is damaged, "
                        "or was written by another program",
                        printable(file), printable(error.what())));
    }
}

void name_file_of_values(const std::string& file, const std::function<void()>& evaluate) {
    try {
        evaluate();
    } catch (const InputError& error) {
        const std::string name = printable(file);
        const std::string_view message = error.what();
        if (message.find(name) != std::string_view::npos) throw;
        throw InputError(fmt::format("{}: {}", name, message));
    }
}

int tell_failure(const std::exception_ptr& failure) {
    try {
        std::rethrow_exception(failure);
    } catch (const EndQuietly& end) {
        return end.status;
    } catch (const InputError& error) {
        return complain(input_wrong, error.what());
    } catch (const RunError& error) {
        return complain(run_failed, error.what());
    } catch (const Interrupted& interrupted) {
        tell(interrupted.says_more() ? fmt::format("ringlock: {}\n", interrupted.what()) : std::string(farewell()));
        return ended_by_signal + interrupt_signal();
    } catch (const std::bad_alloc&) {
        return complain(run_failed, "out of memory; run fewer gyros at a time, or store fewer samples");
    } catch (const std::exception& error) {
        return complain(run_failed, error.what());
    }
}

}  // namespace ringlock::app
