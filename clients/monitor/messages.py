"""What a page may say over its WebSocket: closed, strict and bounded, because any program could be at the other end."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, TypeAdapter, ValidationError

from clients.teleop.inputs import Control

LONGEST = 8192
QUESTIONS = ("param/list", "param/get", "param/set", "param/save", "param/history", "record", "simulator")
"""The only queries that a page may put to a car."""

U32 = Annotated[int, Field(ge=0, le=0xFFFF_FFFF)]
Stick = Annotated[float, Field(ge=-1, le=1)]
Share = Annotated[float, Field(ge=0, le=1)]
Button = Literal["manual", "autonomy", "estop", "reset", "take_over"]


class _PageMessage(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Ack(_PageMessage):
    """The page has bundle n."""

    t: Literal["ack"]
    n: U32


class Watch(_PageMessage):
    """The page wants to see this car."""

    t: Literal["watch"]
    car: Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")]


class InputState(_PageMessage):
    """What is held down in the page, with the newest beat it heard. Says nothing about a moment ago.

    pad: it is a gamepad that is held. age_ms: since that gamepad's last event. share: of the top speed, wanted at most.
    """

    t: Literal["hands"]
    car_session: U32
    beat: U32
    held: Annotated[list[Button], Field(max_length=5)]
    speed: Stick
    steering: Stick
    pad: bool = False
    age_ms: Annotated[int, Field(ge=0)] = 0
    share: Share = 1.0

    @property
    def controls(self) -> frozenset[Control]:
        """What is held, as the pilot calls it."""
        return frozenset(Control(name) for name in self.held)


class Drop(_PageMessage):
    """The page lost sight of the hands (blur, a cancelled touch): what was held is neither held nor released."""

    t: Literal["drop"]


class Leave(_PageMessage):
    """The page stops driving. deliberate: a person switched it off; False: it is being hidden or closed."""

    t: Literal["leave"]
    deliberate: bool


class StopMessage(_PageMessage):
    """E-stop, from anybody, at once."""

    t: Literal["stop"]


class Ask(_PageMessage):
    """A question to the car; the answer carries the same number."""

    t: Literal["ask"]
    id: U32
    what: Literal["param/list", "param/get", "param/set", "param/save", "param/history", "record", "simulator"]
    question: dict[str, Any] = {}


class Ping(_PageMessage):
    """For the page's round trip: comes back as it is. at: the page's own clock."""

    t: Literal["ping"]
    at: float


Word = Ack | Watch | InputState | Drop | Leave | StopMessage | Ask | Ping
_ANY: TypeAdapter[Word] = TypeAdapter(Annotated[Word, Field(discriminator="t")])


class BadMessageError(ValueError):
    """A message that is none of these; the text says what is wrong with it."""


def read(text: str) -> Word:
    """Read one message; NoWordError when it is none."""
    if len(text) > LONGEST:
        raise BadMessageError(f"{len(text)} characters are too long")
    try:
        return _ANY.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        raise BadMessageError(f"{'.'.join(map(str, first['loc'][:3]))}: {first['msg']}") from None
