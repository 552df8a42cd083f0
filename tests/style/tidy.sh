#!/usr/bin/env bash
# clang-tidy over our sources by .clang-tidy: tidy.sh BUILD_FOLDER [PATTERN]
#
# Its cost is the repeated parsing of headers, so it reads what the compiler reads: a few sources of one
# folder at once (FIDUCAP_TOGETHER). Exit code 77: it is missing or has another version.
set -eu
cd "$(dirname "$0")/../.."
build=$1
pattern=${2:-.}
readonly kMajor=14

say_why_not() {
  echo "clang-tidy did not run: $*"
  exit 77
}
tidy=$(command -v clang-tidy-$kMajor || command -v clang-tidy || true)
[ -n "$tidy" ] || say_why_not "it is not installed (Debian 12: apt install clang-tidy)"
"$tidy" --version | grep -q "version $kMajor\." || say_why_not "$tidy is not version $kMajor"
[ -f "$build/compile_commands.json" ] || say_why_not "$build is not configured"

# One line per source of the server and the client: file, tab, its flags without those of GCC and of its precompiled
# headers. Entries of the tests are left out, which compile some of the sources again.
sources=$(awk '/"command":/ {sub(/^[^:]*: "/, ""); sub(/",?$/, ""); gsub(/\\"/, "\""); gsub(/\\\\/, "\\"); command = $0}
    /"file":/ {gsub(/^[^:]*: "|",?$/, ""); print $0 "\t" command}' "$build/compile_commands.json" |
  sed -E 's/\t[^ ]*ccache / /; s/ -o [^ ]+ -c [^ ]+//; s/ -include [^ ]*cmake_pch[^ ]*//
    s/ -(fpch-preprocess|Winvalid-pch|Wno-restrict|Wno-subobject-linkage)//g; s/\t[^ ]+ /\t/' |
  awk -F'\t' -v pattern="$pattern" '$1 ~ /\/(server|client\/src)\// && $1 ~ /\.(cpp|cxx)$/ && $1 !~ /precompiled/ &&
    $1 ~ pattern && !/precompiled_[a-z_]*test/ && !seen[$1]++')
[ -n "$sources" ] || say_why_not "no source is built in $build"

# CI has no time for all sources: those that the newest commits have changed, and a third of the rest, another one with
# each commit. By hand all are read.
readonly kNewest=40 kTurns=3
if [ -n "${CI:-}" ] && oldest=$(git rev-parse --quiet --verify "HEAD~$kNewest"); then
  changed=$(git diff --name-only --diff-filter=d "$oldest" HEAD -- server client | while IFS= read -r file; do
    case $file in
      *.cpp) echo "$file" ;;
      *.hpp) git grep -l -F "\"${file#server/}\"" -- 'server/*.cpp' 'client/*.cpp' || true ;;
    esac
  done | sort -u)
  turn=$(($(git rev-list --count HEAD) % kTurns))
  number=0
  sources=$(while IFS= read -r line; do
    file=${line%%$'\t'*}
    number=$((number + 1))
    if [ $((number % kTurns)) -eq "$turn" ] ||
      { echo "$file"; cat "$file"; } | grep -qF "${changed:-no source}"; then
      printf '%s\n' "$line"
    fi
  done <<<"$sources")
fi
echo "clang-tidy reads $(wc -l <<<"$sources") sources"

# tidied LINE
tidied() {
  local file=${1%%$'\t'*} found
  eval "set -- ${1#*$'\t'}"
  found=$("$tidy" --quiet --config-file=.clang-tidy "$file" -- "$@" 2>/dev/null) && return 0
  echo "$found"
  return 1
}
export -f tidied
export tidy
printf '%s\n' "$sources" | tr '\n' '\0' | xargs -0 -P "$(nproc)" -n 1 bash -c 'tidied "$1"' tidied
