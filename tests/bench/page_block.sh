#!/usr/bin/env bash
# `page_block.sh PAGE BLOCK` prints the page with standard input in place of what stands between the lines
# `<!-- block BLOCK -->` and `<!-- end BLOCK -->`; with --code as a third argument, as code.
set -euo pipefail
page="${1:?usage: page_block.sh PAGE BLOCK [--code]}"
block="${2:?usage: page_block.sh PAGE BLOCK [--code]}"
for mark in block end; do
    if ! grep -qxF "<!-- $mark $block -->" "$page"; then
        echo "page_block.sh: $page has no line '<!-- $mark $block -->'" >&2
        exit 1
    fi
done
text="$(cat)"
if [[ ${3-} == --code ]]; then
    text="\`\`\`
$text
\`\`\`"
fi
sed "/^<!-- block $block -->\$/q" "$page"
printf '\n%s\n\n' "$text"
sed -n "/^<!-- end $block -->\$/,\$p" "$page"
