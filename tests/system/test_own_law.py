"""A law of the user in the whole process: it drives the emulated car, its mistakes stop it, and the process lives."""

import asyncio
import json
import os
import subprocess
import sys
import time

import numpy as np
import pytest

from tests.sim.live.emulated import car, running
from tests.system.bench import bench
from tests.system.operated import operated
from wallride.cli import main
from wallride.drivers.vesc.codec import Packet
from wallride.lab import LawError, run
from wallride.new.gap_follower import GapFollower
from wallride.new.pd_follower import PdFollower
from wallride.sim.live.emulate_command import write_settings
from wallride.sim.live.runtime_process import RuntimeProcess

LAW = """import time
from wallride.laws import Guidance

class Law:
    def __init__(self, settings, car):
        self.scans = 0

    def follow(self, scan, state):
        self.scans += 1
        if self.scans > 60:
            {then}
        return Guidance(1.0, 0.0)
"""


def settings(tmp_path, then):
    (tmp_path / "late_law.py").write_text(LAW.format(then=then))
    return "wall_follow.method=late_law:Law", f"process.laws_folder={tmp_path}"


def typed(folder, *arguments, timeout=50):
    return subprocess.run(
        [sys.executable, "-m", "wallride", *arguments],
        capture_output=True, text=True, timeout=timeout, cwd=folder, check=False,
        env={**os.environ, "TERM": "dumb"},
    )  # fmt: skip


@pytest.fixture
def here(tmp_path, monkeypatch, capsys):
    """Return exit code and errors of a command in the test's folder, without a process of its own."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [*sys.path])
    monkeypatch.setattr("wallride.runtime.host.user_module._folders", [])
    for name in ("bad", "late_law"):
        monkeypatch.delitem(sys.modules, name, raising=False)

    def run_here(*arguments):
        return main(arguments), capsys.readouterr().err

    return run_here


@pytest.mark.parametrize(
    ("then", "sentence"),
    [
        ("raise ValueError('lost the wall')", "late_law:Law raised ValueError: lost the wall"),
        ("time.sleep(0.12)", "late_law:Law is too slow"),
        ("raise __import__('asyncio').CancelledError", "late_law:Law raised CancelledError"),
        ("raise KeyboardInterrupt", "late_law:Law raised KeyboardInterrupt"),
    ],
    ids=["raises", "slow", "cancelled", "interrupt"],
)
async def test_a_mistake_brakes_and_the_process_lives_and_tries_again(tmp_path, then, sentence):
    async with bench(tmp_path, *settings(tmp_path, then)) as car:
        await car.until_driving()
        await car.until(lambda: any(sentence in line for line in car.runtime.log), "the sentence in the log")
        failed_s = time.monotonic()
        await car.until(lambda: car.wheel_mps == 0, "standing")
        assert car.first_brake_s(failed_s - 1.0) < failed_s + 0.25
        line = next(line for line in car.runtime.log if sentence in line)
        assert "late_law.py:" in line
        await car.until_driving()  # operator.permit is "always" here: time tries again
        assert car.runtime.exit_code is None


async def test_a_fault_ends_the_permit_and_the_next_permit_tries_again(tmp_path):
    asked = ("operator.permit=required", *settings(tmp_path, "raise ValueError('lost')"))
    async with operated(tmp_path, *asked) as scene:
        car, log = scene.car, lambda words: any(words in line for line in scene.car.runtime.log)
        tries = lambda: sum("trying again: late_law:Law raised" in line for line in car.runtime.log)  # noqa: E731
        await scene.operator("0,,0,0", "0.5,autonomy,0,0", "8,,0,0", "8.5,autonomy,0,0")
        await car.until_driving()
        await car.until(lambda: log("late_law:Law raised ValueError: lost"), "the sentence in the log")
        await car.until(lambda: car.wheel_mps == 0, "standing, with the button still held")
        stood_s, before = time.monotonic(), tries()  # on a slow computer the law fails before the first permit, too
        await car.until(lambda: tries() > before, "another try", 15.0)
        assert time.monotonic() - stood_s > 2.0, "it was tried again without a new permit"
        assert scene.moves_after(stood_s) == []
        await car.until_driving()
        assert car.runtime.exit_code is None


async def test_an_own_law_drives_the_car_of_wallride_emulate_by_the_settings_that_it_wrote(tmp_path):
    (tmp_path / "late_law.py").write_text(LAW.format(then="pass"))
    file = tmp_path / "car.toml"
    async with running(car(tmp_path, world="loop")) as addresses:
        write_settings(file, addresses)  # as config/car.toml, with the gains of ball
        asked = ("wall_follow.method=late_law:Law", "operator.permit=always", "telemetry.enabled=false")
        runtime = RuntimeProcess(file, asked)
        await runtime.start()
        try:
            async with asyncio.timeout(20.0):
                while not any(line.endswith("navigation: late_law:Law") for line in runtime.log):
                    assert runtime.exit_code is None, "\n".join(runtime.log)
                    await asyncio.sleep(0.05)
        finally:
            assert await runtime.stop() == 0


GREEDY = """import asyncio, signal, threading, time
from wallride.laws import Guidance

class Law:
    def __init__(self, settings, car):
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        threading.Thread(target=self.run).start()

    def run(self):
        while True:
            time.sleep(0.1)

    def follow(self, scan, state):
        return Guidance(1.0, 0.0)
"""


async def test_a_law_takes_neither_the_signals_nor_the_exit(tmp_path):
    (tmp_path / "late_law.py").write_text(GREEDY)
    async with bench(tmp_path, "wall_follow.method=late_law:Law", f"process.laws_folder={tmp_path}") as car:
        said = "late_law:Law changed what SIGTERM does, which ends the process ("
        await car.until(lambda: any(said in line for line in car.runtime.log), "the sentence in the log", 15.0)
        assert await car.runtime.stop() == 0
    lines = "\n".join(car.runtime.log)
    assert "late_law:Law runs" in lines
    assert "asked to stop" in lines


async def test_a_law_that_cancels_the_task_it_runs_in_ends_the_drive_with_a_sentence(tmp_path):
    then = "__import__('asyncio').current_task().cancel()"
    async with bench(tmp_path, *settings(tmp_path, then)) as car:
        await car.until_driving()
        await car.until(lambda: car.runtime.exit_code is not None, "exit")
    assert any("the task wall_follow was cancelled while the car drives" in line for line in car.runtime.log)


async def test_a_law_that_never_returns_is_ended_by_the_vescs_own_timeout(tmp_path):
    async with bench(tmp_path, *settings(tmp_path, "while True: pass"), timeout_s=0.15) as car:
        await car.until_driving()
        await car.until(lambda: car.vesc.demand(time.monotonic()).kind != "speed", "the VESC lets go")
        let_go_s = time.monotonic()
        await asyncio.sleep(0.5)
        assert [p for at_s, p in car.motor_commands(let_go_s) if p[0] != Packet.SET_CURRENT_BRAKE] == []


def test_the_example_drives_the_emulated_car_and_its_recording_replays(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    assert typed(tmp_path, "new", "law", "my_laws.py").returncode == 0
    done = typed(
        tmp_path, "sim", "--headless", "--duration", "8", "--json", "-", "--set", "wall_follow.method=my_laws:Follower"
    )
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert summary["method"] == "my_laws:Follower"
    assert summary["distance_m"] > 2.0
    assert not summary["collided"]
    recording = next((tmp_path / "data").rglob("*.mcap"))
    again = typed(tmp_path, "replay", str(recording))
    assert again.returncode == 0, again.stdout
    assert "identical" in again.stdout
    missing = typed("/", "replay", str(recording))
    assert missing.returncode == 2
    assert "its own law cannot be used: there is no my_laws.py in /" in missing.stderr


def test_the_example_is_graded_by_the_lab_in_processes_of_its_own(tmp_path):
    assert typed(tmp_path, "new", "law", "my_laws.py").returncode == 0
    asked = ("lab", "walls", "--method", "my_laws:Follower", "--only", "t1", "--speeds", "1", "--mu", ".8")
    done = typed(tmp_path, *asked, "--side", "left", "--seeds", "2", "--jobs", "2", "--json", "-")
    assert done.returncode == 0, done.stderr
    rows = json.loads(done.stdout)["cells"]
    assert [row["completed"] for row in rows] == [True, True]
    assert all(row["mean_error_m"] < 0.3 for row in rows)


def test_the_lab_says_which_line_of_a_law_has_failed(tmp_path, here):
    settings(tmp_path, "raise ValueError('lost')")
    asked = ("lab", "walls", "--method", "late_law:Law", "--only", "t1", "--speeds", "1", "--mu", ".8")
    code, said = here(*asked, "--side", "left", "--jobs", "1")
    assert code == 1
    assert "wallride: the car stood: late_law:Law raised ValueError: lost (late_law.py:11)" in said


def test_a_simulated_drive_of_a_law_that_fails_ends_with_its_sentence_and_code_1(tmp_path):
    settings(tmp_path, "raise ValueError('lost')")
    asked = ("--set", "wall_follow.method=late_law:Law", "--set", "telemetry.any_port=true", "--json", "told.json")
    done = typed(tmp_path, "sim", "--headless", "--duration", "3", *asked)
    sentence = "late_law:Law raised ValueError: lost (late_law.py:11)"
    assert done.returncode == 1
    assert f"wallride: {sentence}" in done.stderr
    faults = json.loads((tmp_path / "told.json").read_text())["faults"]
    assert {words: times for words, times in faults.items() if "Law" in words} == {sentence: 1}  # a reply may be missed


def test_a_fault_of_a_law_is_told_at_the_end_although_the_car_drives_again(tmp_path):
    once = "if __import__('sys').argv[1] == 'run' and not hasattr(Law, 'failed'): Law.failed = 1; {}['once']"
    settings(tmp_path, once)
    asked = ("--set", "wall_follow.method=late_law:Law", "--set", "operator.permit=always", "--cars", "2")
    done = typed(tmp_path, "sim", "corridor", "--headless", "--duration", "8", *asked, "--json", "told.json")
    assert done.returncode == 1
    for name in ("car1", "car2"):
        assert f"wallride: {name}: late_law:Law raised KeyError: 'once' (late_law.py:11)\n" in done.stderr
    cars = json.loads((tmp_path / "told.json").read_text())["cars"]
    assert all(one["distance_m"] > 3.0 for one in cars.values())


def test_a_law_that_fails_where_the_starts_of_several_cars_are_looked_for_is_named(tmp_path, here):
    settings(tmp_path, "raise ValueError('lost')")
    code, said = here("sim", "--headless", "--set", "wall_follow.method=late_law:Law", "--cars", "2")
    assert code == 1
    assert "wallride: late_law:Law raised ValueError: lost (late_law.py:11); a car alone drove" in said


@pytest.mark.parametrize("command", [["run"], ["check"], ["sim", "--headless"], ["lab", "walls", "--method"]])
def test_a_law_that_cannot_be_loaded_ends_each_command_with_one_sentence(tmp_path, here, command):
    (tmp_path / "bad.py").write_text("class Law:\n    def __init__(self, settings, car): ...\n")
    by_option = command[0] == "lab"
    code, said = here(*command, *(["bad:Law"] if by_option else ["--set", "wall_follow.method=bad:Law"]))
    assert code == 2
    assert "bad.py:1: class Law has no method follow(self, scan, state)" in said
    assert "Traceback" not in said


def test_a_law_whose_constructor_raises_ends_the_start(tmp_path, here):
    (tmp_path / "bad.py").write_text("class Law:\n  def __init__(self, s, car): 1 / 0\n  def follow(self, a, b): ...\n")
    code, said = here("run", "--set", "wall_follow.method=bad:Law")
    assert code == 2
    assert "bad:Law raised ZeroDivisionError: division by zero (bad.py:2)" in said


def test_new_law_overwrites_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "law", "my_laws.py", "--kind", "gap"]) == 0
    before = (tmp_path / "my_laws.py").read_text()
    assert main(["new", "law", "my_laws.py"]) == 2
    assert "my_laws.py: exists already; nothing was written" in capsys.readouterr().err
    assert (tmp_path / "my_laws.py").read_text() == before
    for name in ("my-laws.py", "my_laws.txt", "no/where.py"):
        assert main(["new", "law", name]) == 2
    assert sorted(path.name for path in tmp_path.iterdir()) == ["my_laws.py", "test_my_laws.py"]


def test_the_example_laps_the_loop():
    driven = run("loop", PdFollower, duration_s=18.0, settings={"wall_follow.speed_mps": 2.0})
    assert driven.contact is None
    lap = driven.case.world.lap
    assert lap is not None
    progress_m = np.array([lap.progress_m(x_m, y_m) for x_m, y_m in driven.pose[::10, :2]])
    ahead_m = (np.diff(progress_m) + lap.length_m / 2) % lap.length_m - lap.length_m / 2
    assert ahead_m.sum() >= lap.length_m


def test_the_gap_follower_drives_without_contact():
    driven = run("loop", GapFollower, duration_s=15.0)
    assert driven.contact is None
    assert driven.distance_m > 4.0


def test_a_drive_from_python_takes_settings_and_repeats_bit_by_bit():
    asked = {"wall_follow.side": "right", "wall_follow.own.kp": 2.5}
    first, again = (run("loop", PdFollower, duration_s=2.0, settings=asked) for _ in range(2))
    other = run("loop", PdFollower, duration_s=2.0, settings={"wall_follow.side": "right"})
    assert np.array_equal(first.pose, again.pose)
    assert not np.array_equal(first.pose, other.pose)


def test_a_law_that_fails_in_a_drive_from_python_raises_its_sentence():
    class Fails(PdFollower):
        def follow(self, scan, state):
            raise ValueError("lost")

    with pytest.raises(LawError, match=r"Fails raised ValueError: lost \(tests/system/test_own_law\.py:\d+\)"):
        run("loop", Fails, duration_s=0.1)
