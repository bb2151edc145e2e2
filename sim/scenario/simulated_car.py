"""Settings files of simulated cars: those that come with the program, and what was changed in a simulation."""

import os
import sys
import zlib
from collections.abc import Mapping
from pathlib import Path

from wallride.sim.scenario.conditions import ConditionsError

CONFIG = "config/sim.toml"
FOLDER = "wallride/sim"


def find_config(name: str = CONFIG) -> Path:
    """Return a settings file that comes with the program: of this checkout, or of the installed package."""
    candidates = [Path(__file__).resolve().parents[2] / name, Path(sys.prefix) / "share" / "wallride" / name]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    raise ConditionsError(f"{name} is not installed (looked for {candidates[-1]}); give one with --config")


def saved_settings(config: Path, environment: Mapping[str, str] = os.environ) -> Path:
    """Return the user's file of differences that belongs to a settings file; it may not exist.

    The simulator starts from a file that is tracked by git or installed with the package, and never writes to it; the
    next simulation reads the differences on top. Two files of one name in different folders have one each.
    """
    folder, file = Path(environment.get("XDG_CONFIG_HOME") or "~/.config").expanduser(), config.resolve()
    place = "" if file.parent == find_config().resolve().parent else f"-{zlib.crc32(str(file.parent).encode()):08x}"
    return folder / FOLDER / f"{config.stem}{place}.toml"
