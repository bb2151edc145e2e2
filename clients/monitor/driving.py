"""Operator's commands from a page's inputs: the deadman's second half. Pure: time is an argument.

The same pilot as `wallride teleop`'s decides which presses count. In contrast to a terminal a page can stop unnoticed:
a frozen, hidden or closed tab. Therefore

* every command follows from a message of the page; nothing renews a command while the page is silent,
* the pilot receives only the beats that the page echoes, so that a late page is late on the car's own clock too,
* a page that is silent for SILENT_S has no inputs: the car is commanded to stop and to require a release (a page that
  is busy for a moment less than that loses nothing: the car itself waits 0.2 s for the next command),
* an end without a person's wish (closed socket, hidden tab) is never a goodbye, after which autonomy may go on.

An e-stop needs none of that: it goes out at once, also from a page that does not drive.
"""

import math
import secrets
from collections import OrderedDict
from collections.abc import Iterable, Mapping
from dataclasses import replace
from typing import Any

from wallride.clients.monitor.messages import InputState
from wallride.clients.teleop.advice import advise
from wallride.clients.teleop.inputs import Control, Inputs
from wallride.clients.teleop.pilot import DISTRUST, Pilot
from wallride.clients.teleop.shaping import InputShape
from wallride.runtime.wire.teleop import Beat, Command, Input, Press

SILENT_S = 0.15
"""Six messages of the page missing. The car learns it at the next tick, 0.02 s later at most, and by itself, from the
age of the last command, 0.05 s later."""
GIVE_UP_S = 1.0
"""Timeout of a silent page: by then the car has stopped twice over, and has declared the operator lost."""
INSIST_S = 5.0
"""Duration of repeating an e-stop to a car that does not confirm it, from a page that sends nothing more."""
REMEMBERED_BEATS = 256
LAST_WORDS = 3
NAMES: Mapping[Control, str] = {
    Control.MANUAL: "{manual}",
    Control.AUTONOMY: "{autonomy}",
    Control.ESTOP: "STOP",
    Control.RESET: "{reset}",
    Control.TAKE_OVER: "{take_over}",
    Control.SPEED: "up and down",
    Control.STEERING: "left and right",
}
"""Only the page knows whether it has keys, a gamepad or a finger: it puts its own names into the braces."""
NO_INPUT = Inputs(Input.PAGE, live=False, trouble="the page is silent: is it hidden, or frozen?")


class PageDriver:
    """Inputs of one page.

    engaged: the page took control; otherwise only an e-stop leaves here. by_keys: as of `advise`.
    """

    def __init__(self, name: str, feel: InputShape) -> None:
        self._name = name
        self._feel = feel
        self._pilot = self._new_pilot()
        self._beats: OrderedDict[tuple[int, int], Beat] = OrderedDict()
        self._newest: Beat | None = None
        self._hands = NO_INPUT
        self._share = 1.0
        self._heard_s = -math.inf
        self._stopped_s = -math.inf
        self.by_keys = False
        self.engaged = False

    def hear(self, beat: Beat, arrival_s: float) -> None:
        """Process a heartbeat of the car. While the page drives, it counts once the page has echoed it."""
        self._newest = beat
        self._beats[beat.car_session, beat.beat] = beat
        if len(self._beats) > REMEMBERED_BEATS:
            self._beats.popitem(last=False)
        if not self.engaged:
            self._pilot.hear(beat, arrival_s)

    @property
    def session(self) -> int:
        """Return the number of this page's operator session on the car."""
        return self._pilot.session

    def whose(self, pages: Iterable["PageDriver"]) -> str:
        """Return the operator of the car: "this page", "another page" of this monitor, "elsewhere", or "" for none."""
        beat = self._newest
        if beat is None or not beat.operator_session:
            return ""
        if beat.operator_session == self.session:
            return "this page"
        return "another page" if any(page.session == beat.operator_session for page in pages) else "elsewhere"

    def know_link(self, round_trip_s: float | None) -> None:
        """Take the monitor's round trip to the car, None where it does not answer."""
        self._pilot.know_link(math.nan if round_trip_s is None else round_trip_s, math.nan)

    def forget_car(self) -> None:
        """Reset for another car; the old session must have been ended by `leave`."""
        self._beats.clear()
        self._newest = None
        self._pilot = self._new_pilot()

    def take_input(self, hands: InputState, now_s: float) -> Command:
        """Return the command that follows from a message of the page."""
        self.engaged = True
        echoed = self._beats.get((hands.car_session, hands.beat))
        if echoed is not None:
            self._pilot.hear(echoed, now_s)
        self._heard_s, self._share = now_s, hands.share
        self._hands = Inputs(
            kind=Input.PAD if hands.pad else Input.PAGE,
            live=True,
            event_s=now_s - hands.age_ms / 1000,
            pressed=hands.controls,
            speed=hands.speed,
            steering=hands.steering,
        )
        return self._step(self._hands, now_s)

    def drop(self, now_s: float) -> Command | None:
        """Return the command for inputs that the page lost; None when it does not drive."""
        if not self.engaged:
            return None
        self._hands = NO_INPUT
        return self._step(NO_INPUT, now_s)

    def stop(self, now_s: float) -> Command:
        """Return the e-stop; `tick` repeats it until the car reports that it latched."""
        self._stopped_s = now_s
        pressed = self._hands.pressed | {Control.ESTOP}
        return self._step(Inputs(Input.PAGE, live=True, event_s=now_s, pressed=pressed), now_s)

    def tick(self, now_s: float) -> Command | None:
        """Return the command due without a message of the page, or None; call it 50 times a second."""
        situation = self._pilot.situation
        if situation is not None and situation.stop_pending and now_s - self._stopped_s < INSIST_S:
            return self._step(self._hands if self._is_heard(now_s) else NO_INPUT, now_s)
        if not self.engaged or self._is_heard(now_s):
            return None
        if now_s - self._heard_s > GIVE_UP_S:
            return None
        self._hands = NO_INPUT
        return self._step(NO_INPUT, now_s)

    def leave(self, now_s: float, *, deliberate: bool) -> list[Command]:
        """Return the last messages, to be sent a few milliseconds apart; [] when the page did not drive."""
        if not self.engaged:
            return []
        self.engaged, hands = False, self._hands
        self._hands, self._heard_s = NO_INPUT, -math.inf
        if deliberate:
            words = [self._pilot.goodbye(Input.PAGE) for _ in range(LAST_WORDS)]
            self._pilot = self._new_pilot()
            if self._newest is not None:
                self._pilot.hear(self._newest, now_s)
            return words
        if hands.live and hands.released:
            return [self._step(NO_INPUT, now_s)]
        return [replace(self._step(NO_INPUT, now_s), flags=DISTRUST) for _ in range(LAST_WORDS)]

    def view(self, now_s: float) -> dict[str, Any]:
        """Return the present for the page, as plain values."""
        now = self._pilot.situation
        if now is None or not (self.engaged or now.stop_pending):
            return {"engaged": False, "stop_pending": False, "mood": "yellow", "state": "watching", "next": ""}
        advice = advise(now, NAMES, by_keys=self.by_keys)
        return {
            "engaged": self.engaged,
            "stop_pending": now.stop_pending,
            "mood": advice.mood.value,
            "state": advice.state,
            "next": advice.next_step,
            "armed": now.armed,
            "mine": now.mine,
            "manual": now.flags == Press.MANUAL,
            "autonomy": now.flags == Press.AUTONOMY,
            "speed_mps": now.wanted_mps * self._share,
            "steering_rad": now.wanted_rad,
            "round_trip_s": now.round_trip_s,
            "beat_age_s": min(now.beat_age_s, 1e6),
            "progress": now.progress,
            "silent": self.engaged and not self._is_heard(now_s),
        }

    def _step(self, inputs: Inputs, now_s: float) -> Command:
        command = self._pilot.step(inputs, now_s)
        return replace(command, speed_mps=command.speed_mps * self._share)

    def _is_heard(self, now_s: float) -> bool:
        return now_s - self._heard_s <= SILENT_S

    def _new_pilot(self) -> Pilot:
        return Pilot(secrets.randbits(63) + 1, self._name, self._feel)
