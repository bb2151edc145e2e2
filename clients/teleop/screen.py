"""Display for the operator, twenty times a second: the car's state and reason, the link, and the next step."""

import contextlib
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, TextIO

from rich.console import Console, Group
from rich.live import Live
from rich.text import Text

from wallride.clients.status import overruled_words
from wallride.clients.teleop.advice import Advice
from wallride.clients.teleop.inputs import Control
from wallride.clients.teleop.pilot import PilotState
from wallride.runtime.arbitration.command import NO_WINNER
from wallride.runtime.host.terminal_text import one_line
from wallride.runtime.telemetry.screen_words import because, steering_words
from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import CarCondition


@dataclass(slots=True)
class CarState:
    """Car state from `status` and `decision`. Reads the known fields and ignores the rest: versions may differ."""

    winner: str = ""
    reason: str = ""
    measure: float | None = None
    voltage_v: float | None = None
    fault: str = ""
    overruled: str = ""
    operators: set[str] = field(default_factory=set)

    def take(self, payload: bytes) -> None:
        """Process either of the two messages; an invalid one changes nothing on the screen."""
        try:
            message = topics.decode(payload)
        except (ValueError, TypeError):
            return
        decision = message.get("decision") or message.get("output") or message
        if isinstance(decision, Mapping) and isinstance(decision.get("reason"), str):
            self.winner = str(decision.get("winner") or NO_WINNER)
            self.reason = decision["reason"]
            self.measure = _number(decision.get("measure"))
        battery = message.get("battery")
        voltage_v = _number(
            message.get("voltage_v", battery.get("voltage_v") if isinstance(battery, Mapping) else None)
        )
        if voltage_v is not None:
            self.voltage_v = voltage_v
        if "overruled" in message:
            said = message["overruled"]
            self.overruled = overruled_words(said) if isinstance(said, Mapping) else ""
        if isinstance(message.get("fault"), str):
            self.fault = message["fault"]

    def on_operator(self, key: str, alive: bool) -> None:  # noqa: FBT001 - the bus's callback
        """Remember which operators' clients are connected."""
        (self.operators.add if alive else self.operators.discard)(key.rsplit("/", 1)[-1])


def lines(car: str, now: PilotState, advice: Advice, news: CarState, names: Mapping[Control, str]) -> list[str]:
    """Return the screen as text, most important first: the state, what to do next, then the reasons."""
    beat = now.beat
    measured_mps = beat.speed_mps if beat is not None else math.nan
    others = max(0, len(news.operators) - 1)
    round_trip_s = now.round_trip_s if now.mine else now.link_s  # of our commands, else of a question
    volts = "-" if news.voltage_v is None else f"{news.voltage_v:.1f} V"
    permit = "given" if beat is not None and CarCondition.PERMITTED in beat.flags else "not given"
    rows = [
        f"{advice.state}   {advice.next_step}",
        f"{car}: {_why(news)}" if now.linked else f"{car}: not heard",
        f"speed {measured_mps:+.2f} m/s   wished {now.wanted_mps:+.2f} m/s, {steering_words(now.wanted_rad)}",
        f"operator: {_operator(now)}" + (f"   {others} more connected" if others else ""),
        (
            f"link: beat {_milliseconds(now.beat_age_s)} ago, round trip {_milliseconds(round_trip_s)}"
            f"   battery {volts}   permit {permit}"
        ),
        f"input: {now.inputs.device or 'none'}" + (f"   {now.inputs.trouble}" if now.inputs.trouble else ""),
        (
            f"{names[Control.MANUAL]} drive   {names[Control.AUTONOMY]} autonomy   {names[Control.ESTOP]} e-stop"
            f"   {names[Control.RESET]} (1 s) reset   {names[Control.TAKE_OVER]} (1 s) take over   Ctrl-C leave"
        ),
        f"speed: {names[Control.SPEED]}   steering: {names[Control.STEERING]}",
    ]
    if news.overruled:
        rows.insert(2, news.overruled)
    if news.fault:
        rows.insert(2, f"fault: {news.fault}")
    return rows


class Screen:
    """Draws the lines: in place in a terminal, or, where it is none, one line for every change of state."""

    def __init__(self, out: TextIO, *, plain: bool) -> None:
        console = Console(file=out)
        self._console = console
        self._live = None if plain or not console.is_terminal else Live(console=console, auto_refresh=False)
        self._last = ""
        if self._live is not None:
            self._live.start()

    def draw(self, rows: Sequence[str], advice: Advice) -> None:
        """Show the present state. OSError when the terminal is gone."""
        rows = list(map(one_line, rows))
        if self._live is not None:
            if not self._console.is_terminal:  # rich would draw nothing, without a word
                raise OSError("the terminal is gone")
            head = Text(rows[0], style=f"bold {advice.mood.value}")
            body = [Text(row) for row in rows[1:]]
            self._live.update(Group(head, *body), refresh=True)
        elif advice.state != self._last:
            self._last = advice.state
            self._console.print(rows[0], highlight=False, soft_wrap=True)

    def close(self) -> None:
        """Leave the terminal as it was."""
        if self._live is not None:
            with contextlib.suppress(OSError):  # the terminal may be gone
                self._live.stop()


def _why(news: CarState) -> str:
    if not news.reason:
        return "no status yet"
    return f"{news.winner}: {because(news.reason, news.measure)}"


def _operator(now: PilotState) -> str:
    if now.mine:
        return "you"
    name = now.operator_name
    if now.beat is not None and CarCondition.OPERATOR_LOST in now.beat.flags:
        return f"not operated, {name or 'the last one'} was lost"
    return name or "not operated"


def _milliseconds(seconds: float) -> str:
    return f"{seconds * 1000:.0f} ms" if math.isfinite(seconds) else "-"


def _number(value: Any) -> float | None:  # noqa: ANN401 - whatever JSON holds
    return float(value) if isinstance(value, int | float) and math.isfinite(value) else None
