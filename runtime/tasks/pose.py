"""The pose on a map at every scan, found when the scan's command has left. Nothing drives by it."""

from collections.abc import Callable, Mapping
from typing import Any, Literal

from wallride.drivers.api import MotorState, Scan
from wallride.runtime.control.localization.localizer import Localizer, PoseEstimate, Whereabouts
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.map_files import CarMap


class PoseFinder:
    """Finds the pose on one map. publish: called with each estimate."""

    def __init__(self, known: CarMap, start: Literal["lap", "anywhere"], car: CarSettings) -> None:
        self._map = known.name
        self._localizer = Localizer(known.field, car, known.start if start == "lap" else None, known.scale)
        self._newest: PoseEstimate | None = None
        self.publish: Callable[[PoseEstimate], None] = lambda _estimate: None

    def learn(self, scan: Scan, motor: MotorState | None) -> None:
        """Find the pose at a scan. motor: the very report with which it was answered, which is recorded."""
        self._newest = self._localizer.take(scan, motor)
        self.publish(self._newest)

    def status(self) -> Mapping[str, Any]:
        """Return the newest pose as plain values; numbers that are not known are NaN."""
        told: dict[str, Any] = {"map": self._map, "whereabouts": str(Whereabouts.SEARCHING)}
        if (newest := self._newest) is not None:
            told |= {
                "whereabouts": str(newest.whereabouts), "stamp_s": newest.stamp_s, "x_m": newest.x_m, "y_m": newest.y_m,
                "yaw_rad": newest.yaw_rad, "std_m": newest.std_m, "fits": newest.share,
                "alike": [list(place) for place in newest.alike],
            }  # fmt: skip
        return told
