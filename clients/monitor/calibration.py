"""A calibration from a page: the steps of `wallride calibrate`, each begun and held by the person at the page.

It drives in a thread of its own, with an operator's session of its own, as the command in a terminal does; the page's
hands are its deadman. Values are written only into a file that the monitor was started with, on the car's computer.
"""

import logging
import math
import queue
import threading
import time
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from wallride.clients.calibration import settings_file
from wallride.clients.calibration.command import begin, refusal
from wallride.clients.calibration.current_values import check_writable, current_values
from wallride.clients.calibration.link import LetGoError, RemoteLink
from wallride.clients.calibration.steps import CalibrationProgress, DrivenStep, driven_steps
from wallride.clients.calibration.ways import CalibrationError
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.decoding import UnreadableError
from wallride.clients.monitor.driving import REMEMBERED_BEATS, SILENT_S
from wallride.clients.monitor.messages import Calibrate, InputState
from wallride.clients.remote.car import RemoteCar
from wallride.clients.remote.driver import DriveRefusedError
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pilot import LINK_LOST_S
from wallride.runtime.calibration.proposals import Proposal
from wallride.runtime.parameters.file import StoreError
from wallride.runtime.settings.tree import SettingsError
from wallride.runtime.wire.network import RefusedError
from wallride.runtime.wire.teleop import Beat

PERIOD_S = 0.02
MANUAL = frozenset({Control.MANUAL})
log = logging.getLogger("wallride.monitor")

ENDS_WITHIN_S = 2.0
EXPECTED = (
    CalibrationError, ConnectionProblemError, DriveRefusedError, RefusedError, SettingsError, StoreError,
    UnreadableError,
)  # fmt: skip
Stage = Literal["connecting", "ready", "taking", "hold", "driving", "measured", "ended"]
"""taking: the car is asked to obey, which takes up to 10 s where it refuses."""


class PageDeadman:
    """Implements HeldDeadman by the rules of driving from a page (`driving`).

    It is held while the page says so, again and again, with a heartbeat of the car that is fresh; and only after the
    page was seen with nothing held. A page that is silent, late, hidden or closed holds nothing, and has to release
    first. `is_held`, `wait` and `renew` are called in the thread that drives.

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


class PageCalibration:
    """One calibration, from `begin` to accepted or discarded. connect: opens a connection to the car, in the thread.

    file: the car's settings, None where they are not on this computer.
    """

    def __init__(self, wish: Calibrate, connect: Callable[[], RemoteCar], file: Path | None) -> None:
        self.deadman = PageDeadman()
        self.stage: Stage = "connecting"
        self._wish, self._connect, self._file = wish, connect, file
        self._orders: queue.SimpleQueue[Calibrate | None] = queue.SimpleQueue()
        self._step: DrivenStep | None = None
        self._link: RemoteLink | None = None
        self._words = ""
        self._found: list[Proposal] = []
        self._notes: Sequence[str] = ()
        self._thread = threading.Thread(target=self._run, name="calibration", daemon=True)
        self._thread.start()

    @property
    def drives(self) -> bool:
        """Return whether the hands of the page are its deadman now."""
        return self.stage in {"taking", "hold", "driving"}

    def order(self, word: Calibrate) -> None:
        """Pass on what the page wants, if it fits the present stage."""
        if word.do in {"drive", "skip"} and self.stage != "ready":
            return
        if word.do in {"accept", "discard"} and self.stage not in {"ready", "measured"}:
            return
        self._orders.put(word)

    def end(self, why: str) -> None:
        """Stop the car if it is driven, and write nothing."""
        self.deadman.end(why)
        self._orders.put(None)

    def join(self) -> None:
        """Wait for the end; at most ENDS_WITHIN_S."""
        self._thread.join(ENDS_WITHIN_S)

    def fields(self) -> dict[str, Any]:
        """Return the present for the page, as plain values."""
        step, link = self._step, self._link
        return {
            "stage": self.stage,
            "file": str(self._file or ""),
            "title": step.title if step else "",
            "before": step.before if step else "",
            "words": self._words,
            "driven": _driven(link) if link is not None and self.stage == "driving" else None,
            "found": [{**asdict(one), "changes": one.changes} for one in self._found],
            "notes": list(self._notes),
        }

    def _run(self) -> None:
        try:
            with self._connect() as car:
                self._measure(car)
            self._settle()
        except EXPECTED as error:
            self._words = str(error)
        except Exception:
            log.exception("a calibration ended badly")
            self._words = "the calibration ended with an error of the program; the monitor's log has it"
        self._step = None
        self.stage = "ended"

    def _measure(self, car: RemoteCar) -> None:
        wish = self._wish
        if self._file is not None:
            check_writable(self._file)
        now = current_values(car, self._file)
        so_far, self._found = begin(now, wish.wheelbase_m)
        self._notes = so_far.notes
        if why := refusal(so_far.now):
            raise CalibrationError(f"{why}; measure the outline first, in a terminal: wallride calibrate outline")
        for step in driven_steps(frozenset(wish.steps)):
            if missing := step.missing(so_far):
                so_far.notes.append(missing)
                continue
            self._step = step
            self._found += self._drive(car, step, so_far)
        self._step = None

    def _drive(self, car: RemoteCar, step: DrivenStep, so_far: CalibrationProgress) -> list[Proposal]:
        """Drive a step as often as the page wants; [] where it was left out."""
        while True:
            if self._next().do == "skip":
                self._words = f"{step.title}: left out"
                return []
            self.stage, self._words = "taking", ""
            try:
                with RemoteLink(car, self.deadman, self._tell) as self._link:
                    self.stage = "hold"
                    self.deadman.renew()
                    self.stage = "driving"
                    self._link.forget()
                    found = list(step.run(self._link, so_far))
                    self._words = ""
                    return found
            except CalibrationError as error:
                if self.deadman.ended:
                    raise
                self._tell(f"{error}. Nothing was measured in this step: drive it again, or leave it out.")
            finally:
                self._link = None

    def _next(self) -> Calibrate:
        """Wait for the order to drive or to leave out; LetGoError for an end."""
        self.stage = "ready"
        order = self._orders.get()
        if order is None or order.do == "discard":
            raise LetGoError(self.deadman.ended or "Ended; nothing was written.")
        return order

    def _settle(self) -> None:
        """Write what is accepted, when the file takes it."""
        self.stage = "measured"
        while True:
            order = self._orders.get()
            names = frozenset(order.names) if order is not None and order.do == "accept" else frozenset()
            accepted = [one for one in self._found if one.changes and one.name in names]
            if not accepted or self._file is None:
                self._words = "Nothing was written."
                return
            try:
                kept = settings_file.write(self._file, accepted, datetime.now(UTC).date().isoformat())
            except StoreError as error:
                self._words = f"{error}. Nothing was written: mend that, and write again."
            else:
                break
        self._words = (
            f"{self._file}: {len(accepted)} values written; restart the car, it drives with the old ones until then."
            f" Undo: wallride calibrate --undo --config {self._file} (the values before are in {kept.name})."
        )

    def _tell(self, text: str) -> None:
        self._words = text.strip()


class PageCalibrator:
    """The calibrations of one page, one after the other. file: as of PageCalibration."""

    def __init__(self, file: Path | None) -> None:
        self._file = file
        self._now: PageCalibration | None = None
        self._takes_hands = False

    @property
    def takes_hands(self) -> bool:
        """Return whether the page's hands belong to a calibration: from a step's begin until the page left off."""
        return self._takes_hands or (self._now is not None and self._now.drives)

    def hear(self, beat: Beat, arrival_s: float) -> None:
        """Note a heartbeat of the car, which the page's hands echo."""
        if self._now is not None:
            self._now.deadman.hear(beat, arrival_s)

    def take_input(self, hands: InputState, now_s: float) -> bool:
        """Take the page's hands, if they belong to a calibration; return whether they do."""
        if self._now is None or not self.takes_hands:
            return False
        self._now.deadman.take(hands, now_s)
        return True

    def lose(self) -> None:
        """Count nothing as held until the page was seen released."""
        if self._now is not None:
            self._now.deadman.lose()

    def receive(self, word: Calibrate, connect: Callable[[], RemoteCar]) -> None:
        """Do what the page wants."""
        now = self._now
        if word.do == "begin":
            if now is None or now.stage == "ended":
                self._now = PageCalibration(word, connect, self._file)
        elif now is not None:
            self._takes_hands = self._takes_hands or (word.do == "drive" and now.stage == "ready")
            now.order(word)

    def leave(self) -> None:
        """Stop the step that is driven: the page switched its driving off, or was hidden."""
        self._takes_hands = False
        if self._now is not None:
            self._now.deadman.leave()

    def end(self, why: str) -> "PageCalibration | None":
        """End the present calibration; return it, so that its end can be waited for."""
        if self._now is not None and self._now.stage != "ended":
            self._now.end(why)
        return self._now

    def forget(self) -> None:
        """Forget the calibration of a car that is no longer shown."""
        self.end("The page left the car; nothing was written.")
        self._now, self._takes_hands = None, False

    def fields(self) -> Mapping[str, Any]:
        """Return the present for the page."""
        return self._now.fields() if self._now is not None else {"stage": "none", "file": str(self._file or "")}


def _driven(link: RemoteLink) -> dict[str, Any]:
    seen = link.seen
    _, speed_mps, steering_rad = seen.commands[-1] if seen.commands else (0.0, 0.0, 0.0)
    return {
        "speed_mps": speed_mps, "steering_rad": steering_rad, "reported_mps": seen.motor[-1][2] if seen.motor else 0.0,
        "scans": len(seen.scans), "reports": len(seen.motor),
    }  # fmt: skip
