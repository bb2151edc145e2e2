"""The emergency stop: one latch with several causes; it opens when the last cause is cleared."""

from collections.abc import Mapping
from enum import StrEnum
from types import MappingProxyType

from wallride.runtime.arbitration.command import Source, refusal
from wallride.runtime.arbitration.command_queue import CommandQueue


class Cause(StrEnum):
    """Causes of the emergency stop; each is cleared only by its own side."""

    OPERATOR = "operator"
    """The button was pressed; cleared by a deliberate reset."""
    MOTOR = "motor"
    """The motor controller has a fault or its kill switch is on; cleared when the controller reports the end of it."""


class EmergencyStop:
    """Limits the speed to zero as Source.ESTOP while any cause holds. Its only user, so that no cause hides another.

    The limit never expires: an e-stop ends by an act, not by a silence.
    """

    def __init__(self, queue: CommandQueue) -> None:
        self._queue = queue
        self._reasons: dict[Cause, str] = {}

    @property
    def causes(self) -> Mapping[Cause, str]:
        """Causes that hold the latch, in the order of latching, each with its reason; empty when it is open."""
        return MappingProxyType(self._reasons)

    @property
    def latched(self) -> bool:
        """Whether the emergency stop is latched."""
        return bool(self._reasons)

    def latch(self, cause: Cause, reason: str) -> None:
        """Latch the stop. A cause that is latched already keeps its first reason: that one describes the beginning."""
        if cause not in self._reasons:
            self._reasons[cause] = reason
            self._speak()

    def clear(self, cause: Cause) -> None:
        """Clear one cause; harmless when it is not latched."""
        if self._reasons.pop(cause, None) is not None:
            self._speak()

    def _speak(self) -> None:
        if self._reasons:
            self._queue.put(refusal(Source.ESTOP, "; ".join(self._reasons.values())))
        else:
            self._queue.withdraw(Source.ESTOP)
