"""One run as displayed on the page, beside another or alone."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import accumulate
from typing import Any

from wallride.sim.replay.figures import RecordedStop, numbers, stops
from wallride.sim.replay.run import RecordedRun


@dataclass(frozen=True, slots=True)
class Shown:
    """A run with its figures. truth: the simulator's, where there are any. tag: "A" or "B" beside another run."""

    run: RecordedRun
    numbers: Mapping[str, Any]
    found: Sequence[RecordedStop]
    truth: Mapping[str, Any] | None = None
    tag: str = ""

    @property
    def label(self) -> str:
        """Return its label in tables and legends."""
        return f"{self.tag} {self.run.name}" if self.tag else ""

    @property
    def world(self) -> str:
        """Return the name of its simulated world, "" on a real car."""
        return self.run.settings.recording.world or str((self.truth or {}).get("world") or "")

    @property
    def laps_s(self) -> Sequence[float]:
        """Return the times of complete laps, on the run's clock; only the simulator has them."""
        truth = self.truth or {}
        began_s = float(truth.get("began_unix_s") or self.run.zero_unix_s) - self.run.zero_unix_s
        return [began_s + end_s for end_s in accumulate(truth.get("lap_times_s") or ())]

    @property
    def races(self) -> bool:
        """Return whether its errors are distances from a race line, not from a wall."""
        return self.run.settings.wall_follow.method == "line"

    def tagged(self, text: str) -> str:
        """Return a series' or a mark's name, with the run's tag where there are two."""
        return f"{self.tag} {text}" if self.tag and text else self.tag or text


def shown(run: RecordedRun, truth: Mapping[str, Any] | None = None, tag: str = "") -> Shown:
    """Return a run with its figures and stops."""
    return Shown(run, numbers(run), stops(run), truth, tag)
