#!/usr/bin/env python3
"""./dev chaos: the real server, clients of every protocol, and faults at random instants.

After each instant every protocol has to deliver again by itself, and the stored map has to be sound and no older. The seed
determines faults, instants and durations; their effect depends on real time. Exit code 1 when a protocol did not recover; the
server's log is kept. However this script ends, server and disk end with it.
"""

import argparse
import collections
import contextlib
import json
import os
import random
import signal
import statistics
import struct
import sys
import time

import clients
import faults
import stage

WITHIN_S = 30  # the watchdog's twenty seconds, a restart, poses of all bodies
STEADY_S = 2.5  # of frames: the protocol has recovered
RATE_HZ = 100


class Instant:
    """Effects of one fault. Frames lost: 100 for each second without frames of the native client."""

    def __init__(self, kind):
        self.kind = kind
        self.recovery_s = {}  # by protocol, after the end of the fault
        self.missing = []  # protocols that did not recover
        self.frames_lost = 0
        self.versions_lost = 0
        self.problems = []
        self.alarms = set()
        self.restarted = False
        self.stood_still_s = 0.0  # this program, for want of a processor


class Chaos:
    """Disk, server, sensor driver and clients, which end with it."""

    def __init__(self, programs, folder, seed, shim):
        self.random = random.Random(seed)
        self.programs = programs
        self.newest_event = 0
        with contextlib.ExitStack() as owned:
            self.disk = owned.enter_context(stage.Disk(folder))
            self.store = stage.store_of(self.disk.folder)
            self.driver = driver = stage.SensorDriver(programs) if stage.SensorDriver.exists(programs) else None
            arguments = stage.arguments_of_server(folder, self.disk.folder, driver is not None)
            if problem := stage.why_not_mapping(programs, arguments):
                sys.exit(problem)
            self.service = owned.enter_context(stage.Service(programs, arguments, folder, shim))
            self.clients = clients.of_every_protocol(programs)
            if driver:
                owned.enter_context(driver)
                self.clients.append(clients.RosSource(stage.ROS_BODY))
            self.faults = faults.Faults(programs, self.service, self.disk, driver, shim, self.random)
            self.metronome = clients.Metronome()
            for client in (self.metronome, *self.clients):
                client.start()
                owned.callback(client.stop)
            self.owned = owned.pop_all()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.owned.close()

    def wait_until_all_flow(self, begin, within):
        """@return seconds from `begin` by protocol, None for those that did not recover"""
        while True:
            now = time.monotonic()
            since = {c.name_of_protocol: c.flows_since(begin, now) for c in self.clients}
            if all(s is not None and now - s >= STEADY_S for s in since.values()):
                return {name: s - begin for name, s in since.items()}
            if now - begin > within + STEADY_S:
                return {name: None if s is None else s - begin for name, s in since.items()}
            time.sleep(0.1)

    def version(self, instant):
        try:
            sound, version = stage.newest_version(self.store)
            if sound != "ok":
                instant.problems.append(f"store: {sound}")
            return version
        except Exception as error:  # any of SQLite
            instant.problems.append(f"store cannot be read: {error}")
            return None

    def alarms(self):
        """Subjects and kinds of the page's events since the last call."""
        try:
            events = json.loads(clients.get("/api/v1/state")[1]).get("events", {})
        except (OSError, ValueError, IndexError):
            return set()
        events = events.get("events", []) if isinstance(events, dict) else events
        numbers = [e.get("number", e.get("n", 0)) for e in events]
        if numbers and max(numbers) < self.newest_event:
            self.newest_event = 0  # another server since
        fresh = [e for e, n in zip(events, numbers) if n > self.newest_event and not e.get("over")]
        self.newest_event = max(numbers, default=0)
        return {f'{e.get("subject")}: {e.get("kind")}' for e in fresh}

    def one_instant(self):
        kind = self.random.choice(sorted(self.faults.kinds))
        recording = self.random.random() < 0.3
        time.sleep(self.random.uniform(0.5, 3))
        instant = Instant(kind)
        before = self.version(instant)
        self.alarms()
        if recording:
            stage.operator(self.programs, "record", f"chaos-{time.monotonic_ns()}")
        restarts = self.service.restarts
        begin = time.monotonic()
        self.faults.kinds[kind]()
        well = time.monotonic()
        found = self.wait_until_all_flow(well, WITHIN_S)
        instant.recovery_s = {name: s for name, s in found.items() if s is not None and s <= WITHIN_S}
        instant.missing = [name for name in found if name not in instant.recovery_s]
        end = time.monotonic()
        instant.frames_lost = round(RATE_HZ * self.clients[0].silent_between(begin, end))
        instant.stood_still_s = self.metronome.silent_between(begin, end)
        if recording:
            stage.operator(self.programs, "stop")
        faults.forget_recordings(self.disk)
        after = self.version(instant)
        if before is not None and after is not None:
            instant.versions_lost = max(0, before - after)
        instant.alarms = self.alarms()
        instant.restarted = self.service.restarts > restarts
        return instant

    def end(self):
        """@return sentences about faults at the end"""
        for client in self.clients:
            client.stopping.set()
        if self.driver:
            self.driver.unplug()
        return stage.what_is_wrong_at_the_end(self.service, self.store)


def forget_logs(folder):
    for old in ("fiducapd.log", "thrown"):
        with contextlib.suppress(FileNotFoundError):
            os.remove(os.path.join(folder, old))


def thrown(folder):
    try:
        with open(os.path.join(folder, "thrown"), "rb") as file:
            return struct.unpack("<I", file.read(4))[0]
    except (OSError, struct.error):
        return 0


def table(instants, protocols):
    lines = []
    by_kind = collections.defaultdict(list)
    for instant in instants:
        by_kind[instant.kind].append(instant)
    lines.append(f'{"fault":18}{"instants":>9}{"back":>6}{"restarts":>9}{"frames lost":>13}{"versions lost":>14}   median / max s until it flows')
    lines.append(f'{"":18}{"":>9}{"":>6}{"":>9}{"median / max":>13}{"":>14}   ' + "  ".join(f"{p:>11}" for p in protocols))
    for kind, some in sorted(by_kind.items()):
        lost = [i.frames_lost for i in some]
        times = []
        for protocol in protocols:
            seconds = [i.recovery_s[protocol] for i in some if protocol in i.recovery_s]
            times.append(f"{statistics.median(seconds):5.1f}/{max(seconds):5.1f}" if seconds else "-")
        lines.append(f"{kind:18}{len(some):>9}{sum(not i.missing for i in some):>6}{sum(i.restarted for i in some):>9}"
                     f"{f'{round(statistics.median(lost))} / {max(lost)}':>13}{sum(i.versions_lost for i in some):>14}   "
                     + "  ".join(f"{t:>11}" for t in times))
    for kind, some in sorted(by_kind.items()):
        alarms = collections.Counter(alarm for i in some for alarm in i.alarms)
        if alarms:
            lines.append(f"alarms after {kind}: " + ", ".join(f"{alarm} ({n})" for alarm, n in alarms.most_common()))
    return "\n".join(lines)


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--instants", type=stage.at_least_one, default=50)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--programs", default=os.path.join(stage.ROOT, "build/release/bin"))
    parser.add_argument("--folder", default=os.path.join(stage.ROOT, "build/chaos"), help="logs and the disk of the server")
    parser.add_argument("--only", help="one kind of fault")
    return parser.parse_args()


def run(chaos, given, instants):
    """@return number of instants with faults; None when a protocol does not flow at first"""
    bad = 0
    first = chaos.wait_until_all_flow(time.monotonic(), 60)
    if None in first.values():
        print("before the first fault, these do not flow: " + ", ".join(n for n, s in first.items() if s is None))
        return None
    for number in range(1, given.instants + 1):
        instant = chaos.one_instant()
        instants.append(instant)
        wrong = [f"{name} did not recover" for name in instant.missing] + instant.problems
        if instant.versions_lost:
            wrong.append(f"{instant.versions_lost} map version(s) lost")
        slowest = max(instant.recovery_s.values(), default=0)
        print(f"{number}/{given.instants} {instant.kind}: " + ("; ".join(wrong) or f"recovered within {slowest:.1f} s")
              + (", restarted" if instant.restarted else "") + f", {instant.frames_lost} frames lost"
              + (f" (this program stood still for {instant.stood_still_s:.1f} s)" if instant.stood_still_s > 0.3 else ""), flush=True)
        if wrong:
            bad += 1
            os.kill(chaos.service.pid, signal.SIGKILL)  # so that the next instants count for themselves
            chaos.wait_until_all_flow(time.monotonic() + stage.RESTART_S, 60)
    return bad


def main():
    given = parse()
    stage.enter_namespaces()
    folder = os.path.abspath(given.folder)
    os.makedirs(folder, exist_ok=True)
    forget_logs(folder)
    shim = os.path.join(given.programs, "libthrowing_new.so")
    instants, bad = [], None
    with Chaos(os.path.abspath(given.programs), folder, given.seed, shim if os.path.exists(shim) else None) as chaos:
        for kind, why in chaos.faults.left_out.items():
            print(f"left out: {kind}: {why}", flush=True)
        if given.only:
            chaos.faults.kinds = {given.only: chaos.faults.kinds[given.only]}
        try:
            bad = run(chaos, given, instants)
        finally:
            exceptions, missed = thrown(folder), chaos.clients[0].lost
            watchdog, ends = chaos.service.watchdog_kills, [code for _, code in chaos.service.ends]
            at_the_end = chaos.end()
            if instants:
                print("\n" + table(instants, [c.name_of_protocol for c in chaos.clients]))
            print(f"\nseed {given.seed}: {len(instants)} instants, {bad} with faults; the server ended {len(ends)} times "
                  f"({dict(collections.Counter(ends))}), {watchdog} by its watchdog; {exceptions} exceptions thrown; the SDK missed "
                  f"{missed} numbers; at the end " + ("; ".join(at_the_end) or "no fault"), flush=True)
    if bad is None or bad or at_the_end:
        print(f"the server's log: {os.path.join(folder, 'fiducapd.log')}")
        return 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
