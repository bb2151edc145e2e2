"""The pose on a map along a recorded drive, as the car itself finds it."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.localization.localizer import Localizer, PoseEstimate, Whereabouts
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.map_files import CarMap
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.world.pose import Booleans, Floats

RANGE_M = (0.02, 60.0)
WHOLE_SEARCH = 1_000_000
"""Parts of a search at one scan: offline, the whole search may run at once."""


@dataclass(frozen=True, slots=True, eq=False)
class PoseTrack:
    """Estimates of a drive, one for each scan. time_s: (n,), since its first scan; poses: (n, 3), NaN until located.

    scale: true way over reported way, as the map has shown it.
    """

    time_s: Floats
    poses: Floats
    estimates: tuple[PoseEstimate, ...]
    scale: float

    @property
    def located(self) -> Booleans:
        """Return at which scans the car was located, (n,)."""
        return np.array([one.whereabouts is Whereabouts.LOCATED for one in self.estimates])

    @property
    def way_m(self) -> float:
        """Return the length of the way, as far as it is known."""
        return float(np.nansum(np.abs(np.diff(self.poses[:, 0] + 1j * self.poses[:, 1]))))

    @property
    def losses_s(self) -> list[float]:
        """Return when the pose was lost."""
        was, now = self.estimates[:-1], self.estimates[1:]
        lost = [
            one.whereabouts is not Whereabouts.LOST and two.whereabouts is Whereabouts.LOST
            for one, two in zip(was, now, strict=True)
        ]
        times_s: list[float] = self.time_s[1:][np.array(lost, dtype=np.bool_)].tolist()
        return times_s


def track(record: LapRecord, known: CarMap, start: tuple[float, float, float] | None) -> PoseTrack:
    """Return the poses of a drive on a map. start: a pose near which it begins, None for anywhere."""
    car = CarSettings(wheelbase_m=record.wheelbase_m, lidar_x_m=record.lidar_m.real, lidar_y_m=record.lidar_m.imag)
    localizer = Localizer(known.field, car, start, known.scale, WHOLE_SEARCH)
    found = tuple(localizer.localize(scan, motor) for scan, motor in moments(record))
    return track_of(found, record)


def track_of(found: Sequence[PoseEstimate], record: LapRecord) -> PoseTrack:
    """Return estimates at scans of a drive as its track."""
    times_s = np.array([one.stamp_s for one in found]) - record.scan_s[0]
    poses = np.array([(one.x_m, one.y_m, one.yaw_rad) for one in found]).reshape(-1, 3)
    scales = [one.scale for one in found if one.whereabouts is Whereabouts.LOCATED]
    return PoseTrack(times_s, poses, tuple(found), scales[-1] if scales else 1.0)


def moments(record: LapRecord) -> Iterator[tuple[Scan, MotorState | None]]:
    """Yield each scan of a drive with the newest report of the wheels at its time."""
    newest = np.searchsorted(record.reports[:, 0], record.scan_s, side="right") - 1
    for number, (stamp_s, ranges_m) in enumerate(zip(record.scan_s.tolist(), record.ranges_m, strict=True)):
        scan = Scan(stamp_s, stamp_s, record.kind[0], record.kind[1], *RANGE_M, ranges_m, number, record.ray_s)
        if newest[number] < 0:
            yield scan, None
            continue
        report_s, way_m, speed_mps, steering_rad = record.reports[newest[number]].tolist()
        yield scan, MotorState(report_s, speed_mps, way_m, steering_rad)
