"""The common part of every service on the bus: the form of a request, and its reply or refusal."""

from collections.abc import Awaitable, Callable
from typing import Protocol

from pydantic import BaseModel, ConfigDict

from wallride.runtime.wire.network import RefusedError

Reply = Callable[[bytes], bytes | Awaitable[bytes]]


class Request(BaseModel):
    """A closed form: unknown keys, other types and numbers that are not finite are refused."""

    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False, strict=True)


class RequestServer(Protocol):
    """A source of requests; the bus on the car."""

    def answer(self, key: str, reply: Reply) -> None:
        """Answer queries on exactly this key."""


def refuse_on(problem: type[Exception], reply: Callable[[bytes], bytes]) -> Reply:
    """Return a reply that turns such an error into a refusal with its text."""

    def answer(payload: bytes) -> bytes:
        try:
            return reply(payload)
        except problem as error:
            raise RefusedError(str(error)) from None

    return answer


def refuse_later_on(problem: type[Exception], reply: Callable[[bytes], Awaitable[bytes]]) -> Reply:
    """Return the same as `refuse_on`, for an asynchronous reply."""

    async def answer(payload: bytes) -> bytes:
        try:
            return await reply(payload)
        except problem as error:
            raise RefusedError(str(error)) from None

    return answer
