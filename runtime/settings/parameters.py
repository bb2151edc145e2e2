"""Settings of the parameter server."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from wallride.runtime.settings_base import Section


class ParameterSettings(Section):
    """Bounds of the history of live changes."""

    history: Annotated[int, Field(ge=1, le=1000)] = 100
    """Number of remembered changes."""
    history_file: str = ""
    """File of the changes, written at most once a second; empty: in memory only."""

    @property
    def history_path(self) -> Path | None:
        """The file of the changes, None without one."""
        return Path(self.history_file) if self.history_file else None
