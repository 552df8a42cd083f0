"""Poses: Client and its data."""

import ctypes
import enum
import math
from typing import Dict, List, NamedTuple, Optional, Sequence, Tuple

from . import _library

_lib = _library.load()

Vector = Tuple[float, float, float]
Quaternion = Tuple[float, float, float, float]


class Tracking(enum.IntEnum):
    SEARCHING = 0
    TRACKING = 1
    COASTING = 2
    LOST = 3


class Body(NamedTuple):
    """One body at one instant: metres, radians, seconds; quaternions Hamilton, w x y z."""

    id: int
    name: str
    tracking: Tracking
    valid: bool  #: False: there is no pose, all numbers are NaN
    position_m: Vector
    orientation_wxyz: Quaternion
    velocity_m_s: Vector  #: W axes
    body_rate_rad_s: Vector  #: P axes
    acceleration_m_s2: Vector  #: W axes, at rest 0
    position_sigma_m: float
    rotation_sigma_rad: float
    velocity_sigma_m_s: float
    rate_sigma_rad_s: float
    age_s: float  #: since the last image with a tag
    tags_in_view: int
    pose_covariance: Tuple[float, ...]  #: upper triangle, row by row, of (position, rotation vector)


class Frame(NamedTuple):
    """All bodies at one instant."""

    number: int
    at_server_ns: int  #: instant of the poses, server's clock
    at_client_ns: Optional[int]  #: the same on time.monotonic_ns(); None: the clocks are not known
    at_utc_ns: int
    published_server_ns: int
    received_ns: int  #: time.monotonic_ns()
    map_version: int
    rate_hz: float
    clock_sigma_s: float
    bodies: Dict[str, Body]


class Statistics(NamedTuple):
    connected: bool
    problem: str  #: cause of a missing connection
    frames: int
    lost: int
    dropped_by_server: int
    dropped_here: int
    reconnects: int
    rate_hz: float
    latency_p50_s: float  #: NaN: not known
    latency_p99_s: float
    latency_max_s: float
    clock_known: bool
    clock_offset_ns: int  #: server = ours + offset
    clock_drift_ppm: float
    clock_sigma_s: float
    clock_bound_s: float
    round_trip_s: float
    multicast: bool


class Server(NamedTuple):
    address: str
    port: int
    host: str
    version: str
    bodies: int
    rate_hz: float


def _text(raw: bytes) -> str:
    return raw.decode("utf-8", "replace")


def _body(c: _library.Body) -> Body:
    return Body(
        c.id, _text(c.name), Tracking(c.tracking), bool(c.valid), tuple(c.position_m), tuple(c.orientation_wxyz),
        tuple(c.velocity_m_s), tuple(c.body_rate_rad_s), tuple(c.acceleration_m_s2), c.position_sigma_m,
        c.rotation_sigma_rad, c.velocity_sigma_m_s, c.rate_sigma_rad_s, c.age_s, c.tags_in_view,
        tuple(c.pose_covariance),
    )


def _ns(seconds: float) -> int:
    return int(math.floor(seconds * 1e9 + 0.5))


class Client:
    """Connects in the background and reconnects by itself.

    >>> with Client("127.0.0.1") as client:
    ...     for frame in client.frames():
    ...         print(frame.bodies["drone"].position_m)
    """

    def __init__(
        self,
        server: str = "127.0.0.1",
        port: int = 21600,
        *,
        name: str = "",
        up: str = "z",
        turn_bodies: bool = False,
        max_rate_hz: float = 0,
        bodies: Sequence[str] = (),
        covariance: bool = True,
        multicast: bool = False,
        reconnect_s: float = 0.5,
    ):
        """
        :param up: "z" or "y" (x' = x, y' = z, z' = -y)
        :param turn_bodies: with y up the bodies' own axes turn, too
        :param max_rate_hz: the server leaves frames out to stay below; 0: every frame
        :param bodies: names, at most 32; empty: all
        :raises ValueError: for options that cannot be
        """
        self._handle = None
        if up not in ("y", "z"):
            raise ValueError(f'up must be "z" or "y", not {up!r}')
        if not 0 < port < 65536:
            raise ValueError(f"port must be 1 to 65535, not {port}")
        names = (ctypes.c_char_p * max(1, len(bodies)))(*[n.encode() for n in bodies])
        options = _library.sized(_library.Options)
        options.server, options.port, options.name = server.encode(), port, name.encode()
        options.up, options.turn_bodies = int(up == "y"), int(turn_bodies)
        options.max_rate_hz, options.reconnect_s = max_rate_hz, reconnect_s
        options.bodies = ctypes.cast(names, ctypes.POINTER(ctypes.c_char_p))
        options.body_count = len(bodies)
        options.without_covariance, options.multicast = int(not covariance), int(multicast)
        problem = ctypes.create_string_buffer(_library.TEXT_SIZE)
        self._handle = _lib.fiducap_connect(options, problem, len(problem))
        if not self._handle:
            raise ValueError(_text(problem.value))
        self._frame = _library.sized(_library.Frame)
        self._frame.body_size = ctypes.sizeof(_library.Body)
        self._bodies = (_library.Body * 16)()

    def close(self) -> None:
        """Unsubscribes. No other method may be called afterwards."""
        if self._handle:
            _lib.fiducap_disconnect(self._handle)
            self._handle = None

    def __enter__(self) -> "Client":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def __del__(self):
        self.close()

    def _open(self):
        if not self._handle:
            raise RuntimeError("the client is closed")
        return self._handle

    def latest(self) -> Optional[Frame]:
        """The newest frame; None: there is none yet. Never waits."""
        while True:
            if not _lib.fiducap_latest(self._open(), self._frame, self._bodies, len(self._bodies)):
                return None
            count = self._frame.body_count
            if count <= len(self._bodies):
                break
            self._bodies = (_library.Body * (2 * count))()
        f = self._frame
        bodies = {body.name: body for body in map(_body, self._bodies[:count])}
        return Frame(
            f.number, f.at_server_ns, f.at_client_ns or None, f.at_utc_ns, f.published_server_ns, f.received_ns,
            f.map_version, f.rate_hz, f.clock_sigma_s, bodies,
        )

    def wait(self, after_number: int = 0, timeout_s: float = 1.0) -> Optional[Frame]:
        """Waits for a frame newer than `after_number`; None: timeout."""
        if not _lib.fiducap_wait_for_frame(self._open(), after_number, int(timeout_s * 1e3)):
            return None
        return self.latest()

    def frames(self, timeout_s: float = 1.0):
        """Yields frames, skipping those that arrive meanwhile. Ends after `timeout_s` without one."""
        number = 0
        while True:
            frame = self.wait(number, timeout_s)
            if frame is None:
                return
            number = frame.number
            yield frame

    def predict(self, name: str, ahead_s: float) -> Optional[Body]:
        """The body `ahead_s` after the instant of the newest frame; None: unknown, not valid or too far."""
        body = _library.sized(_library.Body)
        done = _lib.fiducap_predict(self._open(), name.encode(), _ns(ahead_s), body)
        return _body(body) if done else None

    def predict_now(self, name: str, ahead_s: float = 0.0) -> Optional[Body]:
        """The body `ahead_s` after now; None also while the clocks are not known or the newest frame is too old."""
        body = _library.sized(_library.Body)
        done = _lib.fiducap_predict_now(self._open(), name.encode(), _ns(ahead_s), body)
        return _body(body) if done else None

    def statistics(self) -> Statistics:
        c = _library.sized(_library.Statistics)
        _lib.fiducap_get_statistics(self._open(), c)
        return Statistics(
            bool(c.connected), _text(c.problem), c.frames, c.lost, c.dropped_by_server, c.dropped_here, c.reconnects,
            c.rate_hz, c.latency_p50_s, c.latency_p99_s, c.latency_max_s, bool(c.clock_known), c.clock_offset_ns,
            c.clock_drift_ppm, c.clock_sigma_s, c.clock_bound_s, c.round_trip_s, bool(c.multicast),
        )


def discover(timeout_s: float = 0.5, port: int = 21600) -> List[Server]:
    """Servers on this machine and its networks; takes the whole timeout."""
    found = (_library.Found * 64)()
    for one in found:
        one.struct_size = ctypes.sizeof(_library.Found)
    count = _lib.fiducap_discover(int(timeout_s * 1e3), port, found, len(found))
    return [
        Server(_text(f.address), f.port, _text(f.host), _text(f.version), f.bodies, f.rate_hz) for f in found[:count]
    ]
