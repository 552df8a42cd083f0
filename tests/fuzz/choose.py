#!/usr/bin/env python3
"""Chooses few small inputs that together reach every edge that all of them reach.

choose.py PROGRAM KEPT FOUND: adds inputs of FOUND to the kept corpus. Kept inputs stay, because a corrected finding reaches no
new edge.
"""

import hashlib
import pathlib
import shutil
import subprocess
import sys
import tempfile

LONGEST = 2048  # bytes of an input worth keeping
MOST = 60  # of one target: so that all corpora together stay below a megabyte


def edges_of_inputs(program, folders):
    """libFuzzer's merge writes the edges of each input."""
    with tempfile.TemporaryDirectory() as nowhere:
        control = pathlib.Path(nowhere, "control")
        merged = pathlib.Path(nowhere, "merged")
        merged.mkdir()
        subprocess.run(
            [program, "-merge=1", f"-merge_control_file={control}", merged, *folders],
            check=True,
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )
        return parsed(control.read_text().splitlines())


def parsed(lines):
    count = int(lines[0])
    files = lines[2 : 2 + count]
    edges = {}
    for line in lines[2 + count :]:
        kind, number, *reached = line.split()
        if kind == "COV":
            # Each edge is listed with the first input that reached it.
            edges.setdefault(files[int(number)], set()).update(reached)
    return edges


def main():
    program, kept, found = sys.argv[1], pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    edges = edges_of_inputs(program, [kept, found])
    known = set()
    new = []
    for name, reached in edges.items():
        path = pathlib.Path(name)
        if path.parent.resolve() == kept.resolve():
            known |= reached
        elif path.stat().st_size <= LONGEST:
            new.append((path, reached))
    new.sort(key=lambda one: (-len(one[1] - known), one[0].stat().st_size))
    taken = 0
    for path, reached in new:
        if taken == MOST or not reached - known:
            continue
        known |= reached
        taken += 1
        shutil.copyfile(path, kept / hashlib.sha1(path.read_bytes()).hexdigest()[:12])
    print(f"{kept.name}: {taken} inputs added, {len(known)} edges")


main()
