#!/usr/bin/env bash
# Holds blocks of a page against what a program prints, and the picture of a block, where one is named, against what it
# draws. TOOL is what mends the page.
# Usage: page_matches.sh BENCH REPOSITORY PAGE TOOL BLOCK[=PICTURE]...
set -euo pipefail
bench="$1"
repository="$2"
page="$3"
tool="$4"
shift 4
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
status=0
for argument in "$@"; do
    block="${argument%%=*}"
    words=("$block")
    if [[ $argument == *=* ]]; then
        words+=("$folder/drawn.svg")
    fi
    figures="$("$bench" "${words[@]}")"
    "$repository/tests/bench/page_block.sh" "$repository/$page" "$block" <<<"$figures" | diff "$repository/$page" - ||
        { echo "$page, block $block: other figures than ${bench##*/} prints; run $tool" >&2; status=1; }
    if [[ $argument == *=* ]]; then
        cmp "$repository/${argument#*=}" "$folder/drawn.svg" ||
            { echo "${argument#*=} is not what ${bench##*/} draws; run $tool" >&2; status=1; }
    fi
done
exit "$status"
