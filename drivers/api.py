"""What every lidar and every motor controller is to the rest of the car: values, contracts, errors.

Units are SI and signs follow REP-103 throughout: x forward, y left, angles counter-clockwise, steering positive
to the left. Conversions to device units live in the codecs and nowhere else.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Never, Protocol

import numpy as np
import numpy.typing as npt

from drivers.value import value

Clock = Callable[[], float]
"""Monotonic seconds. Injected everywhere, so that tests and simulation run on a clock of their own."""
Reschedule = Callable[[float, float], float]
"""Takes the time at which a task wants to wake and how much sooner or later may be; returns a better moment near it,
at which others wake as well or at least nothing that hurries more is due."""


def as_wanted(wanted_s: float, _slack_s: float) -> float:
    """Be a Reschedule that changes nothing."""
    return wanted_s


@value(eq=False)
class Scan:
    """One lidar revolution in the lidar frame (x forward, y left, angles counter-clockwise, REP-103).

    stamp_s: monotonic time at which the sweep's last byte arrived, or would have arrived had the link not been
        late: a scan that waited in a buffer is as old as its measurement, not as fresh as its delivery.
    received_s: monotonic time at which the last byte was really read.
    ranges_m: shape (n,), float32, read-only; NaN where the beam gave no usable distance (no echo, error code, too
        near, too far). NaN is "no information": it is neither an obstacle nor free space.
    sequence: counts the scans of this driver from 0, gaps included.
    """

    stamp_s: float
    received_s: float
    angle_min_rad: float
    angle_step_rad: float
    range_min_m: float
    range_max_m: float
    ranges_m: npt.NDArray[np.float32]
    sequence: int


@value()
class Drive:
    """What the car should do: speed positive forward, steering positive to the left.

    A speed of exactly 0.0 means "stop and stay": the driver brakes, it does not coast.
    brake_mps2: how hard a stop may brake, infinity being all there is; less leaves grip for turning.
    """

    speed_mps: float
    steering_rad: float
    brake_mps2: float = math.inf


@value()
class MotorState:
    """What the motor controller last said about itself.

    speed_mps: from the motor's electrical speed, positive forward. Locked wheels read 0 on a sliding car.
    distance_m: signed distance from the tachometer since the driver started; survives missed polls and reboots.
    steering_rad: the last steering commanded; hobby servos have no read-back.
    fault: latched text of the last fault since `clear_fault()`, "" when there was none.
    """

    stamp_s: float
    speed_mps: float
    distance_m: float
    steering_rad: float
    voltage_v: float
    motor_current_a: float
    input_current_a: float
    temperature_c: float
    fault: str
    timed_out: bool
    killed: bool


class LinkState(StrEnum):
    """Where a device stands, in the order in which it normally comes up."""

    ABSENT = "absent"
    """Nothing there, or it does not answer; the driver keeps trying."""
    STARTING = "starting"
    """Talking to it: identification, settings."""
    READY = "ready"
    """Delivers data and takes commands."""
    FAULTY = "faulty"
    """It answers, and says that it is not well."""


@dataclass(slots=True)
class Health:
    """A device's condition in words and counts, for status pages and logs. Owned by its driver.

    message: what is wrong and what to do about it, or what it is when all is well ("UST-10LX, 1081 beams, 40 Hz").
    trouble: what is wrong with a device that is there and answers, in a few words ("battery empty: 9.1 V"); "" else.
    identity: model and firmware as the device named itself, "" before it did.
    counts: how often each kind of trouble happened since the start ("checksum", "reconnect", "stale").
    """

    link: LinkState = LinkState.ABSENT
    message: str = "not opened yet"
    identity: str = ""
    trouble: str = ""
    counts: dict[str, int] = field(default_factory=dict)

    def count(self, what: str, times: int = 1) -> None:
        """Remember that something happened."""
        self.counts[what] = self.counts.get(what, 0) + times


class Lidar(Protocol):
    """A source of scans that looks after its own connection."""

    @property
    def health(self) -> Health:
        """Its condition now."""
        ...

    async def run(self, on_scan: Callable[[Scan], None]) -> Never:
        """Deliver scans for ever, oldest first, each once; reconnect with back-off for ever.

        `on_scan` is called in the event loop, straight from the read, and must not block. The device is left
        quiet (laser off where it can be) when the task is cancelled.
        """
        ...


class Motor(Protocol):
    """A motor and a steering servo that look after their own connection.

    The driver never repeats a command by itself: the mux must keep sending, so that the controller's own
    timeout remains a watchdog over the whole process.
    """

    @property
    def health(self) -> Health:
        """Its condition now."""
        ...

    @property
    def state(self) -> MotorState | None:
        """The newest report, or None while disconnected or before the first."""
        ...

    async def run(self) -> Never:
        """Keep the connection, poll the state, reconnect with back-off for ever; brake when cancelled."""
        ...

    def send(self, drive: Drive) -> bool:
        """Write one command to the wire at once; False (and nothing is queued) when the device is not there."""
        ...

    def latch_fault(self, words: str) -> None:
        """Hold the car for a contradiction that only others see, as for a fault of the device; once for each."""
        ...

    def clear_fault(self) -> None:
        """Forget the latched fault: a deliberate act of an operator, or of settings that say so."""
        ...


class DriverError(Exception):
    """Trouble with a device that is expected in the field; says what, where, and what to do next."""


class LinkLost(DriverError):  # noqa: N818 - it is an event in the life of a cable, and reads as one
    """The port vanished, was refused, or fell silent."""


class ProtocolError(DriverError):
    """The device answered something that the driver cannot accept."""
