"""Settings of a recording, with assigned changes."""

import tempfile
from collections.abc import Sequence
from pathlib import Path

from runtime.settings.tree import Settings, SettingsError, load_settings, to_toml
from sim.replay.drive_log import DriveLog


def settings_of(log: DriveLog, assignments: Sequence[str] = ()) -> Settings:
    """Return the settings; the defaults if none were recorded.

    assignments: KEY=VALUE, as on the command line. SettingsError when they, or those of another version, do not fit.
    """
    text = log.settings_text
    if not text:
        return load_settings(None, assignments)
    return _read(f"{log.name}.toml", text, assignments)


def with_assignments(settings: Settings, assignments: Sequence[str]) -> Settings:
    """Return settings with some changed; SettingsError when an assignment is unusable."""
    return _read("recorded.toml", to_toml(settings), assignments) if assignments else settings


def _read(name: str, text: str, assignments: Sequence[str]) -> Settings:
    with tempfile.TemporaryDirectory(prefix="wallride-") as folder:
        file = Path(folder) / name
        file.write_text(text)
        try:
            return load_settings(file, assignments)
        except SettingsError as error:
            raise SettingsError(str(error).replace(f"{file}: ", "")) from None
