#!/usr/bin/env bash
# Holds blocks of docs/compensation.md against what bench_limits prints, and the picture of the block detector-noise
# against what it draws.
# Usage: limits_page.sh BENCH REPOSITORY BLOCK...
set -euo pipefail
bench="$1"
repository="$2"
shift 2
page="$repository/docs/compensation.md"
folder="$(mktemp -d)"
trap 'rm -rf "$folder"' EXIT
status=0
for block in "$@"; do
    arguments=("$block")
    if [[ $block == detector-noise ]]; then
        arguments+=("$folder/drawn.svg")
    fi
    figures="$("$bench" "${arguments[@]}")"
    "$repository/tests/bench/page_block.sh" "$page" "$block" <<<"$figures" | diff "$page" - ||
        { echo "docs/compensation.md, block $block: other figures than bench_limits prints; run tools/limits" >&2; status=1; }
    if [[ $block == detector-noise ]]; then
        cmp "$repository/docs/figures/what-limits.svg" "$folder/drawn.svg" ||
            { echo "docs/figures/what-limits.svg is not what bench_limits draws; run tools/limits" >&2; status=1; }
    fi
done
exit "$status"
