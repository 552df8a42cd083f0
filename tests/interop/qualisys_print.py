"""Prints the data of a Qualisys client: names once, then each body's position [mm] and rotation matrix by rows.

usage: qualisys_print.py plain|sdk BASE_PORT little|big tcp|udp

`plain` is a client of its own on the standard library, written after the published description of the protocol; `sdk` uses the
vendor's Python SDK, which must be on PYTHONPATH (little-endian by TCP only). Neither shares a line with the server.
"""

import math
import re
import socket
import struct
import sys

HOST = "127.0.0.1"
COMMAND, XML, DATA = 1, 2, 3
SIX_D = 5


def show(frame, name, position, columns):
    """columns: the nine numbers of R as they travel, column by column."""
    if math.isnan(position[0]):
        print(f"{frame} {name} is lost", flush=True)
        return
    rows = [columns[row + 3 * column] for row in range(3) for column in range(3)]
    print(f"{frame} {name} at " + " ".join(f"{x:.1f}" for x in position) + " turned " + " ".join(f"{round(x, 3) + 0.0:.3f}" for x in rows),
          flush=True)


class PlainClient:
    def __init__(self, base_port, order):
        self.order = ">" if order == "big" else "<"
        self.tcp = socket.create_connection((HOST, base_port + (2 if order == "big" else 1)), timeout=5)
        print("welcome:", self.text(self.packet()[1]))
        print("version:", self.ask("Version 1.23"))

    def packet(self):
        size, kind = struct.unpack(self.order + "II", self.read(8))
        return kind, self.read(size - 8)

    def read(self, count):
        data = b""
        while len(data) < count:
            part = self.tcp.recv(count - len(data))
            if not part:
                sys.exit("the server has gone")
            data += part
        return data

    @staticmethod
    def text(payload):
        return payload.split(b"\0")[0].decode()

    def say(self, command):
        text = command.encode() + b"\0"
        self.tcp.sendall(struct.pack(self.order + "II", 8 + len(text), COMMAND) + text)

    def ask(self, command):
        self.say(command)
        while True:
            kind, payload = self.packet()
            if kind in (0, COMMAND, XML):
                return self.text(payload)

    def run(self, transport):
        names = re.findall(r"<Name>(.*?)</Name>", self.ask("GetParameters 6D"))
        print("names:", ", ".join(names), flush=True)
        if transport == "udp":
            udp = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
            udp.bind((HOST, 0))
            udp.settimeout(5)
            self.say(f"StreamFrames AllFrames UDP:{udp.getsockname()[1]} 6D")
            while True:
                datagram = udp.recv(65536)
                if struct.unpack(self.order + "II", datagram[:8]) == (len(datagram), DATA):
                    self.data(datagram[8:], names)
        self.say("StreamFrames AllFrames 6D")
        while True:
            kind, payload = self.packet()
            if kind == DATA:
                self.data(payload, names)

    def data(self, payload, names):
        _, frame, components = struct.unpack(self.order + "QII", payload[:16])
        at = 16
        for _ in range(components):
            size, kind, bodies = struct.unpack(self.order + "III", payload[at:at + 12])
            for body in range(bodies if kind == SIX_D else 0):
                numbers = struct.unpack_from(self.order + "12f", payload, at + 16 + 48 * body)
                show(frame, names[body], numbers[:3], numbers[3:])
            at += size


async def run_sdk(base_port):
    import asyncio

    try:
        import qtm_rt
    except ImportError:
        import qtm as qtm_rt

    connection = await qtm_rt.connect(HOST, port=base_port + 1, version="1.23")
    if connection is None:
        sys.exit("the SDK could not connect")
    print("version:", await connection.qtm_version())
    names = re.findall(r"<Name>(.*?)</Name>", (await connection.get_parameters(["6d"])).decode())
    print("names:", ", ".join(names), flush=True)

    def on_packet(packet):
        for name, (position, rotation) in zip(names, packet.get_6d()[1]):
            show(packet.framenumber, name, position, rotation.matrix)

    await connection.stream_frames(components=["6d"], on_packet=on_packet)
    await asyncio.sleep(60)


def main():
    kind, base_port, order, transport = sys.argv[1], int(sys.argv[2]), sys.argv[3], sys.argv[4]
    if kind == "sdk":
        import asyncio

        asyncio.run(run_sdk(base_port))
    else:
        PlainClient(base_port, order).run(transport)


main()
