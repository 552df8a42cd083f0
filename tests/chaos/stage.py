"""The stage of chaos and soak: namespaces, a disk of its own, the server under a manager that behaves like systemd."""

import argparse
import contextlib
import fcntl
import os
import re
import resource
import shutil
import signal
import socket
import sqlite3
import subprocess
import sys
import threading
import time

ROOT = os.path.dirname(os.path.dirname(os.path.dirname(os.path.abspath(__file__))))
TOKEN = "operator-of-the-chaos"
RESTART_S = 2.0  # as deploy/fiducapd.service has it
WATCHDOG_S = 20.0  # as deploy/fiducapd.service has it
STOPS_WITHIN_S = 1.0  # docs/promises.md
ROS_BODY = "porter"
F_SETPIPE_SZ = 1031


def at_least_one(text):
    """For argparse."""
    if not text.isdecimal() or int(text) < 1:
        raise argparse.ArgumentTypeError(f"{text} is not possible: it is a whole number, at least 1")
    return int(text)


def enter_namespaces():
    """Starts this program again in network and mount namespaces of its own, or exits with the reason."""
    if os.environ.get("FIDUCAP_CHAOS_INSIDE"):
        for sign in (signal.SIGINT, signal.SIGTERM):  # a shell's background jobs ignore the first
            signal.signal(sign, lambda *_: sys.exit("interrupted"))
        subprocess.run(["ip", "link", "set", "lo", "up"], check=True)
        with contextlib.suppress(OSError):
            os.setpriority(os.PRIO_PROCESS, 0, -10)  # a client that gets no processor misses frames by its own fault
        return
    if os.geteuid() != 0 or not shutil.which("unshare"):
        sys.exit("network and mount namespaces of its own are needed: run this as root, with unshare (util-linux)")
    os.environ["FIDUCAP_CHAOS_INSIDE"] = "1"
    if subprocess.run(["unshare", "-n", "-m", "true"], check=False).returncode != 0:
        sys.exit("this machine does not permit namespaces (unshare -n -m failed): a container needs CAP_SYS_ADMIN")
    os.execvp("unshare", ["unshare", "-n", "-m", sys.executable, *sys.argv])


class Disk:
    """For map and recordings: ext4 on a loop device, which can be frozen; a tmpfs without one. Unmounted on exit."""

    def __init__(self, folder, megabytes=96):
        self.folder = os.path.join(folder, "disk")
        os.makedirs(self.folder, exist_ok=True)
        image = os.path.join(folder, "disk.ext4")
        with open(image, "wb") as file:
            file.truncate(megabytes << 20)
        made = subprocess.run(["mkfs.ext4", "-q", "-F", "-m", "0", image], check=False).returncode == 0
        self.can_freeze = bool(made and shutil.which("fsfreeze") and subprocess.run(
            ["mount", "-o", "loop", image, self.folder], check=False).returncode == 0)
        if not self.can_freeze:
            subprocess.run(["mount", "-t", "tmpfs", "-o", f"size={megabytes}m", "tmpfs", self.folder], check=True)
        self.filler = os.path.join(self.folder, "filler")

    def fill(self):
        with contextlib.suppress(OSError), open(self.filler, "wb", buffering=0) as file:
            while True:
                if file.write(bytes(65536)) == 0:
                    break

    def make_room(self):
        with contextlib.suppress(FileNotFoundError):
            os.remove(self.filler)

    def freeze(self, on):
        subprocess.run(["fsfreeze", "-f" if on else "-u", self.folder], check=True)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        if subprocess.run(["umount", self.folder], check=False).returncode != 0:
            subprocess.run(["umount", "-l", self.folder], check=False)  # when it is no longer used


class Log(threading.Thread):
    """Reads the server's stderr into a file, unless it is blocked."""

    def __init__(self, path):
        super().__init__(daemon=True)
        self.ours, self.servers = os.pipe()
        fcntl.fcntl(self.servers, F_SETPIPE_SZ, 4096)
        self.file = open(path, "ab", buffering=0)
        self.reads = threading.Event()
        self.reads.set()

    def run(self):
        while data := os.read(self.ours, 65536):
            self.file.write(data)
            self.reads.wait()

    def block(self):
        """The pipe is full and not read."""
        self.reads.clear()
        end = os.open(f"/proc/self/fd/{self.servers}", os.O_WRONLY | os.O_NONBLOCK)  # its own flags, not the server's
        with contextlib.suppress(BlockingIOError):
            while True:
                os.write(end, b"(filled by the chaos)\n")
        os.close(end)

    def unblock(self):
        self.reads.set()


class Service(threading.Thread):
    """The server as systemd runs it: started again after a failure, ended when its watchdog is silent, and on exit."""

    def __init__(self, programs, arguments, folder, preload=None):
        super().__init__(daemon=True)
        self.command = [os.path.join(programs, "fiducapd"), *arguments]
        self.log = Log(os.path.join(folder, "fiducapd.log"))
        self.log.start()
        self.notify = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        address = os.path.join(folder, "notify")
        with contextlib.suppress(FileNotFoundError):
            os.remove(address)
        self.notify.bind(address)
        self.notify.settimeout(0.2)
        self.environment = dict(os.environ, NOTIFY_SOCKET=address, WATCHDOG_USEC=str(int(WATCHDOG_S * 1e6)),
                                FIDUCAP_CHAOS_COUNT=os.path.join(folder, "thrown"))
        if preload:
            self.environment["LD_PRELOAD"] = preload
        self.restarts = 0
        self.ends = []  # (time, exit code)
        self.watchdog_kills = 0
        self.hold = threading.Event()  # set: a dead server is examined before it is started again
        self.held = threading.Event()
        self.stopping = threading.Event()
        self.launch()

    def __enter__(self):
        self.start()
        return self

    def __exit__(self, *_):
        self.log.unblock()
        self.stop()

    def launch(self):
        # This program runs at -10, if it may: that makes Nice=-5, as in the unit.
        self.process = subprocess.Popen(["nice", "-n", "5", *self.command], stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL,
                                        stderr=self.log.servers, env=self.environment)
        self.started = self.heard = time.monotonic()
        self.ready = False

    @property
    def pid(self):
        return self.process.pid

    def run(self):
        while not self.stopping.is_set():
            self.listen()
            if self.process.poll() is not None:
                self.restart()
            elif self.ready and time.monotonic() - self.heard > WATCHDOG_S:
                self.watchdog_kills += 1
                self.process.send_signal(signal.SIGABRT)
                with contextlib.suppress(subprocess.TimeoutExpired):
                    self.process.wait(5)
                self.process.kill()
                self.process.wait()

    def listen(self):
        with contextlib.suppress(TimeoutError):
            message = self.notify.recv(256)
            self.ready = self.ready or b"READY=1" in message
            self.heard = time.monotonic()

    def restart(self):
        self.ends.append((time.monotonic(), self.process.returncode))
        self.held.set()
        self.stopping.wait(RESTART_S)
        while self.hold.is_set() and not self.stopping.is_set():
            time.sleep(0.01)
        self.held.clear()
        if not self.stopping.is_set():
            self.restarts += 1
            self.launch()

    def stop(self):
        """Once. @return exit code and seconds that it took"""
        self.stopping.set()
        self.join()
        begin = time.monotonic()
        if self.process.poll() is None:
            self.process.terminate()
        try:
            self.process.wait(15)
        except subprocess.TimeoutExpired:
            self.process.kill()
            self.process.wait()
        return self.process.returncode, time.monotonic() - begin

    def cpu_s(self):
        """@return seconds of processor time that it has had"""
        with open(f"/proc/{self.pid}/stat", encoding="ascii") as file:
            fields = file.read().rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def figures(self):
        """@return resident kB, open descriptors, threads"""
        with open(f"/proc/{self.pid}/status", encoding="ascii") as file:
            status = dict(line.split(":", 1) for line in file)
        descriptors = len(os.listdir(f"/proc/{self.pid}/fd"))
        return int(status["VmRSS"].split()[0]), descriptors, int(status["Threads"])

    def limit_descriptors(self, at_most=None):
        """None: as before."""
        _, hard = resource.prlimit(self.pid, resource.RLIMIT_NOFILE)
        resource.prlimit(self.pid, resource.RLIMIT_NOFILE, (at_most or min(hard, 1024), hard))


class SensorDriver:
    """A ROS 2 driver (camera and IMU) in another process, which can be unplugged, and is on exit."""

    def __init__(self, programs):
        self.command = [os.path.join(programs, "fast_dds_peer"), "write", "0", "127.0.0.1", "127.0.0.1", "1000000", "/cam0"]
        self.process = None

    @staticmethod
    def exists(programs):
        return os.access(os.path.join(programs, "fast_dds_peer"), os.X_OK)

    def __enter__(self):
        self.plug()
        return self

    def __exit__(self, *_):
        self.unplug()

    def plug(self):
        self.process = subprocess.Popen(self.command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)

    def unplug(self):
        if self.process:
            self.process.kill()
            self.process.wait()


def store_of(disk):
    return os.path.join(disk, "map.sqlite")


def arguments_of_server(folder, disk, with_ros):
    """The demo, whose three robots map one room together, with ready corners instead of images, a store, an operator, an
    autopilot and, if it can be driven, a body on ROS."""
    with open(os.path.join(ROOT, "config/demo.yaml"), encoding="utf-8") as file:
        text = file.read()
    porter = f"""
  - name: {ROS_BODY}
    source: {{type: ros, images: [/cam0/image_raw], imu: /imu/data}}
    cameras:
      - model: {{width: 640, height: 480, fu: 458, fv: 457, cu: 319.5, cv: 239.5}}
        X_BV: *forward
        rate_hz: 20
    limits: *limits
"""
    if with_ros:
        text = text.replace("\nstreaming:", porter + "\nstreaming:", 1)
    mavlink = "  mavlink: {enabled: true, vehicles: [{body: drone, address: 127.0.0.1, port: 14580}]}\n"
    text = text.replace("  dds: {enabled: true}", mavlink + "  dds: {enabled: true}", 1)
    config = os.path.join(folder, "server.yaml")
    with open(config, "w", encoding="utf-8") as file:
        file.write(text)
    token_file = os.path.join(os.path.dirname(config), "token")
    with open(os.open(token_file, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), "w", encoding="utf-8") as file:
        file.write(TOKEN)
    settings = {"estimator.corner_noise_px": 0.5, "map.mode": "mapping", "map.store": store_of(disk),
                "recorder.folder": os.path.join(disk, "recordings"), "operator.token_file": token_file,
                "bodies.2.source.faults": "{}"}
    for body in range(3):
        settings[f"bodies.{body}.source.camera.images"] = "false"
    return ["--config", config, *(f"--set={key}={value}" for key, value in settings.items())]


def why_not_mapping(programs, arguments):
    """@return None when the server refines one map of its bodies by its own reading of the configuration"""
    printed = subprocess.run([os.path.join(programs, "fiducapd"), *arguments, "--print-config"], capture_output=True, text=True,
                          check=False).stdout
    of_map = re.split(r"\n(?=\S)", printed.partition("\nmap:\n")[2])[0]
    settings = dict(line.strip().split(": ", 1) for line in of_map.split("\n") if ": " in line)
    if settings.get("mode") != "mapping" or float(settings.get("refine_period_s", 0)) <= 0 or not settings.get("store"):
        return f"the server does not refine and store a map: {of_map[:400]}"
    return None


def why_not_stored(store, before):
    """Faults of the store after the end of a server, whose newest version was `before` while it mapped; None: none"""
    try:
        sound, version = newest_version(store)
        tags, with_ties = newest_contents(store)
    except sqlite3.Error as error:
        return f"the store cannot be read: {error}"
    if sound != "ok":
        return f"the store is damaged: {sound}"
    if version < before:
        return f"version {before} was stored, the newest is {version}"
    if not tags or not with_ties:
        return f"version {version} has {tags} tags and {'their' if with_ties else 'no'} ties"
    return None


def what_is_wrong_at_the_end(service, store):
    """Ends the server by SIGTERM. @return sentences about broken promises"""
    try:
        before = newest_version(store)[1]
    except sqlite3.Error:
        before = 0  # the server has stored nothing yet; why_not_stored reports it if that remains so
    code, seconds = service.stop()
    print(f"SIGTERM ended it with {code} within {seconds:.2f} s (at most {STOPS_WITHIN_S:g})")
    wrong = []
    if code != 0:
        wrong.append(f"the server ended with {code}")
    if seconds > STOPS_WITHIN_S:
        wrong.append(f"it took {seconds:.1f} s to end")
    if problem := why_not_stored(store, before):
        wrong.append(problem)
    return wrong


def newest_contents(store):
    """@return tags of the newest version, and whether their correlations are stored with it"""
    database = sqlite3.connect(f"file:{store}?mode=ro", uri=True, timeout=5)
    try:
        newest = "(SELECT max(version) FROM version)"
        tags = database.execute(f"SELECT count(*) FROM tag WHERE version = {newest}").fetchone()[0]
        return tags, bool(database.execute(f"SELECT count(*) FROM tie WHERE version = {newest}").fetchone()[0])
    finally:
        database.close()


def newest_version(store):
    """@return the result of SQLite's integrity check, and the newest version"""
    database = sqlite3.connect(f"file:{store}?mode=ro", uri=True, timeout=5)
    try:
        sound = database.execute("PRAGMA integrity_check").fetchone()[0]
        version = database.execute("SELECT max(version) FROM version").fetchone()[0] or 0
        return sound, version
    finally:
        database.close()


def operator(programs, *words, timeout=10):
    """@return exit code and output of `fiducap control`"""
    try:
        done = subprocess.run([os.path.join(programs, "fiducap"), "control", *words], capture_output=True, text=True,
                              timeout=timeout, check=False, env=dict(os.environ, FIDUCAP_TOKEN=TOKEN))
        return done.returncode, (done.stdout + done.stderr).strip()
    except subprocess.TimeoutExpired:
        return 124, "no answer"
