#!/usr/bin/env bash
# What systemd thinks of the unit: unit_security.sh UNIT. Exit code 77: there is no systemd-analyze to ask.
set -eu
unit=$1
most=20 # tenths; where systemd itself speaks of "OK"

command -v systemd-analyze >/dev/null || {
  echo "SKIPPED: no systemd-analyze here (package systemd), so nobody judged $unit"
  exit 77
}
# --threshold fails above its value, and prints which setting costs how much.
systemd-analyze security --offline=true --no-pager --threshold=$most "$unit"
# Of the machine, not of the unit: whether the program is already installed.
complaints=$(systemd-analyze verify --man=no "$unit" 2>&1 | grep -v "is not executable: No such file" || true)
[ -z "$complaints" ] || {
  echo "$complaints" >&2
  exit 1
}
