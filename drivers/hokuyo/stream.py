"""The hot path: from the bytes of a running stream to scans, inside the reader callback. No log, no formatting."""

import asyncio
import math
from collections.abc import Callable, Iterator
from typing import Final

from wallride.drivers.api import Health, LinkLost, LinkState, ProtocolError, Scan
from wallride.drivers.hokuyo.codec import BLOCK_LIMIT_BYTES, ReplyBlock, stream_command
from wallride.drivers.hokuyo.conversation import Conversation, SensorIdentity
from wallride.drivers.hokuyo.ranges import RangeDecoder
from wallride.drivers.hokuyo.replies import StreamStatus, decode_number, judge
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.hokuyo.timing import StampGate

START_TIMEOUT_S: Final = 1.0
UNSTABLE_WARN: Final = 5
"""Number of consecutive scan slots without data after which it is reported."""


class ScanStream:
    """One MD stream of all steps, from its command to its end.

    heard_s: time of the last valid block: a scan, late ones included, or "unstable". delivered_s: time of the last
        delivered scan. Both None before the first.
    held_back: number of fresh scans that are not delivered at first ("settling" in the counts), where the sensor does
        not tell how late the first comes.
    numbers: of the driver's scans across all its streams; a scan that is dropped takes a number too.
    trouble: the status in which the sensor gave up, "" while it has not.
    """

    def __init__(
        self,
        talk: Conversation,
        identity: SensorIdentity,
        gate: StampGate,
        health: Health,
        numbers: Iterator[int],
        on_scan: Callable[[Scan], None],
        *,
        settings: HokuyoSettings,
        held_back: int = 0,
    ) -> None:
        parameters = identity.parameters
        self._talk = talk
        self._gate = gate
        self._health = health
        self._numbers = numbers
        self._on_scan = on_scan
        self._ready_message = identity.summary
        self._held_back = held_back
        self._command = stream_command(parameters.first_step, parameters.last_step)
        self._echo_head = self._command[:-3]  # in scans the last two digits count down
        self._decoder = RangeDecoder(
            parameters.beam_count,
            parameters.range_min_mm,
            parameters.range_max_mm,
            reverse=settings.mounted_upside_down,
        )
        self._angle_step_rad = parameters.angle_step_rad
        upside_down = settings.mounted_upside_down
        ray_s = 1 / parameters.rate_hz / parameters.steps_per_turn
        self._ray_s = -ray_s if upside_down else ray_s
        edge_rad = parameters.angle_rad(parameters.last_step if upside_down else parameters.first_step)
        self._angle_min_rad = (-edge_rad if upside_down else edge_rad) + settings.yaw_rad
        self._range_min_m = parameters.range_min_mm / 1000
        self._range_max_m = parameters.range_max_mm / 1000
        self._asked_s = math.inf
        self._started: asyncio.Future[str] = asyncio.get_running_loop().create_future()
        self.heard_s: float | None = None
        self.delivered_s: float | None = None
        self.unstable_in_a_row = 0
        self.trouble = ""

    async def start(self) -> None:
        """Start measuring; the sensor's refusal is left in `trouble` or raised as ProtocolError."""
        self._talk.deframer.limit_bytes = max(BLOCK_LIMIT_BYTES, 2 * self._decoder.block_bytes)
        self._talk.link.listen(self._on_bytes)
        self._asked_s = self._talk.link.clock()
        self._talk.link.write(self._command)
        try:
            async with asyncio.timeout(START_TIMEOUT_S):
                status = await self._started
        except TimeoutError as error:
            raise LinkLost(
                f"{self._talk.link.address}: it does not start measuring within {START_TIMEOUT_S:g} s (power-cycle it)"
            ) from error
        if judge(status) is StreamStatus.REFUSED:
            raise ProtocolError(
                f"{self._talk.link.address}: refuses {self._command.decode().strip()} with status {status}"
                " (restart it; if it stays so, the sensor does not accept its own limits)"
            )

    def _on_bytes(self, chunk: bytes, read_at_s: float) -> None:
        for block in self._talk.deframer.feed(chunk):
            if not block.echo.startswith(self._echo_head):
                self._health.count("stray reply")
            elif block.status == "99":
                self._on_scan_block(block, read_at_s)
            else:
                self._on_status(block.status, read_at_s)

    def _on_scan_block(self, block: ReplyBlock, read_at_s: float) -> None:
        sequence = next(self._numbers)
        stamp_ms = decode_number(block.lines[0]) if len(block.lines) == 2 else None
        ranges_m = self._decoder.decode(block.lines[1]) if len(block.lines) == 2 else None
        if stamp_ms is None or ranges_m is None:
            self._health.count("malformed")
            return
        self.heard_s = read_at_s
        self.unstable_in_a_row = 0
        lateness_s = self._gate.accept(stamp_ms, read_at_s)
        if lateness_s is None:
            return
        if self._held_back and not self._gate.dated:
            self._held_back -= 1
            self._health.count("settling")
            return
        self.delivered_s = read_at_s
        if self._health.link is not LinkState.READY:
            self._health.link = LinkState.READY
            self._health.message = self._ready_message
        self._on_scan(
            Scan(
                stamp_s=read_at_s - lateness_s,
                received_s=read_at_s,
                angle_min_rad=self._angle_min_rad,
                angle_step_rad=self._angle_step_rad,
                range_min_m=self._range_min_m,
                range_max_m=self._range_max_m,
                ranges_m=ranges_m,
                sequence=sequence,
                ray_s=self._ray_s,
                returns=self._decoder.returns(block.lines[1]),
            )
        )

    def _on_status(self, status: str, read_at_s: float) -> None:
        if not self._started.done():
            self._gate.link_s = min(self._gate.link_s, read_at_s - self._asked_s)
            self._started.set_result(status)
        meaning = judge(status)
        if meaning is StreamStatus.UNSTABLE:
            next(self._numbers)
            self.heard_s = read_at_s
            self.unstable_in_a_row += 1
            self._health.count("unstable")
        elif meaning is StreamStatus.ABNORMAL:
            self.trouble = status
            self._health.count("abnormal")
        elif meaning is StreamStatus.REFUSED:
            self._health.count("refused")
