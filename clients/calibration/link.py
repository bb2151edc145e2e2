"""A car over the network as a calibration drives it: as an operator, while the deadman of a person is held."""

import math
import time
from typing import Protocol

from clients.calibration.ways import CalibrationError
from clients.connection import ConnectionProblemError
from clients.remote.car import RemoteCar
from clients.remote.driver import DriveRefusedError, RemoteDriver
from clients.remote.values import DriveSample, MotorSample, ScanSample
from runtime.calibration.trace import TraceBuilder
from runtime.wire import topics

MAX_SPEED_MPS, MAX_STEERING_RAD = 1.5, 0.4
READ = (topics.SCAN, topics.MOTOR, topics.OUTPUT)
DEFAULT_SCAN_TIME_S = 0.025
MAX_LATE_S = 0.4
SETTLES_S = 0.5


class LetGoError(CalibrationError):
    """The deadman was released; the car stops."""


class StalledError(CalibrationError):
    """Scans or this program came too late, and the car stopped."""


class HeldDeadman(Protocol):
    """The deadman of a person."""

    def is_held(self) -> bool:
        """Return whether it is held now; LetGoError for a request to stop for good."""
        ...


class RemoteLink:
    """Implements CalibratedCar. hand: of `car.drive()`, open."""

    def __init__(self, car: RemoteCar, hand: RemoteDriver, deadman: HeldDeadman) -> None:
        self.seen = TraceBuilder()
        self._hand, self._deadman = hand, deadman
        self._now_s = -math.inf
        self._samples = car.topics(*READ)
        self._asked: tuple[float, float] | None = None

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
            self._hand.send(speed_mps, steering_rad)
        except DriveRefusedError as error:
            raise StalledError(str(error)) from None

    def release(self) -> None:
        """Let go."""
        self._asked = None
        self._hand.release()

    def wait(self) -> None:
        """Take all samples up to the next scan; one that is late is bridged, for MAX_LATE_S."""
        begin_s = time.monotonic()
        try:
            for _name, sample in self._samples:
                if self._take(sample):
                    return
                if time.monotonic() - begin_s > MAX_LATE_S:
                    self.release()
                    raise StalledError(f"no scan for {MAX_LATE_S} s: what does `wallride status` say of the lidar?")
                if self._asked is not None:
                    self.send(*self._asked)
        except ConnectionProblemError as error:
            raise CalibrationError(str(error)) from None
        raise CalibrationError("the connection to the car has ended")

    def forget(self) -> None:
        """Drop what waits since the last step."""
        self.seen = TraceBuilder(self.seen.kind, self.seen.sweep_s)
        until_s = time.monotonic() + SETTLES_S
        while time.monotonic() < until_s or not self.seen.motor:
            self.wait()

    def _take(self, sample: object) -> bool:
        """Store a sample; whether it was a scan."""
        match sample:
            case ScanSample():
                seen = self.seen
                seen.kind = sample.angle_min_rad, sample.angle_step_rad, sample.ranges_m.size
                turn_s = sample.scan_time_s if sample.scan_time_s > 0 else DEFAULT_SCAN_TIME_S
                seen.sweep_s = turn_s * abs(sample.angle_step_rad) * (sample.ranges_m.size - 1) / math.tau
                seen.scans.append((sample.stamp_s, sample.ranges_m))
                self._now_s = sample.stamp_s
                return True
            case MotorSample():
                state = sample.stamp_s, sample.distance_m, sample.speed_mps, sample.steering_rad
                self.seen.motor.append(state)
            case DriveSample():
                self.seen.commands.append((sample.stamp_s, sample.speed_mps, sample.steering_rad))
        return False
