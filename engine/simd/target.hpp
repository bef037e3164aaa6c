#pragma once
#include <string>
#include <vector>

/// Which of the compiled instruction sets the vector code uses.
namespace ringlock::simd {

/// Name of the instruction set in use, "AVX3" (AVX-512), "AVX2", ..., as Highway calls it.
std::string active_target();

/// Instruction sets that this program has and this machine can run, best first.
std::vector<std::string> available_targets();

/// Uses the instruction set of that name, one of available_targets(), from now on. For tests: results must not depend
/// on it. Not thread-safe. Throws RunError for another name.
void use_target(const std::string& name);

/// Uses the best one again.
void use_best_target();

}  // namespace ringlock::simd
