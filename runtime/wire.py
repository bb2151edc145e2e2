"""What goes over zenoh: keys and payloads. Shared with every client; knows no session and no task.

    wallride/<car>/status          one JSON object, the answer to "why is it (not) moving"
    wallride/<car>/distance_error  one JSON object per scan: stamp_s, distance_m, error_m
    wallride/<car>/output          one JSON object per decision

Stamps are seconds on the car's monotonic clock. Numbers that do not exist are null, never NaN (which is not JSON).
"""

import json
import math
from collections.abc import Mapping
from typing import Any

ROOT = "wallride"
STATUS = "status"
DISTANCE_ERROR = "distance_error"
OUTPUT = "output"


def key(car: str, topic: str) -> str:
    """Return the key expression of one topic of one car."""
    return f"{ROOT}/{car}/{topic}"


def encode(message: Mapping[str, Any]) -> bytes:
    """Write a message; numbers that are not finite become null."""
    return json.dumps(_finite(message), separators=(",", ":")).encode()


def decode(payload: bytes) -> dict[str, Any]:
    """Read a message; ValueError when it is not JSON, TypeError when it is not an object."""
    message = json.loads(payload)
    if not isinstance(message, dict):
        raise TypeError("not a JSON object")
    return message


def _finite(value: object) -> object:
    if isinstance(value, float):
        return round(value, 6) if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {str(name): _finite(item) for name, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value
