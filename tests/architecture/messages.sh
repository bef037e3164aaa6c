#!/usr/bin/env bash
# `messages.sh ROOT` fails where a text for users has a word that only the authors understand. Texts are the literals of
# engine/, analysis/, app/ and library/ that have a space: literals without one are keys, names and units. Adjacent literals are
# one text.
set -euo pipefail
cd "${1:?usage: messages.sh ROOT}"

folders=()
for folder in engine analysis app library; do
    if [[ -d $folder ]]; then folders+=("$folder"); fi
done
if [[ ${#folders[@]} -eq 0 ]]; then
    echo "no sources in $PWD"
    exit 2
fi

# WORDS | INSTEAD: an extended regular expression for whole words in lower case, and better ones.
banned='foretell(s|ing)?|foretold | predict, predicted
tells?|told|telling | distinguish, identify, estimate, give
besides? | in addition to, next to, with, compared with
nameless | not in the library
merits? | evidence
courses? | trend, frequency track
accounts? | candidate model
summits? | maximum of the likelihood
what (is|was|were) (left|found|added|missing) | the residual, the effects
what would | to distinguish them
what the [a-z]+ (leaves?|adds?|knows?) | the residual, the part
(held|hold|holds) against | tests of, compared with
(goes|go) with | is proportional to, follows
(stood|stands?) in for | is a placeholder for
so many | the number itself
left aside | ignored
settled rows? | deterministic row'

# PATH | WORDS IN THE TEXT | REASON: the texts that may have such a word.
allowed='engine/store/guard.cpp | have h5dump show what is left | the readable part of a damaged file
analysis/noise/fit.cpp | beside spectral lines | in addition to them'

# Path, line and text of each literal, between tabs.
texts() {
    find "${folders[@]}" -type f \( -name '*.cpp' -o -name '*.hpp' \) -print0 | sort -z |
        xargs -0 --no-run-if-empty awk '
        function flush() {
            if (open && index(text, " ") > 0) print file "\t" at "\t" text
            open = 0
            text = ""
        }
        function begin() {
            if (open) return
            open = 1
            at = FNR
        }
        FNR == 1 {
            flush()
            file = FILENAME
            in_comment = in_raw = 0
        }
        {
            line = $0
            while (1) {
                if (in_raw) {
                    end = index(line, raw_end)
                    if (end == 0) {
                        text = text line " "
                        break
                    }
                    text = text substr(line, 1, end - 1)
                    line = substr(line, end + length(raw_end))
                    in_raw = 0
                    continue
                }
                if (in_comment) {
                    end = index(line, "*/")
                    if (end == 0) break
                    line = substr(line, end + 2)
                    in_comment = 0
                    continue
                }
                sub(/^[ \t]+/, "", line)
                if (line == "" || substr(line, 1, 2) == "//") break
                if (substr(line, 1, 2) == "/*") {
                    in_comment = 1
                    line = substr(line, 3)
                    continue
                }
                if (match(line, /^R"[^ ()\\"]*\(/)) {
                    begin()
                    raw_end = ")" substr(line, 3, RLENGTH - 3) "\""
                    line = substr(line, RLENGTH + 1)
                    in_raw = 1
                    continue
                }
                if (match(line, /^"([^"\\]|\\.)*"/)) {
                    begin()
                    text = text substr(line, 2, RLENGTH - 2)
                    line = substr(line, RLENGTH + 1)
                    continue
                }
                flush()
                if (line ~ /^#[ \t]*include/) break
                # A character, a word with the quotes that divide digits, what has neither quote nor slash, or one sign.
                if (match(line, /^'"'"'([^'"'"'\\]|\\.[^'"'"']*)'"'"'/) || match(line, /^[A-QS-Za-z0-9_][A-Za-z0-9_'"'"']*/) ||
                    match(line, /^R[A-Za-z0-9_]+/) || match(line, /^[^A-Za-z0-9_"'"'"'\/]+/)) {
                    line = substr(line, RLENGTH + 1)
                } else {
                    line = substr(line, 2)
                }
            }
        }
        END { flush() }'
}

found="$(texts)"
if [[ -z $found ]]; then
    echo "no texts in ${folders[*]}"
    exit 2
fi

bad=0
# is_allowed PATH TEXT
is_allowed() {
    local path words line
    while IFS= read -r line; do
        path="${line%% | *}"
        words="${line#* | }"
        words="${words%% | *}"
        if [[ $1 == $path && ($words == "*" || $2 == *"$words"*) ]]; then
                return 0
        fi
    done <<<"$allowed"
    return 1
}

while IFS= read -r line; do
    words="${line%% | *}"
    instead="${line#* | }"
    while IFS=$'\t' read -r path at text; do
        if [[ -z $path ]] || is_allowed "$path" "$text"; then continue; fi
        echo "$path:$at: $text"
        echo "^ say: $instead"
        bad=1
    done < <(awk -F'\t' -v words="(^|[^a-z_])($words)([^a-z_]|\$)" '
        { low = tolower($3); gsub(/\\n/, " ", low) }
        low ~ words' <<<"$found")
done <<<"$banned"

# A sentence says first whom it is about.
while IFS=$'\t' read -r path at text; do
    if [[ -z $path ]] || is_allowed "$path" "$text"; then continue; fi
    echo "$path:$at: $text"
    echo "^ begins with Of; say: In records of, For a"
    bad=1
done < <(awk -F'\t' '$3 ~ /(^|[.:;] |\\n)Of /' <<<"$found")

if [[ $bad -eq 0 ]]; then
    echo "$(wc -l <<<"$found") texts have plain words"
fi
exit $bad
