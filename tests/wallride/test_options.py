"""The options of every command: defaults, refused values, and how help names them. In this process, without a car."""

import argparse
import os
import sys

import pytest

from wallride.cli import build_parser, main
from wallride.failure import needs


def parsed(line):
    return build_parser().parse_args(line.split())


def commands(parser=None, name=()):
    """Every command with its parser."""
    parser = parser or build_parser()
    children = next((a for a in parser._actions if isinstance(a, argparse._SubParsersAction)), None)
    if name:
        yield " ".join(name), parser
    for child, under in children.choices.items() if children is not None else ():
        yield from commands(under, (*name, child))


def test_who_asks_for_a_race_on_a_map_is_told_the_command(capsys):
    assert main(["race", "lab.yaml"]) == 2
    assert "a race on a map: wallride sim --race lab.yaml" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("line", "expected"),
    [
        ("run", {"config": None, "assignments": [], "address_file": None, "saved": None}),
        ("run car.toml --set a=1 --set b=2", {"assignments": ["a=1", "b=2"]}),
        ("check --devices", {"devices": True}),
        ("sim", {"world": None, "headless": False, "seed": 0, "obstacle": [], "dirt": [], "recording": None}),
        ("sim --dirt=-10,5 --dirt 1,2", {"dirt": ["-10,5", "1,2"]}),
        ("lab walls", {"method": "ball", "seed": 1000, "seeds": "1", "quick": False, "jobs": None}),
        ("lab stories", {"method": "ball", "speeds": None, "seeds": 1}),
        ("bench latency", {"runs": None, "short": False, "plot": None, "assignments": []}),
        ("teleop", {"max_speed": 0.75, "max_steering": 0.34, "ramp": 2.0, "expo": 0.3, "deadzone": 0.08}),
        ("monitor", {"host": "127.0.0.1", "port": None, "browser": True, "max_speed": 1.5, "default_port": 8447}),
        ("monitor --no-browser --port 0", {"browser": False, "port": 0}),
        ("foxglove", {"host": "127.0.0.1", "port": 8765, "layout": False}),
        ("topic list", {"seconds": 1.5, "json": False, "car": None, "session": None}),
        ("topic echo scan --once", {"topic": "scan", "count": 1, "whole": False}),
        ("status --session 5f", {"session": 0x5F, "watch": False}),
        ("param list wall", {"under": "wall"}),
        ("param history -n 3", {"most": 3}),
        ("keys add ann --role viewer --days 7", {"name": "ann", "role": "viewer", "days": 7, "renew": False}),
        ("keys init", {"days": 365, "san": []}),
        ("logs get --last 3", {"names": [], "last": 3, "output": ".", "black_boxes": False}),
        ("logs list --local", {"local": ""}),
        ("logs", {"action": "list", "local": "", "json": False}),
        ("logs --car x", {"action": "list", "local": None, "car": "x", "json": False}),
        ("logs --connect tcp/car1:1 --json", {"action": "list", "local": None, "connect": "tcp/car1:1", "json": True}),
        ("logs get --car x", {"action": "get", "car": "x"}),
        ("replay run.mcap", {"publish": False, "speed": 1.0, "begin_s": 0.0, "loop": False, "topic": None}),
        ("plot", {"topics": ["distance_error"], "seconds": 20.0, "once": False}),
    ],
)
def test_defaults_and_values(line, expected):
    options = vars(parsed(line))
    assert {name: options[name] for name in expected} == expected
    assert callable(options["run"])


@pytest.mark.parametrize(
    ("line", "said"),
    [
        ("teleop --max-speed 21", "write a number from 0.1 to 20"),
        ("teleop --expo 2", "write a number from 0 to 1"),
        ("monitor --max-steering 0", "write a number from 0.05 to 1.5"),
        ("monitor --port -1", "-1 is not a port: 0 to 65535"),
        ("status --session xyz", "xyz is not a session: eight hexadecimal digits"),
        ("keys add ann --role viewer --days 0", "write a number of days from 1 to 3600"),
        ("keys add ann --role king", "invalid choice: 'king'"),
        ("logs get --last 0", "at least 1"),
        ("logs trim --keep-mb -1", "at least 0"),
        ("line loop --keep abc", "invalid number value: 'abc'"),
        ("replay run.mcap --speed 99", "write a number from 0.05 to 50"),
        ("replay run.mcap --speed nan", "write a number from 0.05 to 50"),
        ("topic list --seconds nan", "write a number of seconds from 0.1 to 600"),
        ("topic list --seconds abc", "invalid number value: 'abc'"),
        ("plot --seconds 0", "write a number of seconds from 1 to 600"),
        ("record", "the following arguments are required: action"),
        ("lab", "the following arguments are required: EXPERIMENT"),
        ("bench latency --runs 0", "argument --runs: at least 1"),
        ("vesc set --nothing x", "wallride vesc set: unrecognized arguments: --nothing (wallride vesc set --help"),
        ("race --laps 3", "unrecognized arguments: --laps (wallride race --help"),
        ("lab walls --jobs 0", "argument --jobs: at least 1"),
        ("lab sweep table.toml --jobs 0", "argument --jobs: at least 1"),
        ("lab report --jobs 0", "argument --jobs: at least 1"),
        ("lab tune --trials 0", "argument --trials: at least 1"),
        ("lab hazards --jobs two", "argument --jobs: invalid whole number value: 'two'"),
        *((f"lab fit run.mcap --wheelbase {value}", "argument --wheelbase: ") for value in ("nan", "-1", "0", "x")),
    ],
)
def test_what_cannot_be_used_is_refused_with_its_bounds_and_by_its_own_command(line, said, capsys):
    with pytest.raises(SystemExit) as end:
        main(line.split())
    assert end.value.code == 2
    assert said in capsys.readouterr().err


def test_every_option_has_a_help():
    bare = [
        f"{name} {'/'.join(action.option_strings) or action.dest}"
        for name, parser in commands()
        for action in parser._actions
        if not isinstance(action, argparse._SubParsersAction) and action.option_strings and not action.help
    ]
    assert bare == []
    assert all(parser.format_help() for _, parser in commands())


def test_names_in_help_keep_their_capitals():
    told = {name: parser.description for name, parser in commands()}
    assert told["bench cpu"].startswith("CPU, memory and threads of the process at 40 Hz")
    assert told["bench loaded"].endswith("under SCHED_FIFO; needs root.")


def test_the_operators_name_is_user_and_computer(monkeypatch):
    monkeypatch.setattr("getpass.getuser", lambda: "ann")
    monkeypatch.setattr("socket.gethostname", lambda: "desk.local")
    assert parsed("teleop").name == parsed("monitor").name == "ann@desk"
    monkeypatch.setattr("getpass.getuser", lambda: (_ for _ in ()).throw(OSError))
    assert parsed("teleop").name == "operator@desk"
    assert parsed("teleop --name bob").name == "bob"


def test_the_endpoint_comes_from_the_environment(monkeypatch):
    monkeypatch.setenv("WALLRIDE_CONNECT", "tls/car1:7448")
    assert parsed("status").connect == "tls/car1:7448"
    monkeypatch.setitem(os.environ, "WALLRIDE_CONNECT", "")
    assert parsed("status").connect == "tcp/127.0.0.1:7447"


def test_a_missing_package_is_one_sentence_that_names_the_extra(monkeypatch, capsys):
    monkeypatch.setitem(sys.modules, "segno", None)
    with pytest.raises(SystemExit) as end, needs("monitor", "the monitor needs"):
        import segno  # noqa: F401
    assert end.value.code == 2
    said = capsys.readouterr().err
    assert "the monitor needs" in said
    assert ".[monitor]" in said
