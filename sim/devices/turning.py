"""Emulated lidar of a full circle (RPLIDAR, YDLIDAR): real bytes over a pseudo-terminal or TCP, with faults to inject.

The protocols are in `rplidar` and `ydlidar`, the port in `sensor_port`; this is the head that turns.
"""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar, Final, Protocol

import numpy as np
import numpy.typing as npt

from wallride.drivers.api import Clock
from wallride.sim.devices.sensor_port import SensorPort

Millimetres = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True, eq=False)
class Rays:
    """Rays of a lidar, shape (n,): directions from its zero, counter-clockwise; beginnings, x + iy, at its middle."""

    bearing_rad: Floats
    start_m: npt.NDArray[np.complex128]


See = Callable[[Rays], Millimetres]
"""Measures: rays of the sensor to their lengths; 0 or SCIP's 65533 for no return."""
_NOWHERE: Final = 65000
"""Distances from here on are SCIP's "no return"."""


class TurningDevice(Protocol):
    """The protocol of an emulated lidar: see `rplidar` and `ydlidar`."""

    streaming: bool
    motor_on: bool
    laser_m: float
    """How far the laser begins to the right of the head's middle."""
    laser_rad: float
    """How far it looks to the left of the head's direction."""

    @property
    def sample_s(self) -> float:
        """Return the time between two samples."""

    @property
    def turns_hz(self) -> float:
        """Return the speed of the head."""

    def power_on(self) -> None:
        """Begin as after power-on."""

    def feed(self, chunk: bytes) -> list[bytes]:
        """Process bytes of commands and return the replies."""

    def frames(self, head_deg: Floats, mm: Millimetres) -> list[bytes]:
        """Add samples and return the frames that they fill."""


class TurningHead:
    """The head of a device: what it measures while it turns.

    Faults to set at any time (None or False: off):
        frozen: every turn repeats the distances of the last one before.
        blocked: the head stands, and measures on.
        covered_mm: everything is so near.
        starts_after_s: a stream's first samples come so long after its announcement (the head spins up).
        device: its own faults; see `RplidarDevice`, `YdlidarDevice`.
    """

    def __init__(self, device: TurningDevice) -> None:
        self.device = device
        self.frozen = self.blocked = False
        self.covered_mm: int | None = None
        self.starts_after_s = 0.0
        self._still_s = -math.inf
        self._head_turns = 0.0
        self._at_s: float | None = None
        self._before: Millimetres = np.zeros(max(1, round(1 / device.turns_hz / device.sample_s)), np.int64)

    @property
    def turns_past_back(self) -> int:
        """Return how often the head has passed the direction opposite to its zero."""
        return int(self._head_turns + 0.5)

    def turn_to(self, now_s: float, see: See) -> list[bytes]:
        """Turn the head to a time, and return the frames that were filled meanwhile."""
        begin_s, self._at_s = self._at_s, now_s
        device = self.device
        if begin_s is None or not device.streaming or not device.motor_on:
            self._still_s = now_s
            return []
        if now_s - self._still_s < self.starts_after_s:
            return []
        count = int((now_s - begin_s) / device.sample_s)
        self._at_s = begin_s + count * device.sample_s  # the rest of a sample is left for the next time
        if not count:
            return []
        per_sample = 0.0 if self.blocked else device.turns_hz * device.sample_s
        turns = np.asarray(self._head_turns + per_sample * np.arange(count), np.float64)
        self._head_turns += per_sample * count
        head_deg = np.asarray(turns % 1.0 * 360.0, np.float64)
        return device.frames(head_deg, self._measured(turns, head_deg, see))

    def _lit(self, head_deg: Floats, see: See) -> Millimetres:
        """Return how far from the middle of the head its laser meets something."""
        head = np.exp(-1j * np.radians(head_deg))
        start_m = -1j * self.device.laser_m * head
        mm = see(Rays(np.radians(-head_deg) + self.device.laser_rad, start_m))
        if not self.device.laser_m:
            return mm
        places = start_m * 1000.0 + mm * head * np.exp(1j * self.device.laser_rad)
        return np.where((mm > 0) & (mm < _NOWHERE), np.rint(np.abs(places)).astype(np.int64), 0)

    def _measured(self, turns: Floats, head_deg: Floats, see: See) -> Millimetres:
        place = (turns % 1.0 * self._before.size).astype(np.intp)
        if self.frozen:
            return self._before[place]
        mm = self._lit(head_deg, see)
        if self.covered_mm is not None:
            mm = np.full_like(mm, self.covered_mm)
        mm = np.where(mm >= _NOWHERE, 0, mm)
        self._before[place] = mm
        return mm


class TurningEmulator(TurningHead, SensorPort):
    """Emulates one sensor with one client. Its owner calls `advance` often, and `close` at the end.

    Faults to set at any time: those of its head and of its port, see `TurningHead` and `SensorPort`.
    """

    held_frames: ClassVar = 4000
    garbage_bytes: ClassVar = 60

    def __init__(self, device: TurningDevice, *, clock: Clock = time.monotonic, seed: int = 1) -> None:
        TurningHead.__init__(self, device)
        SensorPort.__init__(self, clock, seed)

    @property
    def streaming(self) -> bool:
        """Return whether a client requested samples and is still connected."""
        return self._port is not None and self.device.streaming

    def advance(self, now_s: float, see: See) -> float | None:
        """Turn the head to a time, and send what it measured meanwhile.

        Return the monotonic time right after the last frame was handed to the kernel; None where none was.
        """
        sent_s = None
        for frame in self.turn_to(now_s, see):
            sent_s = self._emit(self._spoil(frame)) or sent_s
        return sent_s

    def _answers(self, chunk: bytes) -> list[bytes]:
        return self.device.feed(chunk)

    def _power_on(self) -> None:
        self.device.power_on()
