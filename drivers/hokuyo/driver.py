"""A Hokuyo lidar with a self-maintained connection: connect, identify, stream, monitor, restart, reconnect."""

import contextlib
import itertools
import math
import time
from collections.abc import Callable
from typing import Final, Never

from wallride.drivers.api import Clock, DriverError, LinkLost, LinkState, ProtocolError, Reschedule, Scan, as_wanted
from wallride.drivers.hokuyo.codec import command
from wallride.drivers.hokuyo.conversation import Conversation, SensorIdentity, identify, quieten, read_clock
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.hokuyo.stream import UNSTABLE_WARN, ScanStream
from wallride.drivers.hokuyo.timing import ClockReading, StampGate
from wallride.drivers.lidar import LATE_SAID_S, ConnectedLidar
from wallride.drivers.link import ByteLink, until_lost

USUAL_BAUDS: Final = (115200, 19200, 38400, 57600)
FIRST_SCAN_TIMEOUT_S: Final = 1.5
REBOOT_PAUSE_S: Final = 20.0
SETTLING_SCANS: Final = 2
"""Number of scans skipped after a restart of the stream of a sensor that does not tell its time: the first sets the
clock, and may have waited; the third that fits it is delivered."""
LATE_CHANGED_S, LATE_CHANGED = 0.03, 0.3
PROMPT_LINK_S: Final = 0.1
"""Round trip of a link on which a request for the time is not answered because the sensor does not know it."""
_FAREWELL_TIMEOUT_S: Final = 0.2


class Hokuyo(ConnectedLidar[Conversation]):
    """A `Lidar` (see wallride.drivers.api) with SCIP 2.x at a TCP or serial address.

    clear_s: moves the checks of the stream to a better moment.
    """

    def __init__(
        self, settings: HokuyoSettings, *, clock: Clock = time.monotonic, clear_s: Reschedule = as_wanted
    ) -> None:
        super().__init__(settings, USUAL_BAUDS, clock, clear_s)
        self._settings = settings
        self._numbers = itertools.count()
        self._gate = StampGate(settings.stale_after_s, self.health.count)
        self._last_reset_s: float | None = None
        self._last_reboot_s: float | None = None
        self._has_streamed = False
        self._timeless: set[str] = set()  # identities that do not tell their time
        self._late_s = 0.0

    async def _meet(self, link: ByteLink) -> Conversation:
        talk = Conversation(link, self._on_bad_block)
        await quieten(talk)
        return talk

    async def _who(self, talk: Conversation) -> str:
        return (await identify(talk)).name

    async def _measure(self, talk: Conversation, on_scan: Callable[[Scan], None]) -> Never:
        while True:
            self._say(LinkState.STARTING, f"{talk.link.address}: asking the sensor who it is{self._lateness}")
            talk.quickest_s = math.inf  # the link may be another since the last start
            identity = await identify(talk)
            self._note(identity.name)
            if unfit := identity.parameters.unfit:
                raise ProtocolError(f"{talk.link.address}: this {identity.parameters.model} {unfit}")
            stream, started_s = await self._start_stream(talk, identity, on_scan)
            why = await self._watch(stream, identity, started_s)
            talk.listen()
            self._say(LinkState.FAULTY, f"{talk.link.address}: {why}")
            if stream.trouble:
                await self._recover(talk, why)
            elif stream.delivered_s is None:
                raise LinkLost(f"{talk.link.address}: {why}")
            self.health.count("restart")
            await quieten(talk)

    async def _start_stream(
        self, talk: Conversation, identity: SensorIdentity, on_scan: Callable[[Scan], None]
    ) -> tuple[ScanStream, float]:
        """Return the stream, and when it was started."""
        reading = await self._read_clock(talk, identity)
        stream = ScanStream(
            talk,
            identity,
            self._gate,
            self.health,
            self._numbers,
            on_scan,
            settings=self._settings,
            held_back=SETTLING_SCANS if self._has_streamed else 0,
        )
        self._has_streamed = True
        self._late_s = 0.0
        self._gate.restart(talk.quickest_s, reading, 1 / identity.parameters.rate_hz)
        started_s = self._clock()
        try:
            await stream.start()
        except DriverError:
            if talk.quickest_s < PROMPT_LINK_S:
                self._timeless.add(identity.name)  # the reading may be what keeps it from measuring
            raise
        return stream, started_s

    async def _read_clock(self, talk: Conversation, identity: SensorIdentity) -> ClockReading | None:
        """Read the sensor's clock where it tells it, and remember where it does not."""
        if identity.name in self._timeless:
            return None
        reading = await read_clock(talk)
        if reading is None and talk.quickest_s < PROMPT_LINK_S:
            self._timeless.add(identity.name)
        return reading

    async def _watch(self, stream: ScanStream, identity: SensorIdentity, started_s: float) -> str:
        """Check the stream ten times a second; return the reason for a restart."""
        model = identity.parameters.model
        next_s = self._watch_begin_s()
        while not stream.trouble:
            next_s = await self._next_watch(next_s)
            now_s = self._clock()
            self._note_lateness()
            if why := self._why_restart(stream, now_s, started_s):
                return why
            self._log_changes()
            if stream.unstable_in_a_row >= UNSTABLE_WARN:
                self._say(LinkState.FAULTY, f"{model} checks itself and sends no data (sunlight? dirty window?)")
            elif stream.delivered_s is not None:
                self._failures = 0
                age_s = now_s - stream.delivered_s
                if age_s > self._settings.degraded_after_s:
                    self._say(
                        LinkState.FAULTY, f"{model}: no scan for {age_s:.1f} s{self._lateness or ' (cable, power?)'}"
                    )
                elif self.health.link is LinkState.READY:
                    self.health.message = identity.summary + self._untimed + self._lateness
            elif stream.heard_s is not None and self._lateness:
                self._say(LinkState.FAULTY, f"{model}: no usable scan{self._lateness}")
        return f"the sensor is in trouble, status {stream.trouble} (if it stays so, power-cycle it)"

    def _note_lateness(self) -> None:
        """Follow the newest scans' delay where it has really changed: each change of a message is logged."""
        least_s, self._gate.least_s = self._gate.least_s, math.inf
        if math.isfinite(least_s) and abs(least_s - self._late_s) > max(LATE_CHANGED_S, LATE_CHANGED * self._late_s):
            self._late_s = least_s

    @property
    def _lateness(self) -> str:
        """The delay noted in words, "" while the scans are prompt."""
        if self._late_s < LATE_SAID_S:
            return ""
        return f"; its scans come {self._late_s:.2f} s late (network? a busy computer?)"

    @property
    def _untimed(self) -> str:
        """How the scans' age is known where the sensor does not tell it, "" where it does."""
        if self._gate.dated:
            return ""
        return f"; it does not tell its time (TM): its scans count as {self._gate.link_s * 1000:.0f} ms late"

    def _why_restart(self, stream: ScanStream, now_s: float, started_s: float) -> str:
        silent_s = self._settings.silent_after_s
        if stream.heard_s is None:
            late = now_s - started_s > max(FIRST_SCAN_TIMEOUT_S, silent_s)
            return "measuring, but no scan came (is the motor turning? power-cycle it)" if late else ""
        if now_s - stream.heard_s > silent_s:
            return f"no scan for {now_s - stream.heard_s:.1f} s (cable, power, or the sensor hangs)"
        unused_s = now_s - (started_s if stream.delivered_s is None else stream.delivered_s)
        if unused_s > 2 * silent_s and not stream.unstable_in_a_row:
            return f"for {unused_s:.1f} s no usable scan{self._lateness or '; all have foreign stamps'}"
        return ""

    async def _recover(self, talk: Conversation, why: str) -> None:
        """Recover in steps: laser off and reset; then a reboot, never twice within 20 s; then wait for a human."""
        now_s = self._clock()
        await quieten(talk)
        if self._last_reset_s is None or now_s - self._last_reset_s > REBOOT_PAUSE_S:
            self._last_reset_s = now_s
            if (await talk.ask(command("RS"))).status == "00":
                return
        if self._last_reboot_s is None or now_s - self._last_reboot_s > REBOOT_PAUSE_S:
            self._last_reboot_s = now_s
            self.health.count("reboot")
            with contextlib.suppress(LinkLost):  # it may go down before its second reply is sent
                await talk.ask(command("RB"))
                await talk.ask(command("RB"))
            raise ProtocolError(f"{talk.link.address}: {why}; rebooting it")
        raise ProtocolError(f"{talk.link.address}: {why}; reset and reboot did not help: power-cycle it")

    async def _say_goodbye(self, talk: Conversation) -> None:
        """Turn the laser off before closing, and wait a moment for the echo: a close can overtake the written bytes."""
        talk.listen()
        # A link that is already lost takes no command; on any other the write in ask() sends it at once.
        with contextlib.suppress(LinkLost):
            await until_lost(talk.link, talk.ask(command("QT"), timeout_s=_FAREWELL_TIMEOUT_S))

    def _on_bad_block(self, what: str) -> None:
        next(self._numbers)
        self.health.count(what)
