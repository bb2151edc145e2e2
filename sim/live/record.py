"""What one simulated drive leaves behind: newest values, sums, and a thinned track, however long it lasts."""

import cmath
import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import numpy.typing as npt

from wallride.runtime.host.address_file import Address
from wallride.runtime.parameters.history import SettingChange
from wallride.sim.devices.vesc import MotorDemand
from wallride.sim.figures.summary import DriveSums, Sample
from wallride.sim.live.latency import HeldUp, LatencyProbe
from wallride.sim.world.pose import Pose

DISTANCE = "wall_follow.desired_distance_m"
MAX_TRACK = 20_000
"""Samples of a track; eight minutes have as many scans."""


class ThinnedTrack:
    """A way of any length in a bounded number of samples: when they are too many, every other one goes."""

    def __init__(self) -> None:
        self.samples: list[Sample] = []
        self._every = 1
        self._count = 0

    def add(self, sample: Sample) -> None:
        """Take a sample, or leave it out."""
        if self._count % self._every == 0:
            self.samples.append(sample)
            if len(self.samples) > MAX_TRACK:
                del self.samples[1::2]
                self._every *= 2
        self._count += 1


@dataclass(slots=True)
class Record:
    """Record of one drive, while it goes on and afterwards.

    desired_m: the distance that is wanted at the start. fresh: the truth, one sample per scan, not summed up yet.
    track: of the whole drive, thinned. scans: those that the lidar has sent.
    steering_rad: our answer to each scan, read from the wire before the next one; None where it is not needed.
    telemetry: the runtime's newest message of each topic. unheard: why there are none, "" if there are some.
    poses: on its map, as its status told them: stamp, x, y. reasons_s: for how long it decided for which reason.
    hard_stops: brakes of a moving car.
    address: address of the runtime. listen: endpoints that it was to have. starting_s: how long the start has taken.
    began_unix_s: when time_s was 0, since 1970. began_s: the same moment on the monotonic clock.
    changes: the settings that were changed while it drove.
    stop_command: the last motor command it ever wrote.
    held_up: how long this computer kept the emulated devices from running.
    own_faults: how often each fault of the user's laws and drivers began. recorded: files of its recordings, in order.
    cpu_s: processor time of the runtime up to the end of the drive; NaN where the system does not tell.
    log, page: what the runtime, and the monitor beside it, printed. failed: why the runtime's end was none in order.
    """

    desired_m: float = math.nan
    fresh: list[Sample] = field(default_factory=list)
    sums: DriveSums = field(default_factory=DriveSums)
    track: ThinnedTrack = field(default_factory=ThinnedTrack)
    scans: int = 0
    steering_rad: list[float] | None = None
    latency: LatencyProbe = field(default_factory=LatencyProbe)
    held_up: HeldUp = field(default_factory=HeldUp)
    ranges_mm: npt.NDArray[np.integer] | None = None
    time_s: float = 0.0
    began_unix_s: float = 0.0
    began_s: float = 0.0
    changes: Sequence[SettingChange] = ()
    telemetry: dict[str, Any] = field(default_factory=dict)
    own_faults: Mapping[str, int] = field(default_factory=dict)
    recorded: Sequence[str] = ()
    poses: Sequence[tuple[float, float, float]] = ()
    reasons_s: Mapping[str, float] = field(default_factory=dict)
    hard_stops: int = 0
    unheard: str = "the runtime did not say where its telemetry is"
    address: Address | None = None
    listen: Sequence[str] = ()
    starting_s: float = 0.0
    cpu_s: float = math.nan
    log: Sequence[str] = ()
    page: Sequence[str] = ()
    exit_code: int | None = None
    stop_command: MotorDemand | None = None
    failed: str = ""

    def note(self, sample: Sample) -> None:
        """Take the truth at a moment."""
        self.fresh.append(sample)
        self.track.add(sample)

    def sum_up(self, count: int) -> None:
        """Sum up the oldest fresh samples, by the changes that are known now."""
        wanted_m = self.wanted_m()
        for sample in self.fresh[:count]:
            self.sums.add(sample, wanted_m(sample.time_s))
        del self.fresh[:count]

    def end_early(self, failed: str) -> bool:
        """Sum up a drive whose runtime failed; False where none had begun."""
        self.failed = failed
        self.sum_up(len(self.fresh))
        return self.time_s > 0

    def as_driven(self) -> tuple[npt.NDArray[np.float64], npt.NDArray[np.float64]]:
        """Return true time, x, y and speed of the track, (n, 4), and time, x and y of the poses on the map, (m, 3)."""
        track = [(one.time_s, one.x_m, one.y_m, one.speed_mps) for one in self.track.samples]
        poses = [(stamp_s - self.began_s, x_m, y_m) for stamp_s, x_m, y_m in self.poses]
        return np.array(track).reshape(-1, 4), np.array(poses).reshape(-1, 3)

    def trajectory(self, origin: Pose) -> Iterator[tuple[float, float, float, float]]:
        """Yield the time since 1970 and the true pose, x, y and yaw, of each sample, seen from an origin."""
        turn = cmath.exp(-1j * origin.yaw_rad)
        for one in self.track.samples:
            place_m = turn * complex(one.x_m - origin.x_m, one.y_m - origin.y_m)
            yield self.began_unix_s + one.time_s, place_m.real, place_m.imag, one.yaw_rad - origin.yaw_rad

    def values_of(self, name: str, first: str) -> list[str]:
        """Return the values that a setting had while it drove, in order. first: that of the start."""
        values = [first, *(str(change.new) for change in self.changes if change.name == name)]
        return [value for before, value in zip([None, *values], values, strict=False) if value != before]

    def wanted_m(self) -> Callable[[float], float]:
        """Return the function that tells the distance that was wanted at a time of the drive."""
        times_s, values_m = [], [self.desired_m]
        for change in self.changes:
            if change.name == DISTANCE and isinstance(change.new, int | float):
                times_s.append(change.stamp_s - self.began_s)
                values_m.append(float(change.new))
        return lambda time_s: values_m[bisect_right(times_s, time_s)]
