"""Messages of a page over its WebSocket: closed, strict and bounded, because any program could be at the other end."""

from typing import Annotated, Any, Literal

from pydantic import BaseModel, ConfigDict, Field, StringConstraints, TypeAdapter, ValidationError

from wallride.clients.teleop.inputs import Control

LONGEST = 8192

U32 = Annotated[int, Field(ge=0, le=0xFFFF_FFFF)]
Stick = Annotated[float, Field(ge=-1, le=1)]
Share = Annotated[float, Field(ge=0, le=1)]
CalibrationStep = Literal["speed", "steering", "lidar", "own-parts", "delay", "brake"]
Button = Literal["manual", "autonomy", "estop", "reset", "take_over"]


class _PageMessage(BaseModel):
    model_config = ConfigDict(frozen=True, extra="forbid", allow_inf_nan=False)


class Ack(_PageMessage):
    """Acknowledges bundle n."""

    t: Literal["ack"]
    n: U32


class Watch(_PageMessage):
    """Selects the car to watch."""

    t: Literal["watch"]
    car: Annotated[str, StringConstraints(pattern=r"^[a-z0-9][a-z0-9_-]{0,31}$")]


class InputState(_PageMessage):
    """Held inputs of the page, with the newest beat received. Describes the present only.

    pad: it is a gamepad that is held. age_ms: since that gamepad's last event. share: of the top speed, wanted at most.
    """

    t: Literal["hands"]
    car_session: U32
    beat: U32
    held: Annotated[list[Button], Field(max_length=5)]
    speed: Stick
    steering: Stick
    pad: bool = False
    age_ms: U32 = 0
    share: Share = 1.0

    @property
    def controls(self) -> frozenset[Control]:
        """Return the held inputs in the pilot's form."""
        return frozenset(Control(name) for name in self.held)


class Drop(_PageMessage):
    """Reports that the page lost its inputs (blur, a cancelled touch): they are neither held nor released."""

    t: Literal["drop"]


class Leave(_PageMessage):
    """Ends driving by the page. deliberate: a person switched it off; False: it is being hidden or closed."""

    t: Literal["leave"]
    deliberate: bool


class StopMessage(_PageMessage):
    """E-stop, from any page, at once."""

    t: Literal["stop"]


class LookAtAll(_PageMessage):
    """Shows all cars instead of one, until the next Watch."""

    t: Literal["all"]


class StopAll(_PageMessage):
    """E-stop to every car, at once."""

    t: Literal["stop_all"]


class NewRace(_PageMessage):
    """Begins a new race, for all pages: laps are counted from here on."""

    t: Literal["new_race"]


class Calibrate(_PageMessage):
    """Begins a calibration, drives or leaves out its next step, accepts values by name, or discards them all.

    steps, wheelbase_m: for `begin`, as of `wallride calibrate`. names: for `accept`.
    """

    t: Literal["calibrate"]
    do: Literal["begin", "drive", "skip", "accept", "discard"]
    steps: Annotated[list[CalibrationStep], Field(max_length=6)] = []
    wheelbase_m: Annotated[float, Field(ge=0.05, le=2.0)] | None = None
    names: Annotated[list[Annotated[str, StringConstraints(max_length=64)]], Field(max_length=24)] = []


class Ask(_PageMessage):
    """Query to the car, one of these and no other; the answer carries the same number."""

    t: Literal["ask"]
    id: U32
    what: Literal["param/list", "param/get", "param/set", "param/save", "param/history", "record", "simulator"]
    question: dict[str, Any] = {}


class Ping(_PageMessage):
    """Measures the page's round trip: comes back as it is. at: the page's own clock."""

    t: Literal["ping"]
    at: float


class MapLap(_PageMessage):
    """Makes a map of the newest recording of the watched car, ends that, or has the car race along the map.

    speed_mps: that the car may reach in a race; None: the line's own.
    """

    t: Literal["map_lap"]
    do: Literal["begin", "cancel", "race"]
    speed_mps: Annotated[float, Field(ge=0.1, le=50.0)] | None = None


PageMessage = (
    Ack
    | Watch
    | InputState
    | Drop
    | Leave
    | StopMessage
    | LookAtAll
    | StopAll
    | NewRace
    | Calibrate
    | MapLap
    | Ask
    | Ping
)
_ANY: TypeAdapter[PageMessage] = TypeAdapter(Annotated[PageMessage, Field(discriminator="t")])


class BadMessageError(ValueError):
    """An invalid message; the text names the fault."""


def read(text: str) -> PageMessage:
    """Read one message; BadMessageError for an invalid one."""
    if len(text) > LONGEST:
        raise BadMessageError(f"{len(text)} characters are too long")
    try:
        return _ANY.validate_json(text)
    except ValidationError as error:
        first = error.errors(include_url=False, include_context=False, include_input=False)[0]
        raise BadMessageError(f"{'.'.join(map(str, first['loc'][:3]))}: {first['msg']}") from None
