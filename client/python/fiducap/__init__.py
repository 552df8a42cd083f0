"""Poses of rigid bodies from a Fiducap motion capture server. Pure Python over the C library."""

from .client import Body, Client, Frame, Server, Statistics, Tracking, discover
from .control import Control, ControlError, ControlledBody, ControlState, Recording, RecordingState

__all__ = [
    "Body", "Client", "Control", "ControlError", "ControlState", "ControlledBody", "Frame", "Recording",
    "RecordingState", "Server", "Statistics", "Tracking", "discover",
]
