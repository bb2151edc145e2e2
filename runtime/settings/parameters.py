"""Settings of the parameter server."""

from typing import Annotated

from pydantic import Field

from runtime.settings_base import Section


class ParameterSettings(Section):
    """Bounds of the history of live changes."""

    history: Annotated[int, Field(ge=1, le=1000)] = 100
    """So many changes are remembered."""
    history_file: str = ""
    """Also written to this file, at most once a second; empty: only kept until the restart."""
