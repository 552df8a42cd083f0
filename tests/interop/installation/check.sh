#!/usr/bin/env bash
# The installed server: check.sh BUILD WORK PREFIX. All files are in their places, the programs run from there, the unit
# names installed files.
set -eu
build=$1 work=$2 prefix=$3
if [ "$prefix" = /usr ]; then etc=/etc/fiducap; else etc=$prefix/etc/fiducap; fi

die() {
  echo "$*" >&2
  exit 1
}
installed() { [ -s "$work$1" ] || die "not installed: $1"; }
install_it() { DESTDIR=$work cmake --install "$build" --prefix "$prefix" --component server >"$build/installed.txt"; }

rm -rf "$work"
install_it
for file in "$prefix"/bin/{fiducapd,fiducap} "$prefix"/share/doc/fiducap/{README.md,LICENSE,docs/calibration.md} \
  "$prefix"/share/doc/fiducap/config/one_robot.yaml "$etc/fiducap.yaml" "$prefix"/lib/udev/rules.d/99-fiducap-cameras.rules; do
  installed "$file"
done

# The unit: its programs and files are where it names them.
unit=$prefix/lib/systemd/system/fiducapd.service
installed "$unit"
start=$(sed -n 's/^ExecStart=//p' "$work$unit")
# shellcheck disable=SC2086  # words on purpose
set -- $start
installed "$1"
[ "$2" = --config ] || die "ExecStart names no configuration: $start"
installed "$3"
program=$work$1 configuration=$work$3
installed "$(sed -n 's|^Documentation=file://||p' "$work$unit")"
token=$(sed -n 's/^LoadCredential=token://p' "$work$unit")
[ "$token" = "$etc/token" ] || die "the token is looked for in $token"

# The programs, from there.
version=$("$program" --version)
[ "$("$work$prefix/bin/fiducap" --version)" = "$version" ] || die "the programs differ in their version"
# Its only fault may be a missing camera; with the simulator's it has none.
"$program" --config "$configuration" --check-config >"$work/review" 2>&1 || true
grep '^wrong' "$work/review" | grep -v /dev/video0 && die "the first configuration is not usable: $(cat "$work/review")"
"$program" --config "$configuration" --check-config --set "bodies.0.source={type: simulator}" ||
  die "the first configuration is not usable"

# The page, by the installed server, which would report a missing one.
for example in "$work$prefix"/share/doc/fiducap/config/*.yaml; do
  "$program" --config "$example" --print-config >/dev/null || die "$example does not load"
done
free=(--set streaming.web.port=0 --set streaming.native.port=0 --set streaming.vrpn.port=0)
simulated=(--set "bodies.0.source={type: simulator}" --set "map.store=''" --set recorder.folder=none)
"$program" --config "$configuration" "${free[@]}" "${simulated[@]}" >"$work/log" 2>&1 &
server=$!
trap 'kill -KILL $server 2>/dev/null || true' EXIT
for _ in $(seq 600); do
  grep -q "serving 1 bodies" "$work/log" && break
  kill -0 "$server" 2>/dev/null || die "the server ended: $(cat "$work/log")"
  sleep 0.05
done
port=$(sed -n 's|.*page on http://127.0.0.1:\([0-9]*\)/.*|\1|p' "$work/log")
exec 3<>"/dev/tcp/127.0.0.1/$port"
printf 'GET / HTTP/1.0\r\nHost: 127.0.0.1\r\n\r\n' >&3
answer=$(timeout 20 cat <&3)
kill -TERM "$server"
wait "$server" || die "the server ended badly: $(cat "$work/log")"
trap - EXIT
if [ -d "$build/bin/web" ]; then
  case "$answer" in *"<title>Fiducap"*) ;; *) die "the installed server has no page: $answer" ;; esac
else
  echo "there is no page in this build: not checked"
fi

# A second installation keeps the configuration.
echo "log_level: debug" >"$configuration"
install_it
[ "$(cat "$configuration")" = "log_level: debug" ] || die "a second installation wrote over the configuration"
echo "$version: installed below $prefix, runs from there"
