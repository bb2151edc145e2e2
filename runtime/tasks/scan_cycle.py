"""The end of a scan's cycle, in this order: the motor's command, telemetry, then work that can wait for both."""

from collections.abc import Callable, Sequence

from wallride.drivers.api import Scan
from wallride.runtime.control.guidance import Guidance
from wallride.runtime.realtime.stage_timing import TimedStage


class ScanCycle:
    """One per car. A navigator calls `begin` before it answers a scan and `end` with its answer, and nothing else.

    decide: the mux's decision on the commands present now; the motor need not wait for the mux's turn of the loop.
    publish: passes scan and answer to telemetry. afterwards: called with the scan, in order, once the command is sent.
    """

    def __init__(
        self,
        stage: TimedStage,
        decide: Callable[[], None],
        publish: Callable[[Scan, Guidance], None],
        afterwards: Sequence[Callable[[Scan], None]] = (),
    ) -> None:
        self._stage = stage
        self._decide = decide
        self._publish = publish
        self._afterwards = tuple(afterwards)

    def begin(self) -> None:
        """Note the start of the answer."""
        self._stage.begin()

    def end(self, scan: Scan, guidance: Guidance) -> None:
        """End a scan; its commands are in the command queue."""
        self._stage.end()
        self._decide()
        self._publish(scan, guidance)
        for each in self._afterwards:
            each(scan)
