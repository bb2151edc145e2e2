"""`wallride doctor` and `check --devices` as commands, on `wallride emulate` as a process."""

import json
import signal
from contextlib import asynccontextmanager

import pytest

from tests.waiting import until
from wallride.bringup import doctor_options
from wallride.cli import main
from wallride.doctor.findings import EXIT_CODES, Level, as_json, exit_code, fail, line, ok, summary, warn, worst
from wallride.sim.live.runtime_process import WallrideProcess

DEVICES = ["--only", "ports", "--only", "lidar", "--only", "motor"]


@asynccontextmanager
async def emulated(folder, *options):
    """Run `wallride emulate`; yields its settings file."""
    devices = WallrideProcess(["emulate", "--folder", str(folder), "--port", "0", "--duration", "60", *options])
    await devices.start()
    try:
        await until(lambda: sum(text.startswith("--set ") for text in devices.log) >= 2, 30)
        yield folder / "car.toml"
    finally:
        devices.kill(signal.SIGINT)
        assert await devices.wait() == 0


async def answer(*words):
    asking = WallrideProcess(list(words))
    await asking.start()
    code = await asking.wait()
    return code, "\n".join(asking.log)


async def test_the_devices_of_an_emulated_car_are_ok_and_can_be_checked_again(tmp_path):
    async with emulated(tmp_path / "ports", "--lidar", "both") as file:
        code, text = await answer("doctor", str(file), *DEVICES)
        assert (code, "are ok" in text) == (0, True), text
        code, text = await answer("check", "--devices", str(file))
        assert code == 0, text
        code, text = await answer(
            "doctor", str(file), *DEVICES, "--json", "--set", "motor.address=serial:///dev/none-23"
        )
        found = json.loads(text)
        assert (code, found["level"]) == (2, "fail")
        assert {one["subject"] for one in found["findings"] if one["level"] == "fail"} == {"motor port"}


async def test_a_controller_as_it_is_sold_is_told_what_to_set(tmp_path):
    async with emulated(tmp_path / "ports", "--vesc-timeout", "1", "--vesc-brake", "0") as file:
        code, text = await answer("doctor", str(file), *DEVICES)
        assert code == 2
        assert text.count("VESC Tool: App Settings, General: Timeout 150 ms, Timeout Brake Current 10 A") == 2
        code, text = await answer("check", "--devices", str(file))
        assert (code, "5.0 m under power" in text) == (2, True), text


def test_devices_that_are_not_there_are_a_line_each(capsys):
    away = ["lidar.address=tcp://127.0.0.1:1", "motor.address=serial:///dev/nothing-here"]
    assert main(["check", "--devices", *(word for one in away for word in ("--set", one))]) == 2
    lines = [text for text in capsys.readouterr().err.splitlines() if text.startswith("wallride: ")]
    assert len(lines) == 2
    assert "motor.address = serial:///dev/nothing-here: not there now; plug it in" in lines[0]
    assert "connection refused" in lines[1]


def test_wheels_up_needs_a_confirmation(capsys, monkeypatch):
    monkeypatch.setattr("sys.stdin.isatty", lambda: False, raising=False)
    assert main(["doctor", "--wheels-up"]) == 2
    assert "stand" in capsys.readouterr().err


@pytest.mark.parametrize("options", [["--json"], ["--only", "lidar"]])
def test_wheels_up_needs_the_motor_and_a_person(options, capsys, monkeypatch):
    monkeypatch.setattr(doctor_options, "_confirmed", lambda: pytest.fail("it is refused before the question"))
    assert main(["doctor", "--wheels-up", *options]) == 2
    assert "--only motor" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("typed", "begins"),
    [(["wheels up"], True), (["Wheels Up "], True), (["yy", "wheels up"], True), (["y", ""], False), ([""], False)],
)
def test_only_the_words_are_a_confirmation_and_others_are_asked_again(typed, begins, monkeypatch, capsys):
    answers = iter(typed)
    monkeypatch.setattr("builtins.input", lambda _prompt: next(answers))
    assert doctor_options._confirmed() is begins
    assert list(answers) == []
    assert capsys.readouterr().out.count("type the two words wheels up") == len(typed) - 1


def test_what_was_not_confirmed_is_not_blamed_on_the_terminal(monkeypatch, capsys):
    monkeypatch.setattr("sys.stdin.isatty", lambda: True, raising=False)
    monkeypatch.setattr("builtins.input", lambda _prompt: "")
    assert main(["doctor", "--wheels-up"]) == 2
    assert capsys.readouterr().err == "wallride: nothing was turned: --wheels-up needs the confirmation\n"


def test_wrong_settings_are_a_finding_and_the_rest_is_looked_at(tmp_path, capsys):
    file = tmp_path / "car.toml"
    file.write_text("[wall_follow]\nsped_mps = 1\n")
    assert main(["doctor", str(file), "--only", "joystick"]) == 2
    out = capsys.readouterr().out
    assert "did you mean wall_follow.speed_mps" in out
    assert "gamepad" in out


MOTOR_AWAY = "motor.address=serial:///dev/nothing-here"
LIDAR_AWAY = "lidar.address=tcp://127.0.0.1:1"


@pytest.mark.parametrize(
    ("settings", "unknown", "looked_at"),
    [
        (["lidar.driver=nowhere:Lidar", MOTOR_AWAY], {"lidar"}, {"motor port"}),
        (["lidar.driver=hokyo", MOTOR_AWAY], {"lidar"}, {"motor port"}),
        (["lidar.adress=1", MOTOR_AWAY], {"lidar"}, {"motor port"}),
        (["motor.adress=1", LIDAR_AWAY], {"motor"}, {"lidar"}),
        (["motor.adress=1", "lidar.driver=auto"], {"lidar", "motor"}, set()),
        (["motor=1", "lidar.driver=topic", "ros2.enabled=false"], {"lidar", "motor"}, set()),
        (["wall_follow.sped_mps=1", MOTOR_AWAY, LIDAR_AWAY], set(), {"lidar", "motor port"}),
    ],
)
def test_a_device_with_wrong_settings_is_not_looked_at_by_the_defaults(settings, unknown, looked_at, capsys):
    assert main(["doctor", *DEVICES, "--json", *(word for one in settings for word in ("--set", one))]) == 2
    found = json.loads(capsys.readouterr().out)["findings"]
    told = {one["subject"] for one in found if "its settings are wrong" in one["words"]}
    failed = {one["subject"] for one in found if one["level"] == "fail"}
    assert (told, failed) == (unknown, looked_at | {"settings"})


@pytest.mark.parametrize(
    ("findings", "code"),
    [
        ([], 0),
        ([ok("a", "b")], 0),
        ([ok("a", "b"), warn("c", "d", "e")], 1),
        ([fail("a", "b", "c"), warn("c", "d", "e")], 2),
    ],
)
def test_the_exit_code_is_that_of_the_worst(findings, code):
    assert exit_code(findings) == code == EXIT_CODES[worst(findings)]


def test_a_line_names_the_remedy_and_json_has_it_too():
    finding = fail("motor port", "not there", "plug it in")
    assert line(finding).splitlines()[1].strip() == "-> plug it in"
    assert "\n" not in line(ok("motor port", "there"))
    assert json.loads(as_json([finding]))["findings"][0]["remedy"] == "plug it in"
    assert summary([finding]) == "1 to mend before it drives, 0 warnings, 0 ok"
    assert worst([]) is Level.OK
