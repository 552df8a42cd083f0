"""Changes of a server's state, with the operator's token."""

import ctypes
import enum
from typing import List, NamedTuple, Sequence

from . import _library
from .client import Quaternion, Vector, _lib, _text

_MOST_BODIES = 1024
_MOST_RECORDINGS = 64


class ControlError(Exception):
    """A command was not executed; the text has the cause."""


class ControlledBody(NamedTuple):
    id: int
    name: str
    enabled: bool
    pivot_position_m: Vector
    pivot_orientation_wxyz: Quaternion


class ControlState(NamedTuple):
    bodies: List[ControlledBody]
    mapping: bool
    recording: str  #: name of the running recording, or empty


class RecordingState(enum.IntEnum):
    STARTING = 0  #: samples are accepted; the files are not open yet
    RECORDING = 1
    STOPPING = 2  #: no more samples are accepted; accepted ones are being written
    FINISHED = 3  #: everything is on disk
    FAILED = 4  #: ended; see reason


class Recording(NamedTuple):
    name: str
    state: RecordingState
    reason: str  #: cause of the failure, or empty
    samples: int  #: on disk: IMU samples, and images or their corners
    bytes: int  #: on disk
    dropped: int  #: not recorded, because the disk was slow or failed


class Control:
    """Commands over one connection. Every method waits for the reply and raises ControlError on failure."""

    def __init__(self, token: str, server: str = "127.0.0.1", port: int = 21600, timeout_s: float = 2.0):
        self._handle = None
        self._handle = _lib.fiducap_control_open(server.encode(), port, token.encode(), int(timeout_s * 1e3))
        if not self._handle:
            raise MemoryError("no control handle")

    def close(self) -> None:
        if self._handle:
            _lib.fiducap_control_close(self._handle)
            self._handle = None

    def __enter__(self) -> "Control":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def __del__(self):
        self.close()

    def _run(self, function, *arguments) -> None:
        if not self._handle:
            raise RuntimeError("the control connection is closed")
        problem = ctypes.create_string_buffer(_library.TEXT_SIZE)
        if not function(self._handle, *arguments, problem, len(problem)):
            raise ControlError(_text(problem.value))

    def list(self) -> ControlState:
        bodies = (_library.ControlledBody * _MOST_BODIES)()
        for body in bodies:
            body.struct_size = ctypes.sizeof(_library.ControlledBody)
        count, mapping = ctypes.c_uint32(len(bodies)), ctypes.c_int()
        recording = ctypes.create_string_buffer(_library.NAME_SIZE)
        self._run(_lib.fiducap_control_list, bodies, count, mapping, recording)
        return ControlState(
            [
                ControlledBody(
                    b.id, _text(b.name), bool(b.enabled), tuple(b.pivot_position_m), tuple(b.pivot_orientation_wxyz)
                )
                for b in bodies[: count.value]
            ],
            bool(mapping.value),
            _text(recording.value),
        )

    def recordings(self) -> List[Recording]:
        """All running ones and up to eight ended ones; the newest last."""
        all_ = (_library.Recording * _MOST_RECORDINGS)()
        for recording in all_:
            recording.struct_size = ctypes.sizeof(_library.Recording)
        count = ctypes.c_uint32(len(all_))
        self._run(_lib.fiducap_control_recordings, all_, count)
        return [
            Recording(_text(r.name), RecordingState(r.state), _text(r.reason), r.samples, r.bytes, r.dropped)
            for r in all_[: count.value]
        ]

    def set_enabled(self, body_id: int, enabled: bool) -> None:
        self._run(_lib.fiducap_control_set_enabled, body_id, int(enabled))

    def rename(self, body_id: int, name: str) -> None:
        self._run(_lib.fiducap_control_rename, body_id, name.encode())

    def set_pivot(self, body_id: int, position_m: Sequence[float], orientation_wxyz: Sequence[float]) -> None:
        position, orientation = (ctypes.c_double * 3)(*position_m), (ctypes.c_double * 4)(*orientation_wxyz)
        self._run(_lib.fiducap_control_set_pivot, body_id, position, orientation)

    def set_mapping(self, mapping: bool) -> None:
        self._run(_lib.fiducap_control_set_mapping, int(mapping))

    def commit_map(self) -> None:
        self._run(_lib.fiducap_control_commit_map)

    def start_recording(self, name: str = "") -> None:
        """Returns before the files are open; recordings() has the state, also after stop_recording()."""
        self._run(_lib.fiducap_control_start_recording, name.encode())

    def stop_recording(self) -> None:
        self._run(_lib.fiducap_control_stop_recording)
