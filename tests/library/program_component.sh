#!/usr/bin/env bash
# `program_component.sh BUILD CMAKE`: the component of the installation from which the package of the program is made
# holds the program, its manual pages and completions, and the program runs from there.
set -euo pipefail
build="$1"
cmake="$2"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT

DESTDIR="$folder" "$cmake" --install "$build" --component program >"$folder/log" 2>&1 || {
    cat "$folder/log"
    exit 1
}
bad=0
for file in bin/ringlock share/man/man1/ringlock.1 share/bash-completion/completions/ringlock \
    share/zsh/vendor-completions/_ringlock share/fish/vendor_completions.d/ringlock.fish; do
    if [[ -z $(find "$folder" -path "*/$file") ]]; then
        echo "missing: $file"
        bad=1
    fi
done
if [[ -n $(find "$folder" -name '*.hpp') ]]; then
    echo "headers of the library are in the component of the program"
    bad=1
fi
((bad)) || "$(find "$folder" -path '*/bin/ringlock')" --version
exit $bad
