"""What every part of the settings tree is: frozen and closed. Declared beside its reader, composed in `settings`."""

from pydantic import BaseModel, ConfigDict


class Section(BaseModel):
    """A part of the tree: cannot change, and knows all its keys."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)
