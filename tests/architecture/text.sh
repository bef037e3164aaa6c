#!/usr/bin/env bash
# `text.sh ROOT` fails where a text file of the repository names a folder of one machine or an open end.
# Ends with 77, which ctest counts as skipped, outside a git checkout.
set -euo pipefail
cd "${1:?usage: text.sh ROOT}"

if ! command -v git >/dev/null; then
    echo "skipped: no git"
    exit 77
fi
if ! git rev-parse --show-toplevel; then
    echo "skipped: not a git checkout"
    exit 77
fi
# A copy without its own .git inside another checkout would be judged by the other's list of files.
if [[ $(git rev-parse --show-cdup) != "" ]]; then
    echo "skipped: not the top of a git checkout"
    exit 77
fi

bad=0
# check WHAT PATTERN: files that git tracks or would add. The brackets in the patterns keep them from matching
# themselves.
check() {
    local found=0
    git grep --untracked -nIE -e "$2" || found=$?
    case $found in
        0)
            echo "^ $1"
            bad=1
            ;;
        1) ;;
        *)
            echo "text.sh: git grep failed"
            exit 2
            ;;
    esac
}
check "path of one machine" '(^|[^[:alnum:]_.}~/])/((hom[e]|User[s]|roo[t])/|(wor[k]|workspac[e])($|[^[:alnum:]_]))'
check "open end; write it into the changelog or do it" '(^|[^[:alnum:]_])(TOD[O]|FIXM[E])($|[^[:alnum:]_])'

# `for (x : make().parts.front().of)` goes over the parts of an object that is gone: the loop keeps the last temporary
# of the expression only.
if git grep --untracked -nE \
    'for \([^;]* : ([a-z_]+::)*[a-z_]+\(.*\)(\.[a-z_]+)*(->|\.(front|back|at|value|items|elements)\(|\[)' \
    -- '*.cpp' '*.hpp'; then
    echo "^ may go over a part of a temporary; give the object a name"
    bad=1
fi
# Files that somebody names are opened behind store::guarded() alone: by File::open(), which takes nothing but its
# permission, and by the reader of MAT-files within it.
if git grep --untracked -nE 'H5Fope[n]|Mat_Ope[n]|archive_read_ope[n]' -- engine analysis app ':!engine/store' \
    ':!analysis/record/arrays/mat_series.cpp' ':!analysis/record/arrays/npy_series.cpp'; then
    echo "^ opens a file without the guard"
    bad=1
fi
# In the program no file is read without its trial.
if git grep --untracked -n 'WithoutTria[l]' -- engine analysis app ':!engine/store/without_trial.*'; then
    echo "^ reads a file without its trial"
    bad=1
fi
exit $bad
