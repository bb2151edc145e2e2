"""Faults of the lidar window: dirt, blind beams, too few echoes, learnt per metre moved.

Evidence per beam: p <- p + (1 - exp(-dm / memory)) (seen - p), with dm = metres moved + 0.3 * radians turned, so that a
parked car learns nothing (a leg beside it stays an obstacle). Dirt stays on its beam, at its range, while the world
moves past; an operator walking behind the car does not keep a distance constant to the centimetre.

What dirt looks like on real cars (a RACECAR, benchmarks/laws.md): patches of 9 to 15 degrees that read 0.45 to
0.8 m while a wall is within 1.7 m behind them, and let the beam through to anything farther. So a patch is compared
with beams 15 degrees away as well, evidence reaches to 0.9 m, and the blurred rim of a patch belongs to it.
"""

import math

import numpy as np

from wallride.drivers.api import MotorState
from wallride.runtime.control.perception.geometry import Booleans, beyond
from wallride.runtime.control.perception.lidar_health_settings import LidarHealthSettings
from wallride.runtime.control.perception.view import BODY_BEYOND_RAD, View
from wallride.runtime.control.perception.window_dirt import (
    SMUDGE_NEARER_THAN_M,
    Evidence,
    LearningShares,
    find_dirt,
    patches,
    runs_longer_than,
    weigh_dirt,
)

METRES_PER_RADIAN = 0.3
BODY_MEMORY_M = 0.3
"""Distance constant of the evidence for near returns behind the car's shoulders."""
LEARNS_EVERY_M = 0.1
FORWARD_RAD = math.pi / 4
BLIND_MEMORY_RAD = 1.0
WIPED_EVERY_S, WIPED_MEMORY_S = 0.25, 1.5
"""Interval and time constant of the check for a wiped window: a car stopped for dirt cannot learn by driving, so two
seconds of a clear view suffice."""
TOO_MUCH_DIRT = "too much dirt: clean the lidar"
FAR_SEEING_M = 10.0
"""Reference range of the required share of echoes: a sensor of shorter range has fewer echoes in the same room, and
needs proportionally fewer to count as uncovered."""


class _Beams:
    """State of each beam: evidence in 0..1 for dirt, blindness and the car's own body; and the findings."""

    def __init__(self, beams: int) -> None:
        self.dirt = np.zeros(beams)
        self.blind = np.zeros(beams)
        self.own = np.zeros(beams)
        self.near_m = np.full(beams, math.nan)
        self.dirty: Booleans = np.zeros(beams, np.bool_)
        self.parts: Booleans = np.zeros(beams, np.bool_)
        self.blinded: Booleans = np.zeros(beams, np.bool_)


class LidarHealth:
    """Assesses the window.

    mask: beams (n,) to ignore, None while there are none or while ignoring them would not be safe.
    ceiling_mps: infinity, the doubtful speed, or 0; reason: its constant text.
    words: one sentence for each patch, for the user.
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
        self._wiped_s = 0.0
        self._empty = False
        self._tuned = False
        self._told: tuple[float, bool] | None = None
        self.mask: Booleans | None = None
        self.ceiling_mps = math.inf
        self.reason = "window clean"
        self.words: tuple[str, ...] = ()

    @property
    def own(self) -> Booleans:
        """Return the beams (n,) that see the car's own body, or dirt near enough to look like it."""
        return self._beams.own > self._settings.mask_above

    @property
    def blinded(self) -> Booleans:
        """Return the beams (n,) that have no echo at any heading of the car."""
        return self._beams.blinded

    def tune(self, settings: LidarHealthSettings, doubtful_mps: float) -> None:
        """Change the settings; the evidence of each beam is kept and judged by them at the next scan."""
        self._settings = settings
        self._doubtful_mps = doubtful_mps
        self._tuned = True

    def forget(self) -> None:
        """Reset the state of the window."""
        self._begin(0)
        self.mask, self.ceiling_mps, self.reason, self.words = None, math.inf, "window clean", ()

    def _begin(self, beams: int) -> None:
        self._beams = _Beams(beams)
        self._moved_m = self._waiting_m = self._waiting_rad = 0.0
        self._told = None
        self._empty = False

    def glance(self, view: View) -> None:
        """Detect at once when almost all echoes are missing, or when they return."""
        beams = view.ranges_m.shape[0]
        if self._beams.dirt.shape[0] != beams:
            self._begin(beams)
        least_share = (1.0 - self._settings.empty_share) * min(view.scan.range_max_m / FAR_SEEING_M, 1.0)
        empty = view.silent > (1.0 - least_share) * beams
        if empty != self._empty:
            self._empty = empty
            self._judge(view)

    def update(self, view: View, motor: MotorState | None, *, scene_stands: bool = False) -> None:
        """Learn from one scan; cheap while the car stands.

        scene_stands: whether the wheels turn and the car does not move: that teaches nothing.
        """
        self.glance(view)
        self._look_whether_wiped(view)
        step_m, turn_rad = self._motion(motor)
        if scene_stands:
            self._waiting_m = self._waiting_rad = 0.0
            return
        self._waiting_m += step_m + METRES_PER_RADIAN * turn_rad
        self._waiting_rad += turn_rad
        if self._waiting_m < LEARNS_EVERY_M and not self._tuned:
            return
        self._tuned = False
        if self._waiting_m >= LEARNS_EVERY_M:
            self._learn(view)
        self._judge(view)

    def _look_whether_wiped(self, view: View) -> None:
        """Clear beams that see beyond the range of dirt (wiped), while too much dirt keeps the car from moving."""
        elapsed_s = view.scan.stamp_s - self._wiped_s
        if self.reason != TOO_MUCH_DIRT or 0.0 <= elapsed_s < WIPED_EVERY_S:
            return
        self._wiped_s = view.scan.stamp_s
        clear = self._beams.dirty & (view.ranges_m > SMUDGE_NEARER_THAN_M)  # NaN, no echo, tells nothing
        self._beams.dirt[clear] *= math.exp(-min(max(elapsed_s, 0.0), WIPED_EVERY_S) / WIPED_MEMORY_S)
        self._judge(view)

    def _motion(self, motor: MotorState | None) -> tuple[float, float]:
        """Return metres moved and radians turned since the last scan, both >= 0."""
        last_m, self._last_m = self._last_m, motor.distance_m if motor is not None else None
        if motor is None or last_m is None:
            return 0.0, 0.0
        step_m = abs(motor.distance_m - last_m)
        return step_m, step_m * abs(math.tan(motor.steering_rad)) / self._wheelbase_m

    def _learn(self, view: View) -> None:
        beams = self._beams
        beams.near_m, beams.dirt, beams.own, beams.blind = weigh_dirt(
            view,
            beyond(view.scan, BODY_BEYOND_RAD),
            Evidence(beams.near_m, beams.dirt, beams.own, beams.blind),
            LearningShares(
                1 - math.exp(-self._waiting_m / self._settings.memory_m),
                1 - math.exp(-self._waiting_m / BODY_MEMORY_M),
                1 - math.exp(-self._waiting_rad / BLIND_MEMORY_RAD),
            ),
        )
        self._moved_m += self._waiting_m
        self._waiting_m = self._waiting_rad = 0.0

    def _judge(self, view: View) -> None:
        settings, beams = self._settings, self._beams
        setting_off = self._moved_m < settings.first_mask_m  # the car drives away from what is before its shoulders
        found, lost = find_dirt(
            Evidence(beams.near_m, beams.dirt, beams.own, beams.blind),
            beyond(view.scan, BODY_BEYOND_RAD) if setting_off else None,
            (beams.dirty, beams.parts, beams.blinded), settings.mask_above, settings.unmask_below,
        )  # fmt: skip
        if found is not None:
            beams.dirty, beams.parts, beams.blinded = found
        self.mask, share, safe = self._masked(view) if lost else (None, 0.0, True)
        self.ceiling_mps, self.reason = self._ceiling(share, safe=safe)
        told = view.bearing_rad[0], self._empty
        if found is not None or told != self._told:
            self._told = told
            self.words = tuple(self._sentences(view))

    def _masked(self, view: View) -> tuple[Booleans | None, float, bool]:
        """Return the beams to ignore, None for none, the share that is lost, and whether it is safe without them.

        Shares are those of the beams before the car's shoulders: the car's parts behind them take nothing from its
        view of where it drives.
        """
        settings, dirty = self._settings, self._beams.dirty
        lost = dirty | self._beams.blinded
        before = ~beyond(view.scan, BODY_BEYOND_RAD)
        beams = max(1, int(np.count_nonzero(before)))
        most = max(1.0, settings.masked_share * beams)
        widest = int((settings.masked_gap_rad + 1e-9) / abs(view.scan.angle_step_rad))
        too_wide = runs_longer_than(lost & ~beyond(view.scan, FORWARD_RAD), widest)
        masked = dirty & ~too_wide  # a patch too wide to be ignored ahead does not unmask the others
        few = int(np.count_nonzero(dirty & before)) < most
        lost_beams = int(np.count_nonzero(lost & before))
        safe = lost_beams < most and not np.count_nonzero(too_wide)
        return masked if few and np.count_nonzero(masked) else None, lost_beams / beams, safe

    def _ceiling(self, share: float, *, safe: bool) -> tuple[float, str]:
        if self._empty:
            return 0.0, "the lidar sees almost nothing: uncover or clean it"
        if share > self._settings.refused_share:
            return 0.0, TOO_MUCH_DIRT
        if not safe:
            return self._doubtful_mps, "dirty window: clean the lidar"
        return math.inf, "window clean"

    def _sentences(self, view: View) -> list[str]:
        rear = beyond(view.scan, BODY_BEYOND_RAD)
        told = [
            (self._beams.dirty & ~rear, "are dirty: clean the window"),
            (self._beams.blinded & ~rear, "see nothing: uncover or clean the window"),
            (
                self._beams.parts | (self._beams.dirty & rear),
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
