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
