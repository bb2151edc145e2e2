"""A motor by servo pulses that maintains its connection: find the board, arm the ESC with neutral, command, reconnect.

What differs between boards is a `PulsePort`. The speed is not the board's: `learn` takes it from whatever sees the car.
"""

import asyncio
import contextlib
import math
import time
from abc import ABC, abstractmethod
from typing import Final, Never, Protocol

from wallride.drivers.api import Clock, Drive, DriverError, Health, LinkLost, LinkState, MotorState, ProtocolError
from wallride.drivers.link import Tap
from wallride.drivers.pwm.settings import PwmSettings
from wallride.drivers.pwm.speed import EstimatedSpeed
from wallride.drivers.pwm.speed_loop import SpeedLoop
from wallride.drivers.pwm.throttle import Throttle, steering_rad, steering_us

REOPEN_AFTER_S: Final = (0.2, 0.5, 1.0)
"""Pauses before the attempts to reopen; the last one repeats."""
UNGUARDED_MPS: Final = 1.5
"""Maximum speed with a board that goes on with its last pulse when nothing commands it any more."""
BRAKES_FIRST_S: Final = 1.0
"""Time of a brake after a connection that was lost while the car drove: its ESC may have gone on."""
NO_TIMEOUT: Final = "its board has no command timeout"
ESTIMATE: Final = "speed by scans, an estimate"


class PulsePort(Protocol):
    """An open board. identity: what it is. unguarded: why it does not stop the car without commands, "" if it does."""

    identity: str
    unguarded: str
    timed_out: bool

    def write(self, steering_pulse_us: float, throttle_pulse_us: float) -> None:
        """Write both pulses at once; LinkLost where that fails."""

    async def check(self) -> None:
        """Wait for the next look at the board, about ten times a second; DriverError where it is not as it was left."""

    def close(self) -> None:
        """Close it."""


class PwmMotor(ABC):
    """A `Motor` (see wallride.drivers.api) but for its board.

    A stop brakes while the ESC would brake and is neutral afterwards: see `Throttle`. The last pulses of a connection
    are a stop. health: its condition, FAULTY while a fault is latched. state: the newest report, whose speed is an
    estimate, None while disconnected. words: what bounds the speed, for the car's status. Counted in `health`:
    bad_command, fault, lost, reconnect.
    """

    def __init__(self, settings: PwmSettings, *, clock: Clock = time.monotonic) -> None:
        self._settings, self._clock = settings, clock
        self.health = Health()
        self._throttle, self._loop = Throttle(settings), SpeedLoop(settings)
        self._port: PulsePort | None = None
        self._ready = False
        self._broken: DriverError | None = None
        self.state: MotorState | None = None
        self._distance_m = self._steering_rad = 0.0
        self._latched, self._contradicts = "", False
        self._failures = 0
        self.braked_instead = False
        self.tap: Tap | None = None

    @abstractmethod
    async def open_port(self) -> PulsePort:
        """Open the board and set it up, neither pulse changed yet; DriverError with the usual remedy."""

    @property
    def max_speed_mps(self) -> float:
        """Maximum speed with this board."""
        most_mps = self._settings.max_speed_mps
        return most_mps if self._port is None or not self._port.unguarded else min(most_mps, UNGUARDED_MPS)

    @property
    def bounded_by(self) -> str:
        """What bounds the speed: the setting, or what the board lacks."""
        unguarded = self._port is not None and self._settings.max_speed_mps > UNGUARDED_MPS and self._port.unguarded
        return unguarded or "motor.max_speed_mps"

    @property
    def words(self) -> tuple[str, ...]:
        """What bounds the speed, in sentences."""
        if self._port is None or not self._ready:
            return ()
        why = "; ".join(dict.fromkeys(filter(None, (self.bounded_by, self._port.unguarded))))
        words = [f"the motor allows {self.max_speed_mps:.1f} m/s: {why}"]
        if self._loop.blind:
            words.append(f"the scans do not tell the speed: {self._settings.blind_speed_mps:.1f} m/s at most")
        return tuple(words)

    async def run(self) -> Never:
        """Maintain the connection; brakes and closes the port when cancelled."""
        while True:
            try:
                await self._serve()
            except DriverError as error:
                self.health.link = LinkState.FAULTY if isinstance(error, ProtocolError) else LinkState.ABSENT
                self.health.message = str(error)
            pause_s = REOPEN_AFTER_S[min(self._failures, len(REOPEN_AFTER_S) - 1)]
            self._failures += 1
            await asyncio.sleep(pause_s)

    def send(self, drive: Drive) -> bool:
        """Write one command at once; False where the board is not connected. Numbers that are none are a stop."""
        port, now_s = self._port, self._clock()
        if port is None or not self._ready:
            return False
        wanted_mps = self._allowed_mps(drive)
        if math.isfinite(drive.steering_rad):
            pulse_us = steering_us(self._settings, drive.steering_rad)
            self._steering_rad = steering_rad(self._settings, pulse_us)
        asked_mps = self._loop.command_mps(wanted_mps, now_s)
        throttle_us = self._throttle.pulse_us(asked_mps, self._loop.speed_mps, now_s)
        self.braked_instead |= self._throttle.braked_instead
        try:
            port.write(steering_us(self._settings, self._steering_rad), throttle_us)
        except DriverError as error:
            self._broken, self._ready, self.state = error, False, None
            self.health.count("lost")
            self.health.link, self.health.message = LinkState.ABSENT, str(error)
            return False
        self._report(now_s)
        return True

    def learn(self, told: EstimatedSpeed) -> None:
        """Take an estimate of the speed; what contradicts the command is a latched fault."""
        if self._ready:
            now_s = self._clock()
            self._loop.learn(told, now_s)
            if self._loop.fault:
                self.latch_fault(self._loop.fault)
            self._report(now_s)

    def brake_now(self) -> None:
        """Write one stop without the event loop: the last act of a process whose loop has ended. Never raises."""
        if self._port is not None:
            with contextlib.suppress(Exception):
                self._port.write(steering_us(self._settings, self._steering_rad), self._throttle.last_us())

    def latch_fault(self, words: str) -> None:
        """Latch a fault; no effect where one is latched."""
        if not self._latched:
            self._latched, self._contradicts = words, True
            self.health.count("fault")
            self._tell()

    def retry_fault(self) -> None:
        """Clear no fault: a board reports none itself, and a contradiction stays."""
        return

    def clear_fault(self) -> None:
        """Clear the latched fault."""
        self._latched, self._loop.fault = "", ""
        self._tell()

    def _allowed_mps(self, drive: Drive) -> float:
        """Return the speed that may be driven now, 0 for a stop."""
        self.braked_instead = False
        if not math.isfinite(drive.speed_mps + drive.steering_rad) or math.isnan(drive.brake_mps2):
            self.health.count("bad_command")
            self.braked_instead = True
            return 0.0
        if abs(drive.speed_mps) < self._settings.min_speed_mps:
            return 0.0
        if self._latched:
            self.braked_instead = True
            return 0.0
        most_mps = min(self.max_speed_mps, self._settings.blind_speed_mps if self._loop.blind else math.inf)
        return min(max(drive.speed_mps, -most_mps), most_mps)

    async def _serve(self) -> Never:
        self._port = port = await self.open_port()
        try:
            self._broken = None
            self.health.link = LinkState.STARTING
            self.health.message = f"{port.identity}: neutral for {self._settings.arming_s:g} s, until its ESC is armed"
            await self._arm(port)
            self._begin(port)
            while True:
                await port.check()
                if self._broken is not None:
                    raise self._broken
                self._report(self._clock())
        finally:
            self._hang_up(port)

    async def _arm(self, port: PulsePort) -> None:
        """Brake a car that was driven when the board was lost, then hold neutral, without which no ESC obeys."""
        if self._throttle.last_us() != self._settings.neutral_us:
            await self._hold(port, self._throttle.last_us(), BRAKES_FIRST_S)
        self._throttle.begin(self._clock())
        await self._hold(port, self._settings.neutral_us, self._settings.arming_s)

    async def _hold(self, port: PulsePort, throttle_us: float, duration_s: float) -> None:
        begun_s = self._clock()
        while self._clock() - begun_s < duration_s:
            port.write(steering_us(self._settings, self._steering_rad), throttle_us)
            await port.check()

    def _begin(self, port: PulsePort) -> None:
        if self.health.identity:
            self.health.count("reconnect")
        self.health.identity = port.identity
        self._loop.forget(self._clock())
        self._ready, self._failures = True, 0
        self._report(self._clock())

    def _hang_up(self, port: PulsePort) -> None:
        """Close the connection with a stop as the last pulses."""
        if self._ready:
            self.health.count("lost")
        self._ready, self.state = False, None
        self.health.link, self.health.message = LinkState.ABSENT, f"{port.identity}: closed"
        self.health.trouble = ""
        with contextlib.suppress(LinkLost):
            port.write(steering_us(self._settings, self._steering_rad), self._throttle.last_us())
        self._port = None
        port.close()

    def _report(self, now_s: float) -> None:
        if self._port is None or not self._ready:
            return
        self._loop.advance(now_s)
        speed_mps = self._loop.speed_mps
        if self.state is not None:
            self._distance_m += speed_mps * max(now_s - self.state.stamp_s, 0.0)
        self.state = MotorState(
            now_s, speed_mps, self._distance_m, self._steering_rad, fault=self._latched,
            timed_out=self._port.timed_out,
        )  # fmt: skip
        self._tell()

    def _tell(self) -> None:
        health = self.health
        if not self._ready:
            return
        health.link, health.trouble = (LinkState.FAULTY if self._latched else LinkState.READY), self._latched
        health.message = f"{health.identity}: {self._latched}" if self._latched else f"{health.identity}; {ESTIMATE}"
