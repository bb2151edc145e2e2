"""`wallride bench`: runs a measurement several times, prints the medians, writes JSON and pictures."""

import argparse
import json
import os
import platform
import sys
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

from wallride.runtime.host.output_files import write_answer
from wallride.sim.bench import measure
from wallride.sim.bench.measure import median_of
from wallride.sim.bench.rig import BenchError

Measurement = Callable[[measure.MeasurementPlan], dict[str, Any]]
MEASUREMENTS: Final[Mapping[str, Measurement]] = {
    "latency": measure.latency,
    "cpu": measure.cpu,
    "startup": measure.startup,
    "rates": measure.rates,
    "readers": measure.readers,
    "loaded": measure.loaded,
}
FAILED: Final = 1


def run(options: argparse.Namespace) -> int:
    """Measure; exit code 1 for a defect, never because of a time."""
    plan = replace(measure.SHORT if options.short else measure.MeasurementPlan(), settings=tuple(options.assignments))
    count = options.runs or (1 if options.short else 3)
    runs: list[dict[str, Any]] = []
    try:
        for _ in range(count):
            runs.append(MEASUREMENTS[options.measurement](plan))
            _say(f"run {len(runs)} of {count}, load {os.getloadavg()[0]:.1f}")
    except BenchError as error:
        print(f"wallride bench: {error}", file=sys.stderr)  # noqa: T201 - this is the command line
        return FAILED
    samples_ms = [sample for one in runs for sample in one.pop("samples_ms", ())]
    medians = median_of(runs)
    if options.measurement == "latency":  # a median would hide a single slipped one
        medians["onsets"] |= {name: sum(one["onsets"][name] for one in runs) for name in ("onsets", "slipped")}
    if options.json != "-":
        for line in TABLES[options.measurement](medians):
            print(line)  # noqa: T201
    document = {"measurement": options.measurement, **machine(), "medians": medians, "runs": runs}
    write_answer(json.dumps(document, indent=2) + "\n", options.json)
    if options.plot is not None and samples_ms:
        from wallride.sim.bench.picture import histogram

        histogram(options.plot / "latency.png", "scan bytes to motor bytes", {"wallride": samples_ms})
    return FAILED if options.measurement == "latency" and medians["onsets"]["slipped"] else 0


def machine() -> dict[str, Any]:
    """Return the machine of the measurement, and its load."""
    return {"python": platform.python_version(), "cores": os.cpu_count(), "load": list(os.getloadavg())}


def _latency_lines(medians: Mapping[str, Any]) -> list[str]:
    onset = medians["onsets"]
    seen = (
        f"{medians['unanswered']:g} of {medians['scans']:g} scans without an answer;"
        f" moving commands from a blocked scan: {onset['slipped']:g} in {onset['onsets']:g} onsets;"
        f" others used {medians['others_cores']:.2f} cores"
    )
    return [
        f"{'ms':<28}{'p50':>8}{'p99':>8}{'p99.9':>8}{'max':>8}",
        _row("scan to the answer to it", medians, ""),
        _row("scan to any command", medians, "any_"),
        _row("blocked scan to a stop", onset, "") if "p50" in onset else "no stop was seen",
        seen,
        *_stage_lines(medians.get("stages_us") or {}),
    ]


def _stage_lines(stages_us: Mapping[str, Any]) -> list[str]:
    rows = {name: row for name, row in stages_us.items() if isinstance(row, Mapping)}
    if not rows:
        return []
    title = f"{'us, inside the process':<28}{'p50':>8}{'p99':>8}{'p99.9':>8}{'max':>8}"
    columns = ("p50", "p99", "p99_9", "max")
    return [title, *(f"{name:<28}" + "".join(f"{row[c]:8.0f}" for c in columns) for name, row in rows.items())]


def _cpu_lines(medians: Mapping[str, Any]) -> list[str]:
    threads = ", ".join(f"{name} {used:.3f}" for name, used in medians["by_thread"].items() if used >= 0.0005)
    memory = f"PSS {medians['pss_mib']:.1f} MiB, {medians['threads']:g} threads"
    return [f"{medians['cores']:.4f} cores ({threads}), {memory}; others used {medians['others_cores']:.2f} cores"]


def _startup_lines(medians: Mapping[str, Any]) -> list[str]:
    first, moving = medians["first_command_ms"], medians["first_moving_ms"]
    return [f"process start to the first motor command {first:.0f} ms, to the first that moves {moving:.0f} ms"]


def _rates_lines(medians: Mapping[str, Any]) -> list[str]:
    rows = [f"{'Hz':>6}{'lost':>7}{'p50 ms':>9}{'p99 ms':>9}{'cores':>8}  held"]
    for row in medians["rates"]:
        figures = f"{row['lost']:7.0f}{row.get('p50', 0):9.2f}{row.get('p99', 0):9.2f}{row['cores']:8.3f}"
        rows.append(f"{row['rate_hz']:6.0f}{figures}  {'yes' if row['held'] else 'no'}")
    rows.append(f"highest rate held: {medians['highest_held_hz']:g} Hz")
    rows.append(f"{'beams':>6}{'ms CPU per scan':>17}{'p50 ms':>9}{'p99 ms':>9}")
    rows += [
        f"{row['beams']:6.0f}{row['ms_per_scan']:17.3f}{row.get('p50', 0):9.2f}{row.get('p99', 0):9.2f}"
        for row in medians["beams"]
    ]
    return rows


def _loaded_lines(medians: Mapping[str, Any]) -> list[str]:
    rows = [f"{'ms, others want every core':<28}{'p50':>8}{'p99':>8}{'p99.9':>8}{'max':>8}"]
    said = f"{medians['unanswered']:g} unanswered; {medians['cores']:.3f} cores, others {medians['others_cores']:.2f}"
    return [*rows, _row("scan to the answer to it", medians, ""), said]


def _reader_lines(medians: Mapping[str, Any]) -> list[str]:
    rows = [f"{'scan to the answer to it, ms':<28}{'p50':>8}{'p99':>8}{'p99.9':>8}{'max':>8}{'cores':>8}"]
    return rows + [_row(name, figures, "") + f"{figures['cores']:8.3f}" for name, figures in medians.items()]


TABLES: Final[Mapping[str, Callable[[Mapping[str, Any]], list[str]]]] = {
    "latency": _latency_lines,
    "cpu": _cpu_lines,
    "startup": _startup_lines,
    "rates": _rates_lines,
    "readers": _reader_lines,
    "loaded": _loaded_lines,
}


def _row(name: str, figures: Mapping[str, Any], prefix: str) -> str:
    return f"{name:<28}" + "".join(f"{figures[prefix + column]:8.3f}" for column in ("p50", "p99", "p99_9", "max"))


def _say(text: str) -> None:
    print(text, file=sys.stderr)  # noqa: T201 - progress
