// version() and git_hash() are those of the engine: this source checks that the two declarations agree.
#include "engine/core/version.hpp"

#include "library/include/ringlock/version.hpp"
