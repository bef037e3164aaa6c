#!/usr/bin/env bash
# `closure_numbers.sh ROOT LIST FOLDER...` fails where a source in one of these folders of ROOT/analysis/closure has a
# number that may decide: a numeric constant, or a comparison with a literal other than 0, 1 and 2. Such numbers are
# documented fields of Options. Pure numerics stay where they are used and stand in LIST, one a line:
#     path | name of the constant, or the comparison as it is written | reason in a word or two
# Paths are those below analysis/closure. A line that applies to nothing is an error too.
set -euo pipefail
root="${1:?usage: closure_numbers.sh ROOT LIST FOLDER...}"
list="$(realpath "${2:?usage: closure_numbers.sh ROOT LIST FOLDER...}")"
shift 2
cd "$root/analysis/closure"

sources=()
for folder in "$@"; do
    if [[ ! -d $folder ]]; then
        echo "closure_numbers.sh: no folder analysis/closure/$folder"
        exit 2
    fi
    mapfile -t -O "${#sources[@]}" sources < <(find "$folder" -type f \( -name '*.cpp' -o -name '*.hpp' \) | LC_ALL=C sort)
done
if [[ ${#sources[@]} -eq 0 ]]; then
    echo "closure_numbers.sh: no sources under $PWD"
    exit 2
fi

# The list is read first, then each source without its comments and strings.
LC_ALL=C awk '
function trimmed(text) {
    gsub(/[ \t]+/, " ", text)
    sub(/^ /, "", text)
    sub(/ $/, "", text)
    return text
}
# Number of literals in a text, or of those that match none of `but`. Digits of names are no literals.
function literals(text, but,    count, token) {
    count = 0
    while (text != "") {
        if (match(text, /^[A-Za-z_][A-Za-z0-9_]*/)) {
        } else if (match(text, /^(0x[0-9a-fA-F.]+(p[-+]?[0-9]+)?|[.]?[0-9][0-9.]*([eE][-+]?[0-9]+)?)/)) {
            token = substr(text, 1, RLENGTH)
            if (but == "" || token !~ but) ++count
        } else {
            RLENGTH = 1
        }
        text = substr(text, RLENGTH + 1)
    }
    return count
}
# A text up to the first parenthesis that closes more than it has opened.
function closed(text,    depth, k, letter) {
    depth = 0
    for (k = 1; k <= length(text); ++k) {
        letter = substr(text, k, 1)
        if (letter == "(") ++depth
        if (letter == ")" && --depth < 0) return substr(text, 1, k - 1)
    }
    return text
}
function complain(line, key, problem) {
    if ((FILENAME, key) in allowed) {
        used[FILENAME, key] = 1
        return
    }
    print "analysis/closure/" FILENAME ":" line ": " problem ": " key
    ++bad
}
# A numeric constant: the initialiser has any number at all, for a cost of 2 decides as well as one of 2.5.
function constant(line, text,    name, value) {
    if (text !~ /[=\[{]/) return
    name = text
    sub(/ *[=\[{].*/, "", name)
    if (name ~ /[()]/) return # a function
    sub(/.*[ &*>]/, "", name)
    value = text
    sub(/^[^={]*[={]/, "", value)
    sub(/;.*/, "", value)
    if (literals(value, "") > 0) complain(line, name, "a constant that is no field of Options")
}
FILENAME == LIST {
    if ($0 ~ /^(#|[ \t]*$)/) next
    if (split($0, field, "|") != 3) {
        print LIST ":" FNR ": a line is PATH | NAME OR COMPARISON | REASON"
        ++bad
        next
    }
    allowed[trimmed(field[1]), trimmed(field[2])] = FNR
    next
}
FNR == 1 { statement = "" }
{
    line = $0
    gsub(/"([^"\\]|\\.)*"/, "\"\"", line)
    sub(/\/\/.*/, "", line)
    if (line ~ /^[ \t]*#/) next

    if (statement == "" && line ~ /(^|[ \t(])constexpr[ \t]/ && line !~ /if constexpr/) {
        statement = line
        sub(/.*constexpr[ \t]+/, "", statement)
        began = FNR
    } else if (statement != "") {
        statement = statement " " line
    } else if (match(line, /(^|[ \t])const (double|int|std::size_t|std::ptrdiff_t|Eigen::Index|auto) [a-z_0-9]+ = -?[0-9][0-9.e+-]*;/)) {
        constant(FNR, trimmed(line))
    }
    if (statement ~ /;/) {
        constant(began, trimmed(statement))
        statement = ""
    } else if (statement ~ /\) *(const *)?[{]/) {
        statement = "" # the body of a function
    }

    count = split(line, part, /&&|\|\||[?;,]| : /)
    for (k = 1; k <= count; ++k) {
        text = trimmed(part[k])
        if (text !~ / (<|>|<=|>=|==|!=) /) continue
        sub(/^.*(if|while) \(/, "", text)
        sub(/^(return|(const )?[a-z]+ [a-z_]+ =) /, "", text)
        text = closed(text)
        if (literals(text, "^[012]([.]0*)?$") > 0) complain(FNR, text, "a comparison with a number")
    }
}
END {
    for (key in allowed) {
        if (key in used) continue
        split(key, field, SUBSEP)
        print LIST ":" allowed[key] ": applies to nothing: " field[1] " | " field[2]
        ++bad
    }
    exit bad > 0
}' LIST="$list" "$list" "${sources[@]}" || {
    echo "Numbers that decide are fields of Options (analysis/closure/options*.hpp), with unit, reason and source; pure"
    echo "numerics stand in $list."
    exit 1
}
echo "${#sources[@]} files, every number that decides is a field of Options"
