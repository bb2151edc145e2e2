"""What one scan puts into the strip that the car would sweep, for any steering: points, margins, floors, memory."""

import math
from dataclasses import dataclass, field, replace

import numpy as np

from runtime.car_settings import CarSettings
from runtime.control.behind import Behind
from runtime.control.footprint import ENOUGH_POINTS, NOTHING, Contact, Motion, Outline, Path, arc, first_contact
from runtime.control.geometry import Floats
from runtime.control.perception import View
from runtime.control.stopping import GRAVITY_MPS2, grip_curvature_per_m
from runtime.control.swept_settings import SweptSettings

LOOK_SPARE_M = 0.25
OTHER_STEERINGS = (0.0, 0.5, -0.5, 1.0, -1.0)
FREE_WAY_M = 0.5


class Body:
    """The car as safety sees it: outlines bare, with margins forward, with margins backward; and what floors hold."""

    def __init__(self, settings: SweptSettings, car: CarSettings) -> None:
        self.settings = settings
        self.car = car
        wide_m, spare_m = car.half_width_m + settings.side_margin_m, settings.front_margin_m
        self.bare = Outline(car.front_m, car.rear_m, car.half_width_m)
        self.ahead = Outline(car.front_m + spare_m, car.rear_m, wide_m)
        self.aback = Outline(car.front_m, car.rear_m + spare_m, wide_m)
        self.grip_mps2 = settings.grip_mu * GRAVITY_MPS2
        self.slippery_mps2 = min(settings.slippery_mu, settings.grip_mu) * GRAVITY_MPS2


@dataclass(slots=True, eq=False)
class Strip:
    """One scan, ready to be swept. Sweeps are kept by steering, length and direction.

    speed_mps: signed. wheel_rad: of the wheels now. latency_s: until a new steering shows. walkers_m: where walkers
    will be, (2, k). behind: the memory of what the lidar no longer sees.
    """

    body: Body
    view: View
    speed_mps: float
    wheel_rad: float
    latency_s: float
    walkers_m: Floats
    behind: Behind
    _kept: dict[tuple[float, float, float], Contact] = field(default_factory=dict)
    _near_m: tuple[Floats, Floats] | None = None
    _hidden_m: Floats | None = None

    def contact(self, steering_rad: float, length_m: float, direction: float = 1.0) -> Contact:
        """Return what the outline meets first on the way that this steering leads to."""
        key = (round(steering_rad, 3), length_m, direction)
        found = self._kept.get(key)
        if found is None:
            found = self._kept[key] = self._sweep(steering_rad, length_m, direction)
        return found

    def free_somewhere(self, length_m: float = FREE_WAY_M) -> bool:
        """Whether any steering leads the standing car so far ahead without a contact."""
        most_rad = self.body.car.max_steering_rad
        return any(self.contact(share * most_rad, length_m).travel_m >= length_m for share in OTHER_STEERINGS)

    def grazes(self, steering_rad: float, way_m: float) -> bool:
        """Whether the car itself, without margins, gets past on this arc."""
        length_m = way_m + self.body.car.front_m + LOOK_SPARE_M
        path = self._path(steering_rad, length_m, 1.0, self.body.slippery_mps2)
        return first_contact(path, self.body.bare, np.hstack(self._points_m())) == NOTHING

    def _sweep(self, steering_rad: float, length_m: float, direction: float) -> Contact:
        body = self.body
        found = self._along(self._path(steering_rad, length_m, direction), direction)
        if direction > 0 and self._needs_grip(steering_rad):
            slides = self._along(self._path(steering_rad, length_m, direction, body.slippery_mps2), direction)
            found = min(found, replace(slides, slippery=True), key=lambda contact: contact.travel_m)
        return found if found.travel_m <= length_m else NOTHING

    def _needs_grip(self, steering_rad: float) -> bool:
        """Whether the bend asks for more than a slippery floor gives."""
        aside_mps2 = self.speed_mps**2 * abs(math.tan(steering_rad)) / self.body.car.wheelbase_m
        return aside_mps2 > self.body.slippery_mps2

    def _along(self, path: Path, direction: float) -> Contact:
        body = self.body
        free_m, touching_m = self._points_m()
        if direction < 0:
            free_m = np.hstack([free_m, self._points_behind_m()])
        outline = body.ahead if direction > 0 else body.aback
        if touching_m.shape[1]:
            outline = replace(outline, half_width_m=self._room_aside_m(touching_m, outline))
        found = first_contact(path, outline, free_m, direction)
        if touching_m.shape[1]:
            # What is within the margins already would stop the car for ever: it is judged by the bare outline.
            pressed = first_contact(path, body.bare, touching_m, direction)
            found = min(found, pressed, key=lambda contact: contact.travel_m)
        return found

    def _room_aside_m(self, touching_m: Floats, outline: Outline) -> float:
        """Return the half width of the strip beside something within the margin: a wall there goes on ahead.

        It keeps half of what room there is; without this a car two centimetres from a wall never moves along it.
        """
        aside_m = np.abs(touching_m[1])
        aside_m = aside_m[aside_m > self.body.bare.half_width_m]
        if aside_m.size < ENOUGH_POINTS:
            return outline.half_width_m
        third_m = float(np.partition(aside_m, ENOUGH_POINTS - 1)[ENOUGH_POINTS - 1])
        return (self.body.bare.half_width_m + third_m) / 2

    def _path(self, steering_rad: float, length_m: float, direction: float, grip_mps2: float = math.nan) -> Path:
        body = self.body
        if math.isnan(grip_mps2):
            grip_mps2 = body.grip_mps2
        speed_mps = max(0.0, direction * self.speed_mps)
        grip_per_m = grip_curvature_per_m(speed_mps, grip_mps2)
        slip_m = speed_mps * speed_mps / (grip_mps2 * body.settings.cornering_per_rad)
        car = body.car
        motion = Motion(
            speed_mps,
            direction,
            self.wheel_rad,
            self.latency_s,
            car.steering_rate_radps,
            car.wheelbase_m,
            grip_per_m,
            slip_m,
        )
        return arc(motion, steering_rad, length_m)

    def _points_m(self) -> tuple[Floats, Floats]:
        """Return the solid points outside and inside the margins, (2, k) each."""
        if self._near_m is None:
            view, ahead, aback = self.view, self.body.ahead, self.body.aback
            points = np.stack([view.x_m[view.solid], view.y_m[view.solid]])
            if self.walkers_m.shape[1]:
                points = np.hstack([points, self.walkers_m])
            inside = (points[0] <= ahead.front_m) & (points[0] >= -aback.rear_m)
            inside &= np.abs(points[1]) <= ahead.half_width_m
            self._near_m = (points[:, ~inside], points[:, inside]) if inside.any() else (points, points[:, :0])
        return self._near_m

    def points_around_m(self, within_m: float) -> Floats:
        """Return everything seen and remembered within a distance of the rear axle, (2, k), base_link."""
        points = np.hstack([*self._points_m(), self._points_behind_m()])
        return points[:, np.hypot(points[0], points[1]) < within_m]

    def _points_behind_m(self) -> Floats:
        if self._hidden_m is None:
            half_view_rad = float(np.abs(self.view.bearing_rad[[0, -1]]).min())
            self._hidden_m = self.behind.points_m(half_view_rad)
        return self._hidden_m
