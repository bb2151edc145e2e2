"""The address file of a car that another program started: its endpoint with the real port, and its session.

`wallride run --address-file FILE` writes it once telemetry is open, or is known not to open.
"""

import json
import os
from dataclasses import asdict, dataclass
from pathlib import Path


@dataclass(frozen=True, slots=True)
class Address:
    """car, session: its name and this start of its process. endpoint: "" without telemetry; problem: the reason."""

    car: str
    session: str
    endpoint: str = ""
    problem: str = ""


def write_address(path: Path, address: Address) -> None:
    """Write the whole file at once, so that a reader never gets half of it; OSError when it cannot be written."""
    part = path.with_name(f"{path.name}.{os.getpid()}")
    part.write_text(json.dumps(asdict(address)) + "\n")
    part.replace(path)


def read_address(path: Path) -> Address | None:
    """Return the address that a car wrote, None before that."""
    try:
        return Address(**json.loads(path.read_text()))
    except FileNotFoundError:
        return None
