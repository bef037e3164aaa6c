#pragma once
#include <filesystem>
#include <string>

#include "analysis/parts/team.hpp"
#include "app/run/run_one.hpp"

namespace ringlock::app {

/// Simulates the gyros that the leader of a run orders, until the leader ends the run; finished blocks go into the
/// leader's folder. Throws InputError where scenario or program are not the leader's.
void run_member(const RunArguments& arguments, const std::string& scenario_file, const std::filesystem::path& result,
                parts::Member& member, int threads);

}  // namespace ringlock::app
