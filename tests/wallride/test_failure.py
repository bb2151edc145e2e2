"""An exception that nothing expected is a sentence; the details are kept."""

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
