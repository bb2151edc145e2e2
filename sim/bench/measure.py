"""Measurements: one run of each, as plain values. Times in milliseconds, CPU in cores, memory in MiB."""

import gc
import itertools
import os
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any

from wallride.sim.bench.answers import onsets, pair
from wallride.sim.bench.course import BenchScans, make_course
from wallride.sim.bench.rig import BenchError, Rig, SentScan

_PROC = Path("/proc")
_TICK_HZ = os.sysconf("SC_CLK_TCK")
RATE_HZ = 40.0
ONSET_EVERY = 20
ONSET_LENGTH = 6
RATES_HZ = (100, 200, 300, 400, 500, 600, 700, 800, 900, 1000)
BEAMS = (361, 721, 1081, 2161, 4321)
FAST_STEERING = ("car.steering_rate_radps=50",)
"""Settings for hundreds of scans a second, where the limiter would remove the difference that identifies an answer."""


@dataclass(frozen=True, slots=True)
class Cost:
    """cpu: cores, by thread name. pss_mib: memory, shared pages in proportion. others: cores that others used."""

    cpu: Mapping[str, float]
    pss_mib: float
    threads: int
    others: float

    @property
    def cores(self) -> float:
        """Return the cores of all threads together."""
        return sum(self.cpu.values())


class ProcessMeter:
    """Measures processes from now until `stop`. began_s: when that began (monotonic)."""

    def __init__(self, pids: Sequence[int]) -> None:
        self._pids = pids
        self.began_s = time.monotonic()
        self._threads_s = _threads_s(pids)
        self._machine_s = _machine_s()

    def stop(self) -> Cost:
        """Return the cost since the start."""
        elapsed_s = time.monotonic() - self.began_s
        cpu: dict[str, float] = {}
        for thread, spent_s in _threads_s(self._pids).items():
            name = thread[1]
            cpu[name] = cpu.get(name, 0.0) + (spent_s - self._threads_s.get(thread, 0.0)) / elapsed_s
        others = (_machine_s() - self._machine_s) / elapsed_s - sum(cpu.values())
        pss_kib = sum(_pss_kib(pid) for pid in self._pids)
        threads = sum(len(list((_PROC / str(pid) / "task").iterdir())) for pid in self._pids)
        return Cost({name: used for name, used in cpu.items() if used > 0}, pss_kib / 1024, threads, others)


def _threads_s(pids: Sequence[int]) -> dict[tuple[str, str], float]:
    """Return the CPU time of every thread; ended threads are missing."""
    spent: dict[tuple[str, str], float] = {}
    for pid in pids:
        for task in (_PROC / str(pid) / "task").iterdir():
            name = (task / "comm").read_text().strip()
            spent[task.name, name] = int((task / "schedstat").read_text().split()[0]) / 1e9
    return spent


def _machine_s() -> float:
    """Return the CPU time of all cores together."""
    fields = [int(text) for text in (_PROC / "stat").read_text().splitlines()[0].split()[1:]]
    return (sum(fields[:8]) - fields[3] - fields[4]) / _TICK_HZ


def _pss_kib(pid: int) -> int:
    for line in (_PROC / str(pid) / "smaps_rollup").read_text().splitlines():
        if line.startswith("Pss:"):
            return int(line.split()[1])
    return 0


@dataclass(frozen=True, slots=True)
class MeasurementPlan:
    """Duration of each measurement. settings: of the car, as `--set` takes them."""

    warm_up_s: float = 3.0
    seconds: float = 30.0
    onsets: int = 170
    rate_seconds: float = 4.0
    rates_hz: Sequence[int] = RATES_HZ
    beams: Sequence[int] = BEAMS
    settings: Sequence[str] = ()


SHORT = MeasurementPlan(warm_up_s=1.0, seconds=4.0, onsets=8, rate_seconds=1.0, rates_hz=(100, 400), beams=(361, 1081))


def latency(plan: MeasurementPlan) -> dict[str, Any]:
    """Drive for a while without, then with boards that suddenly stand before the car."""
    course = _course(1081, RATE_HZ)
    with Rig(course, plan.settings) as rig:
        rig.start()
        sent, cost = _driven(rig, plan.warm_up_s, plan.seconds)
        driven = len(rig.commands)
        scares = rig.feed(itertools.islice(_scares(), plan.onsets * ONSET_EVERY), RATE_HZ)
        heard = rig.heard()
        answers, stops = pair(sent, rig.commands[:driven]), onsets(scares, rig.commands)
    if not answers.latency_s:
        raise BenchError("no command ever answered a scan")
    return {
        **answers.figures_ms(),
        "samples_ms": [round(sample_s * 1000, 4) for sample_s in answers.latency_s],
        "unanswered": answers.unanswered,
        "scans": len(sent),
        "others_cores": cost.others,
        "onsets": dict(stops.figures()),
        "stages_us": heard.get("status", {}).get("timings_us"),
        "messages_hz": {name: count / heard["seconds"] for name, count in heard.get("messages", {}).items()},
    }


def _driven(
    rig: Rig, warm_up_s: float, seconds: float, *, begin: Callable[[], None] = lambda: None
) -> tuple[list[SentScan], Cost]:
    """Return the scans that were sent after the warm-up, and the cost of the car meanwhile.

    Without a gap between the two, like the peers' client: a car that waits for a missing scan is cold.
    """
    warming = round(warm_up_s * RATE_HZ)
    meters: list[ProcessMeter] = []

    def scans() -> Iterator[bool]:
        yield from [False] * warming
        begin()
        meters.append(ProcessMeter([rig.process.pid]))
        yield from [False] * round(seconds * RATE_HZ)

    sent = rig.feed(scans(), RATE_HZ)
    return sent[warming:], meters[0].stop()


def cpu(plan: MeasurementPlan) -> dict[str, Any]:
    """Drive at 40 Hz with one subscriber, and measure the cost."""
    with Rig(_course(1081, RATE_HZ), plan.settings) as rig:
        rig.start()
        _, cost = _driven(rig, plan.warm_up_s, plan.seconds)
    return {
        "cores": cost.cores,
        "by_thread": dict(cost.cpu),
        "pss_mib": cost.pss_mib,
        "threads": cost.threads,
        "others_cores": cost.others,
    }


def startup(plan: MeasurementPlan) -> dict[str, Any]:
    """Start the car with the devices present: until the first motor command, and until the first that moves."""
    with Rig(_course(1081, RATE_HZ), plan.settings, subscribers=0) as rig:
        rig.start()
        for _ in range(20):
            rig.feed([False] * 10, RATE_HZ)
            if any(command.moving for command in rig.commands):
                break
        moving = next((command.at_s for command in rig.commands if command.moving), None)
        if moving is None:
            raise BenchError(f"the car did not set off; it said:\n{rig.log}")
        return {
            "first_command_ms": (rig.commands[0].at_s - rig.started_s) * 1000,
            "first_moving_ms": (moving - rig.started_s) * 1000,
        }


def readers(plan: MeasurementPlan) -> dict[str, Any]:
    """Drive without readers, with one reader, with one that stops reading, and with ten."""
    return {
        name: _read_by(plan, count, stops=stops)
        for name, count, stops in (
            ("no reader", 0, False),
            ("one reader", 1, False),
            ("one that stops reading", 1, True),
            ("ten readers", 10, False),
        )
    }


def _read_by(plan: MeasurementPlan, count: int, *, stops: bool) -> dict[str, Any]:
    with Rig(_course(1081, RATE_HZ), plan.settings, subscribers=count) as rig:
        rig.start()
        sent, cost = _driven(
            rig, plan.warm_up_s + 0.5 * count, plan.seconds, begin=rig.stop_reading if stops else lambda: None
        )
        figures = pair(sent, rig.commands).figures_ms()
    if not figures:
        raise BenchError("no command ever answered a scan")
    return {**figures, "cores": cost.cores, "others_cores": cost.others}


def loaded(plan: MeasurementPlan) -> dict[str, Any]:
    """Drive while other processes load every core, scheduled before them as systemd does it."""
    course = _course(1081, RATE_HZ)
    with ExitStack() as stack:
        for _ in range(os.cpu_count() or 1):
            hog = subprocess.Popen([sys.executable, "-c", "while True: pass"])
            stack.callback(hog.communicate)
            stack.callback(hog.kill)
        try:
            rig = stack.enter_context(Rig(course, plan.settings, fifo=True))
        except PermissionError as error:
            raise BenchError("this user may not ask for SCHED_FIFO: run it as root") from error
        rig.start()
        sent, cost = _driven(rig, plan.warm_up_s, plan.seconds)
        answers = pair(sent, rig.commands)
    if not answers.latency_s:
        raise BenchError("no command ever answered a scan")
    return {**answers.figures_ms(), "unanswered": answers.unanswered, "cores": cost.cores, "others_cores": cost.others}


def rates(plan: MeasurementPlan) -> dict[str, Any]:
    """Raise the lidar's rate until scans are lost or p99 exceeds the period; then the cost of more beams."""
    rows = [_at_rate(plan, rate_hz) for rate_hz in plan.rates_hz]
    held = [row["rate_hz"] for row in rows if row["held"]]
    return {
        "highest_held_hz": max(held, default=0),
        "rates": rows,
        "beams": [_with_beams(plan, beams) for beams in plan.beams],
    }


def _at_rate(plan: MeasurementPlan, rate_hz: int) -> dict[str, Any]:
    course = _course(1081, float(rate_hz))
    # with two cores in all, zenoh's own threads would take the only one from the loop for milliseconds
    with Rig(course, [*plan.settings, *FAST_STEERING], every_core=True) as rig:
        rig.start()
        rig.feed([False] * (rate_hz // 2), rate_hz)
        meter = ProcessMeter([rig.process.pid])
        sent = rig.feed([False] * round(plan.rate_seconds * rate_hz), rate_hz)
        cost = meter.stop()
        answers = pair(sent, rig.commands)
        log = _scan_counts(rig)
    lost = log["sent"] - log["answered"]
    reached_hz = (len(sent) - 1) / (sent[-1].at_s - sent[0].at_s)
    p99_ms = answers.figures_ms().get("p99", float("inf"))
    return {
        "rate_hz": rate_hz,
        "reached_hz": reached_hz,
        "lost": lost,
        "held": lost == 0 and p99_ms < 1000 / rate_hz and reached_hz > 0.99 * rate_hz,
        "cores": cost.cores,
        **answers.figures_ms(),
    }


def _with_beams(plan: MeasurementPlan, beams: int) -> dict[str, Any]:
    with Rig(_course(beams, RATE_HZ), plan.settings) as rig:
        rig.start()
        rig.feed([False] * round(RATE_HZ), RATE_HZ)
        meter = ProcessMeter([rig.process.pid])
        sent = rig.feed([False] * round(plan.rate_seconds * RATE_HZ), RATE_HZ)
        cost = meter.stop()
        figures = pair(sent, rig.commands).figures_ms()
    return {"beams": beams, "ms_per_scan": 1000 * cost.cores / RATE_HZ, "cores": cost.cores, **figures}


def _scan_counts(rig: Rig) -> dict[str, int]:
    """Return the number of scans that the lidar sent since it streams, and that the follower answered, by its log."""
    rig.heard()
    rig.stop()
    counts = [line.split("follow")[1].split()[0] for line in rig.log.splitlines() if ": follow " in line]
    return {"sent": rig.scans_sent, "answered": int(counts[-1]) if counts else 0}


def _scares() -> Iterator[bool]:
    """Yield whether the next scan is blocked."""
    while True:
        yield from [False] * (ONSET_EVERY - ONSET_LENGTH)
        yield from [True] * ONSET_LENGTH


@lru_cache(maxsize=2)
def _course(beams: int, rate_hz: float) -> BenchScans:
    course = make_course(beams, rate_hz, scans=800, blocked=(beams, rate_hz) == (1081, RATE_HZ))
    gc.collect()
    return course


def median_of(runs: Sequence[Any]) -> Any:  # noqa: ANN401 - whatever the runs are made of
    """Return one run with the medians of all; other values, and those that only some runs have, are the first run's.

    A boolean is that of most runs, half being no majority. Lists are taken place by place.
    """
    first = runs[0]
    if isinstance(first, bool):
        return sum(map(bool, runs)) * 2 > len(runs)
    if isinstance(first, int | float):
        return statistics.median(run for run in runs if isinstance(run, int | float))
    if isinstance(first, Mapping):
        return {key: median_of([run[key] for run in runs if isinstance(run, Mapping) and key in run]) for key in first}
    if isinstance(first, Sequence) and not isinstance(first, str):
        return [median_of(places) for places in zip(*runs, strict=False)]
    return first
