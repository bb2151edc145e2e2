"""An exception that nothing expected is a sentence; the details are kept."""

import errno
import os
import subprocess
import sys
import threading
import weakref
from pathlib import Path
from types import SimpleNamespace

import pytest

from wallride import cli, failure
from wallride.runtime.host.terminal_text import USAGE_ERROR


def fail_by(monkeypatch, command):
    def broken(_options):
        raise ValueError("odd\x1b[2J\nthing")

    monkeypatch.setattr("wallride.service.options.add", lambda commands: _add(commands, command, broken))


def _add(commands, command, run):
    commands.add_parser(command).set_defaults(run=run)


def test_a_sentence_and_a_file_with_the_details(monkeypatch, capsys, tmp_path):
    fail_by(monkeypatch, "broken")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert cli.main(["broken"]) == failure.UNEXPECTED
    said = capsys.readouterr()
    assert said.out == ""
    (line,) = said.err.splitlines()
    assert line.startswith(r"wallride: broken failed in a way that it did not expect (ValueError: odd\x1b[2J\nthing).")
    kept = tmp_path / "wallride" / failure.LAST_ERROR
    assert str(kept) in line
    assert "Traceback" in kept.read_text()


ROOT = Path(__file__).resolve().parents[2]


def typed(line, folder):
    return subprocess.run(
        ["sh", "-c", line], cwd=folder, capture_output=True, text=True, timeout=60, check=False,
        env={**os.environ, "PYTHONPATH": str(ROOT), "HOME": str(folder), "PYTHON": sys.executable, "LANG": "C"},
    )  # fmt: skip


@pytest.mark.parametrize(
    "command", ["check", "logs", "import --car f1tenth", "doctor --only joystick", "sim --help", "--version"]
)
def test_a_full_disk_behind_the_output_is_a_sentence(command, tmp_path):
    """Written at once or, where a command's output goes through a buffer, at its end."""
    unbuffered = "1" if command in {"logs", "sim --help", "doctor --only joystick"} else ""
    answer = typed(f"PYTHONUNBUFFERED={unbuffered} $PYTHON -m wallride {command} > /dev/full", tmp_path)
    assert answer.returncode == 2
    assert answer.stderr.splitlines()[-1] == (
        "wallride: the output cannot be written: No space left on device; make room, or write it elsewhere"
    )
    assert "Traceback" not in answer.stderr


INTERRUPTED_IMPORT = """
import signal, sys
class Interrupting:
    def find_spec(self, name, *_):
        if name == "wallride.cli":
            signal.raise_signal(signal.SIGINT)
sys.meta_path.insert(0, Interrupting())
from wallride.__main__ import start
sys.exit(start())
"""


@pytest.mark.parametrize(
    ("command", "code"),
    [
        ("check >&-", 0),
        ("check 2>&-", 0),
        ("logs <&- >&- 2>&-", 0),
        ("check nowhere.toml 2>&-", 2),
        ("mointor 2>&-", 2),
    ],
)
def test_a_closed_output_changes_no_exit_code(command, code, tmp_path):
    answer = typed(f"$PYTHON -m wallride {command}", tmp_path)
    assert (answer.returncode, "Traceback" in answer.stderr) == (code, False)


def test_a_ctrl_c_while_modules_are_imported_ends_without_a_word(tmp_path):
    (tmp_path / "late.py").write_text(INTERRUPTED_IMPORT)
    answer = typed("$PYTHON late.py check", tmp_path)
    assert (answer.returncode, answer.stdout, answer.stderr) == (130, "", "")


def test_a_reader_that_has_seen_enough_is_no_error(tmp_path):
    answer = typed("$PYTHON -m wallride completion bash | head -1", tmp_path)
    assert (answer.returncode, answer.stderr) == (0, "")
    assert len(answer.stdout.splitlines()) == 1


@pytest.mark.parametrize("mistake", [PermissionError, FileNotFoundError, NotADirectoryError])
def test_a_place_that_cannot_be_used_is_a_sentence(mistake, monkeypatch, capsys):
    code = {PermissionError: errno.EACCES, FileNotFoundError: errno.ENOENT, NotADirectoryError: errno.ENOTDIR}[mistake]

    def broken(_options):
        raise mistake(code, os.strerror(code), "/there/my_law.py")

    monkeypatch.setattr("wallride.service.options.add", lambda commands: _add(commands, "broken", broken))
    assert cli.main(["broken"]) == USAGE_ERROR
    (line,) = capsys.readouterr().err.splitlines()
    assert line == f"wallride: /there/my_law.py cannot be used: {os.strerror(code)}; name another place"


@pytest.mark.parametrize(
    ("text", "words"),
    [("nowhere/out", "there is no directory nowhere"), (".", "is a directory"), ("kept", "may not be written by you")],
)
@pytest.mark.parametrize(
    "option", ["sim --json", "sim --plot", "lab walls --json", "report --json", "report -o", "line loop -o"]
)
def test_an_output_is_looked_at_before_the_work_and_told_in_one_line(
    option, text, words, tmp_path, monkeypatch, capsys
):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "kept").write_text("kept")
    monkeypatch.setattr("wallride.parser.os.access", lambda *_: False)
    with pytest.raises(SystemExit, match="2"):
        cli.main([*option.split(), text])
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


@pytest.mark.parametrize("command", ["line loop", "map lap.mcap", "pose lap.mcap map.yaml"])
def test_of_several_files_none_goes_beside_a_device(command, capsys):
    with pytest.raises(SystemExit, match="2"):
        cli.main([*command.split(), "-o", "/dev/full"])
    (line,) = capsys.readouterr().err.splitlines()
    assert "/dev/full is a device, and other files go beside it; name another place" in line


def test_where_no_file_can_be_written_the_details_are_shown(monkeypatch, capsys, tmp_path):
    fail_by(monkeypatch, "broken")
    (tmp_path / "wallride").write_text("")
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    assert cli.main(["broken"]) == failure.UNEXPECTED
    assert "Traceback" in capsys.readouterr().err


def test_it_is_raised_for_who_asks(monkeypatch):
    fail_by(monkeypatch, "broken")
    monkeypatch.setenv(failure.TRACEBACK_VARIABLE, "1")
    with pytest.raises(ValueError, match="odd"):
        cli.main(["broken"])


def test_a_ctrl_c_that_is_lost_in_a_callback_comes_again(monkeypatch):
    def interrupted(_reference):
        raise KeyboardInterrupt

    monkeypatch.setattr(sys, "unraisablehook", sys.unraisablehook)
    failure.ask_again_for_lost_interrupts()
    things = [{1}]
    _reference = weakref.ref(things[0], interrupted)
    things.clear()
    with pytest.raises(KeyboardInterrupt):
        threading.Event().wait(10.0)


def test_other_lost_errors_are_shown_as_ever(monkeypatch):
    shown = []
    monkeypatch.setattr(sys, "unraisablehook", shown.append)
    failure.ask_again_for_lost_interrupts()
    sys.unraisablehook(lost := SimpleNamespace(exc_type=ValueError))
    assert shown == [lost]


@pytest.mark.parametrize(
    ("command", "file"),
    [("new law my_law.py", "my_law.py"), ("new driver my_eye --kind lidar", "test_my_eye.py"),
     ("line loop", "loop.line.csv"), ("line loop -o out.csv", "out.csv")],
)  # fmt: skip
def test_a_full_disk_leaves_no_file_behind(command, file, tmp_path):
    """A limit of 0 bytes for each file does what a full disk does."""
    answer = typed(f"ulimit -f 0; $PYTHON -m wallride {command}", tmp_path)
    assert (answer.returncode, answer.stdout) == (2, "")
    assert answer.stderr == f"wallride: {file} cannot be used: File too large; name another place\n"
    assert [one.name for one in tmp_path.iterdir() if one.name != ".cache"] == []


@pytest.mark.parametrize(
    ("command", "words"),
    [("keys init --dir /dev/null/keys", "/dev/null/keys: Not a directory; name another folder: --dir DIR"),
     ("emulate --folder /dev/null/e", "/dev/null/e cannot be used: Not a directory; name another place")],
)  # fmt: skip
def test_a_folder_that_cannot_be_made_is_to_be_another(command, words, capsys):
    assert cli.main(command.split()) == 2
    assert capsys.readouterr().err.endswith(f"wallride: {words}\n")
