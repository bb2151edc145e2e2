"""Deadman of a calibration: what a page says that it holds, by the rules of driving from a page (`driving`).

It is held while the page says so, again and again, with a heartbeat of the car that is fresh; and only after the page
was seen with nothing held. A page that is silent, late, hidden or closed holds nothing, and has to release first.
"""

import math
import time
from collections import OrderedDict
from collections.abc import Callable

from wallride.clients.calibration.link import LetGoError
from wallride.clients.monitor.driving import REMEMBERED_BEATS, SILENT_S
from wallride.clients.monitor.messages import InputState
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pilot import LINK_LOST_S
from wallride.runtime.wire.teleop import Beat

PERIOD_S = 0.02
MANUAL = frozenset({Control.MANUAL})


class PageDeadman:
    """Implements HeldDeadman. `is_held`, `wait` and `renew` are called in the thread that drives.

    ended: why it is over for good, "" while it is not.
    """

    key, again = "the page's deadman", "Let go, and hold again."

    def __init__(self, clock: Callable[[], float] = time.monotonic) -> None:
        self.ended = ""
        self._clock = clock
        self._beats: OrderedDict[tuple[int, int], float] = OrderedDict()
        self._heard_s = -math.inf
        self._released = self._held = self._left = False

    def hear(self, beat: Beat, arrival_s: float) -> None:
        """Note a heartbeat of the car."""
        self._beats[beat.car_session, beat.beat] = arrival_s
        if len(self._beats) > REMEMBERED_BEATS:
            self._beats.popitem(last=False)

    def take(self, hands: InputState, now_s: float) -> None:
        """Take a message of the page."""
        late = now_s - self._beats.get((hands.car_session, hands.beat), -math.inf) > LINK_LOST_S
        if late or now_s - self._heard_s > SILENT_S:
            self.lose()
        self._heard_s = now_s
        self._released = not late and (self._released or not hands.held)
        self._held = self._released and hands.controls == MANUAL

    def lose(self) -> None:
        """Count nothing as held until the page was seen released."""
        self._released = self._held = False

    def leave(self) -> None:
        """Lose it, and give up waiting for it: the page switched its driving off, or was hidden."""
        self.lose()
        self._left = True

    def end(self, why: str) -> None:
        """End it for good; who waits for it, or drives with it, gets a LetGoError."""
        self.lose()
        self.ended = self.ended or why

    def is_held(self) -> bool:
        """Return whether it is held now; LetGoError once it has ended."""
        if self.ended:
            raise LetGoError(self.ended)
        return self._held and self._clock() - self._heard_s <= SILENT_S

    def renew(self) -> None:
        """Wait until it was released, and is held; LetGoError when the page leaves off meanwhile."""
        self.lose()
        self._left = False
        while not self.is_held():
            if self._left:
                raise LetGoError("driving was switched off at the page")
            time.sleep(PERIOD_S)
