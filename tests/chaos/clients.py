"""Minimal clients of every protocol, each written after the protocol's description, without the server's code (except
`fiducap watch`, which is the SDK's). A client runs until it is stopped and connects again by itself, as real ones do; it keeps the
times of frames."""

import base64
import collections
import json
import os
import re
import socket
import struct
import subprocess
import threading
import time

HOST = "127.0.0.1"
SILENCE_S = 0.6  # at 100, 40 or 20 frames a second: not jitter
POLL_SILENCE_S = 2.0  # of a client that polls four times a second, each time by a new connection
GAP_S = 0.1  # of 100 frames a second: frames are missing


class Client(threading.Thread):
    """Derived classes have `converse`, which returns or raises when the conversation has ended."""

    name_of_protocol = "?"
    silence_s = SILENCE_S

    def __init__(self):
        super().__init__(daemon=True)
        self.arrivals = collections.deque(maxlen=60_000)
        self.count = 0
        self.stopping = threading.Event()
        self.stalled = threading.Event()

    def run(self):
        while not self.stopping.is_set():
            try:
                self.converse()
            except (OSError, EOFError, ValueError, struct.error, LookupError, TypeError):
                pass  # the server is away, or its reply is incomplete
            self.stopping.wait(0.2)

    def converse(self):
        raise NotImplementedError

    def frame(self, number=1):
        self.count += number
        self.arrivals.append(time.monotonic())

    def rest(self):
        """Between two reads: a stalled client reads nothing but stays."""
        while self.stalled.is_set() and not self.stopping.is_set():
            time.sleep(0.05)
        if self.stopping.is_set():
            raise EOFError

    def stop(self):
        self.stopping.set()
        self.join(10)

    def flows_since(self, begin, now):
        """When frames began to flow without a silence up to now; None while they do not."""
        times = [t for t in list(self.arrivals) if t >= begin - self.silence_s]
        if not times or now - times[-1] > self.silence_s:
            return None
        since = times[0]
        for before, after in zip(times, times[1:]):
            if after - before > self.silence_s:
                since = after
        return max(since, begin)

    def silent_between(self, begin, end):
        """Seconds without frames: all gaps longer than a few frames."""
        times = [begin, *(t for t in list(self.arrivals) if begin <= t < end), end]
        return sum(after - before for before, after in zip(times, times[1:]) if after - before > GAP_S)

    def received_between(self, begin, end):
        return sum(begin <= t < end for t in list(self.arrivals))


class Metronome(Client):
    """Without a connection: when it stands still, this machine does."""

    def converse(self):
        while True:
            self.rest()
            time.sleep(0.02)
            self.frame()


class TcpClient(Client):
    port = 0

    def connect(self):
        self.socket = socket.create_connection((HOST, self.port), timeout=2)
        self.socket.settimeout(1)
        self.buffer = b""

    def read(self, count):
        while len(self.buffer) < count:
            self.rest()
            part = self.socket.recv(65536)
            if not part:
                raise EOFError
            self.buffer += part
        data, self.buffer = self.buffer[:count], self.buffer[count:]
        return data

    def converse(self):
        self.connect()
        try:
            self.talk()
        finally:
            self.socket.close()


class Vrpn(TcpClient):
    name_of_protocol = "vrpn"
    port = 3883

    def talk(self):
        self.socket.sendall(b"vrpn: ver. 07.33  0" + bytes(5))
        self.read(24)
        senders, types = {}, {}
        while True:
            length, _, _, sender, kind, _ = struct.unpack(">IIIiiI", self.read(24))
            payload = self.read((length - 24 + 7) // 8 * 8)
            if kind in (-1, -2):
                (senders if kind == -1 else types)[sender] = payload[4:length - 24].split(b"\0")[0]
            elif senders.get(sender) == b"drone" and types.get(kind) == b"vrpn_Tracker Pos_Quat":
                self.frame()


class Vicon(TcpClient):
    name_of_protocol = "vicon"
    port = 801
    types = (1, 2, 5, 8, 9, 23, 26, 28, 36, 37, 39, 40, 28001, 100004)

    @staticmethod
    def packet(kind, payload):
        body = struct.pack("<II", kind, len(payload)) + payload
        return struct.pack("<II", 0x1A2B0001, len(body)) + body

    def talk(self):
        self.one_packet()  # the greeting
        self.socket.sendall(self.packet(100001, struct.pack(f"<{1 + len(self.types)}I", len(self.types), *self.types)))
        self.socket.sendall(self.packet(100002, b"\1"))
        while True:
            kinds = self.one_packet()
            if 2 in kinds or 5 in kinds:
                self.frame()

    def one_packet(self):
        magic, size = struct.unpack("<II", self.read(8))
        if magic != 0x1A2B0001:
            raise ValueError("not a packet")
        body, at, kinds = self.read(size), 0, []
        while at + 8 <= size:
            kind, length = struct.unpack_from("<II", body, at)
            kinds.append(kind)
            at += 8 + length
        return kinds


class Qualisys(TcpClient):
    name_of_protocol = "qualisys"
    port = 22223

    def say(self, text):
        data = text.encode() + b"\0"
        self.socket.sendall(struct.pack("<II", 8 + len(data), 1) + data)

    def one_packet(self):
        size, kind = struct.unpack("<II", self.read(8))
        self.read(size - 8)
        return kind

    def talk(self):
        self.one_packet()  # the welcome
        self.say("Version 1.23")
        self.one_packet()
        self.say("StreamFrames AllFrames 6D")
        while True:
            if self.one_packet() == 3:
                self.frame()


class NatNet(Client):
    name_of_protocol = "natnet"
    port = 1510

    def converse(self):
        connect = struct.pack("<HH", 0, 269) + b"chaos".ljust(256, b"\0") + bytes([4, 1, 0, 0, 0, 4, 1, 0, 0]) + bytes(4)
        keep_alive = struct.pack("<HH", 10, 0)
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            udp.settimeout(0.2)
            asked, heard = 0.0, 0.0
            while True:
                self.rest()
                now = time.monotonic()
                if now - asked > 0.7:
                    # A client of this family connects again when its server was silent.
                    try:
                        udp.sendto(keep_alive if now - heard < 2 else connect, (HOST, self.port))
                    except OSError:
                        pass
                    asked = now
                try:
                    data = udp.recv(65536)
                except OSError:
                    continue
                heard = now
                if len(data) >= 4 and struct.unpack_from("<H", data)[0] == 7:
                    self.frame()


class Web(TcpClient):
    """The page's WebSocket."""

    name_of_protocol = "web"
    port = 8080

    def talk(self):
        key = base64.b64encode(os.urandom(16)).decode()
        self.socket.sendall(f"GET /api/v1/live HTTP/1.1\r\nHost: {HOST}:{self.port}\r\nConnection: Upgrade\r\nUpgrade: websocket\r\n"
                            f"Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: {key}\r\n\r\n".encode())
        head = b""
        while not head.endswith(b"\r\n\r\n"):
            head += self.read(1)
        if b" 101 " not in head.split(b"\r\n")[0]:
            raise ValueError("no upgrade")
        while True:
            first, size = self.read(2)
            if size == 126:
                size = struct.unpack(">H", self.read(2))[0]
            elif size == 127:
                size = struct.unpack(">Q", self.read(8))[0]
            payload = self.read(size)
            if first & 15 == 9:  # ping: masked with zeros, which changes nothing
                self.socket.sendall(bytes([0x8A, 0x80 | size]) + bytes(4) + payload)
            elif first & 15 == 8:
                raise EOFError
            elif payload.startswith(b'{"type":"frame"'):
                self.frame()


def get(path, timeout=2.0):
    """@return status and body of one request"""
    with socket.create_connection((HOST, Web.port), timeout=timeout) as tcp:
        tcp.sendall(f"GET {path} HTTP/1.0\r\nHost: {HOST}:{Web.port}\r\n\r\n".encode())
        data = b""
        while part := tcp.recv(65536):
            data += part
    head, _, body = data.partition(b"\r\n\r\n")
    return int(head.split()[1]), body


class Health(Client):
    """/healthz a few times a second: a frame is an answer of 200."""

    name_of_protocol = "healthz"
    silence_s = POLL_SILENCE_S

    def converse(self):
        while True:
            self.rest()
            if get("/healthz")[0] == 200:
                self.frame()
            time.sleep(0.2)


class Mavlink(Client):
    """An autopilot at 127.0.0.1:14580: counts ODOMETRY."""

    name_of_protocol = "mavlink"
    port = 14580

    def converse(self):
        with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as udp:
            udp.bind((HOST, self.port))
            udp.settimeout(0.2)
            while True:
                self.rest()
                try:
                    data = udp.recv(65536)
                except TimeoutError:
                    continue
                at = 0
                while at + 12 <= len(data) and data[at] == 0xFD:
                    if int.from_bytes(data[at + 7:at + 10], "little") == 331:
                        self.frame()
                    at += 12 + data[at + 1]


class LineClient(Client):
    """Another program; each line that it prints is a frame."""

    command = ()
    process = None

    def converse(self):
        self.process = process = subprocess.Popen(self.command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        try:
            while True:
                self.rest()
                line = process.stdout.readline()
                if not line:
                    raise EOFError
                if not self.stopping.is_set():
                    self.take(line)
        finally:
            process.kill()
            process.wait()
            process.stdout.close()

    def take(self, line):
        self.frame()

    def stop(self):
        self.stopping.set()
        if self.process:
            self.process.kill()  # its output ends, and so the thread
        self.join(2)


class Native(LineClient):
    """The SDK, as `fiducap watch --json`: one process for the whole time, which connects again by itself."""

    name_of_protocol = "native"

    def __init__(self, programs):
        super().__init__()
        self.command = (os.path.join(programs, "fiducap"), "watch", "--json")
        self.lost = 0  # as the SDK counts: numbers that never came

    def take(self, line):
        self.lost = int(re.search(rb'"lost":(\d+)', line).group(1))
        self.frame()


class Dds(LineClient):
    """Fast DDS reading /drone/pose, another vendor's ROS 2 side."""

    name_of_protocol = "dds"

    def __init__(self, programs):
        super().__init__()
        self.command = (os.path.join(programs, "fast_dds_peer"), "read", "0", HOST, HOST, "1000000", "PoseStamped:rt/drone/pose:l")


class RosSource(Client):
    """Whether the page reports images of the body with a ROS source."""

    name_of_protocol = "ros source"
    silence_s = POLL_SILENCE_S

    def __init__(self, body):
        super().__init__()
        self.body = body

    def converse(self):
        while True:
            self.rest()
            state = json.loads(get("/api/v1/state")[1])
            ids = {b["name"]: b["id"] for b in state["hello"]["bodies"]}
            for body in state["frame"]["bodies"]:
                if body["id"] == ids.get(self.body) and body["image_rate_hz"] > 5:
                    self.frame()
            time.sleep(0.25)


def of_every_protocol(programs):
    clients = [Native(programs), Vrpn(), NatNet(), Vicon(), Qualisys(), Web(), Health(), Mavlink()]
    if os.access(os.path.join(programs, "fast_dds_peer"), os.X_OK):
        clients.append(Dds(programs))
    return clients
