"""What the car says of its pose: each estimate, and where it is in the status."""

from collections.abc import Callable, Mapping
from typing import Any

from wallride.runtime.control.localization.localizer import PoseEstimate, Whereabouts


class PoseTeller:
    """Tells the pose on one map. publish: called with each estimate. race: tells laps and errors along the line."""

    def __init__(self, map_name: str, race: Callable[[], Mapping[str, Any]] = dict) -> None:
        self._map = map_name
        self._newest: PoseEstimate | None = None
        self._race = race
        self.publish: Callable[[PoseEstimate], None] = lambda _estimate: None

    def tell(self, estimate: PoseEstimate) -> None:
        """Take in the pose at a scan."""
        self._newest = estimate
        self.publish(estimate)

    def status(self) -> Mapping[str, Any]:
        """Return the newest pose as plain values; numbers that are not known are NaN."""
        told: dict[str, Any] = {"map": self._map, "whereabouts": str(Whereabouts.SEARCHING)}
        if (newest := self._newest) is not None:
            told |= {
                "whereabouts": str(newest.whereabouts), "stamp_s": newest.stamp_s, "x_m": newest.x_m, "y_m": newest.y_m,
                "yaw_rad": newest.yaw_rad, "std_m": newest.std_m, "fits": newest.share,
                "alike": [list(place) for place in newest.alike],
            }  # fmt: skip
        if race := self._race():
            told["race"] = dict(race)
        return told
