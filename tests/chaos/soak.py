#!/usr/bin/env python3
"""./dev soak: the real server for an hour, three robots that map one room, with clients of all protocols that come, go and stall.

A line a minute: memory, descriptors, threads and processor time of the server with the clients that stay, versions of the map,
frames, clients. At the end the verdict: after the warm-up nothing grows, a client that stayed missed no frame, and SIGTERM ended
the server within a second with the map stored. Exit code 1 when that is not so.
"""

import argparse
import csv
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
# What may grow after the warm-up, a minute: the map's last tags, a log's buffer; not what a leak of one client does.
MOST_KB_PER_MINUTE = 1024
# … and in an hour once the map is learned, which a run of half of one can tell.
MOST_KB_PER_HOUR = 8 * 1024
LEARNED_MIN = 5
LONG_MIN = 30
MOST_PER_HOUR = {"descriptors": 2.0, "threads": 1.0}
# Of one processor: who the clients are differs by this much from minute to minute.
MOST_CPU_GROWTH_PERCENT = 10.0
COLUMNS = ("minute", "rss_kb", "descriptors", "threads", "cpu_percent", "map_version", "frames_hz", "lost", "silent_s", "joined", "left",
           "stalled", "clients")


class Crowd:
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
    """@return what grows after the warm-up"""
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
        # A short run's slope is noise: what has to be seen is growth, too.
        if slope > most and grown > (1024 if column == "rss_kb" else 2):
            wrong.append(f"{column} grows")
    points = settled(rows, "cpu_percent")
    growth = slope_per_hour(points) * (points[-1][0] - points[0][0]) if points else 0.0
    print(f"cpu_percent: {growth:+.1f} in all (at most {MOST_CPU_GROWTH_PERCENT:g})")
    if growth > MOST_CPU_GROWTH_PERCENT:
        wrong.append("processor time grows")
    return wrong


def verdict(rows, ticks):
    """@return what is not as it should be"""
    wrong = grows(rows)
    lost = sum(row["lost"] for row in rows)
    silent = sum(row["silent_s"] for row in rows if row["minute"] > 1)
    print(f"ticks that the server missed: {ticks}; frames that the SDK missed: {lost}; its program was without any for "
          f"{silent:.1f} s (on a busy machine: its own fault)")
    if ticks:
        wrong.append("frames were not made in time")
    if lost:
        wrong.append("frames were missed")
    if rows and not rows[-1]["map_version"]:
        wrong.append("no version of the map was stored")
    return wrong


def missed_ticks(folder):
    with open(os.path.join(folder, "fiducapd.log"), encoding="utf-8", errors="replace") as file:
        found = re.findall(r"frames published, (\d+) ticks missed", file.read())
    return int(found[-1]) if found else -1


class Soak:
    def __init__(self, given, folder):
        self.given, self.folder = given, folder
        programs = os.path.abspath(given.programs)
        self.programs = programs
        self.random = random.Random(given.seed)
        self.disk = stage.Disk(folder, 512)
        arguments = stage.arguments_of_server(folder, self.disk.folder, False)
        if problem := stage.why_not_mapping(programs, arguments):
            sys.exit(problem)
        self.store = stage.store_of(self.disk.folder)
        self.service = stage.Service(programs, arguments, folder)
        self.service.start()
        self.began = time.monotonic()
        self.staying = clients.of_every_protocol(programs)
        for client in self.staying:
            client.start()
        self.crowd = Crowd(programs, self.random)
        self.rows = []

    def minute(self, number):
        begin = time.monotonic()
        native = self.staying[0]
        frames, lost, cpu_s = native.count, native.lost, self.service.cpu_s()
        while time.monotonic() - begin < 60:
            self.crowd.step()
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
        present = len(self.staying) + len(self.crowd.members)
        self.crowd.leave()  # so that what is counted belongs to the same clients each time
        time.sleep(SETTLED_S)
        rss, descriptors, threads = self.service.figures()
        silent = round(native.silent_between(begin, end), 2)
        row = dict(zip(COLUMNS, (number, rss, descriptors, threads, cpu_percent, stage.newest_version(self.store)[1], rate, lost,
                                 silent, self.crowd.joined, self.crowd.left, self.crowd.stalled, present)))
        self.rows.append({**row, "since_s": time.monotonic() - self.began})
        return row

    def end(self):
        for client in self.staying:
            client.stopping.set()
        self.crowd.leave()
        wrong = stage.what_is_wrong_at_the_end(self.service, self.store)
        self.disk.leave()
        return wrong


def parse():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("--minutes", type=int, default=60)
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
    soak = Soak(given, folder)
    problem = None
    with open(os.path.join(folder, "soak.csv"), "w", newline="", encoding="utf-8") as file:
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
            problem = str(error)
        finally:
            at_the_end = soak.end()
    wrong = verdict(soak.rows, missed_ticks(folder))
    wrong += [problem] if problem else []
    wrong += at_the_end
    print("flat, and no frame missed" if not wrong else "NOT well: " + "; ".join(wrong) + f"; log in {folder}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
