"""A car over the network as a calibration drives it: as an operator, while the deadman of a person is held."""

import math
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from statistics import median
from types import TracebackType
from typing import Protocol, Self

from wallride.clients.answers import reading
from wallride.clients.calibration.ways import CalibrationError
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.remote.car import RemoteCar
from wallride.clients.remote.driver import DriveRefusedError, RemoteDriver
from wallride.clients.remote.values import DriveSample, FieldsSample, MotorSample, ScanSample
from wallride.clients.status import lost_device
from wallride.runtime.calibration.trace import TraceBuilder
from wallride.runtime.wire import topics

MAX_SPEED_MPS, MAX_STEERING_RAD = 1.5, 0.4
READ = (topics.SCAN, topics.MOTOR, topics.OUTPUT, topics.STATUS)
MAX_LATE_S = 0.4
PERIODS = 99
"""Scan times whose median is the sensor's: a lost or late scan makes a single one too long."""
SETTLES_S = 0.5
MAX_STALLS = 12
TELL_EVERY_S = 10.0
GONE = "{}: see to its cable and power, then drive again"


class LetGoError(CalibrationError):
    """The deadman was released; the car stops."""


class HeldDeadman(Protocol):
    """The deadman of a person."""

    @property
    def key(self) -> str:
        """Return the name of the key."""

    @property
    def again(self) -> str:
        """Return what the operator does to go on after a stall."""

    def renew(self) -> None:
        """Wait until it was released, and is held again."""

    def is_held(self) -> bool:
        """Return whether it is held now; LetGoError for a request to stop for good."""


class RemoteLink:
    """Implements CalibratedCar, within a `with` block. tell: gets what the operator has to know.

    A stall, of scans or of this program, stops the car by the rules of teleop. The way goes on when the operator let
    go and holds again: what lies between two stops is measured, however long it became.
    """

    def __init__(self, car: RemoteCar, deadman: HeldDeadman, tell: Callable[[str], None]) -> None:
        self.seen = TraceBuilder()
        self._car, self._deadman, self._tell = car, deadman, tell
        self._hand: RemoteDriver | None = None
        self._now_s = -math.inf
        self._samples = iter(car.topics(*READ))
        self._asked: tuple[float, float] | None = None
        self._stalls = 0
        self._lost = ""
        self._periods_s: deque[float] = deque(maxlen=PERIODS)
        self._began_s = self._told_s = math.inf
        self._settled_s = -math.inf

    def __enter__(self) -> Self:
        self._take_hand()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        try:
            if self._hand is not None:
                self._hand.__exit__(kind, error, trace)
        except DriveRefusedError as refused:
            raise CalibrationError(refused.reason) from None

    @property
    def now_s(self) -> float:
        """Return the time of the newest scan."""
        return self._now_s

    def send(self, speed_mps: float, steering_rad: float) -> None:
        """Ask for a drive for 0.2 s, while the deadman is held."""
        if not self._deadman.is_held():
            self.release()
            raise LetGoError("let go: the car stops")
        self._asked = speed_mps, steering_rad
        try:
            if self._hand is not None:
                self._hand.send(speed_mps, steering_rad)
        except DriveRefusedError as error:
            self._begin_anew(error.reason)

    def release(self) -> None:
        """Let go."""
        self._asked = None
        if self._hand is not None:
            self._hand.release()

    def wait(self) -> None:
        """Take all samples up to the next scan; one that is late is bridged, for MAX_LATE_S."""
        begin_s = time.monotonic()
        try:
            for _name, sample in self._samples:
                has_come = self._take(sample)
                if self._lost and time.monotonic() > self._settled_s:  # before that it may be of a while ago
                    raise CalibrationError(GONE.format(self._lost))
                if has_come:
                    self._tell_time()
                    return
                if self._asked is None:
                    continue
                if time.monotonic() - begin_s > MAX_LATE_S:
                    self._begin_anew(f"no scan for {MAX_LATE_S} s")
                    begin_s = time.monotonic()
                else:
                    self.send(*self._asked)
        except ConnectionProblemError as error:
            raise CalibrationError(str(error)) from None
        raise CalibrationError("the connection to the car has ended")

    def _tell_time(self) -> None:
        """Tell every TELL_EVERY_S that it still drives."""
        if self._asked is not None and self._now_s - self._told_s >= TELL_EVERY_S:
            self._told_s = self._now_s
            self._tell(f"  it drives, for {self._now_s - self._began_s:.0f} s so far")

    def _begin_anew(self, why: str) -> None:
        """Let go, and take the car again once the operator holds again."""
        self._stalls += 1
        if self._stalls > MAX_STALLS:
            raise CalibrationError(f"{why}, for the {self._stalls}th time: is the computer, or the network, too slow?")
        hand, self._hand, self._asked = self._hand, None, None
        if hand is not None:
            with suppress(DriveRefusedError):  # that is why it begins anew
                hand.__exit__(None, None, None)
        self._tell(f"  {why}: the car stops. {self._deadman.again}")
        self._deadman.renew()
        self._settle()
        self._take_hand()
        self._tell("  it goes on")

    def _take_hand(self) -> None:
        """Begin to drive; a car that still counts us as lost frees us a moment later."""
        for last in (False, False, True):
            hand = self._car.drive(max_speed_mps=MAX_SPEED_MPS, max_steering_rad=MAX_STEERING_RAD)
            try:
                self._hand = hand.__enter__()
            except DriveRefusedError as error:
                if last:
                    raise CalibrationError(error.reason) from None
            else:
                return

    def _settle(self) -> None:
        """Take what waits: it is of a while ago, neither the car's present state nor time in which it drove."""
        self._settled_s = until_s = time.monotonic() + SETTLES_S
        while time.monotonic() < until_s or not self.seen.motor:
            self._deadman.is_held()  # a terminal that is not asked for long counts as gone
            self.wait()

    def forget(self) -> None:
        """Drop what waits since the last step."""
        self.seen = TraceBuilder(self.seen.kind, self.seen.sweep_s, self.seen.period_s)
        self._settle()
        self._began_s = self._told_s = self._now_s

    def _take(self, sample: object) -> bool:
        """Store a sample; whether it was a scan."""
        match sample:
            case ScanSample():
                seen = self.seen
                seen.kind = sample.angle_min_rad, sample.angle_step_rad, sample.ranges_m.size
                seen.sweep_s = abs(sample.ray_s) * (sample.ranges_m.size - 1)
                if sample.scan_time_s > 0:
                    self._periods_s.append(sample.scan_time_s)
                    seen.period_s = median(self._periods_s)
                seen.scans.append((sample.stamp_s, sample.ranges_m))
                self._now_s = sample.stamp_s
                return True
            case MotorSample():
                state = sample.stamp_s, sample.distance_m, sample.speed_mps, sample.steering_rad
                self.seen.motor.append(state)
            case DriveSample():
                self.seen.commands.append((sample.stamp_s, sample.speed_mps, sample.steering_rad))
            case FieldsSample():
                with reading(self._car.name, "status"):
                    self._lost = lost_device(sample.fields)
        return False
