"""Other sites, other names and other machines stay outside."""

import pytest

from wallride.clients.door.auth import DoorAuth, door_auth, is_loopback
from wallride.clients.door.listening import file_name, login_token

SECRET = login_token(environment={})
LOCAL = door_auth("127.0.0.1", SECRET)
WIDE = DoorAuth(frozenset({"localhost", "box", "box.local"}), SECRET, numbers=True)


@pytest.mark.parametrize("host", ["127.0.0.1:8447", "localhost", "localhost:9000", "[::1]:8447", "LOCALHOST:1"])
def test_our_own_names_are_welcome_through_any_tunnels_port(host):
    assert LOCAL.objection(host, SECRET) == ""


EVIL = [
    "evil.example:8447", "", "127.0.0.1.evil.example", "192.168.1.5:8447", "localhost.", "[127.0.0.1].evil.example",
    "[::1].evil.example:8447", "[127.0.0.1", "127.0.0.1]", "127.0.0.1:80:evil.example", "127.0.0.1:x", "localhost\n",
]  # fmt: skip


@pytest.mark.parametrize("host", EVIL)
def test_a_name_that_merely_points_here_is_not(host):
    assert "this is not the address" in LOCAL.objection(host, SECRET)


@pytest.mark.parametrize(
    "origin",
    ["", "null", "http://evil.example", "http://127.0.0.1:3000", "https://127.0.0.1:8447", "http://localhost:8447"],
)
def test_only_the_page_from_here_may_open_a_socket(origin):
    assert LOCAL.socket_objection("127.0.0.1:8447", origin, SECRET) != ""
    assert LOCAL.socket_objection("127.0.0.1:8447", "http://127.0.0.1:8447", SECRET) == ""
    assert "token" in LOCAL.socket_objection("127.0.0.1:8447", "http://127.0.0.1:8447", "")


def test_from_other_machines_the_address_must_carry_its_token():
    assert WIDE.objection("192.168.1.5:8447", SECRET) == ""
    assert WIDE.objection("box.local:8447", SECRET) == ""
    assert "token" in WIDE.objection("192.168.1.5:8447", "")
    assert "token" in WIDE.objection("192.168.1.5:8447", f"{SECRET}\u00e9")
    assert WIDE.objection("evil.example", SECRET) != ""


def test_a_door_has_a_token_to_this_machine_too():
    assert LOCAL.token == SECRET
    assert door_auth("0.0.0.0", SECRET).token == SECRET
    hosts = ("::1", "127.3.2.1", "192.168.1.5", "car1.local")
    assert [is_loopback(host) for host in hosts] == [True, True, False, False]


def test_a_secret_is_kept_for_a_login_and_only_for_its_user(tmp_path):
    login = {"XDG_RUNTIME_DIR": str(tmp_path)}
    first = login_token(environment=login)
    assert len(first) >= 16
    assert login_token(environment=login) == first, "a phone's page finds the server again after its restart"
    kept = tmp_path / file_name("monitor")
    assert kept.stat().st_mode & 0o777 == 0o600
    kept.chmod(0o644)
    assert login_token(environment=login) != first, "others could have read it"
    kept.chmod(0o600)
    kept.write_text("easy")
    assert len(login_token(environment=login)) >= 16
    kept.unlink()
    kept.symlink_to(tmp_path / "elsewhere")
    assert login_token(environment=login) != login_token(environment=login)
    assert not (tmp_path / "elsewhere").exists()


@pytest.mark.parametrize("environment", [{}, {"XDG_RUNTIME_DIR": ""}, {"XDG_RUNTIME_DIR": "/nowhere/at/all"}])
def test_without_a_place_for_it_every_start_has_its_own(environment):
    assert login_token(environment=environment) != login_token(environment=environment)
