#!/usr/bin/env bash
# Run by ./dev fuzz after the build: run.sh PROGRAMS SECONDS BATCH KEEP PROCESSES TARGET…
# Each target runs for SECONDS from the kept corpus and the inputs of earlier runs, then on BATCH variants of all of these; at
# the end a table, and exit code 1 with findings. KEEP=1: the corpora are chosen again from all inputs, see choose.py.
set -eu
programs=$1 seconds=$2 batch=$3 keep=$4 processes=$5
shift 5
here=$(cd "$(dirname "$0")" && pwd)
work=$programs/../corpus findings=$programs/../findings logs=$programs/../logs
mkdir -p "$work" "$findings" "$logs"
# A slower input is a hang; more memory for so few bytes is a leak.
limits="-timeout=20 -rss_limit_mb=2048 -malloc_limit_mb=512"
export ASAN_OPTIONS=detect_leaks=1:allocator_may_return_null=1:handle_abort=1 UBSAN_OPTIONS=print_stacktrace=1

# The longest input that is tried: a datagram, a connection's first packets, a small file.
longest() {
  case $1 in
    map_store_fuzz) echo 24576 ;;
    *yaml_fuzz | config_fuzz | calibration_fuzz | map_tagslam_fuzz | map_bundles_fuzz | map_rcars_fuzz | map_aruco_fuzz) echo 3072 ;;
    *) echo 1500 ;;
  esac
}

fuzz_one() {
  local target=$1
  mkdir -p "$work/$target" "$findings/$target"
  rm -f "$logs/$target.log" "$logs/$target.batch.log"
  [ "$seconds" = 0 ] || find_new "$target"
  [ "$batch" = 0 ] || "$programs/${target}_batch" "$batch" "$(date +%s)" "$(longest "$target")" \
    "$findings/$target/batch" "$here/corpus/$target" "$work/$target" >"$logs/$target.batch.log" 2>&1 || true
}

# The words of a target: its own, those of YAML, and what the sources compare bytes with.
words_of() {
  local sources=$here/../../server own=$here/dictionaries/${1/_request/}.dict
  [ ! -f "$own" ] || cat "$own"
  case $1 in
    config_fuzz | calibration_fuzz | recording_yaml_fuzz | map_yaml_fuzz | map_tagslam_fuzz | map_bundles_fuzz | map_rcars_fuzz)
      cat "$here/dictionaries/yaml.dict" ;;
  esac
  case $1 in
    config_fuzz) grep -rhoP '\bv\.\w+\("\K\w+(?=")' "$sources" | sort -u | sed 's/.*/"&:"/' ;;
    natnet*_fuzz | qualisys_fuzz)
      cat "$sources/streaming/${1%%_*}"/*.cpp | grep -v '^#include' | LC_ALL=C grep -oE '"[^"\]*"' |
        LC_ALL=C grep -E '^"[]!#-[^-~ ]{2,40}"$' | sort -u ;;
  esac
}

find_new() {
  local target=$1 dictionary=$logs/$1.dict
  local words=()
  words_of "$target" >"$dictionary"
  [ -s "$dictionary" ] && words=("-dict=$dictionary")
  # shellcheck disable=SC2086
  "$programs/$target" "$work/$target" "$here/corpus/$target" "${words[@]}" $limits -max_total_time="$seconds" \
    -max_len="$(longest "$target")" -len_control=20 -print_final_stats=1 -artifact_prefix="$findings/$target/" \
    >"$logs/$target.log" 2>&1 || true
}

row() {
  local log=$logs/$1.log
  local runs speed edges kept found varied
  touch "$log" "$logs/$1.batch.log"
  runs=$(awk '/^stat::number_of_executed_units/ {print $2}' "$log" | tail -1)
  # A target that ended early has no statistics; its last status line has the count.
  [ -n "$runs" ] || runs=$(grep -aoE '^#[0-9]+' "$log" | tail -1 | tr -d '#')
  speed=$(grep -aoE 'exec/s: [0-9]+' "$log" | tail -1 | tr -dc 0-9)
  edges=$(grep -aoE 'cov: [0-9]+' "$log" | tail -1 | tr -dc 0-9)
  kept=$(find "$work/$1" -type f | wc -l)
  found=$(find "$findings/$1" -type f | wc -l)
  varied=$(awk '/ executions, / {print $1 " " $3}' "$logs/$1.batch.log")
  # shellcheck disable=SC2086  # two words
  printf '%-22s %13s %9s %13s %9s %7s %7s %8s\n' "$1" "${runs:--}" "${speed:--}" ${varied:-- -} "${edges:--}" "$kept" "$found"
}

running=0
for target in "$@"; do
  fuzz_one "$target" &
  running=$((running + 1))
  if [ "$running" -ge "$processes" ]; then
    wait -n
    running=$((running - 1))
  fi
done
wait

printf '%-22s %13s %9s %13s %9s %7s %7s %8s\n' target executions per_s batch per_s edges corpus findings
for target in "$@"; do row "$target"; done

if [ "$keep" = 1 ]; then
  for target in "$@"; do "$here/choose.py" "$programs/$target" "$here/corpus/$target" "$work/$target"; done
fi
if [ "$batch" != 0 ]; then
  for target in "$@"; do
    grep -q ' executions, ' "$logs/$target.batch.log" || touch "$findings/$target/batch" # died
  done
fi
unsound=$(find "${@/#/$findings/}" -type f)
[ -z "$unsound" ] || {
  printf 'findings; each becomes a corpus entry when it is corrected:\n%s\n' "$unsound"
  exit 1
}
