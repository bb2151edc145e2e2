"""`wallride keys` as a person types it."""

import json
import socket
from datetime import UTC, datetime, timedelta

import pytest

from tests.typed import typed
from wallride.clients.keys import command
from wallride.runtime.security.access_list import AccessEntry
from wallride.runtime.wire.zenoh_config import Person, Role


@pytest.fixture
def wallride(tmp_path, monkeypatch, capsys):
    """Return a function that runs one command in an empty folder: (exit code, standard output, standard error)."""
    monkeypatch.chdir(tmp_path)

    def run(line):
        options = typed(*line.split(), "--dir", tmp_path / "keys")
        code = options.run(options)
        out = capsys.readouterr()
        return code, out.out, out.err

    return run


def test_from_nothing_to_a_secured_car(wallride, tmp_path):
    code, out, _ = wallride("keys init --car car7 --san 10.0.0.7")
    assert code == 0
    assert "car7.local" in out
    assert "10.0.0.7" in out
    assert f'keys_dir = "{tmp_path / "keys"}"' in out
    code, out, _ = wallride("keys add alice --role operator")
    assert code == 0
    assert "alice is an operator of car7" in out
    assert sorted(path.name for path in (tmp_path / "alice-keys").iterdir()) == ["alice.key", "alice.pem", "ca.pem"]
    assert wallride("keys add bob --role viewer --days 10 --car car7")[0] == 0
    assert wallride("keys revoke alice --car car9")[1].startswith("alice may do nothing on car7")
    code, out, _ = wallride("keys list")
    lines = out.splitlines()
    assert code == 0
    assert lines[0].startswith("car7   car       until")
    assert "alice  operator  revoked 20" in out
    assert "in 10 days: keys add bob --renew" in out
    found = json.loads(wallride("keys list --json")[1])
    assert found["car"]["name"] == "car7"
    assert "car7.local" in found["car"]["reached_as"]
    assert [(one["name"], one["role"], one["revoked"] is None) for one in found["people"]] == [
        ("alice", "operator", False),
        ("bob", "viewer", True),
    ]


@pytest.mark.parametrize(("days", "says"), [(0, "today"), (1, "in 1 day"), (2, "in 2 days"), (31, "")])
def test_the_list_says_in_proper_words_when_keys_end(days, says):
    now = datetime(2026, 5, 1, 12, tzinfo=UTC)
    entry = AccessEntry(Person("ann", Role.VIEWER), (now + timedelta(days=days)).date())
    expected = f"until {entry.expires}"
    assert command._state(entry, now) == (f"{expected}, {says}: keys add ann --renew" if says else expected)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("keys list", "no such file"),
        ("keys add alice --role viewer", "wallride keys init"),
        ("keys revoke alice", "wallride keys init"),
        ("keys init --car Car", "not a car's name"),
        ("keys init --san a/b", "--san a/b"),
        ("keys init --san ::1", "IPv6 address; use a name"),
    ],
)
def test_what_the_user_can_mend_is_one_line_and_exit_code_2(wallride, line, says):
    code, out, err = wallride(line)
    assert (code, out) == (2, "")
    assert says in err
    assert err.count("\n") == 1


def test_the_help_promises_no_name_on_the_car_which_the_client_chooses_itself(wallride, capsys):
    with pytest.raises(SystemExit):
        wallride("keys add --help")
    about_name = capsys.readouterr().out.partition("positional arguments:")[2].partition("options:")[0]
    assert "up to 24 characters" in about_name
    assert "operator" not in about_name


def test_a_folder_that_cannot_be_made_is_one_line_too(wallride, tmp_path):
    (tmp_path / "keys").write_text("a file, not a folder")
    code, _, err = wallride("keys init")
    assert code == 2
    assert str(tmp_path / "keys") in err


@pytest.mark.parametrize("days", ["0", "-1", "4000", "soon"])
def test_days_are_a_sensible_number(wallride, days, capsys):
    with pytest.raises(SystemExit):
        wallride(f"keys init --days={days}")
    assert "--days" in capsys.readouterr().err


def test_a_person_is_revoked_beside_a_certificate_that_cannot_be_read(wallride, tmp_path):
    wallride("keys init --car car7")
    wallride("keys add ann --role operator")
    (tmp_path / "keys" / "car.pem").write_text("junk")
    assert wallride("keys revoke ann --car car7")[1].startswith("ann may do nothing on car7")


def test_a_renewed_certificate_keeps_its_names_and_a_renewed_person_the_role(wallride):
    wallride("keys init --car car7 --san 10.0.0.7")
    assert "10.0.0.7" in wallride("keys init --car car7 --renew")[1]
    assert "10.0.0.7" in wallride("keys list")[1]
    wallride("keys add alice --role operator")
    assert "alice is an operator" in wallride("keys add alice --renew --out again")[1]
    assert "name a role" in wallride("keys add bob --renew")[2]


def test_a_router_goes_by_the_names_in_its_certificate(wallride, monkeypatch):
    assert "10.0.0.9" in wallride("keys router track --san 10.0.0.9")[1]
    monkeypatch.setattr(socket, "gethostname", lambda: "another-laptop")
    code, out, _ = wallride("keys router track")
    assert (code, "10.0.0.9" in out, "another-laptop" in out) == (0, True, False)
    code, _, err = wallride("keys router track --san 10.0.0.8")
    assert code == 2
    assert "without 10.0.0.8; --renew makes it anew" in err
    out = wallride("keys router track --san 10.0.0.8 --renew --days 9")[1]
    assert "10.0.0.9, 10.0.0.8" in out
    assert "the router's certificate expires" in out


def test_keys_are_not_made_by_a_clock_that_was_never_set(wallride, monkeypatch):
    monkeypatch.setattr(command, "FIRST_S", 2**40)
    code, _, err = wallride("keys init --car car7")
    assert code == 2
    assert "set the clock" in err
