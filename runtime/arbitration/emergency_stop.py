"""The emergency stop: one latch with several causes behind it; it opens when the last cause is gone."""

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType

from runtime.arbitration.command import Source, refusal
from runtime.arbitration.command_queue import CommandQueue


class Cause(StrEnum):
    """Who may hold the emergency stop; each is cleared only by its own side."""

    OPERATOR = "operator"
    """The button was pressed; cleared by a deliberate reset."""
    MOTOR = "motor"
    """The motor controller has a fault or its kill switch is on; cleared when it says that this is over."""


class EmergencyStop:
    """Speaks as Source.ESTOP while anything holds it. The only one that does, so that no cause hides another.

    The word never expires: an e-stop ends by an act, not by a silence.
    """

    def __init__(self, voices: CommandQueue) -> None:
        self._voices = voices
        self._reasons: dict[Cause, str] = {}

    @property
    def causes(self) -> Mapping[Cause, str]:
        """What holds it, in the order in which it was latched, each in words; empty when it is open."""
        return MappingProxyType(self._reasons)

    @property
    def latched(self) -> bool:
        """Whether the car is held."""
        return bool(self._reasons)

    def latch(self, cause: Cause, reason: str) -> None:
        """Hold the car. A cause that holds it already keeps its first words: those say how it began."""
        if cause not in self._reasons:
            self._reasons[cause] = reason
            self._speak()

    def clear(self, cause: Cause) -> None:
        """Let go on behalf of one cause; harmless when it does not hold."""
        if self._reasons.pop(cause, None) is not None:
            self._speak()

    def _speak(self) -> None:
        if self._reasons:
            self._voices.say(refusal(Source.ESTOP, "; ".join(self._reasons.values())))
        else:
            self._voices.silence(Source.ESTOP)
