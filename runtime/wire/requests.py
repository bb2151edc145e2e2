"""The common part of every service on the bus: the form of a request, and what takes it to its reply."""

from typing import Protocol

from pydantic import BaseModel, ConfigDict

from wallride.runtime.wire.network import Reply


class Request(BaseModel):
    """A closed form: unknown keys, other types and numbers that are not finite are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class RequestServer(Protocol):
    """A source of requests; the bus on the car."""

    def answer(self, key: str, reply: Reply) -> None:
        """Answer queries on exactly this key."""
