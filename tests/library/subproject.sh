#!/usr/bin/env bash
# `subproject.sh SOURCE COMPILER [built]`: a project that takes ringlock by add_subdirectory() gets the library and
# nothing else: no tests, no program, no build type and no warnings. With `built` the examples are built and run, too.
set -euo pipefail
source="$1"
compiler="$2"
# shellcheck source=tests/library/examples.sh
. "$source/tests/library/examples.sh"

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
mkdir "$work/project"
cat >"$work/project/CMakeLists.txt" <<'PROJECT'
cmake_minimum_required(VERSION 3.25)
project(user LANGUAGES C CXX)
add_subdirectory("${RINGLOCK}" ringlock EXCLUDE_FROM_ALL)
add_subdirectory("${RINGLOCK}/examples" examples)
foreach(target library_tests unit_tests ringlock bench_allan)
  if(TARGET ${target})
    message(SEND_ERROR "target ${target} is there")
  endif()
endforeach()
if(CMAKE_BUILD_TYPE)
  message(SEND_ERROR "the build type was set to ${CMAKE_BUILD_TYPE}")
endif()
get_target_property(options ringlock_library INTERFACE_COMPILE_OPTIONS)
if(options)
  message(SEND_ERROR "users get the options ${options}")
endif()
PROJECT
settings=()
if [[ ${3-} == built ]]; then
    settings=(-DCMAKE_CXX_FLAGS_INIT=-O1 -DRINGLOCK_UNITY_BUILD=ON)
    if command -v ccache >/dev/null; then settings+=(-DCMAKE_CXX_COMPILER_LAUNCHER=ccache); fi
fi
cmake -S "$work/project" -B "$work/build" -G Ninja -DRINGLOCK="$source" -DCMAKE_CXX_COMPILER="$compiler" \
    "${settings[@]}" >"$work/configure.log" 2>&1 || {
    cat "$work/configure.log"
    exit 1
}
if [[ ${3-} == built ]]; then
    cmake --build "$work/build" >"$work/build.log" 2>&1 || {
        tail -50 "$work/build.log"
        exit 1
    }
    run_examples "$work/build/examples"
else
    ninja -C "$work/build" examples/CMakeFiles/example_allan.dir/allan.cpp.o >"$work/build.log" 2>&1 || {
        tail -50 "$work/build.log"
        exit 1
    }
fi
exit "$bad"
