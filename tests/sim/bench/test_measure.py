"""The measurements on the real process, as short as they can be: what they see, never how fast it was."""

import json
import os
import subprocess
import sys
import time
from dataclasses import replace
from pathlib import Path

import pytest

from tests.typed import typed
from wallride.sim.bench import measure
from wallride.sim.bench.course import make_course
from wallride.sim.bench.rig import BenchError, Rig

BRIEF = replace(measure.SHORT, warm_up_s=0.5, seconds=1.5, onsets=2, rate_seconds=0.5, rates_hz=(50,), beams=(4321,))


def test_every_scan_is_answered_and_a_board_stops_the_car():
    found = measure.latency(BRIEF)
    assert found["unanswered"] <= 0.1 * found["scans"]
    assert 0 < found["p50"] < found["p99"]
    assert found["onsets"]["onsets"] >= 1
    assert found["onsets"]["slipped"] == 0
    assert found["messages_hz"]["scan"] > 5
    assert {"read", "decode", "safety", "follow", "mux", "write", "scan_to_motor"} <= found["stages_us"].keys()


def test_cost_names_the_threads():
    found = measure.cpu(BRIEF)
    assert 0 < max(found["by_thread"].values()) <= found["cores"] < 2
    assert found["pss_mib"] > 10


def test_a_start_ends_with_a_moving_car():
    found = measure.startup(BRIEF)
    assert 0 < found["first_command_ms"] <= found["first_moving_ms"]


def test_long_scans_are_driven_by_too():
    found = measure.rates(BRIEF)
    assert [row["beams"] for row in found["beams"]] == [4321]
    assert all(row["p50"] > 0 for row in found["beams"])
    assert found["rates"][0]["lost"] < 0.5 * 50


def test_every_reader_is_there_and_the_car_answers_all_the_same():
    found = measure.readers(BRIEF)
    assert list(found) == ["no reader", "one reader", "one that stops reading", "ten readers"]
    assert all(0 < figures["p50"] <= figures["max"] for figures in found.values())


def test_it_answers_while_others_want_every_core():
    try:
        found = measure.loaded(BRIEF)
    except BenchError as error:
        if "root" not in str(error):
            raise
        pytest.skip("SCHED_FIFO needs root")
    assert 0 < found["p50"] <= found["p99"]
    assert os.sched_getscheduler(0) == os.SCHED_OTHER


def test_the_car_does_not_outlive_a_bench_that_was_killed():
    course = "from wallride.sim.bench.course import make_course; course = make_course(scans=2, blocked=False)"
    rig = "from wallride.sim.bench.rig import Rig; r = Rig(course).__enter__(); print(r.process.pid, flush=True)"
    bench = subprocess.Popen(
        [sys.executable, "-c", f"import time; {course}; {rig}; time.sleep(60)"], stdout=subprocess.PIPE, text=True
    )
    assert bench.stdout is not None
    pid = int(bench.stdout.readline())
    bench.kill()
    bench.communicate()
    give_up_s = time.monotonic() + 10
    while Path(f"/proc/{pid}/stat").exists() and "wallride" in Path(f"/proc/{pid}/cmdline").read_text():
        assert time.monotonic() < give_up_s
        time.sleep(0.05)


def test_settings_that_the_car_refuses_are_said():
    course = make_course(scans=2, blocked=False)
    with Rig(course, ["mux.tick_hz=nonsense"]) as rig, pytest.raises(BenchError, match="tick_hz"):
        rig.start()


@pytest.mark.parametrize("measurement", ["latency", "cpu", "startup", "rates", "readers"])
def test_the_command_prints_medians_and_writes_json(measurement, tmp_path, capsys, monkeypatch):
    runs = iter(
        ({"latency": LATENCY, "cpu": CPU, "startup": STARTUP, "rates": RATES, "readers": READERS}[measurement],) * 2
    )
    monkeypatch.setitem(_measurements(), measurement, lambda _plan: json.loads(json.dumps(next(runs))))
    file = tmp_path / "bench.json"
    assert _run(measurement, "--runs", "2", "--json", str(file)) == 0
    document = json.loads(file.read_text())
    assert (document["measurement"], len(document["runs"])) == (measurement, 2)
    assert "nan" not in capsys.readouterr().out


def test_a_slipped_command_fails_the_benchmark(monkeypatch):
    slipped = {**LATENCY, "onsets": {"onsets": 9, "slipped": 1}}
    monkeypatch.setitem(_measurements(), "latency", lambda _plan: dict(slipped))
    assert _run("latency", "--runs", "1") == 1


def _measurements():
    from wallride.sim.bench import command

    return command.MEASUREMENTS


def _run(*arguments):
    options = typed("bench", *arguments)
    return options.run(options)


TIMES = {"p50": 1.0, "p99": 2.0, "p99_9": 3.0, "max": 4.0}
LATENCY = {
    **TIMES, **{f"any_{name}": ms for name, ms in TIMES.items()},
    "samples_ms": [1.0, 2.0], "unanswered": 0, "scans": 2,
    "others_cores": 0.5, "onsets": {"onsets": 3, "slipped": 0, **TIMES},
    "stages_us": {"read": TIMES, "missed_ticks": 0},
}  # fmt: skip
CPU = {"cores": 0.05, "by_thread": {"python": 0.05}, "pss_mib": 40.0, "threads": 16, "others_cores": 0.5}
STARTUP = {"first_command_ms": 400.0, "first_moving_ms": 600.0}
READERS = {"no reader": {**TIMES, "cores": 0.1, "others_cores": 0.0}}
RATES = {
    "highest_held_hz": 100, "rates": [{"rate_hz": 100, "lost": 0, "held": True, "cores": 0.1, **TIMES}],
    "beams": [{"beams": 361, "ms_per_scan": 1.0, **TIMES}],
}  # fmt: skip
