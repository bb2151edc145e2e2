"""The interfaces of every lidar and every motor controller to the rest of the car: values, contracts, errors.

Units are SI and signs follow REP-103 throughout: x forward, y left, angles counter-clockwise, steering positive to the
left. Conversions to device units are in the codecs and nowhere else.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Never, Protocol

import numpy as np
import numpy.typing as npt

from wallride.drivers.value import value

Clock = Callable[[], float]
"""Monotonic seconds. Injected everywhere, so that tests and simulation run on a clock of their own."""
Reschedule = Callable[[float, float], float]
"""Takes the time at which a task wants to wake and its tolerance; returns a better moment near it, at which other tasks
wake too or at least no more urgent work is due."""


def as_wanted(wanted_s: float, _slack_s: float) -> float:
    """Return the deadline unchanged."""
    return wanted_s


class Returns(Protocol):
    """What a sensor said of the beams of a scan that have no distance; asked off the hot path, for ROS."""

    def marked_m(self) -> npt.NDArray[np.float32]:
        """Return the ranges as REP 117 has them, shape (n,): +inf where nothing came back, -inf too near, NaN else."""


@value()
class Correction:
    """The motion that a driver took out of a scan, as it was known then: that of the lidar in its own frame.

    x_mps, y_mps: velocity. yaw_rate_radps: rate of turn. ray_s: time from one beam of the array to the next, negative
    where the array runs against the sensor's turn.
    """

    x_mps: float
    y_mps: float
    yaw_rate_radps: float
    ray_s: float


@value(eq=False)
class Scan:
    """One lidar revolution in the lidar frame (x forward, y left, angles counter-clockwise, REP-103).

    stamp_s: monotonic time at which the sweep's last byte arrived, or would have arrived had the link not been late: a
        scan that waited in a buffer is as old as its measurement, not as fresh as its delivery.
    received_s: monotonic time at which the last byte was really read.
    ranges_m: shape (n,), float32, read-only; NaN where the beam gave no usable distance (no echo, error code, too near,
        too far). NaN is "no information": it is neither an obstacle nor free space.
    sequence: counts the scans of this driver from 0, gaps included.
    ray_s: time from one beam of the array to the next, negative where the array runs against the sensor's turn; 0.0:
        all beams are as seen at stamp_s.
    returns: what the sensor said of beams without a distance, None where it is not known. No law reads it.
    correction: what its driver changed to make it so, None for nothing. Only checks of the lidar and estimates of the
        speed read it.
    """

    stamp_s: float
    received_s: float
    angle_min_rad: float
    angle_step_rad: float
    range_min_m: float
    range_max_m: float
    ranges_m: npt.NDArray[np.float32]
    sequence: int
    ray_s: float = 0.0
    returns: Returns | None = None
    correction: Correction | None = None


@value()
class Drive:
    """A motion command: speed positive forward, steering positive to the left.

    A speed of exactly 0.0 means "stop and stay": the driver brakes, it does not coast.
    brake_mps2: maximum deceleration of a stop, infinity being full braking; less leaves grip for turning.
    """

    speed_mps: float
    steering_rad: float
    brake_mps2: float = math.inf


@value()
class MotorState:
    """The motor controller's last report.

    speed_mps: from the motor's electrical speed, positive forward. Locked wheels read 0 on a sliding car.
    distance_m: signed distance from the tachometer since the driver started; survives missed polls and reboots.
    steering_rad: the last steering commanded; hobby servos have no read-back.
    voltage_v, ..., temperature_c: NaN where the controller does not measure it.
    fault: latched text of the last fault since `clear_fault()`, "" when there was none.
    """

    stamp_s: float
    speed_mps: float
    distance_m: float
    steering_rad: float
    voltage_v: float = math.nan
    motor_current_a: float = math.nan
    input_current_a: float = math.nan
    temperature_c: float = math.nan
    fault: str = ""
    timed_out: bool = False
    killed: bool = False


class LinkState(StrEnum):
    """States of a device, in the order in which it normally comes up."""

    ABSENT = "absent"
    """The device is missing or does not answer; the driver keeps trying."""
    STARTING = "starting"
    """The device answers: identification, configuration."""
    READY = "ready"
    """Delivers data and takes commands."""
    FAULTY = "faulty"
    """It answers, and reports a fault."""


NOT_OPENED = "not opened yet"


@dataclass(slots=True)
class Health:
    """A device's condition as text and counts, for status pages and logs. Owned by its driver.

    message: the problem and its remedy, or a summary when all is well ("UST-10LX, 1081 beams, 40 Hz").
    trouble: the problem of a device that answers, in a few words ("battery empty: 9.1 V"); "" else.
    identity: model and firmware as the device reported them, "" before that.
    counts: number of events of each kind since the start ("checksum", "reconnect", "stale").
    """

    link: LinkState = LinkState.ABSENT
    message: str = NOT_OPENED
    identity: str = ""
    trouble: str = ""
    counts: dict[str, int] = field(default_factory=dict)

    def count(self, what: str, times: int = 1) -> None:
        """Count an event."""
        self.counts[what] = self.counts.get(what, 0) + times


class Lidar(Protocol):
    """A source of scans that maintains its own connection."""

    @property
    def health(self) -> Health:
        """Its present condition."""

    async def run(self, on_scan: Callable[[Scan], None]) -> Never:
        """Deliver scans without end, oldest first, each once; reconnect with back-off.

        `on_scan` is called in the event loop, straight from the read, and must not block. The device is left quiet
        (laser off where it can be) when the task is cancelled.
        """


class Motor(Protocol):
    """A motor and a steering servo that maintain their own connection.

    The driver never repeats a command by itself: the mux must keep sending, so that the controller's own timeout
    remains a watchdog over the whole process.
    """

    @property
    def health(self) -> Health:
        """Its present condition."""

    @property
    def state(self) -> MotorState | None:
        """The newest report, or None while disconnected or before the first."""

    @property
    def braked_instead(self) -> bool:
        """Whether the last `send` wrote a brake in place of a speed that the motor can hold."""

    async def run(self) -> Never:
        """Maintain the connection, poll the state, reconnect with back-off; brake when cancelled."""

    def send(self, drive: Drive) -> bool:
        """Write one command to the wire at once; False (and nothing is queued) when the device is not connected."""

    def latch_fault(self, words: str) -> None:
        """Latch a contradiction detected outside the driver, like a fault of the device; once for each."""

    def retry_fault(self) -> None:
        """Clear a fault that the device reported itself, without an operator; a contradiction stays latched.

        A device recovers; swapped phases do not swap back, and every attempt drives the wrong way once more.
        """

    def clear_fault(self) -> None:
        """Clear the latched fault: a deliberate act of an operator, or of settings that allow it."""


class DriverError(Exception):
    """An expected error of a device in the field; the text names the problem, the place, and the remedy."""


class LinkLost(DriverError):  # noqa: N818 - it is an event in the life of a cable, and reads as one
    """The port vanished, was refused, or fell silent."""


class ProtocolError(DriverError):
    """The device sent a reply that the driver cannot accept."""


def printable(raw: bytes) -> str:
    """Return a device's text for logs and screens: escape sequences and line ends in it are shown as "?"."""
    return "".join(letter if letter.isprintable() else "?" for letter in raw.decode("ascii", errors="replace"))
