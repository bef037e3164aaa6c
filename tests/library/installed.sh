#!/usr/bin/env bash
# `installed.sh BUILD SOURCE COMPILER` installs the library of a build to a folder of its own, builds the examples
# against it with find_package() and one of them with pkg-config, runs them and checks their figures.
set -euo pipefail
build="$1"
source="$2"
compiler="$3"
# shellcheck source=tests/library/examples.sh
. "$source/tests/library/examples.sh"

work="$(mktemp -d)"
trap 'rm -rf "$work"' EXIT
# The name has a blank, as the folders of users may.
prefix="$work/a prefix"
cmake --install "$build" --prefix "$prefix" --component library >"$work/install.log" || {
    cat "$work/install.log"
    exit 1
}
if grep -rnE '#include "' "$prefix/include" ||
    grep -rnoE '#include <[a-z0-9_]+/' "$prefix/include" | grep -v '<ringlock/'; then
    echo "^ an installed header includes one that is not of the standard library"
    exit 1
fi

# Warnings of the examples are theirs: none comes from a header, and no option of the library's build is passed on.
cmake -S "$source/examples" -B "$work/examples" -DCMAKE_PREFIX_PATH="$prefix" -DCMAKE_CXX_COMPILER="$compiler" \
    -DCMAKE_BUILD_TYPE=Release -DCMAKE_CXX_FLAGS="-Wall -Wextra -Wpedantic -Wconversion -Werror" \
    -DCMAKE_EXPORT_COMPILE_COMMANDS=ON >"$work/configure.log" 2>&1 || {
    cat "$work/configure.log"
    exit 1
}
if grep -e '-Wshadow' "$work/examples/compile_commands.json"; then
    echo "^ a warning of the library's own build is forced on its users"
    exit 1
fi
cmake --build "$work/examples" >"$work/build.log" 2>&1 || {
    tail -50 "$work/build.log"
    exit 1
}
run_examples "$work/examples"

if command -v pkg-config >/dev/null; then
    pc="$(find "$prefix" -name ringlock.pc -printf '%h')"
    mkdir "$work/pkg-config"
    # pkg-config escapes the blank of the prefix for a shell.
    flags="$(PKG_CONFIG_PATH="$pc" pkg-config --cflags --libs ringlock)"
    eval "'$compiler' '$source/examples/allan.cpp' $flags -o '$work/pkg-config/example_allan'"
    version="$(PKG_CONFIG_PATH="$pc" pkg-config --modversion ringlock)"
    [[ $version =~ ^[0-9]+\.[0-9]+\.[0-9]+$ ]] || {
        echo "pkg-config has the version '$version'"
        bad=1
    }
    LD_LIBRARY_PATH="${pc%/pkgconfig}" check_allan "$work/pkg-config"
else
    echo "pkg-config is not there: its part was left out"
fi
exit "$bad"
