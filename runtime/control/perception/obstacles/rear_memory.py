"""Memory of the area behind the car: the lidar is blind there, but has seen most of it on the way."""

import cmath
import math
from collections import deque
from typing import Any

import numpy as np

from wallride.drivers.accelerated import accelerated
from wallride.drivers.value import value
from wallride.runtime.control.perception.geometry import NOWHERE, Booleans, Places, places_m
from wallride.runtime.control.perception.motion.scan_matching import ScanPose
from wallride.runtime.control.perception.odometry import OdometryState
from wallride.runtime.control.perception.view import View

NEAR_M = 1.6
ROUNDING_RAD = 1e-9
"""A place that the last beam of a standing car saw is at the edge of the view, within rounding: not behind it."""
KEPT_EVERY_M = 0.1
KEPT_EVERY_RAD = 0.15
KEPT_VIEWS = 16
KEPT_FOR_A_WAY_OUT = 32
TRACK_FOR_S = 30.0
"""Maximum age of the car's own track: places it left longer ago may be occupied by now."""
TRACK_M = 1.5
"""Maximum distance of backing on the car's own track before it drives forward again: no sensor covers that area."""
TRACK_FROM_M, TRACK_TO_M, TRACK_ASIDE_M, TRACK_COS = 0.08, 0.35, 0.08, 0.95
"""Limits for backing on the car's own track: distance behind, lateral offset and heading of an earlier pose."""


@value(eq=False)
class RememberedView:
    """A view and the pose of base_link in the odometry frame at which it was taken."""

    view: View
    place_m: complex
    yaw_rad: float


class RearMemory:
    """Stores near points in the odometry frame over the last one and a half metres, and how far the car backed.

    kept: whole views of the last metres, for the search of a way out; nothing is computed from them before.
    """

    def __init__(self, lidar_m: complex) -> None:
        self._lidar_m = lidar_m
        self._views: deque[Places] = deque(maxlen=KEPT_VIEWS)
        self._seen = NOWHERE
        self.kept: deque[RememberedView] = deque(maxlen=KEPT_FOR_A_WAY_OUT)
        self._doubtful = NOWHERE
        self._last: OdometryState | None = None
        self._at = OdometryState()
        self._now_s = -math.inf
        self.backed_m = self._retraced_m = 0.0

    def move(self, pose: OdometryState, step_m: float) -> None:
        """Move to another pose, step_m (signed) after the last; backing on the own track does not count as blind."""
        self._at = pose
        if step_m >= 0.0 and not (self.backed_m or self._retraced_m):
            return  # as a rule
        if step_m < 0.0 and self.kept:
            place_m, heading = np.array([complex(pose.x_m, pose.y_m)]), np.array([cmath.rect(1.0, pose.yaw_rad)])
            if self._retraced_m < TRACK_M and on_track(place_m, heading, *self.track())[0]:
                self._retraced_m -= step_m
                return
        self._retraced_m = max(0.0, self._retraced_m - max(step_m, 0.0))
        self.backed_m = max(0.0, self.backed_m - step_m)

    def track(self) -> tuple[Places, Places]:
        """Return the recent places of the car, odom, and its headings there, (k,) each."""
        recent = [one for one in self.kept if one.view.scan.stamp_s >= self._now_s - TRACK_FOR_S]
        return np.array([one.place_m for one in recent]), np.array([cmath.rect(1.0, one.yaw_rad) for one in recent])

    def lay_anew(self, kept: list[RememberedView]) -> None:
        """Replace the poses of the kept views, the newest last, and recompute the near points from them."""
        self.kept = deque(kept, maxlen=KEPT_FOR_A_WAY_OUT)
        self._views.clear()
        for one in kept[-KEPT_VIEWS:]:
            self._views.append(find_near_places(one.view, one.place_m, one.yaw_rad))
        self._seen = np.concatenate(self._views) if self._views else NOWHERE

    def keep(self, view: View, doubtful: Places = NOWHERE) -> None:
        """Update from the scan of this pose; keeps a view every 10 cm or 9 degrees.

        doubtful: places (k,), odom, in the lidar's field of view, but which may be the car itself.
        """
        self._now_s = view.scan.stamp_s
        self._doubtful = doubtful
        pose, last = self._at, self._last
        if last is not None:
            moved_m = math.hypot(pose.x_m - last.x_m, pose.y_m - last.y_m)
            if moved_m < KEPT_EVERY_M and abs(math.remainder(pose.yaw_rad - last.yaw_rad, math.tau)) < KEPT_EVERY_RAD:
                return
        self._last = pose
        self.kept.append(self.seen_now(view))
        self._views.append(find_near_places(view, complex(pose.x_m, pose.y_m), pose.yaw_rad))
        self._seen = np.concatenate(self._views)

    def slide(self, moved: ScanPose) -> None:
        """Carry what is remembered by a way that the odometry has not counted; moved: as seen from its pose."""
        at_m, turn = complex(self._at.x_m, self._at.y_m), cmath.rect(1.0, -moved.yaw_rad)
        from_m = at_m + moved.at_m * cmath.rect(1.0, self._at.yaw_rad)
        self.kept = deque(
            (RememberedView(one.view, at_m + (one.place_m - from_m) * turn, one.yaw_rad - moved.yaw_rad)
             for one in self.kept), maxlen=KEPT_FOR_A_WAY_OUT,
        )  # fmt: skip
        self._views = deque((at_m + (places_m - from_m) * turn for places_m in self._views), maxlen=KEPT_VIEWS)
        self._seen = at_m + (self._seen - from_m) * turn
        if self._last is not None:
            there_m = at_m + (complex(self._last.x_m, self._last.y_m) - from_m) * turn
            yaw_rad = math.remainder(self._last.yaw_rad - moved.yaw_rad, math.tau)
            self._last = OdometryState(there_m.real, there_m.imag, yaw_rad)

    def seen_now(self, view: View) -> RememberedView:
        """Return the view with the present pose."""
        return RememberedView(view, complex(self._at.x_m, self._at.y_m), self._at.yaw_rad)

    def points_m(self, half_view_rad: float) -> Places:
        """Return the remembered places outside the lidar's field of view (beyond +-half_view_rad), base_link, (k,).

        Inside the field of view the present scan counts: a person that has left leaves no ghost there. Of that area
        only the doubtful places are added.
        """
        at = self._at.x_m, self._at.y_m, self._at.yaw_rad, self._lidar_m
        found = places_behind(self._seen, *at, half_view_rad)
        return np.concatenate([found, places_behind(self._doubtful, *at, -1.0)]) if self._doubtful.size else found


def on_track(place_m: Places, heading: Places, track_m: Places, track_heading: Places) -> Booleans:
    """Return the places (n,) and headings with an earlier pose of the car a little farther back: no fixed object there.

    track_m, track_heading: of the earlier poses, (k,) each, in the same frame.
    """
    behind_m = (track_m - place_m[:, None]) * heading.conj()[:, None]
    same: Booleans = (behind_m.real <= -TRACK_FROM_M) & (behind_m.real >= -TRACK_TO_M)
    same &= np.abs(behind_m.imag) <= TRACK_ASIDE_M
    same &= (track_heading * heading.conj()[:, None]).real >= TRACK_COS
    there: Booleans = np.asarray(same.any(axis=1))
    return there


def _flat_near(view: View, place_m: complex, yaw_rad: float) -> tuple[Any, ...]:
    return view.x_m, view.y_m, view.solid, view.ranges_m, place_m.real, place_m.imag, yaw_rad


@accelerated(flat=_flat_near)
def find_near_places(view: View, place_m: complex, yaw_rad: float) -> Places:
    """Return in odom, (k,), the solid ones nearer than NEAR_M of the points of a view from a pose of base_link."""
    near = (view.solid & (view.ranges_m < NEAR_M)).nonzero()[0]
    return places_m(view.x_m, view.y_m, near) * cmath.rect(1.0, yaw_rad) + place_m


def _flat_behind(
    places_m: Places, at_x_m: float, at_y_m: float, yaw_rad: float, lidar_m: complex, half_view_rad: float
) -> tuple[Any, ...]:
    return places_m, at_x_m, at_y_m, yaw_rad, lidar_m.real, lidar_m.imag, half_view_rad


@accelerated(flat=_flat_behind)
def places_behind(
    places_m: Places, at_x_m: float, at_y_m: float, yaw_rad: float, lidar_m: complex, half_view_rad: float
) -> Places:
    """Return in base_link of a pose, (k,), the places (n,), odom, nearer than NEAR_M and beyond +-half_view_rad.

    half_view_rad: of the lidar, which is at lidar_m in base_link; negative for all directions.
    """
    here_m = (places_m - complex(at_x_m, at_y_m)) * cmath.rect(1.0, -yaw_rad)
    behind = np.abs(np.angle(here_m - lidar_m)) > half_view_rad + ROUNDING_RAD
    found: Places = here_m[behind & (np.abs(here_m) < NEAR_M)]
    return found
