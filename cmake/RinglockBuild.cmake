# Compiler settings that every ringlock target shares.
if(NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
  set(CMAKE_BUILD_TYPE Release CACHE STRING "Build type" FORCE)
endif()
set(CMAKE_CXX_STANDARD 20)
set(CMAKE_CXX_STANDARD_REQUIRED ON)
set(CMAKE_CXX_EXTENSIONS OFF)
set(CMAKE_EXPORT_COMPILE_COMMANDS ON)

option(RINGLOCK_WERROR "Treat warnings as errors" OFF)

add_library(ringlock_options INTERFACE)
target_include_directories(ringlock_options INTERFACE "${PROJECT_SOURCE_DIR}")
# Contraction to fused multiply-add depends on the target CPU; results must not.
target_compile_options(ringlock_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -ffp-contract=off
  $<$<BOOL:${RINGLOCK_WERROR}>:-Werror>)

# Headers from outside the repository that most sources include, for target_precompile_headers: half of a build's time is
# spent on reading them. Headers of the repository are left out, for a change to one would rebuild the whole target.
# Sources still include what they use: `-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON`, as the preset debug has it, builds without.
set(RINGLOCK_COMMON_HEADERS
  <algorithm> <array> <cmath> <complex> <cstdint> <filesystem> <functional> <limits> <memory> <numeric> <optional> <span>
  <string> <utility> <vector> <fmt/format.h>)
