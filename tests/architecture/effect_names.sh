#!/usr/bin/env bash
# `effect_names.sh ROOT FOLDER...` fails where a source of the folders calls an effect by its name: in quotes, alone or as
# part of a key, or as effects::NAME. Names are those of engine/effects/registry.cpp; engine/effects itself is left out.
# Who needs an effect of some kind asks all of them for their roles and bounds, so that a new effect is one file.
set -euo pipefail
cd "${1:?usage: effect_names.sh ROOT FOLDER...}"
shift

mapfile -t names < <(sed -nE 's/^[[:space:]]*X\(([a-z0-9_]+)\).*$/\1/p' engine/effects/registry.cpp)
if [[ ${#names[@]} -eq 0 || $# -eq 0 ]]; then
    echo "effect_names.sh: no effects in engine/effects/registry.cpp, or no folder given"
    exit 2
fi
any="$(IFS='|' && echo "${names[*]}")"

mapfile -t sources < <(find "$@" -type f \( -name '*.[ch]pp' -o -name '*.[ch]' \) -not -path 'engine/effects/*' |
    LC_ALL=C sort)
if [[ ${#sources[@]} -eq 0 ]]; then
    echo "effect_names.sh: no sources in $*"
    exit 2
fi

found=0
grep -nE "\"(effects\.)?($any)[\".]|effects::($any)([^[:alnum:]_]|\$)" /dev/null "${sources[@]}" || found=$?
case $found in
    0)
        echo "effects are called by their names; ask them for what they do (engine/effects/effect.hpp)"
        exit 1
        ;;
    1) echo "${#sources[@]} files call none of ${#names[@]} effects by its name" ;;
    *) exit 2 ;;
esac
