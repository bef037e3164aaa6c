#include <fmt/format.h>

#include <cstdlib>
#include <string_view>

#include "app/run/ranks.hpp"
#include "engine/core/error.hpp"

namespace ringlock::app {

void with_ranks(const std::function<void(const Ranks&)>& work) {
    for (const char* name : {"OMPI_COMM_WORLD_SIZE", "PMI_SIZE"}) {
        const char* size = std::getenv(name);
        if (size == nullptr || std::string_view(size) == "1") continue;
        throw InputError(
            fmt::format("run: is one of {} processes of mpirun, but this program was built without MPI; "
                        "build it with -DRINGLOCK_MPI=ON, or start one process with --threads",
                        size));
    }
    work({});
}

}  // namespace ringlock::app
