"""Conversion of the hot path's entries to messages for a file; on the way, the armed state and the reasons of stops."""

import math
from collections.abc import Iterator, Sequence

from wallride.drivers.api import Scan
from wallride.runtime.arbitration.command import Output, Source, SpeedLimit
from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.recording import channels
from wallride.runtime.recording.black_box import StopWatcher
from wallride.runtime.recording.channels import RecordMessage
from wallride.runtime.recording.decision_codec import encode
from wallride.runtime.recording.decision_log import Entry, Heard
from wallride.runtime.ros import messages
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.settings.tree import Settings, to_toml
from wallride.runtime.wire import topics

MAX_EVENTS = 64
"""Maximum number of events in one message: its encoding is one stretch of work without a pause."""
MAX_PERIOD_S = 1.0


class Transcriber:
    """Reads entries in their order.

    active_s: when the car was last armed or moving, minus infinity before it was. stops: reasons of stops that are
        worth a black box; the reader clears them. begin_s: when the process began, for entries without an earlier time.
    """

    def __init__(self, wall_clock: WallClock, begin_s: float) -> None:
        self.active_s = -math.inf
        self.stops: list[str] = []
        self._wall_clock = wall_clock
        self._watcher = StopWatcher()
        self._now_s = begin_s
        self._last_scan_s = -math.inf

    def messages(self, entries: Sequence[Entry]) -> Iterator[RecordMessage]:
        """Yield the scans at once, and the decision log in pieces, both in order."""
        piece: list[Entry] = []
        for entry in entries:
            _, kind, parts = entry
            match kind:
                case "scan":
                    yield self._scan(*parts)
                case "step":
                    self._look_at(*parts)
                case "settings":
                    if piece:
                        yield self._decision_log(piece)
                    yield from self._settings(entry)
                    piece = []
                    continue
                case _:
                    pass
            piece.append(entry)
            if len(piece) == MAX_EVENTS:
                yield self._decision_log(piece)
                piece = []
        if piece:
            yield self._decision_log(piece)

    def _scan(self, scan: Scan) -> RecordMessage:
        self._now_s = max(self._now_s, scan.received_s)
        period_s, self._last_scan_s = scan.stamp_s - self._last_scan_s, scan.stamp_s
        header_ns = self._wall_clock.unix_ns(scan.stamp_s)
        payload = messages.laser_scan(header_ns, scan, period_s if period_s < MAX_PERIOD_S else 0.0)
        stamp_ns = self._wall_clock.started_unix_ns(scan.stamp_s)
        return RecordMessage(topics.SCAN, TYPES[topics.SCAN], stamp_ns, payload, scan.sequence)

    def _decision_log(self, piece: Sequence[Entry], *, lasting: bool = False) -> RecordMessage:
        payload = channels.text(encode(piece))
        return RecordMessage(
            channels.TAPE, channels.STRING, self._wall_clock.started_unix_ns(self._now_s), payload, lasting=lasting
        )

    def _settings(self, entry: Entry) -> Iterator[RecordMessage]:
        settings: Settings = entry[2][0]
        payload = channels.text(to_toml(settings).encode())
        yield RecordMessage(
            channels.SETTINGS, channels.STRING, self._wall_clock.started_unix_ns(self._now_s), payload, lasting=True
        )
        yield self._decision_log([entry], lasting=True)

    def _look_at(self, times_s: Sequence[float], elapsed_s: float, live: Heard, output: Output) -> None:  # noqa: ARG002 - an entry's parts
        self._now_s = max(self._now_s, output.stamp_s)
        if output.drive.speed_mps or any(map(_arms, live)):
            self.active_s = output.stamp_s
        if (reason := self._watcher.look(output, live)) is not None:
            self.stops.append(reason)


def _arms(word: object) -> bool:
    """Tell whether an entry means that the car may begin to move."""
    if isinstance(word, SpeedLimit) and word.source is Source.PERMIT:
        return word.assessment.ask(0.0, 0.0).forward_mps > 0
    return not isinstance(word, SpeedLimit | Source) and getattr(word, "source", None) is Source.TELEOP
