"""Where code of the user is just now: the line that waits, the line that calls, the line that holds up the loop."""

import asyncio
import itertools
import logging
import os
import sys
import threading
from collections.abc import Callable, Iterable, Iterator
from pathlib import Path
from types import FrameType
from typing import Any, Final

from wallride.drivers.api import Clock
from wallride.drivers.link import until_lost
from wallride.runtime.host.user_module import shown

LOOK_S: Final = 0.05
HANG_S: Final = 0.25
"""Time without a turn of the loop that is a fault of the driver whose code runs meanwhile."""
SAID_S: Final = 1.0
"""Time without a turn after which the log says where, because it may never turn again."""
GIVEN_UP_S: Final = 10.0
"""Time in one line of a driver without a turn after which the process ends: no signal is heard meanwhile, and without a
service manager nothing else would end it. The motor controller's own timeout has braked long before."""
LAST_WORDS_S: Final = 0.5
"""Time for the thread that writes the log to do so."""
log = logging.getLogger("wallride.own_drivers")


def waiting_place(coroutine: Any, file: Path) -> str:  # noqa: ANN401 - coroutines, generators, futures
    """Return "FILE:LINE" of the innermost line of this file at which a coroutine waits, "" where there is none.

    What `until_lost` was given to do waits in a task of its own, and is looked into.
    """
    found = ""
    while coroutine is not None:
        frame = getattr(coroutine, "cr_frame", None) or getattr(coroutine, "gi_frame", None)
        if frame is not None and _is_in(frame, file):
            found = f"{shown(file)}:{frame.f_lineno}"
        within = frame.f_locals.get("working") if frame is not None and frame.f_code is until_lost.__code__ else None
        if isinstance(within, asyncio.Task):
            coroutine = within.get_coro()
            continue
        coroutine = getattr(coroutine, "cr_await", None) or getattr(coroutine, "gi_yieldfrom", None)
    return found


def calling_place(file: Path) -> str:
    """Return "FILE:LINE" of the innermost line of this file that led to this call, the file alone where none did."""
    return _place(_outwards(sys._getframe(1)), file) or shown(file)  # noqa: SLF001 - documented, "for specialized purposes"


def holding_place(frame: FrameType, file: Path) -> str:
    """Return "FILE:LINE" of the innermost line of this file at work, "" where none is, or where it waits for the car.

    A scan that is delivered outside any task is answered before `on_scan` returns: laws and the motor's driver run
    inside the lidar's callback.
    """
    within = itertools.takewhile(lambda one: one.f_code is not as_the_cars.__code__, _outwards(frame))
    return _place(within, file)


def as_the_cars(code: Callable[[], None]) -> None:
    """Call code of the car from a driver: while it holds up the loop, no line of the driver does."""
    code()


class HangWatch:
    """A thread that notes the line of a file in which the loop stands still. Made and ticked by the loop's thread.

    place: "FILE:LINE" of the newest such line, "" before. give_up: ends the process.
    """

    def __init__(self, file: Path, clock: Clock, give_up: Callable[[int], object] = os._exit) -> None:
        self.place = ""
        self._file, self._clock, self._give_up = file, clock, give_up
        self._words = 0  # said of the present standstill
        self._loops, self._ticked_s = threading.get_ident(), clock()
        self._over = threading.Event()
        threading.Thread(target=self._watch, name="own driver", daemon=True).start()

    def tick(self) -> float:
        """Note a turn of the loop; return how long the last one took beyond what was asked for."""
        before_s, self._ticked_s = self._ticked_s, self._clock()
        return self._ticked_s - before_s - LOOK_S

    def end(self) -> None:
        """End the thread."""
        self._over.set()

    def _watch(self) -> None:
        while not self._over.wait(LOOK_S):
            if (late_s := self._clock() - self._ticked_s) > HANG_S:
                frame = sys._current_frames().get(self._loops)  # noqa: SLF001 - as above
                self._note(late_s, holding_place(frame, self._file) if frame is not None else "")

    def _note(self, late_s: float, place: str) -> None:
        """Note where the loop stands; place: "" where no line of the file is at work."""
        self.place = place or self.place
        if late_s < SAID_S:
            self._words = 0
        elif place and self._words == 0:
            self._words = 1
            log.error("%s has held the car up for %.1f s, and does yet", place, late_s)
        elif place and self._words == 1 and late_s > GIVEN_UP_S:
            self._words = 2
            log.critical("%s has held the car up for %.0f s: the process ends", place, late_s)
        elif self._words == 2 and late_s > GIVEN_UP_S + LAST_WORDS_S:
            self._give_up(1)


def _place(frames: Iterable[FrameType], file: Path) -> str:
    return next((f"{shown(file)}:{one.f_lineno}" for one in frames if _is_in(one, file)), "")


def _outwards(frame: FrameType | None) -> Iterator[FrameType]:
    while frame is not None:
        yield frame
        frame = frame.f_back


def _is_in(frame: FrameType, file: Path) -> bool:
    return frame.f_code.co_filename == str(file)
