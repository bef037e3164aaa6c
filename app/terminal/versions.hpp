#pragma once
#include <string>

namespace ringlock::app {

/// The output of `ringlock --version`: the version in the first line, then the kind of build, the libraries that the
/// program runs with and those that it was compiled with, the instruction sets of this machine, and the programs that
/// it can use.
std::string version_text();

}  // namespace ringlock::app
