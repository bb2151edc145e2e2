"""Settings files that come with the program."""

import sys
from pathlib import Path

from wallride.sim.scenario.conditions import ConditionsError

CONFIG = "config/sim.toml"


def find_config(name: str = CONFIG) -> Path:
    """Return a settings file that comes with the program: of this checkout, or of the installed package."""
    candidates = [Path(__file__).resolve().parents[2] / name, Path(sys.prefix) / "share" / "wallride" / name]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    raise ConditionsError(f"{name} is not installed (looked for {candidates[-1]}); give one with --config")
