# shellcheck shell=bash
# ./dev verify, which sources this file and lends it `need`, `configure`, `tested`, … Parts: tests/parts.cmake and docs/tests.md.
readonly VERIFY_PARTS=(interop statistics sanitizers fuzz tidy browser guide install paper benches chaos)
readonly VERIFY_FOLDER=build/verify

packages_of_part() {
  case "$1" in
    interop) echo libfastrtps-dev fastddsgen python3 ;;
    sanitizers | fuzz) echo "$FUZZ_PACKAGES" ;;
    tidy) if [ "$(debian_release)" = 12 ]; then echo "$STYLE_PACKAGES"; fi ;;
    browser) echo chromium ;;
    guide) echo poppler-utils python3 ;;
    chaos) echo libfastrtps-dev fastddsgen python3 util-linux e2fsprogs iproute2 ;;
  esac
}

# What is verified: the commit, and what differs from it. Empty where there is no repository.
verified_tree() {
  git rev-parse HEAD 2>/dev/null || return 0
  git diff HEAD | git hash-object --stdin
}

# limited COMMAND…: exit code 124 or 137 when the time is over
limited() {
  if [ "$verify_until" -eq 0 ]; then
    "$@"
    return
  fi
  local left=$((verify_until - SECONDS))
  [ "$left" -gt 0 ] || return 124
  timeout --kill-after=20 "$left" "$@"
}

# verify_slice LABEL TARGETS: builds and tests; adds to the part's figures and sets $result
verify_slice() {
  local label=$1 targets=$2 begin=$SECONDS code=0 log=$VERIFY_FOLDER/$part order=()
  [ "$verify_until" -eq 0 ] || order=(--schedule-random) # so that each test runs sometimes
  # shellcheck disable=SC2086  # words on purpose
  [ -z "$targets" ] || limited ./dev build release $targets || code=$?
  build_s=$((build_s + SECONDS - begin))
  if [ "$code" -ne 0 ]; then
    result="FAILED to build"
    case $code in 124 | 137) result="not finished" ;; esac
    return
  fi
  begin=$SECONDS
  limited ./dev ctest "$log" -L "^part-$part\$" -L "^$label\$" --no-tests=error "${order[@]}" || code=$?
  test_s=$((test_s + SECONDS - begin))
  ran=$((ran + $(grep -cE '^ *[0-9]+/[0-9]+ Test +#' "$log.txt" || true)))
  skipped=$((skipped + $(grep -cE '^ *[0-9]+/[0-9]+ Test .*\*\*\*(Skipped|Not Run)' "$log.txt" || true)))
  if [ "$code" -eq 0 ]; then return; fi
  result=FAILED
  case $code in
    124 | 137) grep -qE '^ *[0-9]+/[0-9]+ Test .*\*\*\*(Failed|Timeout|Exception|Not Run)' "$log.txt" || result="not finished" ;;
  esac
}

# verify_part PART FIRST: with a time limit slice by slice from number FIRST on, else all at once
verify_part() {
  local part=$1 first=$2 build_s=0 test_s=0 ran=0 skipped=0 result=passed slices i label targets
  # shellcheck disable=SC2046
  need $(packages_of_part "$part")
  configure release
  if [ "$verify_until" -eq 0 ]; then
    slices=("part-$part fiducap_$part")
  else
    mapfile -t slices < <(sed -n "s/^$part //p" build/release/slices.txt)
  fi
  [ ${#slices[@]} -gt 0 ] || result="FAILED: no test is in it"
  for ((i = 0; i < ${#slices[@]}; i++)); do
    read -r label targets <<<"${slices[(first + i) % ${#slices[@]}]}"
    say "verify $part: $label"
    verify_slice "$label" "$targets"
    [ "$result" = passed ] || break
  done
  case $result in
    passed) [ -z "$tree" ] || echo "$tree$part" >>"$VERIFY_FOLDER/passed" ;;
    FAILED*) verify_failed=1 ;;
  esac
  verify_table+=("$(printf '%-12s %7d.%d %7d.%d %7d %8d  %s' "$part" $((build_s / 60)) $((build_s % 60 / 6)) \
    $((test_s / 60)) $((test_s % 60 / 6)) "$ran" "$skipped" "$result")")
}

# rotated_turn: grows by one with every commit; with every day where only the last commits are here
rotated_turn() {
  if [ "$(git rev-parse --is-shallow-repository 2>/dev/null)" = false ]; then
    git rev-list --count HEAD
  else
    echo $(($(date +%s) / 86400))
  fi
}

# verify [PART...] [--again] [--minutes N] [--rotate]; verify --list
verify() {
  local parts=() again=0 rotate=0 minutes=0 turn=0 first=0 tree part
  while [ $# -gt 0 ]; do
    case "$1" in
      --list)
        sed -n '/^| part /,/^$/p' docs/tests.md
        return
        ;;
      --again) again=1 ;;
      --rotate) rotate=1 ;;
      --minutes)
        case "${2:-}" in '' | *[!0-9]*) die "--minutes needs a whole number" ;; esac
        minutes=$2
        shift
        ;;
      *)
        case " ${VERIFY_PARTS[*]} " in *" $1 "*) ;; *) die "verify: there is no part $1; there are: ${VERIFY_PARTS[*]}" ;; esac
        parts+=("$1")
        ;;
    esac
    shift
  done
  [ ${#parts[@]} -gt 0 ] || parts=("${VERIFY_PARTS[@]}")
  if [ "$rotate" -eq 1 ]; then
    turn=$(rotated_turn)
    first=$((turn / ${#parts[@]}))
    parts=("${parts[turn % ${#parts[@]}]}")
    say "turn $turn is that of ${parts[0]}"
  fi
  mkdir -p "$VERIFY_FOLDER"
  touch "$VERIFY_FOLDER/passed"
  tree=$(verified_tree | tr '\n' ' ')
  verify_until=0 verify_failed=0 verify_table=()
  [ "$minutes" -eq 0 ] || verify_until=$((SECONDS + 60 * minutes))
  for part in "${parts[@]}"; do
    if [ "$again" -eq 0 ] && [ -n "$tree" ] && grep -qxF "$tree$part" "$VERIFY_FOLDER/passed"; then
      verify_table+=("$(printf '%-12s %9s %9s %7s %8s  %s' "$part" - - - - "passed before (--again runs it once more)")")
    else
      sed -i "/ $part\$/d" "$VERIFY_FOLDER/passed"
      verify_part "$part" "$first"
    fi
  done
  printf '\n%-12s %9s %9s %7s %8s  %s\n' part "build min" "tests min" tests skipped result
  printf '%s\n' "${verify_table[@]}"
  return "$verify_failed"
}
