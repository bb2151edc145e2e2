"""Whether a map can be trusted, and why not."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np

from wallride.sim.mapping.closing import ClosedLap
from wallride.sim.mapping.lap_record import LapRecord
from wallride.sim.mapping.pose_graph import ERRORS, Edge, Origin, PoseGraph, between
from wallride.sim.world.pose import Floats

GAP_S: Final = 0.5
MOVED_M: Final = 0.15
"""Way in a gap from which on the gap counts: a car that stands misses nothing."""
RESIDUAL_M: Final = 0.03
INLIERS: Final = 0.6
FULL_LOOPS: Final = 3
UNMATCHED_SHARE: Final = 0.02
TOLERANCE: Final = (0.015, 0.015, 0.01)
"""Standard deviations [m, m, rad] of what a map may be wrong by, beside those of a match: these alone are 4 mm, as
weights of the graph, and a map that is right to 1 cm would contradict them."""
CONTRADICTION: Final = 4.0
"""Mean chi2 of the edges of the loop at the map's poses, with TOLERANCE."""


@dataclass(frozen=True, slots=True)
class MapVerdict:
    """Figures of a map, and the reasons against it; without reasons it is good.

    residual_m: rms distance of points from the surfaces they were laid over. inliers: 5th percentile of the share of
    points that fit. full_loops: keyframes that meet the lap's beginning where the scene determines all directions.
    contradiction: mean chi2 of the loop's edges, NaN without any. gap_s: longest time without a scan in which the car
    moved. unmatched: keyframes that fit no earlier one.
    """

    way_m: float
    keyframes: int
    unmatched: int
    residual_m: float
    inliers: float
    loops: int
    full_loops: int
    contradiction: float
    gap_s: float
    reasons: tuple[str, ...]

    @property
    def good(self) -> bool:
        """Return whether nothing speaks against the map."""
        return not self.reasons

    @property
    def may_be_a_busy_computer(self) -> bool:
        """Return whether scans or reports that a busy computer lost explain the refusal."""
        return self.gap_s > GAP_S or self.contradiction > CONTRADICTION

    @property
    def words(self) -> str:
        """Return "good", or "refused" with the reasons."""
        return "good" if self.good else f"refused: {'; '.join(self.reasons)}"


def judge_map(record: LapRecord, lap: ClosedLap, *, is_open: bool = False) -> MapVerdict:
    """Return the verdict on a lap. is_open: the drive does not return to its beginning, and need not."""
    matched = [edge for edge in lap.edges if edge.origin is not Origin.ODOMETRY]
    near = [edge for edge in matched if edge.origin is Origin.NEIGHBOUR and edge.after - edge.before == 1]
    loops = lap.loops
    gap_s, gap_at_s = _gap(record, lap)
    verdict = MapVerdict(
        way_m=float(np.hypot(*np.diff(lap.poses[:, :2], axis=0).T).sum()),
        keyframes=len(lap.frames),
        unmatched=len(lap.frames) - 1 - len({edge.after for edge in matched}),
        residual_m=float(np.sqrt(np.mean([edge.residual_m**2 for edge in matched]))) if matched else float("nan"),
        inliers=float(np.percentile([edge.share for edge in near], 5)) if near else 0.0,
        loops=len(loops),
        full_loops=sum(edge.full for edge in loops),
        contradiction=contradiction(lap.poses, loops) if loops else float("nan"),
        gap_s=gap_s,
        reasons=(),
    )
    reasons = tuple(_reasons(verdict, gap_at_s, _ring_gap(lap, loops), is_open=is_open))
    return replace(verdict, reasons=reasons)


def contradiction(poses: Floats, loops: Sequence[Edge]) -> float:
    """Return the mean chi2 of edges at poses (n, 3), with TOLERANCE."""
    errors = PoseGraph(loops).errors(poses, np.zeros(ERRORS))[0]
    known = np.array([edge.information for edge in loops])
    known = np.linalg.solve(np.eye(3) + known * np.square(TOLERANCE), known)
    return float(np.mean(np.einsum("ei,eij,ej->e", errors, known, errors)))


def _reasons(verdict: MapVerdict, gap_at_s: float, end: str, *, is_open: bool) -> Iterator[str]:
    if verdict.gap_s > GAP_S:
        yield f"scans are missing for {verdict.gap_s:.1f} s at {gap_at_s:.1f} s while the car moved"
    if verdict.unmatched > max(1, UNMATCHED_SHARE * verdict.keyframes):
        yield f"{verdict.unmatched} of {verdict.keyframes} places fit none before them"
    if verdict.residual_m > RESIDUAL_M:
        yield f"the scans lie {1000 * verdict.residual_m:.0f} mm beside each other (rms; at most {1000 * RESIDUAL_M:g})"
    if verdict.inliers < INLIERS:
        yield f"at some places only {100 * verdict.inliers:.0f} % of the points fit"
    if not is_open and verdict.full_loops < FULL_LOOPS:
        yield f"the ring is open: {end}"
    if verdict.contradiction > CONTRADICTION:
        yield f"the end of the lap contradicts its beginning (chi2 {verdict.contradiction:.1f}, not {CONTRADICTION:g})"


def _ring_gap(lap: ClosedLap, loops: Sequence[Edge]) -> str:
    if loops:
        return (
            "the lap meets its beginning only where the scans hide a direction; drive on to the next corner"
            " (--open takes it as it is)"
        )
    ends: Floats = between(lap.poses[0], lap.poses[-1])
    return f"the drive ends {np.hypot(*ends[:2]):.1f} m from its beginning; drive on past the start, one corner or more"


def _gap(record: LapRecord, lap: ClosedLap) -> tuple[float, float]:
    """Return the longest time without a scan in which the car moved, and when it began."""
    gaps_s = np.diff(record.scan_s)
    times_s = np.array([frame.time_s for frame in lap.frames])
    for at in np.argsort(gaps_s)[::-1]:
        if gaps_s[at] <= GAP_S:
            break
        ends_s = record.scan_s[[at, at + 1]]
        moved_m = [np.interp(ends_s, times_s, lap.poses[:, axis]) for axis in (0, 1)]
        if np.hypot(*(np.diff(one)[0] for one in moved_m)) > MOVED_M:
            return float(gaps_s[at]), float(ends_s[0] - record.scan_s[0])
    return 0.0, 0.0
