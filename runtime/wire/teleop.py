"""The two messages between an operator and a car: fixed, binary, little endian, the version in the first four bytes.

    Command, operator -> car, key `operator/command`, 20 to 100 Hz, 60 bytes, "<4sQIIIBBHff24s"
        "WRC1"  session  sequence  car_session  beat  flags  input  input_age_ms  speed_mps  steering_rad  name
    Beat, car -> all clients, key `beat`, 50 Hz, 55 bytes, "<4sIIBQIHf24s"
        "WRB1"  car_session  beat  flags  operator_session  acknowledged  acknowledged_age_ms  speed_mps  operator_name

An operator's client copies `car_session` and `beat` of the newest heartbeat received into every command, so the car
judges the age of a command by its own clock and no clocks need to agree. A command states what is held down *now*, all
of it, every time: a lost message loses nothing, and a release is a message like any other.
docs/decisions/0008-teleop-protocol.md has the rules and the reasons. Shared by the car and by every client; knows no
clock and no session.
"""

import math
import struct
from enum import IntEnum, IntFlag
from typing import Final

from wallride.drivers.value import value

COMMAND_MAGIC: Final = b"WRC1"
BEAT_MAGIC: Final = b"WRB1"
NAME_BYTES: Final = 24
UNKNOWN_AGE_MS: Final = 0xFFFF
"""Age that is not known, or too long for the field."""
MAX_SPEED_MPS: Final = 50.0
MAX_STEERING_RAD: Final = math.pi / 2
"""Maximum steering (and, above, speed) of a plausible request; larger values are errors. The car's own, tighter limits
apply later."""

_COMMAND = struct.Struct("<4sQIIIBBHff24s")
_BEAT = struct.Struct("<4sIIBQIHf24s")
COMMAND_BYTES: Final = _COMMAND.size
BEAT_BYTES: Final = _BEAT.size
_FLAGS_AT = 4 + 8 + 4 + 4 + 4
_U32 = 0xFFFF_FFFF
_U64 = 0xFFFF_FFFF_FFFF_FFFF


class Malformed(ValueError):  # noqa: N818 - what the payload is, as in wallride.drivers.api
    """A payload that is not one of these messages; the text gives the reason and never quotes the payload.

    stop: the payload is a command in its outer form (length, version) and has e-stop set: stopping is never refused.
    """

    def __init__(self, reason: str, *, stop: bool = False) -> None:
        super().__init__(reason)
        self.stop = stop


class Press(IntFlag):
    """The buttons that the operator holds down at this moment; 0 is "nothing pressed", the explicit release."""

    MANUAL = 1
    """The deadman for driving by hand."""
    AUTONOMY = 2
    """The permit for autonomy."""
    ESTOP = 4
    RESET = 8
    """Resets a latched e-stop; counts only alone, and after a release."""
    TAKE_OVER = 16
    """Becomes the operator in place of another one; the car stops."""
    GOODBYE = 32
    """The last command of a session: everything is released and the operator leaves."""
    UNSURE = 64
    """The state of the input is unknown: the pad is gone or frozen. A stop, and no release; alone, or with GOODBYE: the
    operator leaves without having let go, and autonomy waits for another one."""


class Input(IntEnum):
    """Sources of the operator's input."""

    PAD = 0
    KEYBOARD = 1
    PAGE = 2
    SCRIPT = 3


class CarCondition(IntFlag):
    """The car's own state in every heartbeat."""

    ESTOP_LATCHED = 1
    PERMITTED = 2
    """Autonomy may move now, with or without an operator."""
    OPERATOR_PRESENT = 4
    """`operator_session` is received, and its commands are fresh."""
    OPERATOR_LOST = 8
    """The operator fell silent without a goodbye; nothing moves until an operator acts."""
    REARM = 16
    """A press now is not obeyed: release everything first, then press."""
    FAULT = 32
    """The motor controller reports a fault."""
    ALONE = 64
    """No permit is needed: without an operator autonomy drives on."""


_KNOWN_PRESSES = int(Press(0b111_1111))
_KNOWN_CONDITIONS = int(CarCondition(0b111_1111))


@value()
class Command:
    """The operator's request at this moment.

    session: random per start of the client, never 0. sequence: first 1, then one more each, wrapping after 2**32.
    car_session, beat: copied from the newest heartbeat received; 0, 0 before the first.
    input_age_ms: since the last raw event of the input device; UNKNOWN_AGE_MS is unknown or longer.
    speed_mps, steering_rad: positive forward, positive to the left. name: up to 24 bytes of UTF-8, printable.
    """

    session: int
    sequence: int
    car_session: int
    beat: int
    flags: Press
    input: Input
    input_age_ms: int = UNKNOWN_AGE_MS
    speed_mps: float = 0.0
    steering_rad: float = 0.0
    name: str = ""

    def pack(self) -> bytes:
        """Return the payload. Never fails: a NaN becomes 0, because an e-stop must be sent in any case."""
        return _COMMAND.pack(
            COMMAND_MAGIC,
            self.session & _U64,
            self.sequence & _U32,
            self.car_session & _U32,
            self.beat & _U32,
            int(self.flags) & _KNOWN_PRESSES,
            self.input,
            _age_field(self.input_age_ms),
            _within(self.speed_mps, MAX_SPEED_MPS),
            _within(self.steering_rad, MAX_STEERING_RAD),
            fit_name(self.name),
        )


@value()
class Beat:
    """The car's heartbeat for operators.

    car_session: random per start of the car's process. beat: one more each, wrapping after 2**32.
    operator_session: the session whose commands count, 0 for none. operator_name: its name.
    acknowledged: the newest sequence number accepted from that operator.
    acknowledged_age_ms: time since its arrival; the client's round trip is the time since it sent that command minus
        this. UNKNOWN_AGE_MS is never, or longer.
    speed_mps: measured, NaN when unknown.
    """

    car_session: int
    beat: int
    flags: CarCondition
    operator_session: int = 0
    acknowledged: int = 0
    acknowledged_age_ms: int = UNKNOWN_AGE_MS
    speed_mps: float = math.nan
    operator_name: str = ""

    def pack(self) -> bytes:
        """Return the payload."""
        return _BEAT.pack(
            BEAT_MAGIC,
            self.car_session & _U32,
            self.beat & _U32,
            int(self.flags) & _KNOWN_CONDITIONS,
            self.operator_session & _U64,
            self.acknowledged & _U32,
            _age_field(self.acknowledged_age_ms),
            self.speed_mps if abs(self.speed_mps) <= MAX_SPEED_MPS else math.nan,
            fit_name(self.operator_name),
        )


def read_command(payload: bytes) -> Command:
    """Read a command; Malformed when it is not one."""
    if len(payload) != COMMAND_BYTES:
        raise Malformed(f"{len(payload)} bytes instead of {COMMAND_BYTES}")
    fields = _COMMAND.unpack(payload)
    if fields[0] != COMMAND_MAGIC:
        raise Malformed(f"does not begin with {COMMAND_MAGIC.decode()}: another program, or another version")
    try:
        return _command(fields)
    except Malformed as error:
        raise Malformed(str(error), stop=is_stop(payload[_FLAGS_AT])) from None


def read_beat(payload: bytes) -> Beat:
    """Read a beat; Malformed when it is not one."""
    if len(payload) != BEAT_BYTES:
        raise Malformed(f"{len(payload)} bytes instead of {BEAT_BYTES}")
    magic, car_session, beat, flags, session, acknowledged, age_ms, speed_mps, name = _BEAT.unpack(payload)
    if magic != BEAT_MAGIC:
        raise Malformed(f"does not begin with {BEAT_MAGIC.decode()}: another program, or another version")
    if flags & ~_KNOWN_CONDITIONS:
        raise Malformed("unknown flags")
    if not math.isnan(speed_mps) and abs(speed_mps) > MAX_SPEED_MPS:
        raise Malformed("an impossible speed")
    return Beat(car_session, beat, CarCondition(flags), session, acknowledged, age_ms, speed_mps, _read_name(name))


def session_text(car_session: int) -> str:
    """Return a car's session in the form for people."""
    return f"{car_session & _U32:08x}"


def is_stop(flags: int) -> bool:
    """Tell whether flags request an e-stop: the button itself, or both deadmen at once."""
    both = Press.MANUAL | Press.AUTONOMY
    return bool(flags & Press.ESTOP) or flags & both == both


def fit_name(name: str) -> bytes:
    """Return a name as its 24 bytes: unprintable characters left out, cut between characters, padded with NUL."""
    if not name.isprintable():
        name = "".join(character for character in name if character.isprintable())
    raw = name.encode(errors="ignore")
    return raw[:NAME_BYTES].decode(errors="ignore").encode().ljust(NAME_BYTES, b"\0")


def _command(fields: tuple[bytes, int, int, int, int, int, int, int, float, float, bytes]) -> Command:
    _, session, sequence, car_session, beat, flags, source, input_age_ms, speed_mps, steering_rad, name = fields
    if session == 0:
        raise Malformed("session 0 is no session")
    if flags & ~_KNOWN_PRESSES:
        raise Malformed("unknown flags")
    if source > max(Input):
        raise Malformed("an unknown kind of input")
    if not (abs(speed_mps) <= MAX_SPEED_MPS and abs(steering_rad) <= MAX_STEERING_RAD + 1e-6):  # false for NaN
        raise Malformed("a speed or a steering angle that is no number or impossible")
    return Command(
        session, sequence, car_session, beat, Press(flags), Input(source), input_age_ms, speed_mps, steering_rad,
        _read_name(name),
    )  # fmt: skip


def _read_name(raw: bytes) -> str:
    try:
        name = raw.rstrip(b"\0").decode()
    except UnicodeDecodeError:
        raise Malformed("a name that is not UTF-8") from None
    if not name.isprintable():  # control characters would reach logs and terminals
        raise Malformed("a name with unprintable characters")
    return name


def _age_field(age_ms: int) -> int:
    return max(0, min(age_ms, UNKNOWN_AGE_MS))


def _within(value: float, limit: float) -> float:
    return max(-limit, min(value, limit)) if math.isfinite(value) else 0.0
