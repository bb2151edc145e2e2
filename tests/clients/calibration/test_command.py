"""What `wallride calibrate` refuses, asks and writes."""

from types import SimpleNamespace

import pytest

from wallride.cli import build_parser, main
from wallride.clients.calibration import command
from wallride.clients.calibration.current_values import current_values
from wallride.clients.calibration.steps import OUTLINE_WORDS, CalibrationProgress, driven_steps
from wallride.clients.calibration.ways import CalibrationError
from wallride.clients.teleop import terminal
from wallride.runtime.calibration.proposals import Proposal
from wallride.runtime.parameters.catalogue import values
from wallride.runtime.settings.tree import load_settings

NEW = Proposal("car.wheelbase_m", 0.25, 0.331, "0.330 to 0.332")
KEPT = Proposal("lidar.yaw_rad", 0.0, None, "not identified: no bends")


FILE = "[car]\nwheelbase_m = 0.25\n"


class SettingsOf:
    def __init__(self, known, described):
        self.known, self.described = known, described

    def __getitem__(self, name):
        return self.known[name]

    def describe(self):
        return self.described


def car_with(*, simulated=False, wheelbase_m=0.25):
    settings = SettingsOf({"recording.simulated": simulated}, {"car.wheelbase_m": {"value": wheelbase_m}})
    return SimpleNamespace(name="car1", parameters=settings)


def test_no_key_is_held_for_a_real_car():
    with pytest.raises(CalibrationError, match="simulated and emulated cars only"):
        command.check_yes(given=True, simulated=False)
    command.check_yes(given=True, simulated=True)


def test_without_a_terminal_there_is_no_deadman(monkeypatch):
    monkeypatch.setattr(terminal, "is_there", lambda: False)
    with pytest.raises(CalibrationError, match="terminal"):
        command.check_yes(given=False, simulated=False)


def test_a_bad_address_is_named_as_the_command_line_calls_it(car_toml, capsys):
    assert main(["calibrate", "--config", str(car_toml), "--connect", "bad::x"]) == 2
    assert "wallride: --connect bad::x: write tcp/HOST:PORT" in capsys.readouterr().err


def test_another_car_s_file_is_refused(car_toml):
    assert current_values(car_with(), car_toml) == {"car.wheelbase_m": 0.25}
    with pytest.raises(CalibrationError, match=r"drives with 0\.33"):
        current_values(car_with(wheelbase_m=0.33), car_toml)


def test_a_car_without_a_tachometer_is_refused_before_it_moves(car_toml):
    car = car_with()
    pulses = {name for name in values(load_settings(None, ["motor.driver=maestro"])) if name.startswith("motor.")}
    car.parameters.described.update({name: {"value": 1.0} for name in pulses})
    with pytest.raises(CalibrationError, match=r"no tachometer.*systemctl stop"):
        current_values(car, car_toml)


def test_only_what_is_accepted_is_written(car_toml, monkeypatch, capsys):
    monkeypatch.setattr("builtins.input", lambda _text: "n")
    assert command._write(car_toml, [NEW], yes=False) == 0
    assert load_settings(car_toml).car.wheelbase_m == 0.25
    monkeypatch.setattr("builtins.input", lambda _text: "y")
    command._write(car_toml, [NEW], yes=False)
    assert load_settings(car_toml).car.wheelbase_m == 0.331
    capsys.readouterr()
    assert main(["calibrate", "--undo", "--config", str(car_toml)]) == 0
    assert "0.331 -> 0.25" in capsys.readouterr().out
    assert load_settings(car_toml).car.wheelbase_m == 0.25
    assert main(["calibrate", "--undo", "--config", str(car_toml)]) == 2
    assert "nothing to undo" in capsys.readouterr().err


def test_a_file_that_may_not_be_written_is_said_before_anything_is_driven(car_toml, monkeypatch, capsys):
    monkeypatch.setattr("os.access", lambda path, _mode: path != car_toml.parent)
    monkeypatch.setattr(command, "RemoteCar", lambda *_, **__: pytest.fail("it goes on to drive"))
    assert main(["calibrate", "--config", str(car_toml)]) == 2
    assert "use sudo" in capsys.readouterr().err


def test_it_is_said_when_nothing_is_written(car_toml, monkeypatch, capsys):
    monkeypatch.setattr("builtins.input", lambda _text: "")
    command._write(car_toml, [NEW], yes=False)
    assert "nothing was written: the car drives as before" in capsys.readouterr().out
    command._write(car_toml, [], yes=False)
    assert "as before" in capsys.readouterr().out


def test_a_step_that_fails_with_yes_names_itself_and_that_nothing_was_written():
    class Link:
        def __init__(self, *_):
            pass

        def __enter__(self):
            return self

        def __exit__(self, *_):
            pass

        def forget(self):
            raise CalibrationError("something is 1.20 m ahead")

    (step,) = driven_steps(frozenset({"speed"}))
    with pytest.raises(CalibrationError, match=r"speed, steering.*1\.20 m ahead; nothing was written"):
        command.drive_step(Link, step, CalibrationProgress({}), always=True)


def test_the_table_shows_before_and_after():
    lines = command.table([NEW, KEPT]).splitlines()
    assert lines[1].split()[:3] == ["car.wheelbase_m", "0.25", "0.331"]
    assert "as before" in lines[2]
    assert "no bends" in lines[2]


def test_the_outline_is_asked_for_and_a_wrong_length_again(monkeypatch, capsys):
    now = dict.fromkeys(OUTLINE_WORDS, 0.5)
    answers = iter(["42", "0.1", "0,44", "wide", "", "0.16"])
    monkeypatch.setattr("builtins.input", lambda _text: next(answers))
    found = command._outline(now)
    assert [(one.name, one.new) for one in found] == [("car.front_m", 0.44), ("car.half_width_m", 0.16)]
    said = capsys.readouterr().out
    assert "42: Input should be less than or equal to 3" in said
    assert "front_m = 0.1 is less than wheelbase_m = 0.33: measure it from the rear axle to the front end" in said
    assert "wide is not a length in metres" in said


def test_an_unknown_step_is_refused(capsys):
    with pytest.raises(SystemExit):
        build_parser().parse_args(["calibrate", "sped"])
    assert "is not a step" in capsys.readouterr().err


def test_an_outline_that_what_was_measured_contradicts_is_asked_for_again(car_toml, monkeypatch, capsys):
    now, wheelbase = dict.fromkeys(OUTLINE_WORDS, 0.42), Proposal("car.wheelbase_m", 0.33, 0.5, "by ruler")
    answers = iter(["0.45", "", "", "", "0.6", "", "", "y"])
    monkeypatch.setattr("builtins.input", lambda _text: next(answers))
    progress = command.begin({"car.wheelbase_m": 0.33}, None)[0]
    command.finish(car_toml, frozenset({"outline"}), now, progress, [wheelbase], yes=False)
    assert "front_m = 0.42 is less than wheelbase_m = 0.5: measure it" in capsys.readouterr().out
    assert (load_settings(car_toml).car.wheelbase_m, load_settings(car_toml).car.front_m) == (0.5, 0.6)
