#!/usr/bin/env python3
"""./dev soak: the real server for an hour, three robots that map one room, with clients of all protocols that come, go and stall.

A line a minute: memory, descriptors, threads and processor time of the server with the clients that stay, versions of the map,
frames, clients. At the end the verdict: after the warm-up nothing grows, a client that stayed missed no frame, and SIGTERM ended
the server within a second with the map stored. Exit code 1 otherwise. However this script ends, server and disk end with it.
"""

import argparse
import contextlib
import csv
import multiprocessing
import os
import random
import re
import sys
import time

import chaos
import clients
import faults
import stage

WARM_UP_MIN = 2  # the map's first tags, clients' first buffers
SETTLED_S = 6  # clients that stalled are closed by then
RECORD_EVERY = 3  # minutes: a recording of some seconds
# Permitted growth after the warm-up, a minute: the map's last tags, a log's buffer; less than a leak of one client.
MOST_KB_PER_MINUTE = 1024
# … and in an hour with a complete map, which a run of half of one can measure.
MOST_KB_PER_HOUR = 8 * 1024
LEARNED_MIN = 5
LONG_MIN = 30
MOST_PER_HOUR = {"descriptors": 2.0, "threads": 1.0}
# Of one processor: the load by other clients differs by this from minute to minute.
MOST_CPU_GROWTH_PERCENT = 10.0
COLUMNS = ("minute", "rss_kb", "descriptors", "threads", "cpu_percent", "map_version", "frames_hz", "lost", "silent_s", "joined", "left",
           "stalled", "clients")


class Visitors:
    """Clients that come, stall and go."""

    KINDS = (clients.Vrpn, clients.NatNet, clients.Vicon, clients.Qualisys, clients.Web, clients.Health)

    def __init__(self, programs, random_, most=12):
        self.programs, self.random, self.most = programs, random_, most
        self.members = []
        self.joined = self.left = self.stalled = 0

    def step(self):
        choice = self.random.random()
        if (choice < 0.45 and len(self.members) < self.most) or not self.members:
            kind = self.random.choice(self.KINDS + (clients.Native,))
            client = kind(self.programs) if kind is clients.Native else kind()
            client.start()
            self.members.append(client)
            self.joined += 1
        elif choice < 0.8:
            self.members.pop(self.random.randrange(len(self.members))).stop()
            self.left += 1
        else:
            client = self.random.choice(self.members)
            if client.stalled.is_set():
                client.stalled.clear()
            else:
                client.stalled.set()
                self.stalled += 1

    def leave(self):
        for client in self.members:
            client.stopping.set()
        for client in self.members:
            client.stop()
        self.left += len(self.members)
        self.members = []


def settled(rows, column, begin_min=WARM_UP_MIN):
    """The column from the end of the warm-up on, over hours."""
    return [(row["since_s"] / 3600, row[column]) for row in rows if row["minute"] >= begin_min]


def slope_per_hour(points):
    """Least squares."""
    if len(points) < 2:
        return 0.0
    mean_t = sum(t for t, _ in points) / len(points)
    mean_y = sum(y for _, y in points) / len(points)
    spread = sum((t - mean_t) ** 2 for t, _ in points)
    return sum((t - mean_t) * (y - mean_y) for t, y in points) / spread


def grows(rows):
    """@return sentences about growth after the warm-up"""
    wrong = []
    limits = [("rss_kb", 60 * MOST_KB_PER_MINUTE, WARM_UP_MIN)]
    if rows and rows[-1]["minute"] >= LONG_MIN:
        limits.append(("rss_kb", MOST_KB_PER_HOUR, LEARNED_MIN))
    limits += [(column, most, WARM_UP_MIN) for column, most in MOST_PER_HOUR.items()]
    for column, most, begin_min in limits:
        points = settled(rows, column, begin_min)
        slope = slope_per_hour(points)
        grown = points[-1][1] - points[0][1] if points else 0
        print(f"{column}: {slope:+.1f} an hour (at most {most:g}), {grown:+d} in all")
        # A short run's slope is noise: growth is needed as well.
        if slope > most and grown > (1024 if column == "rss_kb" else 2):
            wrong.append(f"{column} grows")
    points = settled(rows, "cpu_percent")
    growth = slope_per_hour(points) * (points[-1][0] - points[0][0]) if points else 0.0
    print(f"cpu_percent: {growth:+.1f} in all (at most {MOST_CPU_GROWTH_PERCENT:g})")
    if growth > MOST_CPU_GROWTH_PERCENT:
        wrong.append("processor time grows")
    return wrong


def late_ticks(cpu, period_s, missed):
    """Counts the ticks for which a thread of higher priority than the server's, with no work, woke a period too late."""
    os.sched_setaffinity(0, {cpu})
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(20))
    due = time.monotonic()
    while True:
        due += period_s
        time.sleep(max(0.0, due - time.monotonic()))
        late = int((time.monotonic() - due) / period_s)
        if late > 0:
            missed.value += late
            due += late * period_s


class Machine:
    """What this machine misses by itself: a kernel or a host that stops a processor for a tick also stops the server."""

    def __init__(self):
        self.missed = [multiprocessing.Value("q", 0, lock=False) for _ in os.sched_getaffinity(0)]
        self.processes = [multiprocessing.Process(target=late_ticks, args=(cpu, 1 / chaos.RATE_HZ, missed), daemon=True)
                          for cpu, missed in zip(sorted(os.sched_getaffinity(0)), self.missed)]

    def __enter__(self):
        for process in self.processes:
            process.start()
        return self

    def __exit__(self, *_):
        for process in self.processes:
            process.kill()

    def ticks(self):
        return sum(missed.value for missed in self.missed)


def verdict(rows, ticks, machine):
    """@return sentences about faults; what a bare real-time thread missed is the machine's, not the server's"""
    wrong = grows(rows)
    lost = sum(row["lost"] for row in rows)
    silent = sum(row["silent_s"] for row in rows if row["minute"] > 1)
    print(f"ticks missed by the server: {ticks}, by real-time threads without work: {machine}; frames missed by the SDK: {lost}; "
          f"its program was without any for {silent:.1f} s (on a busy machine: its own fault)")
    if not 0 <= ticks <= machine:
        wrong.append("frames were not made in time")
    if lost > machine:
        wrong.append("frames were missed")
    if rows and not rows[-1]["map_version"]:
        wrong.append("no version of the map was stored")
    return wrong


def missed_ticks(folder):
    with open(os.path.join(folder, "fiducapd.log"), encoding="utf-8", errors="replace") as file:
        found = re.findall(r"frames published, (\d+) ticks missed", file.read())
    return int(found[-1]) if found else -1


class Soak:
    """Disk, server and clients, which end with it."""

    def __init__(self, given, folder):
        self.programs = programs = os.path.abspath(given.programs)
        self.random = random.Random(given.seed)
        self.rows = []
        with contextlib.ExitStack() as owned:
            self.disk = owned.enter_context(stage.Disk(folder, 512))
            arguments = stage.arguments_of_server(folder, self.disk.folder, False)
            if problem := stage.why_not_mapping(programs, arguments):
                sys.exit(problem)
            self.store = stage.store_of(self.disk.folder)
            self.service = owned.enter_context(stage.Service(programs, arguments, folder))
            self.began = time.monotonic()
            self.staying = clients.of_every_protocol(programs)
            for client in self.staying:
                client.start()
                owned.callback(client.stop)
            self.visitors = Visitors(programs, self.random)
            owned.callback(self.visitors.leave)
            self.owned = owned.pop_all()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.owned.close()

    def minute(self, number):
        begin = time.monotonic()
        native = self.staying[0]
        frames, lost, cpu_s = native.count, native.lost, self.service.cpu_s()
        while time.monotonic() - begin < 60:
            self.visitors.step()
            time.sleep(self.random.uniform(0.2, 1.5))
            if self.service.restarts:
                raise RuntimeError("the server ended by itself")
        if number % RECORD_EVERY == 0:
            stage.operator(self.programs, "record", f"soak-{number}")
            time.sleep(3)
            stage.operator(self.programs, "stop")
            faults.forget_recordings(self.disk)
        end = time.monotonic()
        cpu_percent = round(100 * (self.service.cpu_s() - cpu_s) / (end - begin), 1)
        rate, lost = round((native.count - frames) / (end - begin), 1), native.lost - lost
        present = len(self.staying) + len(self.visitors.members)
        self.visitors.leave()  # the figures are those with the same clients each time
        time.sleep(SETTLED_S)
        rss, descriptors, threads = self.service.figures()
        silent = round(native.silent_between(begin, end), 2)
        row = dict(zip(COLUMNS, (number, rss, descriptors, threads, cpu_percent, stage.newest_version(self.store)[1], rate, lost,
                                 silent, self.visitors.joined, self.visitors.left, self.visitors.stalled, present)))
        self.rows.append({**row, "since_s": time.monotonic() - self.began})
        return row

    def end(self):
        """@return sentences about faults at the end"""
        for client in self.staying:
            client.stopping.set()
        self.visitors.leave()
        return stage.what_is_wrong_at_the_end(self.service, self.store)


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--minutes", type=stage.at_least_one, default=60)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--programs", default=os.path.join(stage.ROOT, "build/release/bin"))
    parser.add_argument("--folder", default=os.path.join(stage.ROOT, "build/soak"), help="log, disk of the server, soak.csv")
    return parser.parse_args()


def main():
    given = parse()
    stage.enter_namespaces()
    folder = os.path.abspath(given.folder)
    os.makedirs(folder, exist_ok=True)
    chaos.forget_logs(folder)
    problems = []
    with Machine() as machine, Soak(given, folder) as soak, \
            open(os.path.join(folder, "soak.csv"), "w", newline="", encoding="utf-8") as file:
        out = csv.DictWriter(file, COLUMNS)
        out.writeheader()
        print(" ".join(f"{c:>11}" for c in COLUMNS), flush=True)
        try:
            for number in range(1, given.minutes + 1):
                row = soak.minute(number)
                out.writerow(row)
                file.flush()
                print(" ".join(f"{v:>11}" for v in row.values()), flush=True)
        except RuntimeError as error:
            problems.append(str(error))
        problems += soak.end()
        wrong = verdict(soak.rows, missed_ticks(folder), machine.ticks()) + problems
    if wrong:
        print("NOT well: " + "; ".join(wrong) + f"; log in {folder}")
    else:
        print("flat; the server missed no more frames than a real-time thread without work")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
