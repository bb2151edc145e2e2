"""Runs a driver of the user. Any mistake of it is a fault with file and line, never an exception of the car.

A driver with a fault is cancelled and made anew after a pause, as a device is opened anew. What the car's own code
raises in a callback is the car's and passes through.
"""

import asyncio
from collections.abc import Callable, Coroutine
from typing import Any, Final, Never, TypeVar

from wallride.drivers.api import NOT_OPENED, Clock, Health, LinkState, printable
from wallride.drivers.own import DriverSettings
from wallride.runtime.host.stop_signals import STOP_SIGNALS_HELD
from wallride.runtime.host.user_module import is_of_the_process, place_of, shown_text, told
from wallride.runtime.own_drivers.driver_class import DriverClass
from wallride.runtime.own_drivers.places import HANG_S, LOOK_S, HangWatch, as_the_cars, calling_place, waiting_place

RETRY_S: Final = (1.0, 2.0, 4.0, 8.0, 16.0, 32.0, 60.0)
"""Pauses before a driver is made anew; the last one repeats."""
WORKED_S: Final = 30.0
"""Time without a fault after which the pauses begin anew."""
LEAVE_S: Final = 1.0
"""Maximum time for a driver to end."""
HUNG_S: Final = 5.0
"""Time for which a driver may say that all is well and deliver nothing; then it is made anew."""
MAX_WORDS: Final = 300
A = TypeVar("A")
Start = Callable[[Any], Coroutine[Any, Any, object]]


class DriverRun:
    """One driver of the user in operation.

    made: the user's object, None while there is none. fault: one sentence, "" while it works. faults: their number.
    left_behind: whether it did not end when it was cancelled. on_fault: called at once with each fault.
    """

    def __init__(
        self, driver: DriverClass, settings: DriverSettings, clock: Clock, on_fault: Callable[[], None] = lambda: None
    ) -> None:
        self.driver = driver
        self._on_fault = on_fault
        self.made: Any = None
        self.fault = ""
        self.faults = 0
        self.left_behind = False
        self._identity = ""
        self._settings, self._clock = settings, clock
        self._cars: BaseException | None = None
        self._coroutine: Coroutine[Any, Any, object] | None = None

    async def keep(self, start: Start) -> Never:
        """Run it without end, what `start` makes of a new object, and make it anew after each fault."""
        pause, watch = 0, HangWatch(self.driver.file, self._clock)
        try:
            while True:
                began_s = self._clock()
                await self._serve(start, watch)
                pause = 0 if self._clock() - began_s > WORKED_S else pause
                await asyncio.sleep(RETRY_S[min(pause, len(RETRY_S) - 1)])
                pause += 1
        finally:
            watch.end()

    def works(self) -> bool:
        """Tell whether there is an object without a fault."""
        return self.made is not None and not self.fault

    def make(self) -> bool:
        """Make a new object without running it; False, with `fault`, where that fails."""
        self.fault, self.made = "", None
        self.made = self.call(lambda: self.driver.made(self._settings, self._clock))
        return not self.fault

    def call(self, code: Callable[[], A]) -> A | None:
        """Return what code of the user answers; None, with `fault`, where it fails or takes what is the process's."""
        answer = None
        try:
            answer = code()
        except BaseException as error:
            if error is self._cars or is_of_the_process(error):
                raise
            self._raised(error)
        if taken := STOP_SIGNALS_HELD.take_back():
            self.refuse(f"changed what {taken} does, which ends the process")
        return None if self.fault else answer

    def refuse(self, what: str, place: str = "") -> None:
        """Take something that the driver did as a fault; place: its line, by default the one that led here."""
        self._note(f"{self.driver.name} {shown_text(what)} ({place or calling_place(self.driver.file)})")

    def ours(self, code: Callable[[], None]) -> None:
        """Call code of the car from a callback of the driver; what it raises ends the car, not only the driver."""
        try:
            as_the_cars(code)
        except BaseException as error:
            self._cars = error
            raise

    def health(self) -> Health:
        """Return what the driver says of itself, in plain values: a fault where it has one."""
        if self.works():
            given = self.call(lambda: _read(self.made.health))
            if given is not None:
                self._identity = given.identity = given.identity or self._identity  # a lost device is no other device
                if not given.message or (given.message == NOT_OPENED and given.link is LinkState.READY):
                    given.message = given.identity
                return given
        if not self.fault:
            return Health(identity=self._identity)
        return Health(LinkState.FAULTY, self.fault, self._identity, self.fault)

    def silent(self, words: str, since_s: float) -> str:
        """Return that it delivers nothing, with the line at which it waits; after HUNG_S that is a fault."""
        place = waiting_place(self._coroutine, self.driver.file)
        said = f"{words} (it waits in {place})" if place else words
        if since_s > HUNG_S:
            self._note(f"{self.driver.name}: {said}")
        return said

    async def _serve(self, start: Start, watch: HangWatch) -> None:
        """Run one object until it has a fault."""
        if not self.make():
            return
        self._coroutine = self.call(lambda: start(self.made))
        if self._coroutine is None:
            return
        task = asyncio.create_task(self._contained(self._coroutine))
        try:
            await self._watch(task, watch)
        finally:
            self._coroutine = None
            await self._leave(task)
        if self._cars is not None:
            raise self._cars

    async def _watch(self, task: "asyncio.Task[None]", watch: HangWatch) -> None:
        watch.tick()
        while not (task.done() or self.fault or self._cars):
            await asyncio.wait({task}, timeout=LOOK_S)
            if (late_s := watch.tick()) > HANG_S and watch.place:
                self.refuse(f"held the car up for {late_s:.1f} s", watch.place)
                watch.place = ""
        if task.done() and not (self.fault or self._cars):
            self._conclude(task)

    def _conclude(self, task: "asyncio.Task[None]") -> None:
        """Take the end of a run that has none as a fault."""
        what = "cancelled its own run" if task.cancelled() else "ended its run, which has no end"
        self.refuse(what, self.driver.place)

    async def _contained(self, coroutine: Coroutine[Any, Any, object]) -> None:
        """Take what a run raises as its fault: a SystemExit too, with which asyncio would end the loop."""
        try:
            await coroutine
        except asyncio.CancelledError:
            raise
        except BaseException as error:
            if is_of_the_process(error):
                raise
            if error is not self._cars:
                self._raised(error)

    async def _leave(self, task: "asyncio.Task[None]") -> None:
        """Cancel a run, and have it end within LEAVE_S."""
        task.cancel()
        if not task.done():
            await asyncio.wait({task}, timeout=LEAVE_S)
        if not task.done():
            self.left_behind = True
            self.refuse("does not end when it is cancelled", self.driver.place)
            task.add_done_callback(lambda done: done.cancelled() or done.exception())
        elif not task.cancelled():
            task.exception()  # it is known, or comes too late to be one

    def _raised(self, error: BaseException) -> None:
        place = place_of(error, self.driver.file)
        self._note(f"{self.driver.name} raised {told(error)[:MAX_WORDS]} ({place})")

    def _note(self, fault: str) -> None:
        if not self.fault:
            self.fault = fault[:MAX_WORDS]
            self.faults += 1
            self._on_fault()


def _read(given: object) -> Health:
    """Return a driver's condition as values of the car's own."""
    if not isinstance(given, Health):
        raise TypeError(f"its health is a {type(given).__name__}, not a Health")
    texts = (
        str(text)[:MAX_WORDS].encode("ascii", "replace") for text in (given.message, given.identity, given.trouble)
    )
    message, identity, trouble = map(printable, texts)
    counts = {str(what): int(number) for what, number in given.counts.items()}
    return Health(LinkState(given.link), message, identity, trouble, counts)
