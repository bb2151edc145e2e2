"""Measurements: one run of each, as plain values. Times in milliseconds, CPU in cores, memory in MiB."""

import gc
import itertools
import os
import subprocess
import sys
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from wallride.sim.bench.answers import onsets, pair
from wallride.sim.bench.cost import Cost, ProcessMeter
from wallride.sim.bench.course import BenchScans, make_course
from wallride.sim.bench.rig import BenchError, Rig, SentScan

RATE_HZ = 40.0
ONSET_EVERY = 20
ONSET_LENGTH = 6
RATES_HZ = (100, 200, 300, 400, 500, 600, 700, 800, 900, 1000)
BEAMS = (361, 721, 1081, 2161, 4321)
FAST_STEERING = ("car.steering_rate_radps=50",)
"""Settings for hundreds of scans a second, where the limiter would remove the difference that identifies an answer."""


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
        meters.append(ProcessMeter.of(rig.process.pid))
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
        meter = ProcessMeter.of(rig.process.pid)
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
        meter = ProcessMeter.of(rig.process.pid)
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
