"""All drives of the report: gain tables, trials with safety and sudden obstacles, for its law and for one of ours."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache

from runtime.parameters.catalogue import catalogue
from runtime.settings.tree import Settings
from sim.car.vehicle_settings import VehicleSettings
from sim.lab import laws
from sim.lab.cell import Cell
from sim.lab.courses.sudden import PLACES
from sim.lab.report import trials
from sim.lab.safety import DISTANCES_M
from sim.scenario.conditions import put_on_top
from sim.virtual.closed_loop import ROUGH_BEAMS
from sim.world.beams import LidarSettings
from sim.world.pose import Side

REPORT_KP, REPORT_KD = 1.5, 1.6
"""The report's final pair, the average of its optima."""
GRID_KP, GRID_KD = (0.5, 1.0, 1.5, 2.0), (0.8, 1.6, 2.4)
"""The 12 pairs of a gain table. The references give their number and the final pair, not the pairs."""
FACTORS_KP, FACTORS_KD = (0.5, 0.75, 1.0, 1.5), (0.7, 1.0, 1.4)
"""The 12 pairs of another law, as multiples of its default gains."""
SPEEDS_MPS = (1.0, 2.0, 3.0, 4.0)
BOX = "0.3-centred"
REPORT_LAW = "report+report"
ALONE_LAW = "report+none"
CLEAN_TABLE = f"{ALONE_LAW} {trials.CLEAN}"
"""The gain table of the report's follower alone, with a lidar without noise."""
GAIN_KEYS = (("wall_follow.kp", "wall_follow.kd"), ("wall_follow.own.kp", "wall_follow.own.kd"))
Pair = tuple[float, float]


@dataclass(frozen=True, slots=True)
class ReportPlan:
    """Choice of the report. law: compared with the report's. settings: KEY=VALUE texts by law, for both laws.

    conditions: of the simulated car, as `sim.lab.cell.Cell` has them.
    """

    law: str = "ball+swept"
    report_settings: tuple[str, ...] = ()
    law_settings: tuple[str, ...] = ()
    mu: float = 0.8
    own_parts: str = "none"
    seed: int = 1000
    speeds_mps: tuple[float, ...] = SPEEDS_MPS
    tests: tuple[str, ...] = tuple(trials.TESTS)
    conditions: tuple[str, ...] = ()

    def car_and_lidar(self) -> tuple[VehicleSettings, LidarSettings]:
        """Return the simulated car and its lidar."""
        return put_on_top(self.conditions, VehicleSettings(grip_mu=self.mu), ROUGH_BEAMS)

    def noise_words(self) -> str:
        """Return the lidar's noise."""
        _, lidar = self.car_and_lidar()
        return f"{1000 * lidar.noise_std_m:g} mm of noise and {100 * lidar.outlier_share:g} % outliers"

    def assignments(self, law: str) -> tuple[str, ...]:
        """Return the settings of the cars of a law."""
        return self.report_settings if law.startswith("report+") else self.law_settings

    def settings(self, law: str) -> Settings:
        """Return the settings of the cars of a law; SettingsError for a wrong one."""
        return _settings(law, self.assignments(law))

    def gain_keys(self, law: str) -> Pair | tuple[str, str] | None:
        """Return the names of the two gains of a law; None where it does not have both."""
        dumped = self.settings(law).model_dump()
        return next((keys for keys in GAIN_KEYS if all(_value(dumped, key) is not None for key in keys)), None)

    def pairs(self, law: str) -> list[Pair]:
        """Return the pairs (Kp, Kd) of a gain table; a gain that the settings fix is not varied."""
        keys = self.gain_keys(law)
        if keys is None:
            return []
        dumped = self.settings(law).model_dump()
        present = tuple(float(_value(dumped, str(key)) or 0.0) for key in keys)
        grids: list[tuple[float, ...]] = [GRID_KP, GRID_KD]
        if not law.startswith("report+"):
            known = catalogue(self.settings(law))
            highest = [known[str(key)].highest for key in keys]
            grids = [
                tuple(round(min(gain * factor, math.inf if top is None else top), 3) for factor in factors)
                for gain, top, factors in zip(present, highest, (FACTORS_KP, FACTORS_KD), strict=True)
            ]
        fixed = [any(text.partition("=")[0].strip() == key for text in self.assignments(law)) for key in keys]
        kps, kds = ((value,) if one else grid for value, one, grid in zip(present, fixed, grids, strict=True))
        return [(kp, kd) for kp in kps for kd in kds]


def _value(dumped: Mapping[str, object], key: str) -> float | None:
    value: object = dumped
    for part in key.split("."):
        value = value.get(part) if isinstance(value, Mapping) else None
    return float(value) if isinstance(value, int | float) else None


@lru_cache(maxsize=16)
def _settings(law: str, assignments: tuple[str, ...]) -> Settings:
    return laws.settings_of(law, "left", 1.0, 1.0, assignments)


def trial(plan: ReportPlan, law: str, test: str, pair: Pair | None = None, speed_mps: float | None = None) -> Cell:
    """Return one test. pair: the gains, None for the law's own. speed_mps: None for the settings'."""
    chosen = plan.settings(law).wall_follow
    settings = plan.assignments(law)
    keys = plan.gain_keys(law)
    if pair is not None and keys is not None:
        settings = (*settings, *(f"{key}={gain:g}" for key, gain in zip(keys, pair, strict=True)))
    speed_mps = chosen.speed_mps if speed_mps is None else speed_mps
    settings = (*settings, f"wall_follow.speed_mps={speed_mps:g}")
    return Cell(
        trials.NAME, test, law, speed_mps, plan.mu, chosen.side, plan.seed, chosen.desired_distance_m, plan.own_parts,
        settings, plan.conditions,
    )  # fmt: skip


def gain_tables(plan: ReportPlan) -> dict[str, str]:
    """Return the law of each gain table, by the table's name."""
    return {CLEAN_TABLE: ALONE_LAW} | {law: law for law in (ALONE_LAW, REPORT_LAW, plan.law) if plan.pairs(law)}


def gain_table(plan: ReportPlan, name: str) -> list[Cell]:
    """Return the runs of one gain table: every pair in every test."""
    law, _, lidar = name.partition(" ")
    return [trial(plan, law, f"{test} {lidar}".strip(), pair) for pair in plan.pairs(law) for test in plan.tests]


def safety_trials(plan: ReportPlan, law: str) -> list[Cell]:
    """Return the wall-following trials with safety: every test at every speed, with the law's own gains."""
    return [trial(plan, law, test, speed_mps=speed_mps) for test in plan.tests for speed_mps in plan.speeds_mps]


def obstacles(plan: ReportPlan, law: str, driver: str) -> list[Cell]:
    """Return the 28 obstacles. driver: "blind" drives straight on, "follower" is the law's own."""
    side: Side = plan.settings(law).wall_follow.side
    place = tuple(PLACES)[-1]
    return [
        Cell(
            "safety",
            f"{ahead_m:.1f} m" if driver == "blind" else f"{driver} {place} {BOX} {ahead_m:.1f}m",
            law, speed_mps, plan.mu, side, plan.seed, 1.0, plan.own_parts,
            (*plan.assignments(law), f"wall_follow.speed_mps={speed_mps:g}"), plan.conditions,
        )
        for ahead_m in DISTANCES_M
        for speed_mps in plan.speeds_mps
    ]  # fmt: skip


def first_round(plan: ReportPlan) -> dict[str, list[Cell]]:
    """Return all runs that depend on no result, by the name of their table."""
    ours = plan.law
    tables = {f"gains {name}": gain_table(plan, name) for name in gain_tables(plan)}
    tables |= {f"trials {law}": safety_trials(plan, law) for law in (REPORT_LAW, ours)}
    for law in (REPORT_LAW, ours):
        tables |= {f"obstacles {law} {driver}": obstacles(plan, law, driver) for driver in ("blind", "follower")}
    return tables


def second_round(plan: ReportPlan, averaged: Pair | None) -> dict[str, list[Cell]]:
    """Return the runs of the figures: the report's pair, the averaged one and our law's own gains, with their ways."""
    runs: list[tuple[str, str, Pair | None]] = [("report", REPORT_LAW, None), ("ours", plan.law, None)]
    if averaged is not None:
        runs.append(("averaged", REPORT_LAW, averaged))
    return {
        name: [trial(plan, law, f"{test} {trials.TRACED}", pair) for test in plan.tests] for name, law, pair in runs
    }


def names_of(plan: ReportPlan) -> Sequence[str]:
    """Return the full names of the laws compared."""
    return [REPORT_LAW, plan.law]
