#!/usr/bin/env bash
# The arrows between the rooms: `includes.sh ROOT` fails where an #include points against them.
# Also: a source stands beside its header, headers have #pragma once, every include of ours is a path from ROOT, and
# namespaces of instruction sets end.
set -euo pipefail
cd "${1:?usage: includes.sh ROOT}"

# What a room may include beside itself. A room that is not here is an error, so that a new one is placed on purpose.
declare -A may=(
    # Headers of the library that others install and include: standard library alone, and those of one another as
    # <ringlock/...>. The engine throws their exceptions.
    [library/include]=""
    [engine/core]="library/include"
    [engine/simd]="engine/core"
    [engine/gyro]="engine/core engine/simd"
    [engine/random]="engine/core engine/simd"
    [engine/dither]="engine/core engine/simd engine/gyro engine/random"
    [engine/effects]="engine/core engine/simd engine/gyro engine/random"
    [engine/propagate]="engine/core engine/simd engine/gyro"
    [engine/readout]="engine/core engine/simd engine/gyro engine/random"
    [engine/compensate]="engine/core engine/simd engine/gyro engine/propagate engine/readout"
    [engine/reader]="engine/core engine/gyro engine/random engine/propagate engine/readout engine/simd"
    [engine/scenario]="engine/core engine/gyro engine/effects engine/reader"
    [engine/store]="engine/core engine/scenario"
    [engine/ensemble]="engine/core engine/simd engine/gyro engine/random engine/dither engine/effects engine/propagate
        engine/readout engine/reader engine/compensate engine/scenario"
    [analysis/allan]="analysis/allan/sums analysis/allan/statistics engine/core engine/simd"
    [analysis/allan/sums]="engine/core engine/simd"
    [analysis/allan/statistics]="engine/core"
    [analysis/noise]="analysis/allan analysis/allan/sums engine/core engine/random"
    [analysis/noise/losses]="analysis/noise analysis/allan/sums engine/core engine/random"
    [analysis/lot]="engine/core"
    [analysis/design]="engine/core engine/random"
    [analysis/quantity]="engine/core"
    [analysis/text]="engine/core"
    [analysis/record]="analysis/allan analysis/allan/sums analysis/noise analysis/text engine/core engine/reader
        engine/store"
    [analysis/findings]="analysis/allan/sums analysis/noise analysis/noise/losses engine/core"
    [analysis/allan_run]="analysis/allan analysis/allan/sums analysis/findings analysis/noise analysis/quantity
        analysis/record engine/core"
    [analysis/stability]="analysis/allan analysis/allan/sums analysis/noise engine/core"
    [analysis/instrument]="analysis/record engine/*"
    [analysis/study]="analysis/allan analysis/allan/sums analysis/design analysis/lot analysis/noise engine/*"
    [analysis/parts]="analysis/study analysis/allan analysis/noise engine/*"
    # The closed loop has rooms of its own: its halves, turns and samples, never include each other.
    [analysis/closure]="engine/core engine/effects analysis/record"
    [analysis/closure/stats]="analysis/closure engine/core engine/simd"
    [analysis/closure/decide]="analysis/closure analysis/closure/stats engine/core engine/effects"
    [analysis/closure/turns/model]="analysis/closure analysis/closure/stats analysis/closure/decide analysis/record
        engine/*"
    [analysis/closure/turns/fit]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/turns/model analysis/record engine/*"
    [analysis/closure/turns/screen]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/turns/model analysis/closure/turns/fit analysis/record engine/*"
    [analysis/closure/turns/residual]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/turns/model analysis/closure/turns/fit analysis/record engine/*"
    [analysis/closure/turns/loop]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/turns/* analysis/record engine/*"
    [analysis/closure/samples/model]="analysis/closure analysis/closure/stats analysis/closure/decide analysis/record
        engine/*"
    [analysis/closure/samples/fit]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/samples/model analysis/record engine/*"
    [analysis/closure/samples/declared]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/samples/model analysis/closure/samples/fit analysis/record engine/*"
    [analysis/closure/samples/screen]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/samples/model analysis/closure/samples/fit analysis/record engine/*"
    [analysis/closure/samples/residual]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/samples/model analysis/closure/samples/fit analysis/closure/samples/declared analysis/record
        engine/*"
    [analysis/closure/samples/rounded]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/samples/model analysis/closure/samples/fit analysis/record engine/*"
    [analysis/closure/samples/loop]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/samples/* analysis/record engine/*"
    [analysis/closure/loop]="analysis/closure analysis/closure/decide analysis/closure/turns/loop
        analysis/closure/samples/loop analysis/record"
    [analysis/closure/chain]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/samples/* analysis/record engine/*"
    [analysis/closure/report]="analysis/closure analysis/closure/stats analysis/closure/decide
        analysis/closure/turns/model analysis/closure/samples/model analysis/instrument analysis/record
        analysis/noise analysis/allan engine/*"
    [analysis/export]="engine/core engine/scenario engine/store"
    [analysis/report/page]="analysis/report engine/core"
    [analysis/report]="analysis/* engine/*"
    [app]="analysis/* engine/*"
    [library]="library/include analysis/* engine/*"
    # The module for Python sees the library as everybody else does.
    [python]=""
    [tests]="app analysis/* engine/* library/include"
)

bad=0
complain() {
    echo "$1"
    bad=$((bad + 1))
}

# The room of a path: its folder in the closed loop, the Allan family and the reports, two folders deep elsewhere in engine and
# analysis and for the installed headers of the library, one in the rest.
room_of() {
    case "$1" in
        analysis/closure/* | analysis/allan/* | analysis/report/*)
            room="${1%/*}"
            ;;
        library/include/*) room=library/include ;;
        engine/*/* | analysis/*/*)
            local rest="${1#*/}"
            room="${1%%/*}/${rest%%/*}"
            ;;
        *) room="${1%%/*}" ;;
    esac
}

allowed() {
    local from="$1" to="$2" pattern
    [[ $from == "$to" ]] && return 0
    set -f
    for pattern in ${may[$from]}; do
        # shellcheck disable=SC2053  # the right side is meant as a pattern
        if [[ $to == $pattern ]]; then
            set +f
            return 0
        fi
    done
    set +f
    return 1
}

sources=()
for top in engine analysis app library python tests; do
    if [[ -d $top ]]; then
        mapfile -t -O "${#sources[@]}" sources < <(find "$top" -type f \
            \( -name '*.[ch]' -o -name '*.[ch]pp' -o -name '*.cc' -o -name '*.[ch]xx' -o -name '*.hh' -o -name '*.[it]pp' \
            -o -name '*.inl' -o -name '*.[ch]pp.in' \) | LC_ALL=C sort)
    fi
done
if [[ ${#sources[@]} -eq 0 ]]; then
    echo "includes.sh: no sources under $PWD"
    exit 2
fi

# A few searches through all sources are far quicker than some for each.
declare -A once hwy_begins hwy_ends from_room
while IFS= read -r file; do once[$file]=yes; done < <(grep -lx '#pragma once' "${sources[@]}" || true)
while IFS= read -r found; do hwy_begins[${found%:*}]="${found##*:}"; done \
    < <(grep -Hcx 'HWY_BEFORE_NAMESPACE();' "${sources[@]}" || true)
while IFS= read -r found; do hwy_ends[${found%:*}]="${found##*:}"; done \
    < <(grep -Hcx 'HWY_AFTER_NAMESPACE();' "${sources[@]}" || true)

for file in "${sources[@]}"; do
    case "$file" in
        *.cpp | *.cpp.in) ;;
        *-inl.hpp | engine/simd/targets.hpp) ;; # included anew for every instruction set
        *.hpp | *.hpp.in) [[ -n ${once[$file]+found} ]] || complain "$file: no #pragma once" ;;
        *) complain "$file: sources are called .cpp and .hpp" ;;
    esac
    # A missing end leaves the rest of the source, plain functions included, to the last instruction set named.
    if [[ ${hwy_begins[$file]} != "${hwy_ends[$file]}" ]]; then
        complain "$file: HWY_BEFORE_NAMESPACE without HWY_AFTER_NAMESPACE, or the other way round"
    fi
    room_of "$file"
    if [[ -z ${may[$room]+placed} ]]; then
        complain "$file: room '$room' has no line in the table of tests/architecture/includes.sh"
        continue
    fi
    from_room[$file]="$room"
done

last=""
while IFS=: read -r file line text; do
    from="${from_room[$file]-}"
    [[ -n $from ]] || continue
    if [[ $file != "$last" ]]; then
        last="$file"
        first=yes
        stem="${file##*/}"
        stem="${stem%%.*}"
    fi
    [[ $text =~ ^[[:space:]]*\#[[:space:]]*include[[:space:]]*([\"\<])([^\">]+)[\"\>] ]] || continue
    mark="${BASH_REMATCH[1]}"
    target="${BASH_REMATCH[2]}"
    ours=no
    case "$target" in engine/* | analysis/* | app/* | library/* | python/* | tests/*) ours=yes ;; esac
    if [[ $mark == "<" ]]; then
        [[ $ours == yes ]] || continue
        complain "$file:$line: <$target> is ours and wants quotes"
    fi
    if [[ $ours == no || /$target/ == */./* || /$target/ == */../* ]]; then
        complain "$file:$line: \"$target\" is not a path from the top of the repository"
        continue
    fi
    if [[ ! -f $target ]]; then
        complain "$file:$line: \"$target\" does not exist"
        continue
    fi
    room_of "$target"
    allowed "$from" "$room" || complain "$file:$line: $from must not include $room ($target)"
    # A source's own header is its first include and has its name; the two stand in one folder. Tests have none, and a
    # command may be called as the room it serves.
    name="${target##*/}"
    if [[ $first == yes && $from != tests && $file == *.cpp && ${name%.hpp} == "$stem" &&
        ${target%%/*} == "${file%%/*}" && $target != "${file%.cpp}.hpp" ]]; then
        complain "$file:$line: its header $target is not beside it"
    fi
    first=no
done < <(grep -HnE '^[[:space:]]*#[[:space:]]*include' "${sources[@]}" || true)

if [[ $bad -ne 0 ]]; then
    echo "$bad against the rules in ${#sources[@]} files"
    exit 1
fi
echo "${#sources[@]} files, every include along the arrows"
