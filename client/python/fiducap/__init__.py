"""Poses of rigid bodies from a Fiducap motion capture server. Pure Python over the C library."""

from .client import Body, Client, Frame, Server, Statistics, Tracking, discover
from .control import Control, ControlError, ControlledBody, ControlState, Recording, RecordingState
from .events import Event, EventWatch, Severity

__all__ = [
    "Body", "Client", "Control", "ControlError", "ControlState", "ControlledBody", "Event", "EventWatch", "Frame",
    "Recording", "RecordingState", "Server", "Severity", "Statistics", "Tracking", "discover",
]
