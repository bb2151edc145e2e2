"""The command as a user types it: exit codes, one clear message, quick help, lean imports."""

import subprocess
import sys
from pathlib import Path

import pytest

from wallride.cli import main

ROOT = Path(__file__).resolve().parents[2]


@pytest.fixture
def typed(capsys, monkeypatch):
    """Return exit code, output and errors of a command, without a process of its own."""
    monkeypatch.chdir(ROOT)
    monkeypatch.setenv("TERM", "dumb")

    def run(*arguments):
        try:
            return main(arguments), *capsys.readouterr()
        except SystemExit as ended:  # of argparse
            return ended.code, *capsys.readouterr()

    return run


@pytest.mark.parametrize(
    ("arguments", "meant"),
    [
        (["mointor"], "monitor"),
        (["topic", "lst"], "list"),
        (["record", "strat"], "start"),
        (["sim", "--hedless"], "--headless"),
        (["sim", "--duratoin=5"], "--duration"),
        (["teleop", "--keybord"], "--keyboard"),
    ],
)
def test_a_near_miss_is_answered_with_what_was_meant(arguments, meant, typed):
    code, _, errors = typed(*arguments)
    assert code == 2
    assert f"did you mean {meant}?" in errors


def test_what_is_far_from_everything_is_only_refused(typed):
    code, _, errors = typed("sim", "--zzz")
    assert code == 2
    assert "did you mean" not in errors


def test_check_prints_what_is_in_effect(typed):
    code, said, _ = typed("check", "config/car.toml", "--set", "wall_follow.side=right")
    assert code == 0
    assert 'side = "right"' in said
    assert "[motor]" in said


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["run", "nowhere.toml"], ["nowhere.toml", "no such file"]),
        (["check", "config"], ["config", "is a directory"]),
        (["check", "--set", "wall_follow.sped_mps=1"], ["wall_follow.sped_mps", "did you mean wall_follow.speed_mps?"]),
        (["check", "--set", "wal_follow.kp=1"], ["did you mean wall_follow?"]),
        (["run", "--set", "safety.methd=report"], ["safety.methd"]),
        (["check", "--set", "wall_follow.speed_mps=99"], ["wall_follow.speed_mps = 99"]),
        (["run", "--set", "lidar.address=tpc://192.168.0.10:10940"], ["lidar.address", "tcp://HOST:PORT"]),
        (["run", "--set", "motor.address=serial:///tmp"], ["motor.address", "is a directory"]),
        (["run", "--set", "motor.address=serial:///etc/hostname"], ["motor.address", "ordinary file"]),
        (["check", "--set", "motor.address=serial:///tmp"], ["motor.address", "is a directory"]),
        (["sim", "atlantis", "--headless"], ["atlantis", "loop"]),
        (["sim", "nowhere.yaml", "--headless"], ["nowhere.yaml"]),
        (["sim", "--recording", "nowhere.npz"], ["nowhere.npz"]),
        (["sim", "--recording", "config"], ["config"]),
        (["sim", "--pose", "1,2", "--headless"], ["--pose 1,2", "X,Y,THETA"]),
        (["sim", "--pose", "100,0.0,0", "--json", "."], ["--json: .", "is a directory"]),
        (["sim", "--duration", "-1"], ["--duration"]),
        (["sim", "--laps", "0"], ["--laps"]),
        (["sim", "--pose", "1e9,2,0", "--headless"], ["--pose 1e9,2,0", "no wall is within 10 m", "loop"]),
        (["sim", "dead_end", "--laps", "1", "--headless"], ["--laps 1", "no lap"]),
        (["sim", "--plot", "nowhere/plot.png"], ["--plot", "nowhere"]),
        (["sim", "--conditions", "/dev/zero", "--headless"], ["--conditions /dev/zero", "it is longer than 1 MB"]),
        (["lab", "sweep", "/dev/zero"], ["/dev/zero", "it is longer than 1 MB"]),
        (["sim", "--plot", "x.txt"], ["--plot", "x.txt", ".png"]),
        (["sim", "--seed", "-1"], ["--seed", "at least 0"]),
        (["lab", "sweep", "/dev/null"], ["/dev/null:1: declares nothing"]),
        (["lab", "scenario", "/dev/null"], ["/dev/null:1: declares nothing"]),
        (["new", "law", "/tmp/numpy.py"], ["numpy", "there is a module numpy already"]),
        (["new", "driver", "os", "--kind", "lidar"], ["os", "there is a module os already"]),
        (["new", "driver", "class", "--kind", "motor"], ["class", "a word of Python's own"]),
        (["sim", "--set", "wall_follow.side=up"], ["wall_follow.side = 'up'"]),
    ],
    ids=lambda value: " ".join(value)[:50],
)
def test_a_mistake_gets_one_clear_message_and_exit_code_2(arguments, words, typed):
    code, _, errors = typed(*arguments)
    assert code == 2
    assert all(word in errors for word in words), errors
    assert len(errors.strip().splitlines()) == 1


def modules_after(program):
    """Return the first names of the modules that a program in a process of its own has loaded."""
    names = "{name.removeprefix('wallride.').split('.')[0] for name in sys.modules}"
    program = f"{program}\nprint(); print(*{names})"
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True, cwd=ROOT)
    return set(done.stdout.splitlines()[-1].split())


def test_the_car_imports_nothing_heavy():
    loaded = modules_after("import sys, wallride.runtime.app")
    heavy = {"scipy", "matplotlib", "rich", "rosbags", "PIL", "aiohttp", "zenoh", "serial", "sim", "clients", "pandas"}
    assert loaded & heavy == set()


def test_help_loads_neither_numpy_nor_pydantic():
    program = "import sys\nfrom wallride.cli import main\ntry: main(['--help'])\nexcept SystemExit as end: "
    assert not {"numpy", "pydantic", "zenoh", "asyncio"} & modules_after(f"{program} assert not end.code")


@pytest.mark.parametrize("shell", ["bash", "zsh", "fish"])
def test_completion_knows_every_command(shell, capsys):
    assert main(["completion", shell]) == 0
    script = capsys.readouterr().out
    for name in ("run", "sim", "report", "foxglove", "own-parts"):
        assert name in script
    assert "--friction" in script or "-l friction" in script


def test_bash_reads_its_completion_and_completes_a_command(capsys):
    main(["completion", "bash"])
    ask = "\nCOMP_WORDS=(wallride fox); COMP_CWORD=1; _shtab_wallride; echo ${COMPREPLY[@]}\n"
    answer = subprocess.run(["bash"], input=capsys.readouterr().out + ask, capture_output=True, text=True, check=True)
    assert answer.stdout.split() == ["foxglove"]


@pytest.mark.parametrize(
    "arguments",
    [
        ["monitor", "--port", "99999"],
        ["foxglove", "--port", "99999"],
        ["foxglove", "--port", "x"],
        ["topic", "list", "--connect", "tcp/127.0.0.1:99999"],
        ["status", "--connect", "tcp/127.0.0.1:0"],
        ["run", "--set", "telemetry.listen=tcp/127.0.0.1:99999"],
        ["sim", "--headless", "--set", "telemetry.listen=tcp/127.0.0.1:99999"],
    ],
)
def test_an_impossible_port_is_one_sentence(arguments, typed):
    code, _, said = typed(*arguments)
    assert code == 2
    assert "Traceback" not in said
    assert "port" in said


def test_a_limit_that_was_saved_while_the_car_ran_is_said(tmp_path, typed):
    file = tmp_path / "car.toml"
    file.write_text("[safety]\nside_margin_m = 0.01 # saved while the car ran\n")
    code, _, errors = typed("check", str(file))
    assert code == 0
    assert f"{file}: safety.side_margin_m = 0.01 was saved while the car ran: look at it" in errors


def test_a_map_without_room_for_a_car_is_named_and_no_option(tmp_path, capsys):
    (tmp_path / "tiny.pgm").write_text("P2 3 3 255\n0 0 0\n0 254 0\n0 0 0\n")
    (tmp_path / "tiny.yaml").write_text("image: tiny.pgm\nresolution: 0.05\norigin: [0, 0, 0]\n")
    assert main(["sim", str(tmp_path / "tiny.yaml"), "--headless"]) == 2
    assert "wallride: the start in tiny: the car would stand in a wall" in capsys.readouterr().err


def test_a_map_that_is_not_there_is_said_before_the_start(tmp_path, capsys):
    assert main(["check", "--set", f"map.file={tmp_path / 'away.yaml'}"]) == 2
    assert f"wallride: no map file {tmp_path / 'away.yaml'}; give" in capsys.readouterr().err


LINE = "wall_follow.method=line"
NO_MAP = 'wall_follow.method = "line" follows the race line of a map, and map.file names none'


def test_a_line_without_a_map_is_said_before_the_start(tmp_path, capsys):
    assert main(["sim", "--headless", "--set", LINE]) == 2
    assert capsys.readouterr().err == f"wallride: {NO_MAP}; a race on a map: --race MAP.yaml (docs/racing.md)\n"
    (tmp_path / "lab.yaml").write_text("image: lab.pgm\n")
    assert main(["sim", "--headless", "--set", LINE, "--set", f"map.file={tmp_path / 'lab.yaml'}"]) == 2
    assert f"there is no {tmp_path / 'lab.line.csv'} beside the map; make it: wallride line" in capsys.readouterr().err
    assert main(["check", "--set", LINE]) == 0
    assert capsys.readouterr().err == f"wallride: {NO_MAP}: the car follows the wall\n"
