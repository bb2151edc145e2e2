"""An operator's client in a soak: permits and drives, and after an incident does what a person would do."""

import math
import random
from collections.abc import Callable
from typing import Final

from wallride.runtime.wire.teleop import CarCondition, Command, Input, Press, read_beat

SEND_PERIOD_S: Final = 0.04
HAND_MPS: Final = 0.8
_INCIDENT: Final = CarCondition.ESTOP_LATCHED | CarCondition.REARM | CarCondition.OPERATOR_LOST
_THINKS_S: Final = (0.3, 1.2)
_RESETS_S: Final = 0.4
ONCE_TIMES: Final = 3
INSISTS_TIMES: Final = 50

Deliver = Callable[[bytes, Press, int, float], None]
"""Takes a command's payload, and its flags, the number of the beat that it echoes, and its speed."""


class Operator:
    """`hear` the car's beats; `step` sends one command every SEND_PERIOD_S.

    wants: what is held down when nothing is wrong. once: held down at the next steps instead, as last words are:
    ONCE_TIMES, because the way drops all but the first message of a burst; an e-stop until a beat confirms it, or
    INSISTS_TIMES. silent: sends nothing.
    withheld: commands on a link that holds them back, None where it does not.
    """

    def __init__(self, deliver: Deliver, rng: random.Random, session: int, name: str = "ann") -> None:
        self.wants = Press.AUTONOMY
        self.once: Press | None = None
        self.silent = False
        self.withheld: list[tuple[bytes, Press, int, float]] | None = None
        self._deliver = deliver
        self._rng = rng
        self._session = session
        self._name = name
        self._sequence = 0
        self._once_sent = 0
        self._car_session = self._echo = 0
        self._seen = CarCondition(0)
        self._releases_until_s = -math.inf
        self._resets_until_s = -math.inf
        self._thought = False

    def hear(self, payload: bytes) -> int:
        """Take in a beat; return its number."""
        beat = read_beat(payload)
        self._car_session, self._echo, self._seen = beat.car_session, beat.beat, beat.flags
        return beat.beat

    def step(self, now_s: float) -> None:
        """Send one command."""
        flags = self._flags(now_s)
        if self.silent:
            return
        self._sequence += 1
        by_hand = flags == Press.MANUAL
        speed_mps = HAND_MPS if by_hand else 0.0
        steering_rad = 0.1 * math.sin(now_s) if by_hand else 0.0
        command = Command(
            self._session, self._sequence, self._car_session, self._echo, flags, Input.SCRIPT, 0,
            speed_mps, steering_rad, self._name,
        )  # fmt: skip
        message = command.pack(), flags, self._echo, speed_mps
        if self.withheld is not None:
            self.withheld.append(message)
        else:
            self._deliver(*message)

    def release_withheld(self) -> None:
        """Deliver what the link held back, all at once."""
        withheld, self.withheld = self.withheld or [], None
        for message in withheld:
            self._deliver(*message)

    def _flags(self, now_s: float) -> Press:
        if (once := self.once) is not None:
            self._once_sent += 1
            unheard = once == Press.ESTOP and not self._seen & CarCondition.ESTOP_LATCHED
            if self._once_sent >= (INSISTS_TIMES if unheard else ONCE_TIMES):
                self.once, self._once_sent = None, 0
            return once
        if now_s < self._releases_until_s:
            return Press(0)
        if now_s < self._resets_until_s:
            return Press.RESET if self._seen & CarCondition.ESTOP_LATCHED else Press(0)
        if self._seen & _INCIDENT and not self._thought:
            self._thought = True
            self._releases_until_s = now_s + self._rng.uniform(*_THINKS_S)
            return Press(0)
        self._thought = False
        if self._seen & CarCondition.ESTOP_LATCHED:
            self._resets_until_s = now_s + _RESETS_S
            return Press.RESET
        return self.wants
