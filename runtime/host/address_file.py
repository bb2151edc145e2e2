"""The address file of a car that another program started: its endpoint with the real port, and its session.

`wallride run --address-file FILE` writes it once telemetry is open, or is known not to open.
"""

import json
from dataclasses import asdict, dataclass
from pathlib import Path

from wallride.runtime.host.output_files import write_file


@dataclass(frozen=True, slots=True)
class Address:
    """car, session: its name and this start of its process. endpoint: "" without telemetry; problem: the reason."""

    car: str
    session: str
    endpoint: str = ""
    problem: str = ""


def write_address(path: Path, address: Address) -> None:
    """Write the whole file at once, so that a reader never gets half of it; OSError when it cannot be written."""
    write_file(path, json.dumps(asdict(address)) + "\n")


def read_address(path: Path) -> Address | None:
    """Return the address that a car wrote, None before that."""
    try:
        return Address(**json.loads(path.read_text()))
    except FileNotFoundError:
        return None
