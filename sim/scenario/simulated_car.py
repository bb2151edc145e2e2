"""Settings file of the simulated car."""

import sys
from pathlib import Path

from sim.scenario.conditions import ConditionsError

CONFIG = "config/sim.toml"


def find_config() -> Path:
    """Return the simulated car's settings file: of this checkout, or of the installed package."""
    candidates = [Path(__file__).parents[2] / CONFIG, Path(sys.prefix) / "share" / "wallride" / CONFIG]
    for candidate in candidates:
        if candidate.is_file():
            return candidate
    raise ConditionsError(f"{CONFIG} is not installed (looked for {candidates[-1]}); give one with --config")
