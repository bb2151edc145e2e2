"""The MODE button of Logitech's pads, which swaps the left stick with the D-pad: the throttle dies, or is on/off.

The wire carries no state of it, so it is inferred from the events: a D-pad that moves while the stick never does, or a
stick that reports only its ends.
"""

from wallride.clients.teleop.pads import Axis, Event, Hat

FAMILY = frozenset({"046d:c21f", "046d:c219", "046d:c21d", "046d:c216", "046d:c21e", "046d:c218"})
"""F710, F310 and F510, each in X and in D mode."""
REST = 0.1
END = 0.95
EXCURSIONS = 3


class ModeWatch:
    """Watches one pad's events. axis: the raw axis of the left stick's up and down."""

    def __init__(self, axis: int) -> None:
        self._axis = axis
        self._between = False
        self._ends = 0
        self._last = 0.0
        self._hat_moves = 0

    def watch(self, event: Event) -> None:
        """Process one event."""
        match event:
            case Axis(index, value) if index == self._axis:
                if REST < abs(value) < END:
                    self._between, self._hat_moves, self._ends = True, 0, 0
                elif abs(value) >= END > abs(self._last) and not self._between:
                    self._ends += 1
                elif abs(value) <= REST:
                    self._between = False
                self._last = value
            case Hat(_, x, y) if (x, y) != (0, 0):
                self._hat_moves += 1
            case _:
                pass

    @property
    def notice(self) -> str:
        """Return a notice for the operator, "" when all is well."""
        if self._ends >= EXCURSIONS:
            return "the left stick is on/off only: press MODE on the pad (its light must be off)"
        if self._hat_moves >= EXCURSIONS and abs(self._last) <= REST:
            return "the D-pad does nothing here; if that was the left stick, press MODE (its light must be off)"
        return ""
