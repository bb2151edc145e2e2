"""The reference set: every decision of random drives, histories and recordings, for changes that must not change any.

Run: python -m benchmarks.decisions record before.npz   with the code before
     python -m benchmarks.decisions compare before.npz  with the code after

220 drives of the laws (both followers, both safety laws; worlds, sides, speeds, floors, own parts, dirt, obstacles),
90 hand-overs from a human to the autonomy, 90 histories of the whole car (operators, planners, parameters, faults) and
the recordings of a folder, all in virtual time. Of each the numbers and the reason of every decision are kept.
`compare` prints each drive that differs, by how much and from where on; exit code 1 unless all are equal to the bit,
or, with --within, equal up to that and in every reason.
"""

import argparse
import asyncio
import logging
import random
import re
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Final

import numpy as np
import numpy.typing as npt

from benchmarks.hand_overs import HandOver
from benchmarks.hand_overs import decisions as handed_over
from benchmarks.lab.recorded.replay import replay
from benchmarks.lab.recordings import recordings_in
from tests.system.soak.histories import History
from wallride.runtime.arbitration.command import Decision, Output
from wallride.sim.lab.sweep.drive_cell import CellMistakeError, DriveCell, drive_setup, setup_of
from wallride.sim.recordings import RecordingError, load_recording
from wallride.sim.recordings.scans import better_side, is_foreign
from wallride.sim.virtual.virtual_time import run_virtual
from wallride.sim.world.own_parts import OWN_PARTS

DRIVES: Final = 220
HAND_OVERS: Final = 90
HISTORIES: Final = 90
RECORDINGS: Final = Path("..", "shared", "data")
MAX_RECORDINGS: Final = 20
LAWS: Final = ("ball", "ball", "ball", "report", "ball+report", "report+swept")
WORLDS: Final = (
    "corridor", "loop", "l_turn", "u_turn_inner", "curved", "cluttered", "doorway", "dead_end", "track:seed=1",
    "track:seed=2",
)  # fmt: skip


@dataclass(frozen=True, slots=True, eq=False)
class DriveTrace:
    """All decisions of one drive. numbers: shape (n, k), NaN for what there is not. reasons: n texts."""

    numbers: npt.NDArray[np.float64]
    reasons: npt.NDArray[np.str_]

    def difference(self, other: "DriveTrace", within: float) -> str:
        """Return in words how another one differs, "" where it does not. within: allowed for a number."""
        if self.numbers.shape != other.numbers.shape:
            return f"{self.numbers.shape} numbers before, {other.numbers.shape} after"
        with np.errstate(invalid="ignore"):  # infinity less infinity
            apart = np.abs(self.numbers - other.numbers)
        same = (apart <= within) | (self.numbers == other.numbers) | (np.isnan(self.numbers) & np.isnan(other.numbers))
        rows = np.flatnonzero(~same.all(axis=1) | (self.reasons != other.reasons))
        if not rows.size:
            return ""
        first, largest = rows[0], np.max(apart, initial=0.0, where=np.isfinite(apart))
        return (
            f"{rows.size} of {len(self.reasons)} decisions, by up to {largest:.3g}, from the {first}th on:"
            f" {self.numbers[first].tolist()} {self.reasons[first]!r} before,"
            f" {other.numbers[first].tolist()} {other.reasons[first]!r} after"
        )


def traces(folder: Path, first: int = 0) -> Iterator[tuple[str, DriveTrace]]:
    """Yield the name and the decisions of each drive; two at a time. first: seed of the first of each kind."""
    jobs = [
        *(("drive", str(seed)) for seed in range(first, first + DRIVES)),
        *(("hand-over", str(seed)) for seed in range(first, first + HAND_OVERS)),
        *(("history", str(seed)) for seed in range(first, first + HISTORIES)),
        *(("recording", str(path)) for path in _recordings(folder)),
    ]
    with ProcessPoolExecutor(2, initializer=logging.disable, initargs=(logging.CRITICAL,)) as pool:
        for (kind, which), trace in zip(jobs, pool.map(trace_of, jobs), strict=True):
            yield f"{kind} {which.removeprefix(str(folder))}", trace


def trace_of(job: tuple[str, str]) -> DriveTrace:
    """Return the decisions of one drive. job: its kind, and its seed or file."""
    kind, which = job
    if kind == "recording":
        return _recorded(Path(which))
    seed = int(which)
    if kind == "hand-over":
        return _as_trace([_row(one) for one in handed_over(HandOver.random(seed), asked=False)])
    return _driven(seed) if kind == "drive" else run_virtual(_told(seed))


def random_cell(seed: int) -> DriveCell:
    """Return the drive of a seed."""
    rng = random.Random(seed)
    values: dict[str, Any] = {
        "world": rng.choice(WORLDS), "law": rng.choice(LAWS), "side": rng.choice(("left", "right")), "seed": seed,
        "duration_s": 6.0, "start.toward_deg": round(rng.uniform(-15, 15), 1),
        "wall_follow.speed_mps": round(rng.uniform(0.8, 4.0), 2), "car.max_speed_mps": 4.0,
        "wall_follow.desired_distance_m": round(rng.uniform(0.5, 1.1), 2),
        "vehicle.grip_mu": round(rng.uniform(0.4, 1.0), 2), "lidar.noise_std_m": rng.choice((0.005, 0.01, 0.02)),
        "lidar.outlier_share": rng.choice((0.0, 0.02)),
    }  # fmt: skip
    if rng.random() < 0.2:
        values["lidar.own_parts"] = rng.choice(tuple(OWN_PARTS))
    if rng.random() < 0.2:
        values["lidar.dirty_sectors"] = ((round(rng.uniform(-90, 80), 1), round(rng.uniform(82, 95), 1), 0.05),)
    if rng.random() < 0.4:
        kind = rng.choice(("box", "pole", "person"))
        values["obstacles"] = (f"{kind} ahead={rng.uniform(0.8, 4):.2f} after={rng.uniform(1, 4):.2f}",)
    return DriveCell.of(values)


def _driven(seed: int) -> DriveTrace:
    cell = random_cell(seed)
    try:
        run = drive_setup(setup_of(cell))
    except CellMistakeError as error:
        return _as_trace([((0.0,), str(error))])
    numbers = np.column_stack([run.time_s, run.pose, run.speed_mps, run.wish, run.command, run.capped])
    return DriveTrace(numbers, np.array(run.reasons))


def _row(decision: Decision) -> tuple[tuple[float, ...], str]:
    return tuple(_numbers_of(decision)), f"{decision.winner} {decision.driver} {decision.reason}"


def _numbers_of(decision: Decision) -> Iterator[float]:
    for value in (decision.speed_mps, decision.steering_rad, decision.brake_mps2, decision.measure):
        yield np.nan if value is None else float(value)


async def _told(seed: int) -> DriveTrace:
    history, rows = History(seed), []
    heard: Callable[[Output], None] = history.car.telemetry.on_output

    def keep(output: Output) -> None:
        numbers, reason = _row(output.decision)
        # A session is named by chance, in every run by another name.
        said = re.sub(r"\b[0-9a-f]{8,}\b", "ID", f"{output.delivered} {reason}")
        rows.append(((output.stamp_s, output.drive.speed_mps, output.drive.steering_rad, *numbers), said))
        heard(output)

    setattr(history.car.telemetry, "on_output", keep)  # noqa: B010 - it listens in telemetry's place
    await history.run()
    await asyncio.sleep(0)
    return _as_trace(rows)


def _recordings(folder: Path) -> list[Path]:
    """Return the files that can be judged."""
    found: list[Path] = []
    for path in map(Path, recordings_in(folder) if folder.is_dir() else ()):
        try:
            recording = load_recording(path)
        except RecordingError:
            continue
        if not is_foreign(recording) and len(recording) > 1:
            found.append(path)
    return found[:: max(1, len(found) // MAX_RECORDINGS)][:MAX_RECORDINGS]


def _recorded(file: Path) -> DriveTrace:
    recording = load_recording(file)
    rows = []
    for one in replay(recording, better_side(recording)).judged:
        verdict = one.verdict
        numbers = one.scan.stamp_s, one.distance_m, verdict.forward_mps, verdict.reverse_mps, one.motor.speed_mps
        rows.append((numbers, verdict.reason))
    return _as_trace(rows)


def _as_trace(rows: Sequence[tuple[tuple[float, ...], str]]) -> DriveTrace:
    numbers = np.array([numbers for numbers, _ in rows], np.float64)
    return DriveTrace(numbers.reshape(len(rows), -1), np.array([reason for _, reason in rows], np.str_))


def _record(file: Path, folder: Path, first: int) -> int:
    kept: dict[str, Any] = {}
    for name, trace in traces(folder, first):
        kept[f"{name}/numbers"], kept[f"{name}/reasons"] = trace.numbers, trace.reasons
    np.savez_compressed(file, **kept)
    print(f"{len(kept) // 2} drives, {sum(map(len, kept.values())) // 2} decisions in {file}")
    return 0


def _compare(file: Path, folder: Path, first: int, within: float) -> int:
    before, differ, count, names = np.load(file), 0, 0, set()
    for name, trace in traces(folder, first):
        count += len(trace.reasons)
        names.add(name)
        if f"{name}/numbers" not in before:
            words = "is not in the file"
        else:
            words = DriveTrace(before[f"{name}/numbers"], before[f"{name}/reasons"]).difference(trace, within)
        if words:
            differ += 1
            print(f"{name}: {words}")
    if missing := {key.rpartition("/")[0] for key in before.files} - names:
        print(f"only in the file: {', '.join(sorted(missing))}")
    print(f"{differ} of {len(names)} drives differ, {count} decisions compared")
    return 1 if differ or missing else 0


def main(arguments: Sequence[str] | None = None) -> int:
    """Record the reference set, or compare with one."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("file", type=Path)
    parser.add_argument("--recordings", type=Path, default=RECORDINGS, help="folder of recordings")
    parser.add_argument("--seed", type=int, default=0, help="the first one of each kind; the same for both")
    parser.add_argument("--within", type=float, default=0.0, help="difference of a number that is allowed")
    options = parser.parse_args(arguments)
    logging.disable(logging.CRITICAL)
    if options.what == "record":
        return _record(options.file, options.recordings, options.seed)
    return _compare(options.file, options.recordings, options.seed, options.within)


if __name__ == "__main__":
    raise SystemExit(main())
