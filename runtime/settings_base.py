"""The base class of every section of settings: frozen and closed.

Declared beside its reader, composed in `settings`.
"""

from pydantic import BaseModel, ConfigDict


class Section(BaseModel):
    """A section of the settings tree: immutable, and closed to unknown keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
