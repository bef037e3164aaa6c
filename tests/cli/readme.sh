#!/usr/bin/env bash
# Holds the table and the picture of README.md against what the program makes of the scenario they show.
# Usage: readme.sh PROGRAM REPOSITORY
set -euo pipefail
program="$1"
repository="$2"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT

"$program" run "$repository/scenarios/gao-deng-2007.toml" -o "$folder/out.h5" --plot "$folder/out.svg" -q >"$folder/printed"
# The first lines tell durations; the tables begin after them.
sed -n '/^Angle random walk /,$p' "$folder/printed" >"$folder/table"
awk '/^Angle random walk / { inside = 1 } /^```/ { inside = 0 } inside' "$repository/README.md" >"$folder/shown"
status=0
diff "$folder/shown" "$folder/table" || { echo "README.md shows another table than the program prints" >&2; status=1; }
cmp "$repository/docs/figures/gao-deng-2007.svg" "$folder/out.svg" ||
    { echo "docs/figures/gao-deng-2007.svg is not what the program draws" >&2; status=1; }
exit "$status"
