"""Configurations of a fleet's routers and of a car's session with one: what may come in has a rate of its own."""

from pathlib import Path

import pytest

from wallride.runtime.wire.router_config import ROUTED_SHARE, router_config, uplink_config
from wallride.runtime.wire.zenoh_config import Person, Role, Tls

TLS = Tls(Path("ca.pem"), Path("me.pem"), Path("me.key"))
ROUTER = "tls/localhost:7449"
PLANNERS = ("slam", "nn")
PEOPLE = (Person("car1", Role.CAR), Person("car2", Role.CAR), *(Person(name, Role.PLANNER) for name in PLANNERS))


def rates_of(config, name):
    (kind,) = (one for one in config["downsampling"] if one["id"] == name)
    return [(rule["key_expr"], rule["freq"]) for rule in kind["rules"]]


@pytest.mark.parametrize(("kind", "message"), [("commands", "put"), ("questions", "query")])
def test_each_key_that_a_router_may_bring_has_one_rate_that_no_other_key_shares(kind, message):
    """Of two rules that fit a key zenoh takes either: what shares one takes the place of the other."""
    config = uplink_config(ROUTER, TLS, "car1", PLANNERS, Role.ADMIN)
    granted = {
        key
        for rule in config["access_control"]["rules"]
        if rule["flows"] == ["ingress"] and message in rule["messages"]
        for key in rule["key_exprs"]
    }
    rated = [key for key, _ in rates_of(config, kind)]
    assert config["access_control"]["default_permission"] == "deny", "other keys need no rate"
    assert granted <= set(rated)
    assert len(rated) == len(set(rated))
    assert not [key for key in rated if "*" in key]


def test_operators_behind_a_router_have_a_larger_share_than_each_planner():
    rates = dict(rates_of(uplink_config(ROUTER, TLS, "car1", PLANNERS), "commands"))
    assert rates["wallride/car1/operator/command"] == ROUTED_SHARE * rates["wallride/car1/planner/slam/command"]


def test_a_router_bounds_each_planner_on_the_way_in():
    rates = dict(rates_of(router_config([ROUTER], TLS, PEOPLE, "track"), "commands"))
    for car in ("car1", "car2"):
        for planner in PLANNERS:
            key = f"wallride/{car}/planner/{planner}/command"
            assert rates[key] == rates[f"wallride/{car}/operator/command"]
