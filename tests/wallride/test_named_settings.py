"""One way to name the settings file, for every command that reads one; and what `run` says of it first."""

import argparse
import logging
import os
import re
import subprocess
import sys
from pathlib import Path

import pytest

from tests.wallride.test_options import commands
from wallride.bringup import calibrate_options
from wallride.cli import build_parser, main
from wallride.parser import CONFIG_VARIABLE, default_config
from wallride.runtime.launch import Files
from wallride.runtime.settings.tree import Settings, load_settings

PLAIN = ["run", "check", "doctor", "vesc set", "calibrate", "monitor"]
READING = [
    *PLAIN, "sim", "vesc restore copy.bin", "keys init", "keys add ann --role viewer", "keys list", "keys revoke ann",
    "keys router yard", "line yard", "param race lab.yaml",
]  # fmt: skip


@pytest.mark.parametrize("line", [f"{one} --config car.toml" for one in READING] + [f"{one} car.toml" for one in PLAIN])
def test_a_file_is_named_by_an_option_of_each_command_and_is_the_argument_of_one_without_others(line):
    assert build_parser().parse_args(line.split()).config == Path("car.toml")


def test_every_command_with_a_settings_file_is_among_them():
    having = {name for name, parser in commands() if any(action.dest == "config" for action in parser._actions)}
    tested = {
        " ".join(word for word in line.split() if not re.search(r"[-.]|ann|viewer|yard", word)) for line in READING
    }
    assert having == tested


@pytest.mark.parametrize("command", PLAIN)
def test_two_different_files_are_refused(command, capsys):
    with pytest.raises(SystemExit):
        build_parser().parse_args([*command.split(), "a.toml", "--config", "b.toml"])
    assert "two settings files" in capsys.readouterr().err


def test_the_variable_names_the_file_where_the_line_does_not(tmp_path, monkeypatch, capsys):
    named, other = tmp_path / "named.toml", tmp_path / "other.toml"
    named.write_text("[car]\nname = 'emulated'\n")
    other.write_text("[car]\nname = 'other'\n")
    monkeypatch.setenv(CONFIG_VARIABLE, str(named))
    assert default_config() == named
    assert main(["check"]) == 0
    assert 'name = "emulated"' in capsys.readouterr().out
    assert main(["check", str(other)]) == 0
    assert 'name = "other"' in capsys.readouterr().out
    monkeypatch.setenv(CONFIG_VARIABLE, str(tmp_path / "none.toml"))
    assert main(["check"]) == 2
    assert "none.toml: no such file" in capsys.readouterr().err


def test_calibrate_writes_to_the_file_that_the_variable_names(tmp_path, monkeypatch):
    taken: list[Path] = []

    def calibrate(options: argparse.Namespace) -> int:
        taken.append(options.config)
        return 0

    monkeypatch.setenv(CONFIG_VARIABLE, str(tmp_path / "car.toml"))
    monkeypatch.setattr("wallride.clients.calibration.command.run", calibrate)
    assert calibrate_options.run(argparse.Namespace(config=None, undo=False)) == 0
    assert taken == [tmp_path / "car.toml"]


def test_run_says_first_which_file_counts():
    settings = Settings()
    level, words = Files(Path("saved.toml"), Path("car.toml"), None, ["a.b=1"]).words(settings)
    assert (level, words) == (logging.INFO, "settings of car.toml, above it saved.toml, --set a.b=1")
    level, words = Files().words(settings)
    assert level == logging.WARNING
    assert words == "no settings file: the defaults count, a wheelbase of 0.33 m among them"


@pytest.mark.timeout(120)
def test_the_line_that_emulate_prints_is_all_that_the_other_commands_need(tmp_path):
    """Typed as printed, into a shell: the emulated car is what `check`, `vesc set` and `doctor` speak to."""
    wallride = f"{sys.executable} -m wallride"
    environment = {"HOME": str(tmp_path), "PATH": os.environ["PATH"], "PYTHONPATH": str(Path.cwd()), "LANG": "C.UTF-8"}

    def typed(line):
        return subprocess.run(
            ["sh", "-c", line], env=environment, capture_output=True, text=True, timeout=50, check=False
        )

    emulating = subprocess.Popen(
        [sys.executable, "-m", "wallride", "emulate", "--port", "0", "--vesc-timeout", "1"],
        env=environment, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True,
    )  # fmt: skip
    assert emulating.stderr is not None
    try:
        printed = next(line.strip() for line in emulating.stderr if "export" in line)
        file = Path(printed.partition("=")[2])
        assert load_settings(file).car.name == "emulated"
        assert 'name = "emulated"' in typed(f"{printed}; {wallride} check").stdout
        told = typed(f"{printed}; {wallride} vesc set --dry-run").stdout
        assert told.startswith(f"settings of {file}; motor controller at serial://{tmp_path}")
        assert "1000 ms  ->  150 ms" in told
        assert "ok    motor " in typed(f"{printed}; {wallride} doctor --only motor").stdout
    finally:
        emulating.kill()
        emulating.communicate()
