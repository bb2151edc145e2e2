"""What ends a scan, in this order: the motor's command, telemetry, then what can wait until the command is out."""

from collections.abc import Callable, Sequence

from drivers.api import Scan
from runtime.control.guidance import Guidance
from runtime.realtime.stage_timing import TimedStage


class ScanCycle:
    """One for a car. A navigator calls `begin` before it answers a scan and `end` with its answer, and nothing else.

    decide: the mux's decision on the words that there are now; the motor need not wait for the mux's turn of the loop.
    publish: hands scan and answer to telemetry. afterwards: told of the scan, in order, when the command is on its way.
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
        """Note when the answer begins."""
        self._stage.begin()

    def end(self, scan: Scan, guidance: Guidance) -> None:
        """End a scan: its words are in the command queue."""
        self._stage.end()
        self._decide()
        self._publish(scan, guidance)
        for each in self._afterwards:
            each(scan)
