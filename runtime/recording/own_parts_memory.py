"""The file of the car's own parts, kept over restarts: one small file, for one car and one lidar."""

import json
import logging
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from wallride.runtime.control.perception.own_parts import KnownParts
from wallride.runtime.parameters.file import StoreError, replace

FILE = "own-parts.json"
MAX_FILE_B = 200_000
log = logging.getLogger("wallride.own_parts")


@dataclass(frozen=True, slots=True)
class RememberedParts:
    """Own parts with their car and lidar, and the time of the observation (UTC, for people)."""

    car: str
    lidar: str
    at: str
    parts: KnownParts


def file_in(configured: str, environment: Mapping[str, str] = os.environ) -> Path | None:
    """Return the file's path: in the folder from the settings, else in the service's state directory, else None."""
    folder = configured or environment.get("STATE_DIRECTORY", "").split(":")[0]
    return Path(folder).expanduser() / FILE if folder else None


def read(file: Path) -> RememberedParts | None:
    """Return the parts that an earlier run wrote, None where there are none for use.

    Blocks; to be called before the car drives.
    """
    try:
        with file.open("rb") as opened:
            return decoded(json.loads(opened.read(MAX_FILE_B)))
    except FileNotFoundError:
        return None
    except OSError as error:
        log.warning("%s: the car's own parts cannot be read (%s): they are learnt anew", file, error.strerror)
    except (ValueError, TypeError, KeyError, RecursionError):
        log.warning("%s: does not hold a car's own parts: they are learnt anew", file)
    return None


def write(file: Path, remembered: RememberedParts | None) -> None:
    """Replace the file, or delete it for None; blocks, for a thread. Logs errors."""
    try:
        if remembered is None:
            file.unlink(missing_ok=True)
            return
        file.parent.mkdir(parents=True, exist_ok=True)
        replace(file, json.dumps(asdict(remembered)).encode())
    except (OSError, StoreError) as error:
        log.warning("the car's own parts are not remembered: %s", error)


def decoded(tree: Mapping[str, Any]) -> RememberedParts:
    """Return the stored parts; ValueError, TypeError or KeyError when the tree does not hold any."""
    return RememberedParts(str(tree["car"]), str(tree["lidar"]), str(tree["at"]), known_parts(tree["parts"]))


def known_parts(tree: Mapping[str, Any]) -> KnownParts:
    """Return parts from plain values, checked; ValueError, TypeError or KeyError for others."""
    beams = int(tree["beams"])
    ranges_m = tuple((int(beam), float(range_m)) for beam, range_m in tree["ranges_m"])
    if not all(0 <= beam < beams and 0.0 < range_m < 2.0 for beam, range_m in ranges_m):
        raise ValueError("a part lies outside the fan, or no part of a car is so far away")
    return KnownParts(float(tree["angle_min_rad"]), float(tree["angle_step_rad"]), beams, ranges_m)
