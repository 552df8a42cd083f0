"""The C library: where it is, its structs and functions as in fiducap.h."""

import ctypes
import ctypes.util
import os
import pathlib

ABI_VERSION = 1
NAME_SIZE = 132
TEXT_SIZE = 256
EVENT_TEXT_SIZE = 516

_double3 = ctypes.c_double * 3
_double4 = ctypes.c_double * 4


class Options(ctypes.Structure):
    _fields_ = [
        ("struct_size", ctypes.c_uint32),
        ("port", ctypes.c_uint16),
        ("up", ctypes.c_uint8),
        ("turn_bodies", ctypes.c_uint8),
        ("server", ctypes.c_char_p),
        ("name", ctypes.c_char_p),
        ("reconnect_s", ctypes.c_double),
        ("max_rate_hz", ctypes.c_double),
        ("bodies", ctypes.POINTER(ctypes.c_char_p)),
        ("body_count", ctypes.c_uint32),
        ("without_covariance", ctypes.c_uint8),
        ("multicast", ctypes.c_uint8),
        ("reserved", ctypes.c_uint8 * 2),
    ]


class Body(ctypes.Structure):
    _fields_ = [
        ("struct_size", ctypes.c_uint32),
        ("id", ctypes.c_int32),
        ("tracking", ctypes.c_int32),
        ("valid", ctypes.c_int32),
        ("tags_in_view", ctypes.c_int32),
        ("reserved", ctypes.c_uint32),
        ("position_m", _double3),
        ("orientation_wxyz", _double4),
        ("velocity_m_s", _double3),
        ("body_rate_rad_s", _double3),
        ("acceleration_m_s2", _double3),
        ("position_sigma_m", ctypes.c_double),
        ("rotation_sigma_rad", ctypes.c_double),
        ("velocity_sigma_m_s", ctypes.c_double),
        ("rate_sigma_rad_s", ctypes.c_double),
        ("age_s", ctypes.c_double),
        ("pose_covariance", ctypes.c_float * 21),
        ("name", ctypes.c_char * NAME_SIZE),
    ]


class Frame(ctypes.Structure):
    _fields_ = [
        ("struct_size", ctypes.c_uint32),
        ("body_size", ctypes.c_uint32),
        ("body_count", ctypes.c_uint32),
        ("reserved", ctypes.c_uint32),
        ("number", ctypes.c_uint64),
        ("at_server_ns", ctypes.c_int64),
        ("at_client_ns", ctypes.c_int64),
        ("at_utc_ns", ctypes.c_int64),
        ("published_server_ns", ctypes.c_int64),
        ("received_ns", ctypes.c_int64),
        ("map_version", ctypes.c_int64),
        ("rate_hz", ctypes.c_double),
        ("clock_sigma_s", ctypes.c_double),
    ]


class Statistics(ctypes.Structure):
    _fields_ = [
        ("struct_size", ctypes.c_uint32),
        ("connected", ctypes.c_int32),
        ("frames", ctypes.c_uint64),
        ("lost", ctypes.c_uint64),
        ("dropped_by_server", ctypes.c_uint64),
        ("dropped_here", ctypes.c_uint64),
        ("reconnects", ctypes.c_uint64),
        ("rate_hz", ctypes.c_double),
        ("latency_p50_s", ctypes.c_double),
        ("latency_p99_s", ctypes.c_double),
        ("latency_max_s", ctypes.c_double),
        ("clock_offset_ns", ctypes.c_int64),
        ("clock_drift_ppm", ctypes.c_double),
        ("clock_sigma_s", ctypes.c_double),
        ("clock_bound_s", ctypes.c_double),
        ("round_trip_s", ctypes.c_double),
        ("clock_known", ctypes.c_int32),
        ("multicast", ctypes.c_int32),
        ("problem", ctypes.c_char * TEXT_SIZE),
    ]


class Found(ctypes.Structure):
    _fields_ = [
        ("struct_size", ctypes.c_uint32),
        ("port", ctypes.c_uint16),
        ("bodies", ctypes.c_uint16),
        ("rate_hz", ctypes.c_double),
        ("address", ctypes.c_char * 64),
        ("host", ctypes.c_char * 68),
        ("version", ctypes.c_char * 36),
    ]


class ControlledBody(ctypes.Structure):
    _fields_ = [
        ("struct_size", ctypes.c_uint32),
        ("id", ctypes.c_int32),
        ("enabled", ctypes.c_int32),
        ("reserved", ctypes.c_uint32),
        ("pivot_position_m", _double3),
        ("pivot_orientation_wxyz", _double4),
        ("name", ctypes.c_char * NAME_SIZE),
    ]


class Recording(ctypes.Structure):
    _fields_ = [
        ("struct_size", ctypes.c_uint32),
        ("state", ctypes.c_int32),
        ("samples", ctypes.c_uint64),
        ("bytes", ctypes.c_uint64),
        ("dropped", ctypes.c_uint64),
        ("name", ctypes.c_char * NAME_SIZE),
        ("reason", ctypes.c_char * TEXT_SIZE),
        ("reserved", ctypes.c_uint32),
    ]


class Event(ctypes.Structure):
    _fields_ = [
        ("struct_size", ctypes.c_uint32),
        ("severity", ctypes.c_int32),
        ("over", ctypes.c_int32),
        ("reserved", ctypes.c_uint32),
        ("number", ctypes.c_uint64),
        ("at_utc_ms", ctypes.c_int64),
        ("subject", ctypes.c_char * NAME_SIZE),
        ("kind", ctypes.c_char * 36),
        ("text", ctypes.c_char * EVENT_TEXT_SIZE),
        ("remedy", ctypes.c_char * EVENT_TEXT_SIZE),
    ]


def sized(struct):
    """A new struct with its size set, as the library requires."""
    return struct(struct_size=ctypes.sizeof(struct))


def _candidates():
    if os.environ.get("FIDUCAP_LIBRARY"):
        yield os.environ["FIDUCAP_LIBRARY"]
        return
    beside = pathlib.Path(__file__).parent / "libfiducap.so.1"
    if beside.exists():
        yield str(beside)
    yield "libfiducap.so.1"
    found = ctypes.util.find_library("fiducap")
    if found:
        yield found


def _declare(library):
    handle, text, size = ctypes.c_void_p, ctypes.c_char_p, ctypes.c_size_t
    pointer = ctypes.POINTER
    problem = [text, size]
    functions = {
        "fiducap_abi_version": (ctypes.c_uint32, []),
        "fiducap_version": (text, []),
        "fiducap_connect": (handle, [pointer(Options)] + problem),
        "fiducap_disconnect": (None, [handle]),
        "fiducap_latest": (ctypes.c_int, [handle, pointer(Frame), pointer(Body), ctypes.c_uint32]),
        "fiducap_predict": (ctypes.c_int, [handle, text, ctypes.c_int64, pointer(Body)]),
        "fiducap_predict_now": (ctypes.c_int, [handle, text, ctypes.c_int64, pointer(Body)]),
        "fiducap_wait_for_frame": (ctypes.c_int, [handle, ctypes.c_uint64, ctypes.c_uint32]),
        "fiducap_get_statistics": (None, [handle, pointer(Statistics)]),
        "fiducap_discover": (ctypes.c_uint32, [ctypes.c_uint32, ctypes.c_uint16, pointer(Found), ctypes.c_uint32]),
        "fiducap_control_open": (handle, [text, ctypes.c_uint16, text, ctypes.c_uint32]),
        "fiducap_control_close": (None, [handle]),
        "fiducap_control_list": (
            ctypes.c_int,
            [handle, pointer(ControlledBody), pointer(ctypes.c_uint32), pointer(ctypes.c_int), text] + problem,
        ),
        "fiducap_control_set_enabled": (ctypes.c_int, [handle, ctypes.c_int32, ctypes.c_int] + problem),
        "fiducap_control_rename": (ctypes.c_int, [handle, ctypes.c_int32, text] + problem),
        "fiducap_control_set_pivot": (ctypes.c_int, [handle, ctypes.c_int32, _double3, _double4] + problem),
        "fiducap_control_set_mapping": (ctypes.c_int, [handle, ctypes.c_int] + problem),
        "fiducap_control_commit_map": (ctypes.c_int, [handle] + problem),
        "fiducap_control_recordings": (ctypes.c_int, [handle, pointer(Recording), pointer(ctypes.c_uint32)] + problem),
        "fiducap_control_start_recording": (ctypes.c_int, [handle, text] + problem),
        "fiducap_control_stop_recording": (ctypes.c_int, [handle] + problem),
        "fiducap_events_open": (handle, [text, ctypes.c_uint16, ctypes.c_int]),
        "fiducap_events_close": (None, [handle]),
        "fiducap_events_next": (ctypes.c_int, [handle, ctypes.c_uint32, pointer(Event)] + problem),
        "fiducap_events_standing": (ctypes.c_uint32, [handle, pointer(Event), ctypes.c_uint32]),
    }
    for name, (result, arguments) in functions.items():
        function = getattr(library, name)
        function.restype, function.argtypes = result, arguments


def load():
    """The library, with its functions declared.

    Searched at $FIDUCAP_LIBRARY, beside this package, and in the library paths of the system."""
    tried = []
    for candidate in _candidates():
        try:
            library = ctypes.CDLL(candidate)
        except OSError as why:
            tried.append(f"{candidate}: {why}")
            continue
        library.fiducap_abi_version.restype = ctypes.c_uint32
        if library.fiducap_abi_version() != ABI_VERSION:
            raise ImportError(f"{candidate} has ABI {library.fiducap_abi_version()}, this package needs {ABI_VERSION}")
        _declare(library)
        return library
    raise ImportError("libfiducap.so.1 not found; install the client or set FIDUCAP_LIBRARY. Tried " + "; ".join(tried))
