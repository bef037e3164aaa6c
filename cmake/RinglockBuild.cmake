# Compiler settings that every ringlock target shares.
if(PROJECT_IS_TOP_LEVEL AND NOT CMAKE_BUILD_TYPE AND NOT CMAKE_CONFIGURATION_TYPES)
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

# GCC looks through its whole memory for garbage each time it has grown by some share, precompiled headers included, and
# finds little. Without that a source costs a little less time and somewhat more memory.
target_compile_options(ringlock_options INTERFACE
  $<$<COMPILE_LANG_AND_ID:CXX,GNU>:--param=ggc-min-heapsize=4194304>)

# What the library is made of can be in a shared one only if its code does not depend on its place in memory.
function(ringlock_part_of_library target)
  if(BUILD_SHARED_LIBS OR RINGLOCK_PYTHON)
    set_target_properties(${target} PROPERTIES POSITION_INDEPENDENT_CODE ON)
  endif()
endfunction()

# Headers from outside the repository that most sources include, for target_precompile_headers: half of a build's time is
# spent on reading them. Headers of the repository are left out, for a change to one would rebuild the whole target.
# Sources still include what they use: `-DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON`, as the preset debug has it, builds without.
set(RINGLOCK_COMMON_HEADERS
  <algorithm> <array> <cmath> <complex> <cstdint> <filesystem> <functional> <limits> <memory> <numeric> <optional> <span>
  <string> <utility> <vector> <fmt/format.h>)

# Several sources in one compilation (unity build), as the preset release has it: headers are read and templates compiled
# once for all of them. Names in anonymous namespaces of one target must differ for that; the preset debug compiles each
# source by itself. Sources that Highway compiles once for each instruction set, and those made by the build, stay alone.
option(RINGLOCK_UNITY_BUILD "Compile several sources of the program together" OFF)
function(ringlock_compile_together target sources_each)
  if(NOT RINGLOCK_UNITY_BUILD)
    return()
  endif()
  set_target_properties(${target} PROPERTIES UNITY_BUILD ON UNITY_BUILD_BATCH_SIZE ${sources_each})
  # A class whose members have types of the source's anonymous namespace is defined in one source all the same.
  target_compile_options(${target} PRIVATE -Wno-subobject-linkage)
  get_target_property(sources ${target} SOURCES)
  foreach(source IN LISTS sources)
    set(alone OFF)
    if(source MATCHES "^${PROJECT_BINARY_DIR}")
      set(alone ON)
    elseif(source MATCHES "\\.cpp$" AND EXISTS "${source}")
      file(STRINGS "${source}" for_each_target REGEX "HWY_TARGET_INCLUDE" LIMIT_COUNT 1)
      if(for_each_target)
        set(alone ON)
      endif()
    endif()
    if(alone)
      set_source_files_properties("${source}" TARGET_DIRECTORY ${target} PROPERTIES SKIP_UNITY_BUILD_INCLUSION ON)
    endif()
  endforeach()
endfunction()
