#include "app/failure.hpp"

#include <fmt/format.h>

#include <new>
#include <string>
#include <string_view>

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
        throw;
    } catch (const std::exception& error) {
        throw InputError(
            fmt::format("{}: holds a value that cannot be evaluated ({}); it is damaged, or was written by "
                        "another program",
                        printable(file), printable(error.what())));
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
