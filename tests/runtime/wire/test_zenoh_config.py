"""Configurations: what a car may listen on, and that nobody is granted anything by accident."""

from pathlib import Path

import pytest
from pydantic import ValidationError

from wallride.runtime.ros.graph import access
from wallride.runtime.settings.session import SessionSettings
from wallride.runtime.wire.endpoints import check_listening, is_tls, split_endpoint
from wallride.runtime.wire.rmw_zenoh import Distro, RosGraph
from wallride.runtime.wire.zenoh_config import Person, Role, Tls, access_control, car_config, client_config

TLS = Tls(Path("ca.pem"), Path("car.pem"), Path("car.key"))


@pytest.mark.parametrize(
    "listen",
    [
        ["tcp/127.0.0.1:7447"],
        ["tcp/[::1]:7447"],
        ["tcp/127.0.0.1:7447", "tls/[::]:7448"],
        ["tcp/127.0.0.1:7447", "tls/192.168.1.5:7447"],
        [],
    ],
)
def test_addresses_that_are_guarded_or_stay_on_the_machine(listen):
    check_listening(listen)


@pytest.mark.parametrize(
    ("listen", "says"),
    [
        (["tcp/0.0.0.0:7447"], r"anyone on the network drive.*tls/0\.0\.0\.0:7447.*wallride keys init"),
        (["tcp/[::]:7447"], "anyone on the network"),
        (["tcp/192.168.1.5:7447"], "anyone on the network"),
        (["tcp/localhost:7447"], "anyone on the network"),
        (["tcp/127.0.0.1.evil.example:7447"], "anyone on the network"),
        (["tcp/127.0.0.2:7447"], "anyone on the network"),
        (["udp/127.0.0.1:7447"], "not an address that wallride knows"),
        (["ws/127.0.0.1:7447"], "not an address"),
        (["tls/[::]:7448#enable_mtls=false"], "not an address"),
        (["tls/[::]:7448?rel=0"], "not an address"),
        (["tcp/127.0.0.1:7447#iface=wlan0"], "not an address"),
        (["tls/[::]:7448\n"], "not an address"),
        (["127.0.0.1:7447"], "not an address"),
        (["tcp/127.0.0.1:0"], "no port 0"),
        (["tls/[::]:70000"], "no port 70000"),
        (["tcp/127.0.0.1:7447", "tls/[::]:7447"], "same port; give the tls one 7448"),
        (["tls/0.0.0.0:7447", "tcp/127.0.0.1:7447"], "same port"),
        (["tcp/127.0.0.1:7447", "tcp/127.0.0.1:7447"], "twice"),
    ],
)
def test_addresses_that_a_car_must_not_listen_on(listen, says):
    with pytest.raises(ValueError, match=says):
        check_listening(listen)
    with pytest.raises(ValueError, match=says):
        car_config(listen, TLS, (), "car1")


def test_endpoints_are_taken_apart():
    assert split_endpoint("tls/[fe80::1]:7448") == ("tls", "[fe80::1]", 7448)
    assert split_endpoint("tcp/car1.local:7447") == ("tcp", "car1.local", 7447)
    assert is_tls("tls/car1.local:7448")
    assert not is_tls("tcp/127.0.0.1:7447")


def test_settings_take_one_address_or_several_and_refuse_open_ones():
    assert SessionSettings(listen="tls/[::]:7448").listen == ("tls/[::]:7448",)
    assert SessionSettings(listen=["tcp/127.0.0.1:1", "tls/[::]:2"]).listen[1] == "tls/[::]:2"
    with pytest.raises(ValidationError, match="anyone on the network"):
        SessionSettings(listen=("tcp/0.0.0.0:7447",))


def test_tls_needs_keys_at_both_ends_and_a_name_that_can_be_checked():
    with pytest.raises(ValueError, match="needs the keys of"):
        car_config(["tls/[::]:7448"], None, (), "car1")
    with pytest.raises(ValueError, match="needs keys"):
        client_config("tls/car1.local:7448", None)
    with pytest.raises(ValueError, match=r"IPv6 address; use the car's name"):
        client_config("tls/[::1]:7448", TLS)


def test_certificates_are_demanded_and_names_are_checked():
    car = car_config(["tls/[::]:7448"], TLS, (), "car1")["transport"]["link"]["tls"]
    client = client_config("tls/car1.local:7448", TLS)["transport"]["link"]["tls"]
    assert car["enable_mtls"] is client["enable_mtls"] is client["verify_name_on_connect"] is True
    assert "tls" not in client_config("tcp/127.0.0.1:7447", TLS)["transport"]["link"]


def test_nothing_is_searched_for_and_nothing_is_shared_on_the_way():
    for config in (car_config(["tcp/127.0.0.1:7447"], None, (), "car1"), client_config("tcp/127.0.0.1:7447", None)):
        assert config["scouting"] == {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}}
        assert config["transport"]["shared_memory"] == {"enabled": False}
        assert config["transport"]["link"]["tx"].items() >= {"lease": 1000, "keep_alive": 4}.items()


@pytest.mark.parametrize(
    "people", [(), (Person("bob", Role.VIEWER),), (Person("alice", Role.OPERATOR),), (Person("root", Role.ADMIN),)]
)
def test_no_subject_is_everybody(people):
    control = access_control(people, "car1")
    assert control["enabled"] is True
    assert control["default_permission"] == "deny"
    for subject in control["subjects"]:
        if subject["id"] == "this-machine":
            assert (subject["link_protocols"], subject["interfaces"]) == (["tcp"], ["lo", "lo0"])
        else:
            assert subject["link_protocols"] == ["tls"]
            assert subject["cert_common_names"], "an empty list of names would mean everybody"
    used = {name for policy in control["policies"] for name in policy["subjects"]}
    assert used == {subject["id"] for subject in control["subjects"]}
    assert {rule["permission"] for rule in control["rules"]} == {"allow"}, "a deny rule is skipped by a wildcard"


def test_each_role_includes_the_ones_before_it():
    people = (Person("bob", Role.VIEWER), Person("alice", Role.OPERATOR), Person("root", Role.ADMIN))
    subjects = {s["id"]: s.get("cert_common_names") for s in access_control(people, "car1")["subjects"]}
    assert subjects["viewer"] == ["bob", "alice", "root"]
    assert subjects["operator"] == ["alice", "root"]
    assert subjects["admin"] == ["root"]


def test_whoever_is_not_on_the_machine_is_granted_no_wildcard_but_what_leaves_or_is_listened_to():
    rules = [rule for rule in access_control((), "car1")["rules"] if rule["id"] != "everything"]
    for rule in rules:
        assert len(rule["flows"]) == 1, "questions and answers stay apart"
        if rule["flows"] == ["ingress"] and {"put", "query"} & set(rule["messages"]):
            assert not any("*" in key for key in rule["key_exprs"]), rule
        assert not {"delete"} & set(rule["messages"])
        if rule["flows"] == ["ingress"]:
            assert not {"reply", "declare_queryable"} & set(rule["messages"])


def test_ros_2_keys_are_granted_only_while_the_face_is_on_and_none_of_them_inwards():
    ros = access(RosGraph(0, Distro.JAZZY, "wallride_car1"))
    rules = {rule["id"]: rule for rule in access_control((), "car1", ros)["rules"] if rule["id"].startswith("ros-")}
    assert rules
    assert not any(rule["id"].startswith("ros-") for rule in access_control((), "car1")["rules"])
    arriving = {message for rule in rules.values() if rule["flows"] == ["ingress"] for message in rule["messages"]}
    assert arriving == {"declare_subscriber", "query", "liveliness_query", "declare_liveliness_subscriber"}
    assert all(len(rule["flows"]) == 1 for rule in rules.values())
    assert not any("*" in key for key in rules["ros-topics"]["key_exprs"])
    assert all(key.endswith("/@adv/**") for key in rules["ros-late-ask"]["key_exprs"])
