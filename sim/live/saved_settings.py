"""File of settings that were changed in a simulation: one of the user's, never the one it started from.

The simulator starts from a file that is tracked by git or installed with the package. The differences are saved in
`~/.config/wallride/sim/NAME.toml`, which the next simulation reads on top.
"""

import os
from collections.abc import Mapping
from pathlib import Path

FOLDER = "wallride/sim"


def saved_settings(config: Path, environment: Mapping[str, str] = os.environ) -> Path:
    """Return the file of differences that belongs to a settings file; it may not exist."""
    folder = Path(environment.get("XDG_CONFIG_HOME") or "~/.config").expanduser()
    return folder / FOLDER / f"{config.stem}.toml"
