"""Faults of a running server. Each returns when its cause has ended."""

import contextlib
import os
import random
import shutil
import signal
import time

import clients
import stage


class Faults:
    def __init__(self, programs, service, disk, driver, shim, random_: random.Random):
        self.programs, self.service, self.disk, self.driver, self.random = programs, service, disk, driver, random_
        self.kinds = {"kill -9": self.kill, "SIGSTOP": self.stop, "full disk": self.full_disk, "blocked stderr": self.blocked_stderr,
                      "no descriptors": self.no_descriptors}
        self.left_out = {}
        if disk.can_freeze:
            self.kinds["frozen disk"] = self.frozen_disk
        else:
            self.left_out["frozen disk"] = "no loop device or no fsfreeze here"
        if shim:
            self.kinds["exceptions"] = self.exceptions
        else:
            self.left_out["exceptions"] = "the shim was not built"
        if driver:
            self.kinds["unplugged source"] = self.unplugged
        else:
            self.left_out["unplugged source"] = "fast_dds_peer was not built (libfastrtps-dev, fastddsgen)"

    def hold(self, least, most):
        time.sleep(self.random.uniform(least, most))

    def kill(self):
        os.kill(self.service.pid, signal.SIGKILL)

    def stop(self):
        seconds = 0.1 * 150 ** self.random.random()  # 0.1 to 15 s, short ones oftener
        pid = self.service.pid
        os.kill(pid, signal.SIGSTOP)
        time.sleep(seconds)
        with contextlib.suppress(ProcessLookupError):  # the watchdog may have ended it
            os.kill(pid, signal.SIGCONT)

    def full_disk(self):
        self.disk.fill()
        try:
            stage.operator(self.programs, "record", f"full-{time.monotonic_ns()}")
            stage.operator(self.programs, "commit")
            self.hold(0.5, 5)
            stage.operator(self.programs, "stop")
        finally:
            self.disk.make_room()

    def frozen_disk(self):
        self.disk.freeze(True)
        try:
            stage.operator(self.programs, "record", f"frozen-{time.monotonic_ns()}", timeout=3)
            self.hold(0.5, 8)
        finally:
            self.disk.freeze(False)
        stage.operator(self.programs, "stop")

    def blocked_stderr(self):
        self.service.log.block()
        try:
            for _ in range(5):  # something to log
                stage.operator(self.programs, "record", f"blocked-{time.monotonic_ns()}")
                stage.operator(self.programs, "stop")
            self.hold(0.5, 5)
        finally:
            self.service.log.unblock()

    def no_descriptors(self):
        _, open_now, _ = self.service.figures()
        self.service.limit_descriptors(open_now)
        visitors = [kind() for kind in (clients.Vrpn, clients.Vicon, clients.Qualisys, clients.Web, clients.Health)]
        try:
            for client in visitors:
                client.start()
            stage.operator(self.programs, "record", f"few-{time.monotonic_ns()}", timeout=3)
            self.hold(0.5, 5)
        finally:
            with contextlib.suppress(ProcessLookupError):
                self.service.limit_descriptors()
            for client in visitors:
                client.stop()
        stage.operator(self.programs, "stop")

    def exceptions(self):
        for _ in range(self.random.randint(1, 20)):
            with contextlib.suppress(ProcessLookupError):
                if self.service.started + 2 < time.monotonic():  # not while it starts: systemd starts it again then
                    os.kill(self.service.pid, signal.SIGUSR2)
            time.sleep(self.random.uniform(0.02, 0.3))

    def unplugged(self):
        self.driver.unplug()
        self.hold(1, 10)
        self.driver.plug()


def forget_recordings(disk):
    """So that the disk does not fill by itself."""
    shutil.rmtree(os.path.join(disk.folder, "recordings"), ignore_errors=True)
