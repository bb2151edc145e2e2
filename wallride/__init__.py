"""The front door: the `wallride` command, and from Python `connect`, `open_recording` and the errors that they raise.

Everything else is imported when it is needed, never before.
"""

TYPE_CHECKING = False  # that of `typing`, whose import is long enough for a Ctrl-C to hit it
if TYPE_CHECKING:
    from pathlib import Path

    from wallride.clients.connection import ConnectionProblemError
    from wallride.clients.decoding import UnreadableError
    from wallride.clients.remote.car import RemoteCar
    from wallride.clients.remote.driver import DriveRefusedError
    from wallride.clients.remote.planner import PlanRefusedError
    from wallride.clients.remote.recording import RecordedCar
    from wallride.runtime.wire.network import RefusedError

__all__ = [
    "ConnectionProblemError", "DriveRefusedError", "PlanRefusedError", "RefusedError", "UnreadableError", "connect",
    "open_recording",
]  # fmt: skip
_ERRORS = {
    "ConnectionProblemError": "wallride.clients.connection",
    "DriveRefusedError": "wallride.clients.remote.driver",
    "PlanRefusedError": "wallride.clients.remote.planner",
    "RefusedError": "wallride.runtime.wire.network",
    "UnreadableError": "wallride.clients.decoding",
}


def __getattr__(name: str) -> object:
    if name not in _ERRORS:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from importlib import import_module

    return getattr(import_module(_ERRORS[name]), name)


def connect(
    car: str | None = None, *, at: str | None = None, keys: "Path | str | None" = None, session: int | None = None,
    name: str | None = None,
) -> "RemoteCar":  # fmt: skip
    """Connect to a car: iterators over its topics, its parameters, driving, recording (docs/python.md).

    car: its name; None for the only one there. at: its address, such as tls/car1.local:7448, or several with
    commas; by default $WALLRIDE_CONNECT, else this computer. keys: folder of your keys, for tls. session: of this very
    start of the car. name: shown by the car while you drive.
    """
    from wallride.clients.remote.car import connect as connect_to

    return connect_to(car, at=at, keys=keys, session=session, name=name)


def open_recording(path: "Path | str") -> "RecordedCar":
    """Open a recording (.mcap) as if it were a car: the same topics and values."""
    from wallride.clients.remote.recording import open_recording as open_file

    return open_file(path)
