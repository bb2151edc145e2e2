"""Contacts of one scan in the strip that the car would sweep, for any steering: points, margins, floors, memory."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from wallride.runtime.control.perception.geometry import ENOUGH_POINTS, NOWHERE, Places, any_nearer, solid_places
from wallride.runtime.control.perception.obstacles.rear_memory import RearMemory
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.perception.visibility.no_return_regions import find_dark_regions
from wallride.runtime.control.safety.body import LOOK_SPARE_M, Body
from wallride.runtime.control.safety.footprint import (
    NOTHING,
    AxlePath,
    Contact,
    Outline,
    contact_on_arc,
    first_contact,
)

OTHER_STEERINGS = (0.0, 0.5, -0.5, 1.0, -1.0)
FREE_WAY_M = 0.5
GAINS_MPS = 0.1
"""Minimum excess of the requested speed over the car's that counts as an acceleration."""


@dataclass(slots=True, eq=False)
class Strip:
    """Sweeps the outline through one scan. Sweeps are cached by steering, length and direction.

    speed_mps: signed. wheel_rad: current angle of the wheels. latency_s: until a new steering takes effect. more_m:
    points that the scan alone does not show, (k,): predicted places of pedestrians, and thin obstacles. behind: the
    memory of what the lidar no longer sees. past_rad: the wheels' angles at the last scans, with their stamps, this
    one's last. judged: the last judgement of a promise, kept by `promise_judgement`.
    """

    body: Body
    view: View
    speed_mps: float
    wheel_rad: float
    latency_s: float
    more_m: Places
    behind: RearMemory
    past_rad: tuple[tuple[float, float], ...]
    judged: object = None
    _kept: dict[tuple[float, float, float, bool, float], Contact] = field(default_factory=dict)
    _dark: dict[tuple[float, float], bool] = field(default_factory=dict)
    _near_m: tuple[Places, Places] | None = None
    _hidden_m: tuple[Places, Places] | None = None

    def copied(self) -> "Strip":
        """Return the same strip with caches of its own."""
        return replace(self, _kept=self._kept.copy(), _dark=self._dark.copy())

    def contact(
        self,
        steering_rad: float,
        length_m: float,
        direction: float = 1.0,
        *,
        wary: bool = False,
        faster_mps: float = 0.0,
    ) -> Contact:
        """Return the first contact of the outline on the path of this steering; NOTHING beyond length_m.

        wary: with more lateral margin. faster_mps: judge the path on which the car accelerates to this speed on a
        slippery floor: the grip used to accelerate is not available for turning.
        """
        key = (steering_rad, length_m, direction, wary, faster_mps)
        found = self._kept.get(key)
        if found is None:
            ahead = self.body.wary if wary else self.body.ahead
            outline = ahead if direction > 0 else self.body.aback
            found = self._kept[key] = self._sweep(steering_rad, length_m, direction, outline, faster_mps)
        return found

    def leads_into_the_dark(self, steering_rad: float, look_m: float) -> bool:
        """Return whether there is an enclosed region without echoes in that direction, within the look-ahead."""
        return self.is_dark(math.tan(steering_rad) / self.body.car.wheelbase_m * look_m / 2, look_m)

    def is_dark(self, toward_rad: float, look_m: float) -> bool:
        """Return whether there is an enclosed region without echoes at that bearing, within the look-ahead."""
        key = (toward_rad, look_m)
        dark = self._dark.get(key)
        if dark is None:
            dark = self._dark[key] = find_dark_regions(self.view, toward_rad, look_m + LOOK_SPARE_M)
        return dark

    def contact_along(self, path: AxlePath, length_m: float, margin_m: float) -> Contact:
        """Return the first contact on a path with so much more margin to each side; NOTHING beyond length_m.

        Points that are within the margins already are judged as on an arc.
        """
        outline = replace(self.body.ahead, half_width_m=self.body.bare.half_width_m + margin_m)
        points_m = self.points_ahead_m()
        inside = replace(outline, rear_m=self.body.aback.rear_m).holds(points_m)
        touching_m = points_m[inside]
        if touching_m.size:
            outline = replace(outline, half_width_m=self._room_aside_m(touching_m, outline))
        found = first_contact(path, outline, points_m[~inside])
        if touching_m.size:
            pressed = first_contact(path, self.body.bare, touching_m)
            found = min(found, pressed, key=lambda contact: contact.travel_m)
        return found if found.travel_m <= length_m else NOTHING

    def reaches_along(self, points_m: Places, path: AxlePath, length_m: float, margin_m: float) -> Contact:
        """Return the first contact of a path with other places (k,), base_link; NOTHING beyond length_m."""
        outline = replace(self.body.ahead, half_width_m=self.body.bare.half_width_m + margin_m)
        found = first_contact(path, outline, points_m)
        return found if found.travel_m <= length_m else NOTHING

    def free_somewhere(self, length_m: float = FREE_WAY_M) -> bool:
        """Return whether any steering leads the standing car length_m ahead without a contact."""
        most_rad = self.body.car.narrower_end_rad
        return any(self.contact(share * most_rad, length_m).travel_m >= length_m for share in OTHER_STEERINGS)

    def reaches(self, points_m: Places, steering_rad: float, length_m: float) -> Contact:
        """Return the first contact of the outline with other places (k,), base_link; NOTHING beyond length_m."""
        if not points_m.size:
            return NOTHING
        motion = self._motion(1.0, self.body.grip_mps2)
        found = contact_on_arc(motion, steering_rad, length_m, self.body.ahead, points_m)
        return found if found.travel_m <= length_m else NOTHING

    def passes(self, steering_rad: float, length_m: float, outline: Outline) -> bool:
        """Whether such an outline touches nothing on the way that this steering leads to."""
        motion = self._motion(1.0, self.body.grip_mps2)
        return contact_on_arc(motion, steering_rad, length_m, outline, self.points_ahead_m()) is NOTHING

    def needs_grip(self, steering_rad: float, speed_mps: float, grip_mps2: float) -> bool:
        """Return whether the bend needs more grip than this at this speed."""
        return speed_mps * speed_mps * abs(math.tan(steering_rad)) > self.body.car.wheelbase_m * grip_mps2

    def bend_mps(self, steering_rad: float) -> float:
        """Return the speed at which the bend takes all of the assumed floor's grip."""
        turn = abs(math.tan(steering_rad))
        return math.sqrt(self.body.car.wheelbase_m * self.body.grip_mps2 / turn) if turn else math.inf

    def _sweep(
        self, steering_rad: float, length_m: float, direction: float, outline: Outline, faster_mps: float
    ) -> Contact:
        body = self.body
        if faster_mps:
            gain_mps2 = min(body.car.max_acceleration_mps2, 0.9 * body.slippery_mps2)
            motion = self._motion(direction, body.slippery_mps2, gain_mps2, faster_mps)
            found = replace(self._along(motion, steering_rad, length_m, direction, outline), slippery=True)
        else:
            motion = self._motion(direction, body.grip_mps2)
            found = self._along(motion, steering_rad, length_m, direction, outline)
            if direction > 0 and self.needs_grip(steering_rad, self.speed_mps, body.slippery_mps2):
                motion = self._motion(direction, body.slippery_mps2)
                slides = self._along(motion, steering_rad, length_m, direction, outline)
                if slides.travel_m < found.travel_m:
                    found = replace(slides, slippery=True)
        return found if found.travel_m <= length_m else NOTHING

    def _along(
        self, motion: tuple[float, ...], steering_rad: float, length_m: float, direction: float, outline: Outline
    ) -> Contact:
        free_m, touching_m = self._points_m()
        if direction < 0:
            hidden_m, pressing_m = self._points_behind_m()
            free_m, touching_m = np.concatenate([free_m, hidden_m]), np.concatenate([touching_m, pressing_m])
        if not touching_m.size:
            return contact_on_arc(motion, steering_rad, length_m, outline, free_m)
        wide_m = self._room_aside_m(touching_m, outline)
        found = contact_on_arc(motion, steering_rad, length_m, replace(outline, half_width_m=wide_m), free_m)
        # Points already within the margins would stop the car for ever: they are judged by the bare outline. A rear
        # corner that swings to a wall keeps half of the room that is left: it is known from memory alone, some
        # millimetres to centimetres wrong.
        narrows = direction < 0 and wide_m < outline.half_width_m
        bare = replace(self.body.bare, half_width_m=wide_m) if narrows else self.body.bare
        pressed = contact_on_arc(motion, steering_rad, length_m, bare, touching_m)
        return min(found, pressed, key=lambda contact: contact.travel_m)

    def _room_aside_m(self, touching_m: Places, outline: Outline) -> float:
        """Return the half width of the strip beside an object within the margin: a wall there continues ahead.

        The strip keeps half of the available clearance; without this a car two centimetres from a wall never moves
        along it.
        """
        aside_m = np.abs(touching_m.imag)
        aside_m = aside_m[aside_m > self.body.bare.half_width_m]
        if aside_m.size < ENOUGH_POINTS:
            return outline.half_width_m
        third_m = float(np.partition(aside_m, ENOUGH_POINTS - 1)[ENOUGH_POINTS - 1])
        return (self.body.bare.half_width_m + third_m) / 2

    def _motion(
        self, direction: float, grip_mps2: float, along_mps2: float = 0.0, end_mps: float = 0.0
    ) -> tuple[float, ...]:
        """Return the motion on such a floor, the fields of a `PathMotion`; along_mps2 is subtracted from the grip.

        A plain tuple saves two calls and the access to fields by name.
        """
        car = self.body.car
        return (
            max(0.0, direction * self.speed_mps),
            direction,
            self.wheel_rad,
            self.latency_s,
            car.steering_rate_radps,
            car.wheelbase_m,
            math.sqrt(grip_mps2 * grip_mps2 - along_mps2 * along_mps2),
            1.0 / (grip_mps2 * self.body.settings.cornering_per_rad),
            along_mps2,
            end_mps,
        )

    def _points_m(self) -> tuple[Places, Places]:
        """Return the solid points outside and inside the margins, (k,) each."""
        if self._near_m is None:
            view = self.view
            points = solid_places(view.x_m, view.y_m, view.solid)
            if self.more_m.size:
                points = np.concatenate([points, self.more_m])
            if not (self.more_m.size or any_nearer(view.solid, view.ranges_m, self.body.reach_m)):
                self._near_m = points, NOWHERE
                return self._near_m
            inside = self.body.presses(points)
            self._near_m = points[~inside], points[inside]
        return self._near_m

    def points_ahead_m(self) -> Places:
        """Return all points that are not known from memory alone, (k,), base_link."""
        return np.concatenate(self._points_m())

    def points_around_m(self, within_m: float) -> Places:
        """Return all points seen and remembered within a distance of the rear axle, (k,), base_link."""
        points = np.concatenate([*self._points_m(), *self._points_behind_m()])
        around: Places = points[np.abs(points) < within_m]
        return around

    def _points_behind_m(self) -> tuple[Places, Places]:
        """Return the remembered points where the lidar sees nothing, outside and inside the margins, (k,) each.

        Points inside the car's own outline are dropped: they are errors of the odometry of a sliding car.
        """
        if self._hidden_m is None:
            half_view_rad = float(np.abs(self.view.bearing_rad[[0, -1]]).min())
            hidden_m = self.behind.points_m(half_view_rad)
            hidden_m = hidden_m[~self.body.bare.holds(hidden_m)]
            inside = self.body.presses(hidden_m)
            self._hidden_m = hidden_m[~inside], hidden_m[inside]
        return self._hidden_m
