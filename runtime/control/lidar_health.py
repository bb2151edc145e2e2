"""What is wrong with the lidar's window: dirt, blind beams, too much emptiness, learnt per metre moved.

Evidence per beam: p <- p + (1 - exp(-dm / memory)) (seen - p), with dm = metres moved + 0.3 * radians turned, so that a
parked car learns nothing (a leg beside it stays an obstacle). Dirt stays on its beam, at its range, while the world
moves past; the operator who walks along behind the car does not keep his distance to the centimetre.

What dirt looks like on real cars (recordings of a RACECAR, docs/laws.md): patches of 9 to 15 degrees that read 0.45 to
0.8 m while a wall is within 1.7 m behind them, and let the beam through to anything farther. So a patch is compared
with beams 15 degrees away as well, evidence reaches to 0.9 m, and the blurred rim of a patch belongs to it.
"""

import math

import numpy as np

from drivers.api import MotorState
from runtime.control.geometry import Floats
from runtime.control.lidar_health_settings import LidarHealthSettings
from runtime.control.perception import DIRT_STANDS_OUT_M, Booleans, View

NEIGHBOUR_BEAMS = (40, 60)
"""Dirt stands out against the beams 10, or 15, degrees to its left and right."""
SMUDGE_NEARER_THAN_M = 0.9
"""The rim of a real smudge reads up to 0.8 m, a mixture of the dirt and the wall behind it."""
ON_THE_WINDOW_M = 0.06
METRES_PER_RADIAN = 0.3
LEARNS_EVERY_M = 0.1
STEADY_WITHIN_M = 0.06
"""Three standard deviations of a noisy lidar (0.02 m)."""
FORWARD_RAD = math.pi / 4
BODY_BEYOND_RAD = math.radians(105)
"""Behind this bearing a fixed near return is taken for a part of the car, before it for dirt."""
BLIND_MEMORY_RAD = 1.0
BLIND_ABOVE = 0.95
BESIDE_ECHOES_BEAMS = 80
BESIDE_ECHOES_SHARE = 0.25
"""Darkness says something only where a quarter of the beams within 20 degrees see: in the open nothing is there."""
GROUP_BEAMS = 8
"""Beams this near each other are spoken of as one patch."""


class _Beams:
    """What is known of each beam: evidence in 0..1 for dirt, blindness and the car's own body; and the findings."""

    def __init__(self, beams: int) -> None:
        self.dirt = np.zeros(beams)
        self.blind = np.zeros(beams)
        self.own = np.zeros(beams)
        self.near_m = np.full(beams, math.nan)
        self.dirty: Booleans = np.zeros(beams, np.bool_)
        self.blinded: Booleans = np.zeros(beams, np.bool_)


class LidarHealth:
    """Judges the window.

    mask: beams (n,) to ignore, None while there are none or while ignoring them would not be safe.
    ceiling_mps: infinity, the doubtful speed, or 0; reason: constant words for it.
    words: one sentence for each patch, for people.
    """

    def __init__(self, settings: LidarHealthSettings, wheelbase_m: float, doubtful_mps: float = 1.0) -> None:
        self._settings = settings
        self._wheelbase_m = wheelbase_m
        self._doubtful_mps = doubtful_mps
        self._beams = _Beams(0)
        self._moved_m = 0.0
        self._waiting_m = 0.0
        self._waiting_rad = 0.0
        self._last_m: float | None = None
        self._empty = False
        self._tuned = False
        self.mask: Booleans | None = None
        self.ceiling_mps = math.inf
        self.reason = "window clean"
        self.words: tuple[str, ...] = ()

    @property
    def own(self) -> Booleans:
        """Return the beams (n,) that see the car's own body, or dirt so near that it looks like it."""
        return self._beams.own > self._settings.mask_above

    @property
    def blinded(self) -> Booleans:
        """Return the beams (n,) that see nothing, wherever the car turns."""
        return self._beams.blinded

    def tune(self, settings: LidarHealthSettings, doubtful_mps: float) -> None:
        """Go on with other settings; the evidence of each beam is kept and judged by them at the next scan."""
        self._settings = settings
        self._doubtful_mps = doubtful_mps
        self._tuned = True

    def update(self, view: View, motor: MotorState | None) -> None:
        """Learn from one scan; cheap while the car stands."""
        beams = view.ranges_m.shape[0]
        if self._beams.dirt.shape[0] != beams:
            self._beams = _Beams(beams)
            self._moved_m = self._waiting_m = self._waiting_rad = 0.0
        step_m, turn_rad = self._motion(motor)
        self._waiting_m += step_m + METRES_PER_RADIAN * turn_rad
        self._waiting_rad += turn_rad
        empty = bool(np.count_nonzero(view.no_echo) > self._settings.empty_share * beams)
        if self._waiting_m < LEARNS_EVERY_M and empty == self._empty and not self._tuned:
            return
        self._tuned = False
        self._empty = empty
        if self._waiting_m >= LEARNS_EVERY_M:
            self._learn(view)
        self._judge(view)

    def _motion(self, motor: MotorState | None) -> tuple[float, float]:
        """Return metres moved and radians turned since the last scan, both >= 0."""
        last_m, self._last_m = self._last_m, motor.distance_m if motor is not None else None
        if motor is None or last_m is None:
            return 0.0, 0.0
        step_m = abs(motor.distance_m - last_m)
        return step_m, step_m * abs(math.tan(motor.steering_rad)) / self._wheelbase_m

    def _learn(self, view: View) -> None:
        learns = 1 - math.exp(-self._waiting_m / self._settings.memory_m)
        near = stands_out(view.ranges_m)
        off_m = np.where(near, view.ranges_m - self._beams.near_m, math.nan)
        near &= ~(np.abs(off_m) >= STEADY_WITHIN_M)  # NaN: seen near for the first time
        self._beams.near_m = np.where(np.isnan(off_m), self._beams.near_m, self._beams.near_m + learns * off_m)
        fresh = near & np.isnan(self._beams.near_m)
        self._beams.near_m[fresh] = view.ranges_m[fresh]
        body = view.own & (np.abs(view.bearing_rad) > BODY_BEYOND_RAD)
        near &= ~body
        self._beams.own += learns * (body - self._beams.own)
        self._beams.dirt += learns * (near - self._beams.dirt)
        # Only turning tells a blind beam from a long corridor: the emptiness turns with the car.
        turns = 1 - math.exp(-self._waiting_rad / BLIND_MEMORY_RAD)
        self._beams.blind += turns * beside_echoes(view.no_echo) * (view.no_echo - self._beams.blind)
        self._moved_m += self._waiting_m
        self._waiting_m = self._waiting_rad = 0.0

    def _judge(self, view: View) -> None:
        settings = self._settings
        doubtful = self._beams.dirt >= settings.unmask_below
        if self._moved_m < settings.first_mask_m:
            doubtful &= np.abs(view.bearing_rad) > BODY_BEYOND_RAD  # the car drives away from what is there
        surely = (self._beams.dirt > settings.mask_above) | self._beams.dirty
        self._beams.dirty = runs_with(doubtful, surely & doubtful)
        self._beams.blinded = self._beams.blind > BLIND_ABOVE
        lost = self._beams.dirty | self._beams.blinded
        share = np.count_nonzero(lost) / lost.size
        forward = np.abs(view.bearing_rad) <= FORWARD_RAD
        widest = int((settings.masked_gap_rad + 1e-9) / abs(view.scan.angle_step_rad))
        too_wide = runs_longer_than(lost & forward, widest)
        safe = bool(share < settings.masked_share and not too_wide.any())
        masked = self._beams.dirty & ~too_wide  # what is too wide to be ignored ahead is no reason to heed the rest
        few = np.count_nonzero(self._beams.dirty) < settings.masked_share * lost.size
        self.mask = masked if few and masked.any() else None
        self.ceiling_mps, self.reason = self._ceiling(share, safe=safe)
        self.words = tuple(self._sentences(view))

    def _ceiling(self, share: float, *, safe: bool) -> tuple[float, str]:
        if self._empty:
            return 0.0, "the lidar sees almost nothing: uncover or clean it"
        if share > self._settings.refused_share:
            return 0.0, "too much dirt: clean the lidar"
        if not safe:
            return self._doubtful_mps, "dirty window: clean the lidar"
        return math.inf, "window clean"

    def _sentences(self, view: View) -> list[str]:
        rear = np.abs(view.bearing_rad) > BODY_BEYOND_RAD
        told = [
            (self._beams.dirty & ~rear, "are dirty: clean the window"),
            (self._beams.blinded & ~rear, "see nothing: uncover or clean the window"),
            (
                self.own | (self._beams.dirty & rear),
                "see the car itself, or dirt, and are ignored",
            ),
        ]
        said = [
            f"{beams} beams around {bearing_deg:.0f} deg {words}"
            for which, words in told
            for beams, bearing_deg in patches(which, view.bearing_rad)
        ]
        if self._empty:
            said.insert(0, "almost no beam has an echo: uncover or clean the lidar")
        return said


def stands_out(ranges_m: Floats) -> Booleans:
    """Return the beams nearer than a smudge can be and 0.12 m nearer than both beams so far away, or on the glass.

    At the ends of the fan only one of the two exists. No echo counts as far.
    """
    near = ranges_m < SMUDGE_NEARER_THAN_M  # NaN compares as not nearer: no echo is not near
    alone = np.zeros(ranges_m.shape, np.bool_)
    for apart in NEIGHBOUR_BEAMS:
        far = np.full(ranges_m.size + 2 * apart, math.inf)
        far[apart:-apart] = ranges_m
        left_near = far[2 * apart :] - ranges_m < DIRT_STANDS_OUT_M
        right_near = far[: -2 * apart] - ranges_m < DIRT_STANDS_OUT_M
        alone |= ~left_near & ~right_near
    return (near & alone) | (ranges_m < ON_THE_WINDOW_M)


def beside_echoes(no_echo: Booleans) -> Booleans:
    """Return the beams (n,) within 20 degrees of which at least a quarter of all beams have an echo."""
    before = np.concatenate(([0], np.cumsum(~no_echo)))
    index = np.arange(no_echo.size)
    first = np.maximum(index - BESIDE_ECHOES_BEAMS, 0)
    end = np.minimum(index + BESIDE_ECHOES_BEAMS + 1, no_echo.size)
    near: Booleans = before[end] - before[first] >= BESIDE_ECHOES_SHARE * (end - first)
    return near


def runs(which: Booleans) -> list[tuple[int, int]]:
    """Return (first, one past the last) of every row of True."""
    edges = np.flatnonzero(np.diff(np.concatenate(([0], which.view(np.int8), [0])))).tolist()
    return list(zip(edges[::2], edges[1::2], strict=True))


def runs_longer_than(which: Booleans, most: int) -> Booleans:
    """Return only the rows of True that are longer than this."""
    longer = np.zeros_like(which)
    for first, end in runs(which):
        longer[first:end] = end - first > most
    return longer


def runs_with(which: Booleans, some: Booleans) -> Booleans:
    """Return only the rows of True that hold one of `some`, itself a part of `which`: the rim of a sure thing."""
    kept = np.zeros_like(which)
    for first, end in runs(which):
        kept[first:end] = some[first:end].any()
    return kept


def patches(which: Booleans, bearing_rad: Floats) -> list[tuple[int, float]]:
    """Return (beams, middle bearing in degrees) of each patch of beams; small gaps do not divide a patch."""
    index = np.flatnonzero(which)
    if not index.size:
        return []
    groups = np.split(index, np.flatnonzero(np.diff(index) > GROUP_BEAMS) + 1)
    return [(int(group.size), math.degrees(float(bearing_rad[group].mean()))) for group in groups]
