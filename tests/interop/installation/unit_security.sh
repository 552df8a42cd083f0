#!/usr/bin/env bash
# Security of the unit by systemd: unit_security.sh UNIT. Exit code 77: systemd-analyze is missing.
set -eu
unit=$1
most=20 # tenths; systemd's own limit of "OK"

command -v systemd-analyze >/dev/null || {
  echo "SKIPPED: no systemd-analyze here (package systemd), so $unit was not checked"
  exit 77
}
# --threshold fails above its value, and prints the share of each setting.
systemd-analyze security --offline=true --no-pager --threshold=$most "$unit"
# Of the machine, not of the unit: whether the program is already installed.
complaints=$(systemd-analyze verify --man=no "$unit" 2>&1 | grep -v "is not executable: No such file" || true)
[ -z "$complaints" ] || {
  echo "$complaints" >&2
  exit 1
}
