"""Commands in the place of `wallride map`, `line` and `logs get`: they answer as those do, and compute nothing."""

import asyncio
import base64
import json
from pathlib import Path

from wallride.clients.monitor.command_run import CommandAnswer

PNG = base64.b64decode(
    "iVBORw0KGgoAAAANSUhEUgAAAAEAAAABCAYAAAAfFcSJAAAADUlEQVR42mNk+M9QDwADhgGAWjR9awAAAABJRU5ErkJggg=="
)
MAP = {
    "way_m": 31.5, "keyframes": 63, "unmatched": 0, "residual_m": 0.0062, "inliers": 0.93, "loops": 14, "full_loops": 9,
    "contradiction": 0.4, "gap_s": 0.0, "reasons": [], "scale": 0.97, "trim_rad": 0.01,
}  # fmt: skip
OPEN = "the ring is open: the drive ends 4.1 m from its beginning; drive on past the start, one corner or more"
LINE = {
    "length_m": 28.1, "lap_s": 6.77, "nearest_wall_m": 0.45, "tightest_turn_m": 1.2, "slowest_mps": 2.1,
    "fastest_mps": 6.0,
}  # fmt: skip
NAME = "20261121T084600Z-b0007-00042.mcap"
"""The newest recording."""


class LapCommands:
    """words: of each command that was run. reasons: against the map. failing: exit code and words by command.

    gate: keeps a command from ending until it is set.
    """

    def __init__(self):
        self.words = []
        self.reasons = []
        self.failing = {}
        self.gate = asyncio.Event()
        self.gate.set()

    @property
    def names(self):
        """Return what was run, in order."""
        return [words[0] for words in self.words]

    async def __call__(self, words, within_s):
        assert within_s > 0
        self.words.append(list(words))
        await self.gate.wait()
        if (failed := self.failing.get(words[0])) is not None:
            return CommandAnswer(failed[0], "", failed[1])
        return getattr(self, f"_{words[0]}")(words)

    def _map(self, words):
        target = Path(words[words.index("-o") + 1])
        made = target.with_name(f"{target.stem}-refused.yaml") if self.reasons else target
        made.with_suffix(".png").write_bytes(PNG)
        told = {**MAP, "reasons": self.reasons, "map": str(made)}
        return CommandAnswer(1 if self.reasons else 0, json.dumps(told) + "\n", "")

    def _line(self, words):
        Path(words[words.index("-o") + 1]).with_suffix(".png").write_bytes(PNG)
        return CommandAnswer(0, json.dumps(LINE) + "\n", "")

    def _logs(self, words):
        return CommandAnswer(0, "fetched\n", "")


def listing(folder, *names):
    """Return a car's answer to `logs/list`: a black box is the newest of them."""
    files = [{"name": name, "size_bytes": 7, "black_box": False} for name in names]
    box = {"name": "20261121T084655Z-b0007-00043-stop-wall-ahead.mcap", "size_bytes": 7, "black_box": True}
    return {"folder": str(folder), "files": [*files, box]}


def recorded(folder):
    """Write the newest recording into a folder; return the listing of a car whose folder it is."""
    folder.mkdir(exist_ok=True)
    (folder / NAME).write_bytes(b"the lap")
    return listing(folder, "20261121T074600Z-b0007-00041.mcap", NAME)
