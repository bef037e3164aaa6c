#!/usr/bin/env bash
# Holds blocks of docs/replication.md against what bench_replication prints.
# Usage: replication_page.sh BENCH REPOSITORY BLOCK...
set -euo pipefail
bench="$1"
repository="$2"
shift 2
page="$repository/docs/replication.md"
status=0
for block in "$@"; do
    figures="$("$bench" "$block")"
    "$repository/tests/bench/page_block.sh" "$page" "$block" <<<"$figures" | diff "$page" - ||
        { echo "docs/replication.md, block $block: other figures than bench_replication prints; run tools/replication" >&2; status=1; }
done
exit "$status"
