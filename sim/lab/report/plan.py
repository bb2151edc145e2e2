"""All drives of `lab report`: gain tables, conditions varied, trials, obstacles, for the report's law and another."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import lru_cache

from wallride.runtime.parameters.catalogue import Parameter, ValueKind, catalogue
from wallride.runtime.settings.tree import Settings
from wallride.sim.car.vehicle_settings import VehicleSettings
from wallride.sim.lab import laws
from wallride.sim.lab.cell import Cell
from wallride.sim.lab.courses.sudden import PLACES
from wallride.sim.lab.report import drives, wall_ahead
from wallride.sim.lab.report.drives import Starts
from wallride.sim.lab.report.published import (
    FINAL,
    FIXED,
    GAINS,
    OBSTACLE_DISTANCES_M,
    OBSTACLE_SPEEDS_MPS,
    TESTS,
    Half,
    Pair,
)
from wallride.sim.scenario.conditions import put_on_top
from wallride.sim.virtual.closed_loop import ROUGH_BEAMS
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.pose import Side

CHOSEN_STARTS = Starts()
SPEED_MPS = 2.0
"""Speed of the gain tables, which the report does not give."""
NOISE_M = 0.005
"""Noise of a range, as the beams of a standing car's recording spread (4 to 5 mm); no wild beams."""
BOX = "0.3-centred"
REPORT_LAW = "report+report"
ALONE_LAW = "report+none"
GAIN_KEYS = (("wall_follow.kp", "wall_follow.kd"), ("wall_follow.own.kp", "wall_follow.own.kd"))
DISTANCE_KINDS = ("three_smallest", "line", "intercept")


@dataclass(frozen=True, slots=True)
class ReportPlan:
    """Choice of the report. law: compared with the report's. settings: KEY=VALUE texts by law, for both laws.

    wild: share of wild beams. varies: whether the conditions that the report does not give are varied.
    conditions: of the simulated car, as `wallride.sim.lab.cell.Cell` has them.
    """

    law: str = "ball+swept"
    report_settings: tuple[str, ...] = ()
    law_settings: tuple[str, ...] = ()
    mu: float = 0.8
    own_parts: str = "none"
    seed: int = 1000
    tests: tuple[str, ...] = TESTS
    conditions: tuple[str, ...] = ()
    starts: Starts = CHOSEN_STARTS
    wild: float = 0.0
    noise_m: float = NOISE_M
    trial_speeds_mps: tuple[float, ...] = wall_ahead.SPEEDS_MPS
    obstacle_speeds_mps: tuple[float, ...] = OBSTACLE_SPEEDS_MPS
    varies: bool = True

    def lidar_and_car(self) -> tuple[str, ...]:
        """Return the conditions of every car: the plan's lidar, and what is named on top."""
        return (f"lidar.noise_std_m={self.noise_m:g}", f"lidar.outlier_share={self.wild:g}", *self.conditions)

    def car_and_lidar(self) -> tuple[VehicleSettings, LidarSettings]:
        """Return the simulated car and its lidar."""
        return put_on_top(self.lidar_and_car(), VehicleSettings(grip_mu=self.mu), ROUGH_BEAMS)

    def noise_words(self) -> str:
        """Return the lidar's noise."""
        _, lidar = self.car_and_lidar()
        wild = f"{100 * lidar.outlier_share:g} % wild beams" if lidar.outlier_share else "no wild beams"
        return f"{1000 * lidar.noise_std_m:g} mm of noise and {wild}"

    def assignments(self, law: str) -> tuple[str, ...]:
        """Return the settings of the cars of a law."""
        return self.report_settings if law.startswith("report+") else self.law_settings

    def settings(self, law: str) -> Settings:
        """Return the settings of the cars of a law; SettingsError for a wrong one."""
        return _settings(law, self.assignments(law))

    def gain_keys(self, law: str) -> tuple[str, str] | None:
        """Return the names of the two gains of a law; None where it does not have both."""
        dumped, known = self.settings(law).model_dump(), catalogue(self.settings(law))
        if law.startswith("prototype+"):
            return None  # its settings are those of ball, which it does not read
        return next(
            (
                keys
                for keys in GAIN_KEYS
                if all(_value(dumped, key) is not None and known[key].kind is not ValueKind.INTEGER for key in keys)
            ),
            None,
        )

    def pairs(self, law: str) -> dict[Half, list[Pair]]:
        """Return the pairs of the halves of a gain table; the half of a gain that a setting fixes is left out.

        Another law has the report's pairs scaled so that the report's final pair becomes the law's own gains.
        """
        keys = self.gain_keys(law)
        if keys is None:
            return {}
        dumped, known = self.settings(law).model_dump(), catalogue(self.settings(law))
        kp, kd = (float(_value(dumped, key) or 0.0) for key in keys)
        scales = (1.0, 1.0) if law.startswith("report+") else (kp / FINAL[0], kd / FINAL[1])
        of_kp, of_kd = (
            [_scaled(gain * scale, own, known[key]) for gain in GAINS]
            for key, scale, own in zip(keys, scales, (kp, kd), strict=True)
        )
        fixed = tuple(any(text.partition("=")[0].strip() == key for text in self.assignments(law)) for key in keys)
        halves: dict[Half, list[Pair]] = {}
        if not fixed[1]:
            other = kp if fixed[0] else of_kp[GAINS.index(FIXED["kd"])]
            halves["kd"] = [(other, gain) for gain in dict.fromkeys(of_kd)]
        if not fixed[0]:
            other = kd if fixed[1] else of_kd[GAINS.index(FIXED["kp"])]
            halves["kp"] = [(gain, other) for gain in dict.fromkeys(of_kp)]
        return halves


def _scaled(gain: float, own: float, known: Parameter) -> float:
    """Return a gain in four digits within its range; a bound that is not allowed itself is kept off by a hundredth."""
    value = float(f"{gain:.4g}")
    if known.lowest is not None:
        value = max(value, known.lowest + (0.01 * (own - known.lowest) if known.open_below else 0.0))
    if known.highest is not None:
        value = min(value, known.highest - (0.01 * (known.highest - own) if known.open_above else 0.0))
    return value


def _value(dumped: Mapping[str, object], key: str) -> float | None:
    value: object = dumped
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return float(value) if isinstance(value, int | float) else None


@lru_cache(maxsize=16)
def _settings(law: str, assignments: tuple[str, ...]) -> Settings:
    return laws.settings_of(law, "left", 1.0, SPEED_MPS, assignments)


@dataclass(frozen=True, slots=True)
class Variation:
    """One condition that the report does not give, changed. speed_mps, mu: None as in the plan."""

    words: str
    starts: Starts | None = None
    speed_mps: float | None = None
    mu: float | None = None
    plan: Mapping[str, float] = field(default_factory=dict)

    def of(self, plan: ReportPlan) -> ReportPlan:
        """Return the plan with the change."""
        texts = plan.report_settings
        if self.speed_mps is not None:
            texts = (*texts, f"wall_follow.speed_mps={self.speed_mps:g}")
        named: dict[str, float] = {**self.plan, **({} if self.mu is None else {"mu": self.mu})}
        return replace(plan, report_settings=texts, starts=self.starts or plan.starts, **named)  # type: ignore[arg-type]


def variations(plan: ReportPlan) -> dict[str, Variation]:
    """Return the conditions that are varied one at a time, by the name of their table."""
    if not plan.varies or not plan.pairs(ALONE_LAW):
        return {}
    made = [Variation(f"{speed:g} m/s", speed_mps=speed) for speed in (1.0, 1.5, 2.5)]
    made += [Variation(f"turned by {deg:g} degrees", replace(plan.starts, slant_deg=deg)) for deg in (10.0, 30.0)]
    made += [
        Variation("close start at 0.7 of the distance", replace(plan.starts, near=0.7)),
        Variation("far start at 1.3 of the distance", replace(plan.starts, far=1.3)),
        Variation("runs of 2.5 m", replace(plan.starts, way_m=2.5)),
        Variation("runs of 8 m", replace(plan.starts, way_m=8.0)),
        Variation("20 mm of noise", plan={"noise_m": 0.02}),
        Variation("2 % wild beams", plan={"wild": 0.02}),
        Variation("friction 0.5", mu=0.5),
    ]
    usual = _conditions_of(plan)
    return {f"varied {one.words}": one for one in made if _conditions_of(one.of(plan)) != usual}


def _conditions_of(plan: ReportPlan) -> tuple[object, ...]:
    """Return all that a variation can change; a condition that is named holds against it."""
    return plan.starts, plan.settings(ALONE_LAW).wall_follow.speed_mps, plan.car_and_lidar()


def trial(plan: ReportPlan, law: str, scenario: str, pair: Pair | None = None, seed: int | None = None) -> Cell:
    """Return one drive. pair: the gains, None for the law's own. seed: None for the plan's."""
    chosen = plan.settings(law).wall_follow
    settings = plan.assignments(law)
    keys = plan.gain_keys(law)
    if pair is not None and keys is not None:
        settings = (*settings, *(f"{key}={gain:g}" for key, gain in zip(keys, pair, strict=True)))
    settings = (*settings, f"wall_follow.speed_mps={chosen.speed_mps:g}")
    return Cell(
        drives.NAME, scenario, law, chosen.speed_mps, plan.mu, chosen.side, plan.seed if seed is None else seed,
        chosen.desired_distance_m, plan.own_parts, settings, plan.lidar_and_car(),
    )  # fmt: skip


def gain_laws(plan: ReportPlan) -> list[str]:
    """Return the laws that have a gain table."""
    return [law for law in (REPORT_LAW, ALONE_LAW, plan.law) if plan.pairs(law)]


def gain_table(plan: ReportPlan, law: str) -> list[Cell]:
    """Return the runs of one gain table, both halves: every pair in every test.

    The halves have seeds of their own, so that the pair which stands in both tells how far noise alone moves an error.
    """
    return [
        trial(plan, law, plan.starts.scenario(test), pair, plan.seed + number)
        for number, pairs in enumerate(plan.pairs(law).values())
        for pair in pairs
        for test in plan.tests
    ]


def safety_trials(plan: ReportPlan, law: str) -> list[Cell]:
    """Return 25 trials along a wall toward one ahead, with the law's own gains."""
    chosen = plan.settings(law).wall_follow
    return [
        Cell(
            wall_ahead.NAME, f"{ahead_m:g} m", law, speed_mps, plan.mu, chosen.side, plan.seed,
            chosen.desired_distance_m, plan.own_parts, (*plan.assignments(law), f"wall_follow.speed_mps={speed_mps:g}"),
            plan.lidar_and_car(),
        )
        for ahead_m in wall_ahead.DISTANCES_M
        for speed_mps in plan.trial_speeds_mps
    ]  # fmt: skip


def obstacles(plan: ReportPlan, law: str, driver: str) -> list[Cell]:
    """Return an obstacle at each of the report's 28 speeds and distances.

    driver: "blind" drives straight on, "follower" is the law's own.
    """
    side: Side = plan.settings(law).wall_follow.side
    place = tuple(PLACES)[-1]
    return [
        Cell(
            "safety",
            f"{ahead_m:.1f} m" if driver == "blind" else f"{driver} {place} {BOX} {ahead_m:.1f}m",
            law, speed_mps, plan.mu, side, plan.seed, 1.0, plan.own_parts,
            (*plan.assignments(law), f"wall_follow.speed_mps={speed_mps:g}"), plan.lidar_and_car(),
        )
        for ahead_m in OBSTACLE_DISTANCES_M
        for speed_mps in plan.obstacle_speeds_mps
    ]  # fmt: skip


def distance_kinds(plan: ReportPlan, kind: str) -> list[Cell]:
    """Return the five tests of the report's law with another distance to the wall, all else equal."""
    changed = replace(plan, report_settings=(*plan.report_settings, f"wall_follow.distance={kind}"))
    return [trial(changed, REPORT_LAW, plan.starts.scenario(test)) for test in plan.tests]


def first_round(plan: ReportPlan) -> dict[str, list[Cell]]:
    """Return all runs that depend on no result, by the name of their table."""
    tables = {f"gains {law}": gain_table(plan, law) for law in gain_laws(plan)}
    tables |= {name: gain_table(one.of(plan), ALONE_LAW) for name, one in variations(plan).items()}
    for law in (REPORT_LAW, plan.law):
        tables[f"trials {law}"] = safety_trials(plan, law)
        tables |= {f"obstacles {law} {driver}": obstacles(plan, law, driver) for driver in ("blind", "follower")}
    return tables | {f"distance {kind}": distance_kinds(plan, kind) for kind in DISTANCE_KINDS}


def second_round(plan: ReportPlan, averaged: Pair | None) -> dict[str, list[Cell]]:
    """Return the runs of the figures: the report's pair, the averaged one and our law's own gains, with their ways."""
    runs: list[tuple[str, str, Pair | None]] = [("report", REPORT_LAW, None), ("ours", plan.law, None)]
    if averaged is not None:
        runs.append(("averaged", REPORT_LAW, averaged))
    return {
        name: [trial(plan, law, f"{plan.starts.scenario(test)} {drives.TRACED}", pair) for test in plan.tests]
        for name, law, pair in runs
    }
