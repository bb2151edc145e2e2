"""Other sites, other names and other machines stay outside."""

import pytest

from clients.monitor.door import Door, is_loopback, open_door

LOCAL = open_door("127.0.0.1")
SECRET = open_door("0.0.0.0").token
WIDE = Door(frozenset({"localhost", "box", "box.local"}), numbers=True, token=SECRET)


@pytest.mark.parametrize("host", ["127.0.0.1:8447", "localhost", "localhost:9000", "[::1]:8447", "LOCALHOST:1"])
def test_our_own_names_are_welcome_through_any_tunnels_port(host):
    assert LOCAL.objection(host, "") == ""


@pytest.mark.parametrize("host", ["evil.example:8447", "", "127.0.0.1.evil.example", "192.168.1.5:8447", "localhost."])
def test_a_name_that_merely_points_here_is_not(host):
    assert "address" in LOCAL.objection(host, "")


@pytest.mark.parametrize(
    "origin",
    ["", "null", "http://evil.example", "http://127.0.0.1:3000", "https://127.0.0.1:8447", "http://localhost:8447"],
)
def test_only_the_page_from_here_may_open_a_socket(origin):
    assert LOCAL.socket_objection("127.0.0.1:8447", origin, "") != ""
    assert LOCAL.socket_objection("127.0.0.1:8447", "http://127.0.0.1:8447", "") == ""


def test_from_other_machines_the_address_must_carry_its_token():
    assert WIDE.objection("192.168.1.5:8447", SECRET) == ""
    assert WIDE.objection("box.local:8447", SECRET) == ""
    assert "token" in WIDE.objection("192.168.1.5:8447", "")
    assert "token" in WIDE.objection("192.168.1.5:8447", f"{SECRET}\u00e9")
    assert WIDE.objection("evil.example", SECRET) != ""


def test_a_door_to_the_network_has_a_token_and_one_to_this_machine_has_none():
    assert not LOCAL.token
    assert len(open_door("0.0.0.0").token) >= 16
    assert open_door("0.0.0.0").token != open_door("0.0.0.0").token
    assert is_loopback("::1")
    assert is_loopback("127.3.2.1")
    assert not is_loopback("192.168.1.5")
    assert not is_loopback("car1.local")
