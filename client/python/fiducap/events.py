"""Events of a server for users. Needs no token."""

import ctypes
import enum
from typing import Iterator, List, NamedTuple, Optional

from . import _library
from .client import _lib, _text

_MOST_STANDING = 256


class Severity(enum.IntEnum):
    INFO = 0
    WARNING = 1
    ERROR = 2


class Event(NamedTuple):
    number: int  #: counts up from 1 for the life of the server
    at_utc_ms: int  #: wall clock of the server, milliseconds since 1970
    severity: Severity
    subject: str  #: a body's name, or a part of the server: map, recorder, clock, ...
    kind: str  #: one word for programs: lost, overload, ...
    text: str  #: what happened and why
    remedy: str  #: what to do, or empty
    over: bool  #: a condition of this subject and kind ended here


def _event(from_c: _library.Event) -> Event:
    return Event(
        from_c.number,
        from_c.at_utc_ms,
        Severity(from_c.severity),
        _text(from_c.subject),
        _text(from_c.kind),
        _text(from_c.text),
        _text(from_c.remedy),
        bool(from_c.over),
    )


class EventWatch:
    """The events of one server: `for event in EventWatch(): print(event.text)`.

    Connects when first asked and again after the connection broke; what happened meanwhile is not lost.
    @param history  first the events that the server keeps, at most 256"""

    def __init__(self, server: str = "127.0.0.1", port: int = 21600, history: bool = True):
        self.problem = ""  #: cause of a missing connection, or empty
        self._handle = None
        self._handle = _lib.fiducap_events_open(server.encode(), port, int(history))
        if not self._handle:
            raise MemoryError("no events handle")

    def close(self) -> None:
        if self._handle:
            _lib.fiducap_events_close(self._handle)
            self._handle = None

    def __enter__(self) -> "EventWatch":
        return self

    def __exit__(self, *_) -> None:
        self.close()

    def __del__(self):
        self.close()

    def _open(self):
        if not self._handle:
            raise RuntimeError("the event watch is closed")
        return self._handle

    def next(self, timeout_s: float) -> Optional[Event]:
        """Waits for the next event; None: timeout, see `problem`."""
        event = _library.sized(_library.Event)
        problem = ctypes.create_string_buffer(_library.TEXT_SIZE)
        came = _lib.fiducap_events_next(self._open(), int(timeout_s * 1e3), event, problem, len(problem))
        self.problem = _text(problem.value)
        return _event(event) if came else None

    def standing(self) -> List[Event]:
        """Conditions that hold according to the last message of the server."""
        events = (_library.Event * _MOST_STANDING)()
        for event in events:
            event.struct_size = ctypes.sizeof(_library.Event)
        count = _lib.fiducap_events_standing(self._open(), events, len(events))
        return [_event(event) for event in events[: min(count, len(events))]]

    def __iter__(self) -> Iterator[Event]:
        """Yields every event, without end."""
        while True:
            event = self.next(1.0)
            if event is not None:
                yield event
