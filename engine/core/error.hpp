#pragma once
// The exceptions are part of the library's interface: users of it catch those that the engine throws.
#include "library/include/ringlock/error.hpp"  // IWYU pragma: export
