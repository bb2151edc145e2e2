"""Configurations of a fleet's routers and of a car's session with one of them, as plain dictionaries. Pure.

A router stands between cars and people, so that viewers load it and not the car's radio. It is zenoh's own program, and
has no code of ours: what it lets through is access control, by the names in certificates of the fleet's authority. The
car does not rely on it: its session with a router has an access control of its own, that of one role. Routers are not
connected with each other; a client that wants two of them connects to both.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import Any, Final

from wallride.runtime.wire import topics
from wallride.runtime.wire.endpoints import check_listening
from wallride.runtime.wire.ingress import (
    COMMANDS_HZ,
    droppable_answers,
    low_pass_filter,
    planner_rates,
    rate_rule,
    routed_downsampling,
)
from wallride.runtime.wire.teleop import COMMAND_BYTES
from wallride.runtime.wire.zenoh_config import (
    ASKS_WHO,
    Grant,
    Person,
    Role,
    Tls,
    client_config,
    grants,
    keep_little,
    listening_config,
    planner_grants,
    rule,
)

MAX_ROUTER_SESSIONS: Final = 1024
ROUTED_SHARE: Final = 4.0
"""Commands a router may pass to one car, in shares of what one client may send: several operators, one of them in a
hurry to stop the car."""
VIEWED_SCANS_HZ: Final = 10.0
VIEWED_HZ: Final = 20.0
"""Rates at which a router passes telemetry on, of scans and of topics that the car sends oftener."""
FREQUENT: Final = tuple(name for name, topic in topics.TELEMETRY.items() if topic.rate_hz > VIEWED_HZ)


def uplink_config(
    endpoint: str, tls: Tls | None, car: str, planners: Sequence[str], highest: Role = Role.OPERATOR
) -> dict[str, Any]:
    """Return the configuration of the car's session with one router; ValueError when it cannot be made.

    planners: those that may feed a source of this car. highest: the role whose rights the router may pass on.
    """
    check_routers([endpoint])
    config = client_config(endpoint, tls)
    config["metadata"] = {"name": car}
    config["timestamping"] = {"enabled": True}
    keep_little(config["transport"]["link"])
    config["qos"] = {"network": droppable_answers()}
    config["low_pass_filter"] = low_pass_filter(COMMAND_BYTES)
    config["downsampling"] = routed_downsampling(car, planners, ROUTED_SHARE)
    granted = [grant for grant in grants(car) if highest.includes(grant.role)]
    if highest.includes(Role.OPERATOR):
        granted += itertools.chain.from_iterable(planner_grants(car, name, None) for name in planners)
    granted += name_grants(car)
    rules = [rule(grant.name, [grant.flow], grant.messages, grant.keys) for grant in granted]
    config["access_control"] = {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [{"id": "router"}],  # the session has one other side, which has proved its name
        "policies": [{"rules": [one["id"] for one in rules], "subjects": ["router"]}],
    }
    return config


def router_config(
    listen: Sequence[str], tls: Tls | None, people: Sequence[Person], name: str, scans_hz: float = VIEWED_SCANS_HZ
) -> dict[str, Any]:
    """Return the configuration of a router, for zenohd as well; ValueError when it would be open to the network.

    people: all names of the fleet, cars among them. Without `tls` only this machine reaches the router, and each of its
    programs has every right. scans_hz: highest rate of each car's scans towards viewers.
    """
    cars, planners = ([person.name for person in people if person.role is role] for role in (Role.CAR, Role.PLANNER))
    config = listening_config(name, listen, ["tls"] if tls else ["tcp"], tls, MAX_ROUTER_SESSIONS)
    if tls is not None:
        config["access_control"] = router_access_control(people)
        config["downsampling"] = _thinned(cars, planners, scans_hz)
        config["qos"] = {"network": droppable_answers()}
    return config


def router_access_control(people: Sequence[Person]) -> dict[str, Any]:
    """Return the access control of a router: what is not granted is dropped, wildcards included.

    Each car has the rights that it needs as itself and no other; people have those of their role with every car.
    """
    cars, planners = ([person.name for person in people if person.role is role] for role in (Role.CAR, Role.PLANNER))
    shown = {person.name: person.common_name for person in people}
    granted: dict[str, list[Grant]] = {f"car-{car}": list(_car_grants(car, planners)) for car in cars}
    names = {f"car-{car}": [shown[car]] for car in cars}
    for planner in planners:
        granted[f"planner-{planner}"] = _merged(
            itertools.chain.from_iterable(planner_grants(car, planner, None) for car in cars)
        )
        names[f"planner-{planner}"] = [shown[planner]]
    all_grants = list(itertools.chain.from_iterable([*grants(car), *_watching(car)] for car in cars))
    for role in (Role.VIEWER, Role.OPERATOR, Role.ADMIN):
        granted[role.value] = _merged(grant for grant in all_grants if grant.role is role)
        names[role.value] = [person.common_name for person in people if person.role.includes(role)]
    granted = {subject: rules for subject, rules in granted.items() if rules and names[subject]}
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [
            rule(f"{subject}:{grant.name}", [grant.flow], grant.messages, grant.keys)
            for subject, rules in granted.items()
            for grant in rules
        ],
        # An empty list of names would match every client, so that a role without members has no subject.
        "subjects": [
            {"id": subject, "link_protocols": ["tls"], "cert_common_names": names[subject]} for subject in granted
        ],
        "policies": [
            {"rules": [f"{subject}:{grant.name}" for grant in rules], "subjects": [subject]}
            for subject, rules in granted.items()
        ],
    }


def name_grants(car: str) -> Iterator[Grant]:
    """Yield the car's rights by which it holds its name, or says that another one has it; flows seen from the car."""
    holders, refused = topics.key(car, f"{topics.ALIVE}/*"), topics.key(car, f"{topics.REFUSED}/*")
    yield Grant(Role.CAR, "has-the-name", "egress", ("liveliness_token",), (holders, refused))
    yield Grant(Role.CAR, "who-has-the-name", "egress", ASKS_WHO, (holders,))
    yield Grant(Role.CAR, "another-has-it", "ingress", ("liveliness_token",), (holders,))


def check_routers(endpoints: Sequence[str]) -> None:
    """Refuse addresses of routers: ValueError with the remedy. The rules of listening hold for them as well."""
    if len(set(endpoints)) < len(endpoints):
        raise ValueError("names the same router twice; name it once")
    for endpoint in endpoints:
        try:
            check_listening([endpoint])
        except ValueError as error:
            place = endpoint.removeprefix("tcp/")
            raise ValueError(
                str(error) if place == endpoint else f"{endpoint}: tcp has no keys; write tls/{place}"
            ) from None


def _car_grants(car: str, planners: Sequence[str]) -> Iterator[Grant]:
    """Yield a car's rights at a router: all that its own session may allow, with the flows seen from the router."""
    own = [*grants(car), *itertools.chain.from_iterable(planner_grants(car, name, None) for name in planners)]
    for grant in [*own, *name_grants(car)]:
        yield replace(grant, role=Role.CAR, flow="ingress" if grant.flow == "egress" else "egress")


def _watching(car: str) -> Iterator[Grant]:
    """Yield the rights of viewers to see which car has a name, and which one was refused it."""
    asked = tuple(topics.key("*", f"{token}/*") for token in (topics.ALIVE, topics.REFUSED))
    told = tuple(topics.key(car, f"{token}/*") for token in (topics.ALIVE, topics.REFUSED))
    yield Grant(Role.VIEWER, "whose-name", "ingress", ASKS_WHO, asked)
    yield Grant(Role.VIEWER, "the-name", "egress", ("liveliness_token",), told)


def _merged(granted: Iterator[Grant]) -> list[Grant]:
    """Return grants of one name as one, with the keys of all of them."""
    merged: dict[str, Grant] = {}
    for grant in granted:
        known = merged.get(grant.name, replace(grant, keys=()))
        merged[grant.name] = replace(known, keys=tuple(dict.fromkeys((*known.keys, *grant.keys))))
    return list(merged.values())


def _thinned(cars: Sequence[str], planners: Sequence[str], scans_hz: float) -> list[dict[str, Any]]:
    """Return the highest rates towards each client, and what each client may send; every key by name."""
    seen = {topics.key(car, topics.SCAN): scans_hz for car in cars}
    seen |= {topics.key(car, topic): VIEWED_HZ for car in cars for topic in FREQUENT}
    said = {topics.key(car, topics.COMMAND): COMMANDS_HZ for car in cars}
    said |= {key: rate_hz for car in cars for key, rate_hz in planner_rates(car, planners).items()}
    kinds = (("viewed", "egress", seen), ("commands", "ingress", said))
    return [rate_rule(name, ["put"], by_key, flow) for name, flow, by_key in kinds if by_key]
