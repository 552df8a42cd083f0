"""Prints every valid body: print_poses.py [host] [port] [seconds]"""

import sys
import time

import fiducap

host = sys.argv[1] if len(sys.argv) > 1 else "127.0.0.1"
port = int(sys.argv[2]) if len(sys.argv) > 2 else 21600
seconds = float(sys.argv[3]) if len(sys.argv) > 3 else 10.0

end = time.monotonic() + seconds
with fiducap.Client(host, port, name="print_poses.py", max_rate_hz=10) as client:
    for frame in client.frames():
        for body in frame.bodies.values():
            if body.valid:  # never fly with a pose that is not valid
                x, y, z = body.position_m
                print(f"{body.name} at {x:.3f} {y:.3f} {z:.3f} +/- {1e3 * body.position_sigma_m:.1f} mm", flush=True)
        if time.monotonic() > end:
            break
    else:
        print("no frame:", client.statistics().problem)
