#!/usr/bin/env python3
"""How far off may a tag be? Measured with fiducapd's own simulator, detector and filter.

A simulated robot with an IMU and four cameras of different lenses (each a robot of its own) hovers
in front of one tag that is seen 30 degrees from the side, sways a little, and goes further away in
steps. Images are rendered; the server searches them as it does those of a real camera, and records
what it found. Poses are those that a client receives (`fiducap watch --json`). Printed is, per lens
and tag size: up to which distance the tag was found in half of the images and in all of them, and
how far the position was off. And for one lens, step by step: the tag's side in the image, how far
its corners were off, how far the position was.

  docs/examples/tag_distance/tag_distance.py                   # all sizes, about 6 minutes
  docs/examples/tag_distance/tag_distance.py --sizes 0.16 --quick

It runs in real time (a course takes about a minute) and needs Python 3.9 and nothing else.
"""
import argparse
import bisect
import json
import math
import pathlib
import shutil
import socket
import subprocess
import sys
import tempfile

# Name: width, height, focal length in pixels, distortion, how wide it sees.
LENSES = {
    "vga_65": (640, 480, 502, "none", "640 x 480, 65 deg"),
    "hd_70": (1280, 800, 914, "none", "1280 x 800, 70 deg"),
    "fisheye_120": (1280, 800, 611, "equidistant", "1280 x 800, 120 deg (fisheye)"),
    "tele_45": (1456, 1088, 1739, "none", "1456 x 1088, 45 deg"),
}
STEPS = (5, 8, 12, 16, 20, 25, 30, 35, 40, 45, 50, 60, 70, 80, 100, 120, 140)  # of the tag's size
QUICK_STEPS = (8, 20, 60)
STREAM_HZ = 50  # of the poses
START_S = 8.0  # before it counts: the filter begins, the map takes the tag in
HOLD_S = 3.0
MOVE_S = 1.5
HEIGHT_M = 1.5
TILT_RAD = math.radians(30)
EXPOSURE_S = 0.004
NEAR_A_STEP = 0.02  # share of the distance: which images belong to a step


def times(a, b):
    """Product of two quaternions, w x y z."""
    return (a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0])


def about(axis, angle):
    half = angle / 2
    return (math.cos(half),) + tuple(math.sin(half) * x for x in axis)


TAG = times(about((0, 0, 1), TILT_RAD), (0.5, 0.5, 0.5, 0.5))  # attitude in the room
CAMERA = (0.5, -0.5, 0.5, -0.5)  # on the body: it looks forward


def smooth(share):
    """0 … 1 with speed and acceleration 0 at both ends."""
    return share ** 3 * (10 - 15 * share + 6 * share ** 2)


def distances(size_m, quick):
    return [size_m * step for step in (QUICK_STEPS if quick else STEPS)]


def write_course(file, stops):
    """Poses of the body, 20 a second: stands at each stop and sways, then moves on."""
    length_s = START_S + len(stops) * (HOLD_S + MOVE_S)
    with open(file, "w", encoding="utf-8") as out:
        for k in range(int(length_s * 20) + 1):
            t = k / 20
            flown_s = max(t - START_S, 0)
            leg = min(int(flown_s / (HOLD_S + MOVE_S)), len(stops) - 1)
            into = flown_s - leg * (HOLD_S + MOVE_S) - HOLD_S
            here, there = stops[leg], stops[min(leg + 1, len(stops) - 1)]
            d = here + (there - here) * smooth(min(max(into / MOVE_S, 0), 1))
            sway = [math.sin(2 * math.pi * f * t) for f in (0.31, 0.43, 0.37, 0.53)]
            q = times(about((0, 0, 1), math.pi + 0.05 * sway[2]), about((0, 1, 0), 0.05 * sway[3]))
            p = (d, 0.05 * sway[0], HEIGHT_M + 0.05 * sway[1])
            out.write(f"{int(t * 1e9)},{p[0]},{p[1]},{p[2]},{q[0]},{q[1]},{q[2]},{q[3]}\n")
    return length_s


def configuration(size_m, course, length_s, folder, farthest_m, port, options):
    """Everything fiducapd is told; JSON is YAML."""
    tag = {"p": [0, 0, HEIGHT_M], "q_wxyz": TAG}
    behind = {"p": [farthest_m + 3, 0, HEIGHT_M], "q_wxyz": [0.5, 0.5, 0.5, 0.5]}
    bodies = []
    for k, name in enumerate(options.lenses):
        width, height, focal, distortion, _ = LENSES[name]
        lens = {"width": width, "height": height, "fu": focal, "fv": focal,
                "cu": (width - 1) / 2, "cv": (height - 1) / 2, "distortion": distortion,
                "coefficients": [0] * 5}
        camera = {"model": lens, "X_BV": {"p": [0, 0, 0], "q_wxyz": CAMERA},
                  "position_sigma_m": 0.002, "rotation_sigma_rad": 0.002, "rate_hz": options.rate}
        source = {"type": "simulator", "seed": k + 1, "camera": {"exposure_s": EXPOSURE_S},
                  "trajectory": {"kind": "file", "file": str(course), "duration_s": length_s}}
        bodies.append({"name": name, "source": source, "cameras": [camera],
                       "use_imu": not options.no_imu})
    return {"tags": {"size_m": size_m}, "detector": {"min_decision_margin": options.margin},
            "map": {"mode": "mapping", "reference_tag": 0, "reference_pose": tag},
            # The second tag shows its back to the cameras: it makes the room long enough.
            "simulation": {"preset": "custom", "tag_size_m": size_m,
                           "tags": [{"tag_id": 0, "edge_m": size_m, "X_WT": tag},
                                    {"tag_id": 586, "edge_m": size_m, "X_WT": behind}]},
            "bodies": bodies, "recorder": {"folder": str(folder), "at_start": "course"},
            "streaming": {"rate_hz": STREAM_HZ, "vrpn": {"enabled": False},
                          "web": {"enabled": False},
                          "native": {"address": "127.0.0.1", "port": port}}}


def free_port():
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        probe.bind(("127.0.0.1", 0))
        return probe.getsockname()[1]


def fly(programs, folder, port, length_s):
    """Runs the server to the end of the course, and a client beside it."""
    with open(folder / "log", "w", encoding="utf-8") as log, \
            open(folder / "poses.jsonl", "w", encoding="utf-8") as poses:
        client = subprocess.Popen(
            [programs / "fiducap", "watch", "--json", "--server", f"127.0.0.1:{port}",
             "--duration", str(length_s + 1)], stdout=poses, stderr=subprocess.DEVNULL)
        server = subprocess.run([programs / "fiducapd", "--config", folder / "config.yaml",
                                 "--exit-at-end"], stdout=log, stderr=log, check=False)
        client.terminate()
        client.wait()
    if server.returncode != 0:
        sys.exit("fiducapd failed:\n" + (folder / "log").read_text(encoding="utf-8")[-2000:])


def numbers(file, separator):
    """Rows of numbers; lines that begin with # are left out."""
    with open(file, encoding="utf-8") as lines:
        for line in lines:
            if not line.startswith("#"):
                yield [x for x in line.strip().split(separator)]


class Truth:
    """The true place and attitude of a body, at any stamp of its recording."""

    def __init__(self, recording):
        self.stamps, self.poses = [], []
        for row in numbers(recording / "mav0/state_groundtruth_estimate0/data.csv", ","):
            self.stamps.append(int(row[0]))
            self.poses.append([float(x) for x in row[1:8]])

    def at(self, stamp):
        k = min(max(bisect.bisect_left(self.stamps, stamp), 1), len(self.stamps) - 1)
        share = (stamp - self.stamps[k - 1]) / (self.stamps[k] - self.stamps[k - 1])
        share = min(max(share, 0), 1)
        before, after = self.poses[k - 1], self.poses[k]
        sign = 1 if sum(a * b for a, b in zip(before[3:], after[3:])) > 0 else -1
        p = [a + share * (b - a) for a, b in zip(before[:3], after[:3])]
        q = [a + share * (sign * b - a) for a, b in zip(before[3:], after[3:])]
        length = math.sqrt(sum(x * x for x in q))
        return p, tuple(x / length for x in q)


def stop_of(place, stops):
    for k, d in enumerate(stops):
        if abs(place[0] - d) < NEAR_A_STEP * d:
            return k
    return None


def turned(q, v):
    return times(times(q, (0, *v)), (q[0], -q[1], -q[2], -q[3]))[1:]


def true_corners(lens, size_m, pose):
    """Where a camera without distortion sees the corners, pixels."""
    width, height, focal = LENSES[lens][:3]
    p, q = pose
    q_WV = times(q, CAMERA)
    corners = []
    for x, y in ((-1, -1), (1, -1), (1, 1), (-1, 1)):
        at = turned(TAG, (x * size_m / 2, y * size_m / 2, 0))
        ray = turned((q_WV[0], -q_WV[1], -q_WV[2], -q_WV[3]),
                     (at[0] - p[0], at[1] - p[1], at[2] + HEIGHT_M - p[2]))
        corners += [(width - 1) / 2 + focal * ray[0] / ray[2],
                    (height - 1) / 2 + focal * ray[1] / ray[2]]
    return corners


def poses_of(file, lens):
    """Stamp and place, None where it is not valid, of every frame that the client got."""
    with open(file, encoding="utf-8") as lines:
        for line in lines:
            if not line.endswith("\n"):
                return
            frame = json.loads(line)
            for body in frame["bodies"]:
                if body["name"] == lens:
                    place = body["position_m"] if body["valid"] else None
                    yield frame["at_server_ns"], place


def rms(squares):
    return math.sqrt(sum(squares) / len(squares)) if squares else None


def measure(lens, size_m, folder, stops):
    """Per stop: images, those with the tag, frames, those with a valid pose, and both errors."""
    recording = folder / "course" / lens
    truth = Truth(recording)
    rows = [{"distance_m": d, "side_px": LENSES[lens][2] * size_m / d, "images": 0, "found": 0,
             "frames": 0, "valid": 0, "corners": [], "places": []} for d in stops]
    tags = {row[0]: row[3:11] for row in numbers(recording / "mav0/tags0/data.csv", ",")
            if row[1] == "0"}
    begin, end = truth.stamps[0] + int(START_S * 1e9), truth.stamps[-1]
    for stamp, _ in numbers(recording / "mav0/tags0/frames.csv", ","):
        pose = truth.at(int(stamp))
        k = stop_of(pose[0], stops)
        if k is None or not begin < int(stamp) < end:
            continue
        rows[k]["images"] += 1
        rows[k]["found"] += stamp in tags
        if stamp in tags and LENSES[lens][3] == "none":
            rows[k]["corners"] += [(float(a) - b) ** 2 for a, b in
                                   zip(tags[stamp], true_corners(lens, size_m, pose))]
    for stamp, place in poses_of(folder / "poses.jsonl", lens):
        here = truth.at(stamp)[0]
        k = stop_of(here, stops)
        if k is not None and begin < stamp < end:
            rows[k]["frames"] += 1
            rows[k]["valid"] += place is not None
            if place:
                rows[k]["places"].append(sum((a - b) ** 2 for a, b in zip(place, here)))
    for row in rows:
        row["corner_px"] = rms(row.pop("corners"))
        row["error_m"] = rms(row.pop("places"))
    return rows


def up_to(rows, share):
    """The last distance up to which at least this share of the images had the tag."""
    reached = None
    for row in rows:
        if row["images"] == 0 or row["found"] < share * row["images"]:
            break
        reached = row["distance_m"]
    return reached


def error_near(rows, distance_m):
    """Between the two stops beside it; None where not every image of both had the tag."""
    for before, after in zip(rows, rows[1:]):
        if before["distance_m"] <= distance_m <= after["distance_m"]:
            if any(row["found"] < row["images"] or row["error_m"] is None
                   for row in (before, after)):
                return None
            step_m = after["distance_m"] - before["distance_m"]
            share = (distance_m - before["distance_m"]) / step_m
            return before["error_m"] + share * (after["error_m"] - before["error_m"])
    return None


def text(value, unit=1.0, digits=1):
    return "–" if value is None else f"{value * unit:.{digits}f}"


def print_ranges(results):
    print("| lens | tag, mm | in half of the images, m | in every image, m | "
          "position off at 1, 2, 4, 8 m, mm |")
    print("|---|---|---|---|---|")
    for result in results:
        rows = result["stops"]
        errors = ", ".join(text(error_near(rows, d), 1000, 0) for d in (1, 2, 4, 8))
        print(f"| {LENSES[result['lens']][4]} | {result['tag_m'] * 1000:.0f} | "
              f"{text(up_to(rows, 0.5))} | "
              f"{text(up_to(rows, 1))} | {errors} |")


def print_steps(result):
    print(f"\n{LENSES[result['lens']][4]}, tag of {result['tag_m'] * 1000:.0f} mm:\n")
    print("| distance, m | side, px | images with the tag, % | corners off, px | "
          "frames with a pose, % | position off, mm |")
    print("|---|---|---|---|---|---|")
    for row in result["stops"]:
        found = row["found"] / row["images"] if row["images"] else None
        valid = row["valid"] / row["frames"] if row["frames"] else None
        print(f"| {row['distance_m']:.1f} | {row['side_px']:.0f} | {text(found, 100, 0)} | "
              f"{text(row['corner_px'], 1, 2)} | {text(valid, 100, 0)} | "
              f"{text(row['error_m'], 1000)} |")


def main():
    built = pathlib.Path(__file__).resolve().parents[3] / "build/release/bin"
    installed = pathlib.Path(shutil.which("fiducapd") or "fiducapd").parent
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--programs", type=pathlib.Path,
                        default=built if built.exists() else installed,
                        help="folder of fiducapd and fiducap")
    parser.add_argument("--sizes", type=float, nargs="+", default=[0.08, 0.16, 0.3],
                        help="edges of the black square, m")
    parser.add_argument("--lenses", nargs="+", choices=LENSES, default=list(LENSES))
    parser.add_argument("--rate", type=float, default=10, help="images a second (default 10)")
    parser.add_argument("--margin", type=float, default=20,
                        help="detector.min_decision_margin (default as the server, 20)")
    parser.add_argument("--quick", action="store_true", help="three distances only")
    parser.add_argument("--no-imu", action="store_true", help="robots without IMU")
    parser.add_argument("--json", action="store_true", help="all distances, for scripts")
    options = parser.parse_args()
    results = []
    with tempfile.TemporaryDirectory(prefix="tag_distance_") as work:
        for size_m in options.sizes:
            folder = pathlib.Path(work) / f"{size_m:g}"
            folder.mkdir()
            stops = distances(size_m, options.quick)
            length_s = write_course(folder / "course.csv", stops)
            port = free_port()
            config = configuration(size_m, folder / "course.csv", length_s, folder, stops[-1],
                                   port, options)
            (folder / "config.yaml").write_text(json.dumps(config), encoding="utf-8")
            print(f"tag of {size_m:g} m: {length_s:.0f} s", file=sys.stderr)
            fly(options.programs, folder, port, length_s)
            for lens in options.lenses:
                rows = measure(lens, size_m, folder, stops)
                results.append({"lens": lens, "tag_m": size_m, "stops": rows})
    if options.json:
        print(json.dumps(results, indent=1))
        return
    print_ranges(results)
    for result in results:
        if result["lens"] == options.lenses[min(1, len(options.lenses) - 1)]:
            print_steps(result)


if __name__ == "__main__":
    main()
