"""Keyframes laid over each other, many pairs at once: what a pair tells, and what the scene hides.

The matching is that of the calibration (`scan_motion.lay_over`: point to line, by the bearing of the points).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
import numpy.typing as npt

from wallride.runtime.calibration.scan_motion import HUBER_M, SAME_PLACE_M, Kind, lay_over
from wallride.sim.mapping.keyframes import Keyframe
from wallride.sim.mapping.pose_graph import Edge, Origin
from wallride.sim.world.pose import Booleans, Floats

POINTS: Final = 300
"""Maximum number of points of a keyframe that are laid over another one."""
POINT_STD_M: Final = 0.03
"""Standard deviation of a point's distance from a surface: neighbours share most of their error, hence so much."""
MATCH_STD: Final = (0.02, 0.004, 0.003)
"""Least standard deviations [m, m, rad] of a match, of neighbours and of the ends of a loop."""
GUESS_WEIGHT: Final = 0.5
FITS_M: Final = 0.1
"""Maximum distance of a point that fits from its surface."""
MIN_POINTS: Final = 40
WEAK_SHARE: Final = 0.04
LOOP_WEAK_SHARE: Final = 0.15
"""Least ratio of the information in the two directions; below it the odometry has the weaker one. A loop's is larger,
because the noise of the normals invents information along a corridor."""
FACES: Final = 0.35
"""Least component of a normal along a direction that counts as information on it: noise turns normals by less."""
MIN_SHARE: Final = 0.4
LOOP_MIN_SHARE: Final = 0.55
AT_ONCE: Final = 64
"""Pairs at a time, so that their points stay in the processor's cache."""

Complexes = npt.NDArray[np.complex128]
Numbers = npt.NDArray[np.intp]


@dataclass(frozen=True, slots=True, eq=False)
class _Pairs:
    """Points of keyframes with the surfaces of others at their bearings, all (pairs, points).

    off_m: distance along the normal. good: whether there is a surface near it.
    """

    normals: Complexes
    off_m: Floats
    good: Booleans
    seen: Booleans


class Matcher:
    """The keyframes of a drive as arrays, (keyframes, beams or POINTS), to be laid over each other."""

    def __init__(self, frames: Sequence[Keyframe], kind: Kind) -> None:
        self._kind, self._surfaces = kind, [frame.surface for frame in frames]
        self._places_m = np.array([frame.surface.points_m[0] + 1j * frame.surface.points_m[1] for frame in frames])
        self._normals = np.array([frame.surface.normals[0] + 1j * frame.surface.normals[1] for frame in frames])
        usable = np.array([frame.surface.usable for frame in frames])
        self._places_m[~usable] = np.nan
        self._points_m = np.full((len(frames), POINTS), np.nan, dtype=np.complex128)
        for row, places_m, known in zip(self._points_m, self._places_m, usable, strict=True):
            which = np.flatnonzero(known)
            if len(which) > POINTS:
                which = which[np.linspace(0, len(which) - 1, POINTS).astype(np.intp)]
            row[: len(which)] = places_m[which]
        self._ends_m = np.stack([self._points_m.real, self._points_m.imag], axis=1)

    def laid_over(self, before: Numbers, after: Numbers, guesses: Floats, origin: Origin) -> list[Edge | None]:
        """Return the shift of each keyframe `after` in the frame of `before`, (n,); None where it does not fit.

        guesses: (n, 3). Where the scene hides a direction, the shift has the guess's value in it, and the information
        none.
        """
        found: list[Edge | None] = []
        for first in range(0, len(before), AT_ONCE):
            part = slice(first, first + AT_ONCE)
            found += self._laid_over(before[part], after[part], guesses[part], origin)
        return found

    def _laid_over(self, before: Numbers, after: Numbers, guesses: Floats, origin: Origin) -> list[Edge | None]:
        loop = origin is Origin.LOOP
        fitted = [
            lay_over(self._surfaces[one], self._ends_m[other], guess, self._kind, GUESS_WEIGHT)
            for one, other, guess in zip(before, after, guesses, strict=True)
        ]
        shifts, information = np.array([shift for shift, _ in fitted]), np.array([told for _, told in fitted])
        pairs = self._pairs(before, after, shifts)
        fits = pairs.good & (np.abs(pairs.off_m) < FITS_M)
        off_m = np.where(fits, np.abs(pairs.off_m), 0.0)
        weights = fits / np.maximum(1.0, off_m / HUBER_M)
        count, seen = fits.sum(axis=1), pairs.seen.sum(axis=1)
        enough = (count >= MIN_POINTS) & (count >= (LOOP_MIN_SHARE if loop else MIN_SHARE) * seen)
        residual_m = np.sqrt(np.sum(weights * off_m**2, axis=1) / np.maximum(weights.sum(axis=1), 1.0))
        strength, axes = np.linalg.eigh(information[:, :2, :2])
        weak = axes[:, 0, 0] + 1j * axes[:, 1, 0]
        toward = np.abs((pairs.normals * weak.conj()[:, None]).real)
        determined = np.sum(np.where(fits & (toward > FACES), toward**2, 0.0), axis=1) / np.maximum(strength[:, 1], 1.0)
        full = determined > (LOOP_WEAK_SHARE if loop else WEAK_SHARE)
        strong = np.tile(np.eye(3), (len(before), 1, 1))
        strong[~full, :2, :2] = axes[~full, :, 1, None] * axes[~full, None, :, 1]
        known_shifts = guesses + np.einsum("eij,ej->ei", strong, shifts - guesses)
        told: Floats = strong @ information @ strong / POINT_STD_M**2
        known = np.linalg.solve(np.eye(3) + told * np.square(MATCH_STD), told)
        return [
            Edge(
                int(before[at]), int(after[at]), known_shifts[at], known[at], origin, bool(full[at]),
                float(determined[at]), float(count[at] / seen[at]), float(residual_m[at]),
            ) if enough[at] else None
            for at in range(len(before))
        ]  # fmt: skip

    def _pairs(self, before: Numbers, after: Numbers, shifts: Floats) -> _Pairs:
        first_rad, step_rad, beams = self._kind
        turned_m = self._points_m[after] * np.exp(1j * shifts[:, 2])[:, None]
        points_m = turned_m + (shifts[:, 0] + 1j * shifts[:, 1])[:, None]
        with np.errstate(invalid="ignore"):
            beam = np.nan_to_num(np.rint((np.angle(points_m) - first_rad) / step_rad), nan=-1.0).astype(np.intp)
        inside = (beam >= 0) & (beam < beams)
        at = before[:, None] * beams + np.where(inside, beam, 0)
        normals, apart_m = self._normals.ravel()[at], points_m - self._places_m.ravel()[at]
        off_m = (apart_m * normals.conj()).real
        return _Pairs(normals, off_m, inside & (np.abs(apart_m) < SAME_PLACE_M), np.isfinite(off_m))
