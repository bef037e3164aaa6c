#pragma once
#include <functional>

#include "analysis/parts/team.hpp"

/// The processes of one run that mpirun has started. Only ranks_mpi.cpp knows MPI; a program without it has
/// ranks_none.cpp in its place.
namespace ringlock::app {

/// This process among those of the run.
struct Ranks {
    parts::Leader* leader = nullptr;  ///< in the process that leads; null in all others, and where there is one process
    parts::Member* member = nullptr;  ///< in all others
    int of_this_machine = 1;          ///< processes of the run on the same machine
};

/// Calls `work` in a process that mpirun has started together with others, or that is alone. Returns when all processes
/// have finished. Where one fails, its exception is passed on, and the others end with the same status; a failure while
/// the others simulate ends them by a signal, after which they keep what they have finished.
///
/// Throws InputError where mpirun has started several processes of a program that was built without MPI.
void with_ranks(const std::function<void(const Ranks&)>& work);

}  // namespace ringlock::app
