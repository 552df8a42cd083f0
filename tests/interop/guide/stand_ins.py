"""Replacements of a camera, an IMU and a person: recordings, pictures, measured places."""
import json
import math
import random
import shutil
import subprocess
import time
import urllib.request

PATIENCE_S = 120


def wait_for(what, condition):
    """Until it is true; the time ends a hanging test only."""
    end = time.monotonic() + PATIENCE_S
    while not condition():
        if time.monotonic() > end:
            raise TimeoutError(f"waited {PATIENCE_S} s in vain: {what}")
        time.sleep(0.1)


def simulate(programs, out, *options):
    shutil.rmtree(out, ignore_errors=True)
    subprocess.run([programs / "fiducap", "simulate", "--out", out, *options], check=True,
                   capture_output=True)


def pictures(programs, out):
    recording = out.with_name(out.name + "_recording")
    simulate(programs, recording, "--room", "table", "--seconds", "4", "--speed", "4", "--images")
    shutil.rmtree(out, ignore_errors=True)
    shutil.copytree(recording / "mav0/cam0/data", out)


def times(a, b):
    return [a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0]]


def turned_back(q, v):
    back = [q[0], -q[1], -q[2], -q[3]]
    return times(times(back, [0, *v]), q)[1:]


def write_imu(out, rate_hz, motion):
    """An IMU with white noise. @param motion  yields attitude and body rate of each reading"""
    chance = random.Random(1)
    shutil.rmtree(out, ignore_errors=True)
    folder = out / "mav0/imu0"
    folder.mkdir(parents=True)
    with open(folder / "data.csv", "w", encoding="utf-8") as file:
        for k, (q, rate) in enumerate(motion):
            force = turned_back(q, [0, 0, 9.81])
            values = [x + chance.gauss(0, 0.002) for x in rate]
            values += [x + chance.gauss(0, 0.02) for x in force]
            stamp = 1_600_000_000_000_000_000 + k * 10 ** 9 // rate_hz
            file.write(f"{stamp}," + ",".join(f"{x:.9f}" for x in values) + "\n")


def at_rest(out):
    write_imu(out, 100, (([1, 0, 0, 0], [0, 0, 0]) for _ in range(100 * 180)))


def in_attitudes(out):
    """Four seconds at rest, then thirty turns of a second and rests of three."""
    def motion():
        q, chance = [1.0, 0, 0, 0], random.Random(2)
        yield from ((q, [0, 0, 0]) for _ in range(400))
        for _ in range(30):
            axis = [chance.gauss(0, 1) for _ in range(3)]
            length = math.sqrt(sum(x * x for x in axis))
            rate = [x / length * chance.uniform(0.8, 1.8) for x in axis]
            speed = math.sqrt(sum(x * x for x in rate))
            step = [math.cos(speed / 200)] + [math.sin(speed / 200) * x / speed for x in rate]
            for _ in range(100):
                yield q, rate
                q = times(q, step)
            yield from ((q, [0, 0, 0]) for _ in range(300))
    write_imu(out, 100, motion())


class Page:
    """Actions of a person."""

    def __init__(self, port):
        self.address = f"http://127.0.0.1:{port}/api/v1/"
        self.secret = ""  # of a set-up

    def ask(self, path, data=None):
        request = urllib.request.Request(self.address + path, data=data,
                                         headers={"X-Fiducap-Setup": self.secret})
        with urllib.request.urlopen(request, timeout=30) as answer:
            return answer.read().decode()

    def setup(self):
        try:
            return json.loads(self.ask("setup"))
        except OSError:
            return {}

    def tags(self):
        """Ids in the map."""
        try:
            return [tag["id"] for tag in json.loads(self.ask("state"))["map"]["tags"]]
        except (OSError, KeyError):
            return []

    def lead_through(self):
        """A simulated robot from no camera to its configuration, with a guessed lens."""
        def say(command):
            self.ask("setup/" + command, data=b"")

        wait_for("the set-up", lambda: self.setup().get("step") == "camera")
        steps = [one["name"] for one in self.setup()["steps"]]
        say("camera?open=simulated")
        wait_for("a picture", lambda: self.setup().get("picture"))
        for command in ("next", "next", "sheet?size_mm=400", "next", "guess", "imu?source=",
                        "next", "next", "write"):
            say(command)
        return steps
