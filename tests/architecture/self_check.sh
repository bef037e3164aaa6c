#!/usr/bin/env bash
# Shows that the other checks can fail: `self_check.sh FOLDER` makes trees in FOLDER/made_up, a clean one that must pass
# and, one at a time, faults that must each be found and named.
set -euo pipefail
here="$(cd "$(dirname "${BASH_SOURCE[0]}")" && pwd -P)"
mkdir -p "${1:?usage: self_check.sh FOLDER}/made_up"
folder="$(cd "$1/made_up" && pwd -P)"
unset GIT_DIR GIT_WORK_TREE GIT_INDEX_FILE

bad=0
checks=0
clean_tree() {
    rm -rf "$folder"
    mkdir -p "$folder"/{engine/{core,simd,gyro,random,ensemble,store},analysis/{allan,report},app,tests/unit}
    cd "$folder"
    echo '#pragma once' | tee engine/core/units.hpp engine/random/stream.hpp engine/store/file.hpp \
        analysis/allan/allan.hpp app/command.hpp >engine/gyro/device.hpp
    printf '#include "engine/gyro/device.hpp"\n#include <vector>\n#include "engine/core/units.hpp"\n' \
        >engine/gyro/device.cpp
    printf '#include "engine/gyro/device.hpp"\n' >engine/ensemble/run.cpp
    printf '#include <vector>\n' >engine/simd/math-inl.hpp
    printf '#include "analysis/allan/allan.hpp"\n#include "engine/core/units.hpp"\n' >analysis/allan/allan.cpp
    printf '#include "analysis/allan/allan.hpp"\n#include "engine/store/file.hpp"\n' >analysis/report/plot.cpp
    printf '#include "app/command.hpp"\n' | tee tests/unit/command.cpp >app/main.cpp
}

# expect STATUS WORDS SCRIPT ARGUMENT...: SCRIPT on the tree ends with STATUS and its output has WORDS.
expect() {
    local status=0 output
    output="$("$here/$3" "$folder" "${@:4}" 2>&1)" || status=$?
    checks=$((checks + 1))
    if [[ $status -ne $1 || $output != *"$2"* ]]; then
        echo "$3: expected status $1 and '$2', got status $status and: $output"
        bad=1
    fi
}

# include_fault WORDS FILE LINE: the clean tree with LINE added to FILE must be refused with WORDS.
include_fault() {
    clean_tree
    mkdir -p "$(dirname "$2")"
    echo "$3" >>"$2"
    expect 1 "$1" includes.sh
}

clean_tree
expect 0 "13 files" includes.sh
# Nothing to read is not a success.
rm -rf "$folder"/{engine,analysis,app,tests}
expect 2 "no sources" includes.sh

include_fault "engine/gyro must not include analysis/allan" engine/gyro/device.cpp '#include "analysis/allan/allan.hpp"'
include_fault "engine/gyro must not include app" engine/gyro/device.cpp '#include "app/command.hpp"'
include_fault "engine/core must not include engine/gyro" engine/core/units.hpp '#include "engine/gyro/device.hpp"'
include_fault "engine/gyro must not include engine/random" engine/gyro/device.hpp '  #  include "engine/random/stream.hpp"'
include_fault "engine/ensemble must not include engine/store" engine/ensemble/run.cpp '#include "engine/store/file.hpp"'
include_fault "analysis/allan must not include engine/gyro" analysis/allan/allan.cpp '#include "engine/gyro/device.hpp"'
include_fault "analysis/report must not include app" analysis/report/plot.cpp '#include "app/command.hpp"'
include_fault "is ours and wants quotes" engine/gyro/device.cpp '#include <engine/core/units.hpp>'
include_fault "engine/gyro must not include app" engine/gyro/device.cpp '#include <app/command.hpp>'
include_fault "not a path from the top" engine/gyro/device.cpp '#include "device.hpp"'
include_fault "not a path from the top" engine/gyro/device.cpp '#include "engine/gyro/../core/units.hpp"'
include_fault "does not exist" engine/gyro/device.cpp '#include "engine/core/unit.hpp"'
include_fault "no #pragma once" engine/gyro/naked.hpp '// nothing'
include_fault "without HWY_AFTER_NAMESPACE" engine/gyro/device.cpp 'HWY_BEFORE_NAMESPACE();'
include_fault "sources are called" engine/gyro/device.h '#pragma once'
include_fault "room 'engine/attic' has no line" engine/attic/old.cpp '// nothing'
include_fault "room 'engine' has no line" engine/loose.cpp '// nothing'
include_fault "library/include must not include engine/core" library/include/ringlock/units.hpp \
    '#include "engine/core/units.hpp"'
include_fault "python must not include engine/core" python/module.cpp '#include "engine/core/units.hpp"'
include_fault "is not beside it" engine/ensemble/device.cpp '#include "engine/gyro/device.hpp"'

# number_fault STATUS WORDS LINE [ENTRY]: a room of the closed loop whose source has LINE, and a list with ENTRY.
number_fault() {
    cd "$here"
    rm -rf "$folder"
    mkdir -p "$folder/analysis/closure/room"
    printf '%s\n' 'constexpr double least = options.room.least;  // 0.5' 'if (x < least && k > 0) return "x < 5";' "$3" \
        >"$folder/analysis/closure/room/a.cpp"
    printf '# path | name | reason\n%s\n' "${4-}" >"$folder/list.txt"
    expect "$1" "$2" closure_numbers.sh "$folder/list.txt" room
}
number_fault 0 "1 files" 'constexpr std::size_t terms_4 = rows_2; if (size() > 2 || k == 1.0) return x4 < y_3;'
number_fault 0 "1 files" 'constexpr int twice(int x) { return 2 * x; }'
number_fault 1 "a.cpp:3: a constant that is no field of Options: least_share" 'constexpr double least_share = 0.5;'
number_fault 1 "a.cpp:3: a constant that is no field of Options: cost" '    static constexpr double cost = 2.0;'
number_fault 1 "a.cpp:3: a constant that is no field of Options: sizes" 'inline constexpr double sizes[] = {0.1, 0.2};'
number_fault 1 "a.cpp:3: a constant that is no field of Options: tries" '    const std::size_t tries = 7;'
number_fault 1 "a.cpp:3: a constant that is no field of Options: cost" "$(printf 'constexpr double cost =\n 4.0;')"
number_fault 1 "a.cpp:3: a comparison with a number: p < 1e-6" '    if (p < 1e-6) break;'
number_fault 1 "a.cpp:3: a comparison with a number: gain > 0.3 * best" 'return k > 1 && gain > 0.3 * best ? a : b;'
number_fault 1 "a.cpp:3: a comparison with a number: k < 40" 'for (int k = 0; k < 40; ++k) {'
number_fault 0 "1 files" 'for (int k = 0; k < 40; ++k) {' 'room/a.cpp | k < 40 | steps'
number_fault 0 "1 files" 'constexpr double least_share = 0.5;' 'room/a.cpp | least_share | half'
number_fault 1 "applies to nothing: room/a.cpp | most" 'constexpr double most = options.most;' 'room/a.cpp | most | half'
number_fault 1 "a.cpp:3: a constant" 'constexpr double least_share = 0.5;' 'room/b.cpp | least_share | half'
number_fault 1 "a line is PATH" '' 'room/a.cpp | least_share'
expect 2 "no folder" closure_numbers.sh "$folder/list.txt" attic

# name_fault STATUS WORDS LINE: a tree with two effects whose engine/gyro/device.cpp has LINE.
name_fault() {
    clean_tree
    mkdir -p engine/effects
    printf '#define RINGLOCK_EFFECTS(X) \\\n    X(bias_step) \\\n    X(quantum_noise)\n' >engine/effects/registry.cpp
    echo 'return "bias_step";' >engine/effects/bias_step.cpp
    echo "$3" >>engine/gyro/device.cpp
    expect "$1" "$2" effect_names.sh engine app
}
name_fault 0 "call none of 2 effects" '// bias_step, "bias_steps", "a bias_step" and effects::bias_steps are no effects'
name_fault 1 "engine/gyro/device.cpp:4:" 'if (effect.name() == "bias_step") return;'
name_fault 1 "engine/gyro/device.cpp:4:" 'return effects::quantum_noise();'
name_fault 1 "engine/gyro/device.cpp:4:" 'complain("effects.bias_step.time_s");'
expect 2 "no sources" effect_names.sh engine/attic
rm engine/effects/registry.cpp
expect 2 "no effects" effect_names.sh engine

# message_fault STATUS WORDS LINE: the clean tree with LINE added to a source.
message_fault() {
    clean_tree
    echo 'complain("the record is short");' >app/main.cpp
    printf '%s\n' "$3" >>engine/gyro/device.cpp
    expect "$1" "$2" messages.sh
}
message_fault 0 "1 texts have plain words" '// "a word beside a word" in a comment, and "beside" in a key'
message_fault 1 "engine/gyro/device.cpp:4: a gap beside it" 'warn("a gap beside it");'
message_fault 1 "engine/gyro/device.cpp:4: what was left" $'warn("what was "\n     "left");'
message_fault 1 "in addition to" 'warn("a gap Beside it");'
message_fault 1 "begins with Of" 'warn("Rows. Of turns, the last");'
message_fault 1 "device.cpp:5: the model foretells it" $'int rows = 1\'000; char quote = \'"\';\nwarn(R"a(the model\nforetells it)a");'
message_fault 0 "2 texts have plain words" 'warn("coursework, an intellect, what remains, Often");'
clean_tree
expect 2 "no texts" messages.sh
rm -rf "$folder"/{engine,analysis,app,tests}
expect 2 "no sources" messages.sh

# text_fault STATUS WORDS LINE: a fresh repository whose one file has LINE. Slashes and words are put together here, for
# this file is read by the same check.
text_fault() {
    rm -rf "$folder"
    mkdir -p "$folder"
    git -C "$folder" -c init.defaultBranch=main init -q
    echo "$3" >"$folder/notes.md"
    expect "$1" "$2" text.sh
}
if command -v git >/dev/null; then
    s=/
    text_fault 0 "" "engine/home/x, a rate per root/hour, ../work and ~/work are no such paths"
    text_fault 1 "notes.md:1:" "see ${s}home/someone/x"
    text_fault 1 "notes.md:1:" "DATA=\"${s}root/data\""
    text_fault 1 "notes.md:1:" "cd ${s}work"
    text_fault 1 "notes.md:1:" "// TO""DO: later"
    text_fault 1 "notes.md:1:" "FIX""ME"
    text_fault 0 "" "TODOS and fixme-not"
    clean_tree
    (cd "$folder" && git init -q && echo 'H5Fop''en(path);' >>analysis/report/plot.cpp)
    expect 1 "without the guard" text.sh
    mkdir "$folder/below"
    folder="$folder/below" expect 77 "skipped" text.sh
fi

# prose_fault STATUS WORDS FILE TEXT: a folder with one file of prose, under the limits of tools/prose.
prose_fault() {
    cd "$here"
    rm -rf "$folder"
    mkdir -p "$folder"
    # shellcheck disable=SC2016
    printf '| old word | counted forms |\n|---|---|\n| `gain` | `gain of a score`, `gains` |\n' >"$folder/terms.md"
    printf '%b\n' "$4" >"$folder/$3"
    expect "$1" "$2" ../../tools/prose --check --list --terms "$folder/terms.md"
}
if command -v python3 >/dev/null; then
    words="$(printf 'word %.0s' {1..20})"
    prose_fault 0 " 2   0.00   0.00     0" page.md 'A gain.'
    prose_fault 1 "exceeds: what" page.md 'What is what, and what not'
    prose_fault 1 "page.md:3: besides" page.md '\n\nA page, besides'
    prose_fault 1 "page.md:1: gain of a score" page.md 'the gain of\na score'
    prose_fault 1 "exceeds: longest" page.md "$words$words"
    prose_fault 0 " 2   0.00" page.md "A page\n\n| beside |\n\n\`\`\`\nbeside\n\`\`\`\n\n    beside\n\n<!-- block a -->\ngains\n<!-- end a -->"
    prose_fault 0 " 2   0.00" page.md "A [page](beside.md) \`beside\`"
    prose_fault 0 " 2   0.00" a.cpp '// A comment\nconst char* beside = "// beside"; char c = 0x1\x272;'
    prose_fault 1 "a.cpp:2: beside" a.cpp 'char c = \x27"\x27;\nint a = 1; // beside'
    prose_fault 1 "a.cpp:2: beside" a.cpp '/* A comment\n beside */'
    prose_fault 1 "CMakeLists.txt:1: beside" CMakeLists.txt 'set(a "# besides") # beside'
    prose_fault 1 "a.sh:2: beside" a.sh "echo \"# besides \${#a}\"\n# beside"
    prose_fault 0 " 0   0.00" a.sh 'cat <<EOF\n# beside\nEOF'
    prose_fault 1 "a.py:2: beside" a.py 'a = "# besides"\n# beside'
    prose_fault 1 "a.py:2: beside" a.py '"""A module\nbeside"""'
    prose_fault 2 "no table" terms.md '# Terms'
    expect 2 "does not exist" ../../tools/prose "$folder/attic"
fi

# link_fault STATUS WORDS TEXT [FILE]: a repository of two pages and a source, with TEXT at the end of FILE.
link_fault() {
    cd "$here"
    rm -rf "$folder"
    mkdir -p "$folder"/{docs,engine}
    printf '# Index\n\n[Page](page.md#a-heading-of-two_words)\n' >"$folder/docs/README.md"
    # shellcheck disable=SC2016
    printf '# A heading: of `two_words`\n\n## Twice\n\n## Twice\n' >"$folder/docs/page.md"
    echo '// docs/page.md, "Twice"' >"$folder/engine/a.cpp"
    printf '%b\n' "$3" >>"$folder/${4-docs/page.md}"
    expect "$1" "$2" ../../tools/links
}
if command -v python3 >/dev/null; then
    link_fault 0 "lead somewhere" '[a](#twice-1) [b](../engine/a.cpp) ![c](../engine) [d](https://nowhere.example/x#y)'
    link_fault 0 "lead somewhere" "\`\`\`\n[a](none.md)\n\`\`\`\n\`[a](none.md)\`, \`none/a.cpp\`, docs/page.mdx"
    link_fault 0 "lead somewhere" "\`engine/{a,a}.cpp\` \`engine/*.cpp:7\` \`engine/NAME.cpp\` \`docs/\` \`results/a.h5\`"
    link_fault 1 "docs/page.md:7: link leads nowhere: none.md" '\n[a](none.md)'
    link_fault 1 "link leads nowhere: figures/none.svg" '[![a](figures/none.svg)](page.md)'
    link_fault 1 "no such heading: #twice-2" '[a](#twice-2)'
    link_fault 1 "no such heading: README.md#Index" '[a](README.md#Index)'
    link_fault 1 "leaves the repository" '[a](../../..)'
    link_fault 1 "no such path: engine/b.cpp" "see \`engine/{a,b}.cpp\`"
    link_fault 1 "no such path: docs/figures/a.svg" "see \`docs/figures/a.svg --quick\`"
    link_fault 1 "docs/loose.md:1: not reachable" 'A page' docs/loose.md
    link_fault 1 "engine/a.cpp:2: no such page: docs/none.md" '// (docs/none.md)' engine/a.cpp
    link_fault 1 'engine/a.cpp:2: no such heading: docs/page.md, "Thrice"' '// docs/page.md, "Thrice"' engine/a.cpp
    rm -rf "$folder"/{docs,engine}
    expect 2 "no links" ../../tools/links
    rmdir "$folder"
    expect 2 "is no folder" ../../tools/links
fi

if [[ $bad -eq 0 ]]; then
    echo "$checks checks behave"
fi
exit $bad
