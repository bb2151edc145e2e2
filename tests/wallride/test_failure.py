"""An exception that nothing expected is a sentence; the details are kept."""

import sys
import threading
import weakref
from types import SimpleNamespace

import pytest

from wallride import cli, failure


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
