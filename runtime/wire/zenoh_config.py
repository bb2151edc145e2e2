"""Configurations of zenoh sessions as plain dictionaries: the car's and its clients'. Pure: no zenoh, no files.

The car is a router of its own, so that users install nothing; every peer is a client of exactly that car. The rights of
each role are defined in `grants`, and nowhere else. zenoh drops the rest without notice to the sender.
"""

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Literal

from wallride.runtime.wire import topics
from wallride.runtime.wire.endpoints import check_listening, is_tls, split_endpoint
from wallride.runtime.wire.ingress import MAX_ANSWER_B, MAX_INCOMING_B, downsampling, droppable_answers, low_pass_filter
from wallride.runtime.wire.rmw_zenoh import GRAPH, LATCHED_SUFFIX, MAX_DRIVE_B, ROS2_PLANNER, RosAccess
from wallride.runtime.wire.teleop import COMMAND_BYTES

LEASE_MS = 1000
KEEP_ALIVES_PER_LEASE = 4
CONNECT_TIMEOUT_MS = 1000
ACCEPT_TIMEOUT_MS = 3000
"""Maximum time from a connection to a session with rights; a silent one holds a place for so long."""
MAX_SESSIONS = 64
"""Maximum number of clients at once; each of them has its own limits (wallride.runtime.wire.ingress)."""
MAX_BLOCKED_US = 50_000
"""Maximum time for which a client that does not read may hold up a thread of the car; then its session ends. With
zenoh's own 5 s it could hold up the loop as well: messages of one priority to one client wait for each other."""
BATCH_B = 8192
"""Size up to which zenoh sends messages as one; a scan has 4.4 kB, one of more beams is divided."""
PIECE_BATCHES = 12
"""Size of the queues of answers and of `topics.LASTING`: a piece of a recording, 64 KiB, and a map, 96 KiB, have to fit
as a whole, or over a slow link they would never arrive."""
SCAN_BATCHES = 3
"""Size of the queue of topics in bulk: a scan of 4321 beams has to fit."""
SEND_BUFFER_B = 8192
"""Size of the system's buffer for each link; Linux takes twice as much, and counts its own records in it."""
MAX_FRAGMENTS_US = 2_000
"""Maximum time for which a message of several batches waits for a client that reads slowly; then it is dropped."""

EVERY_MESSAGE = [
    "put",
    "delete",
    "declare_subscriber",
    "query",
    "reply",
    "declare_queryable",
    "liveliness_token",
    "liveliness_query",
    "declare_liveliness_subscriber",
]
ASKS_WHO = ("liveliness_query", "declare_liveliness_subscriber")
"""Messages that ask for liveliness tokens."""


class Role(StrEnum):
    """Roles of people; each role includes the rights of the ones before it.

    Two stand apart: the planner, a viewer that also feeds the source of its own name, and the car, which only a fleet's
    routers know.
    """

    VIEWER = "viewer"
    OPERATOR = "operator"
    ADMIN = "admin"
    PLANNER = "planner"
    CAR = "car"

    def includes(self, other: "Role") -> bool:
        """Tell whether this role has all rights of the other."""
        if Role.CAR in {self, other}:
            return self is other
        if Role.PLANNER in {self, other}:
            return other in {self, Role.VIEWER}
        ranks = list(Role)
        return ranks.index(self) >= ranks.index(other)


@dataclass(frozen=True, slots=True)
class Person:
    """The holder of a certificate. renewed: how often the name has got new keys, which end the ones before."""

    name: str
    role: Role
    renewed: int = 0

    @property
    def common_name(self) -> str:
        """Return the name in the newest certificate, by which zenoh knows its holder; a name itself has no dot."""
        return f"{self.name}.{self.renewed}" if self.renewed else self.name


@dataclass(frozen=True, slots=True)
class Tls:
    """The three PEM files that a session trusts and presents."""

    authority: Path
    certificate: Path
    key: Path


@dataclass(frozen=True, slots=True)
class Grant:
    """One right of a role. Flows are seen from the car: ingress arrives there, egress leaves it."""

    role: Role
    name: str
    flow: Literal["ingress", "egress"]
    messages: tuple[str, ...]
    keys: tuple[str, ...]


def car_config(
    listen: Sequence[str], tls: Tls | None, people: Sequence[Person], car: str, ros: RosAccess | None = None
) -> dict[str, Any]:
    """Return the configuration of the car's session, which listens and never connects anywhere.

    Without `tls` only this machine can reach the car, and every local user has all rights. ros: its ROS 2 keys, if any.
    ValueError when an endpoint would be open to the network without certificates.
    """
    config = listening_config(car, listen, ["tcp", "tls"] if tls else ["tcp"], tls, MAX_SESSIONS)
    config["transport"]["link"]["rx"] = {"max_message_size": MAX_INCOMING_B}
    config["qos"] = {"network": droppable_answers()}
    config["downsampling"] = downsampling(car)
    command_bytes = MAX_DRIVE_B if ros is not None and ros.drive else COMMAND_BYTES
    config["low_pass_filter"] = low_pass_filter(MAX_INCOMING_B if ros is not None and ros.scans else command_bytes)
    if tls is not None:
        config["access_control"] = access_control(people, car, ros)
    return config


def listening_config(
    name: str, listen: Sequence[str], protocols: list[str], tls: Tls | None, max_sessions: int
) -> dict[str, Any]:
    """Return what a car's session and a router have in common; ValueError when it would be open to the network."""
    check_listening(listen)
    if tls is None and any(map(is_tls, listen)):
        raise ValueError(f"a tls endpoint needs the keys of {name}")
    config = session_base("router", protocols) | {
        "metadata": {"name": name},
        "listen": {"endpoints": list(listen)},
        "connect": {"endpoints": []},
        "timestamping": {"enabled": True},
        "adminspace": {"enabled": False, "permissions": {"read": False, "write": False}},
    }
    # One link per session: the rights of a session are judged over all its links together.
    config["transport"]["unicast"] = {
        "max_links": 1,
        "max_sessions": max_sessions,
        "accept_timeout": ACCEPT_TIMEOUT_MS,
    }
    keep_little(config["transport"]["link"])
    if tls is not None:
        config["transport"]["link"]["tls"] |= {
            "root_ca_certificate": str(tls.authority),
            "listen_certificate": str(tls.certificate),
            "listen_private_key": str(tls.key),
            "enable_mtls": True,
            "close_link_on_expiration": True,
        }
    return config


def keep_little(link: dict[str, Any]) -> None:
    """Have each link keep little for a slow reader: no thread waits for it, and what it hears is not old.

    Without these sizes the system alone keeps megabytes: at 1 Mbit/s heartbeats wait for seconds behind scans. What
    does not fit is dropped, by zenoh, messages of low priority first (`topics.BULK`).
    """
    link["tx"] |= {
        "batch_size": BATCH_B,
        "queue": {
            "size": {"interactive_low": PIECE_BATCHES, "data_low": SCAN_BATCHES, "background": PIECE_BATCHES},
            "congestion_control": {
                "drop": {"max_wait_before_drop_fragments": MAX_FRAGMENTS_US},
                "block": {"wait_before_close": MAX_BLOCKED_US},
            },
        },
    }
    for protocol in link["protocols"]:
        link[protocol] = {**link.get(protocol, {}), "so_sndbuf": SEND_BUFFER_B}


def client_config(connect: str, tls: Tls | None) -> dict[str, Any]:
    """Return the configuration of a client's session: one car, reconnected within half a second after a loss.

    ValueError when such a connection cannot be made.
    """
    protocol, host, _ = split_endpoint(connect)
    if protocol == "tls" and tls is None:
        raise ValueError(f"{connect} needs keys")
    if protocol == "tls" and host.startswith("["):  # zenoh 1.10 takes the brackets for a part of the name
        raise ValueError(f"{connect}: a certificate cannot be checked against an IPv6 address; use the car's name")
    config = session_base("client", [protocol]) | {
        "connect": {
            "endpoints": [connect],
            "timeout_ms": CONNECT_TIMEOUT_MS,
            "exit_on_failure": True,
            "retry": {"period_init_ms": 100, "period_max_ms": 500, "period_increase_factor": 1.5},
        },
    }
    config["transport"]["link"]["rx"] = {"max_message_size": MAX_ANSWER_B}
    if tls is not None and protocol == "tls":
        config["transport"]["link"]["tls"] = {
            "root_ca_certificate": str(tls.authority),
            "connect_certificate": str(tls.certificate),
            "connect_private_key": str(tls.key),
            "enable_mtls": True,
            "verify_name_on_connect": True,
        }
    return config


def access_control(people: Sequence[Person], car: str, ros: RosAccess | None = None) -> dict[str, Any]:
    """Return the access control of one car: what is not granted here is dropped, wildcards included.

    zenoh skips a `deny` rule when the message's key is wider than the rule's, so nothing is ever allowed first and
    forbidden afterwards. A role without members gets no subject: an empty one would match every client.
    """
    granted = [*grants(car), *(ros_grants(ros) if ros is not None else ())]
    ranked = (Role.VIEWER, Role.OPERATOR, Role.ADMIN)
    members = {role: [person.common_name for person in people if person.role.includes(role)] for role in ranked}
    planning = [person for person in people if person.role is Role.PLANNER]
    planners = {person.name: list(planner_grants(car, person.name, ros)) for person in planning}
    subjects: list[dict[str, Any]] = [
        # A client without a certificate is on the car itself: tcp is never offered elsewhere, and this checks it once
        # more.
        {"id": "this-machine", "link_protocols": ["tcp"], "interfaces": ["lo", "lo0"]},
        *(
            {"id": role.value, "link_protocols": ["tls"], "cert_common_names": names}
            for role, names in members.items()
            if names
        ),
        *(
            {"id": f"planner-{one.name}", "link_protocols": ["tls"], "cert_common_names": [one.common_name]}
            for one in planning
        ),
    ]
    policies = [{"rules": ["everything"], "subjects": ["this-machine"]}] + [
        {"rules": [grant.name for grant in granted if grant.role is role], "subjects": [role.value]}
        for role, names in members.items()
        if names
    ]
    policies += [
        {"rules": [grant.name for grant in own], "subjects": [f"planner-{name}"]} for name, own in planners.items()
    ]
    granted += itertools.chain.from_iterable(planners.values())
    everything = rule("everything", ["ingress", "egress"], EVERY_MESSAGE, ["**"])
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": [everything, *(rule(grant.name, [grant.flow], grant.messages, grant.keys) for grant in granted)],
        "subjects": subjects,
        "policies": policies,
    }


def grants(car: str) -> Iterator[Grant]:
    """Yield the rights of each role with one car.

    One chunk below wallride/<car> is telemetry, which every listed person may receive; deeper keys are granted one by
    one. A query and its reply are separate grants: one for both ways would let a viewer reply in the car's name.
    """
    viewer, operator, admin = Role.VIEWER, Role.OPERATOR, Role.ADMIN
    # A subscription may be wide, because outgoing samples are judged again, by the key they leave with.
    yield Grant(viewer, "wants", "ingress", ("declare_subscriber",), (f"{topics.ROOT}/**",))
    yield Grant(viewer, "telemetry", "egress", ("put",), (topics.key(car, "*"),))
    yield Grant(viewer, "who-is-there", "ingress", ASKS_WHO, (topics.key("*", topics.ALIVE),))
    yield Grant(viewer, "car-is-there", "egress", ("liveliness_token",), (topics.key(car, topics.ALIVE),))
    yield from _questions(viewer, "look", _keys(car, topics.PARAM, "list", "get", "history"))

    command = (topics.key(car, topics.COMMAND),)
    yield Grant(operator, "command", "ingress", ("put",), command)
    yield Grant(operator, "command-heard", "egress", ("declare_subscriber",), command)
    token = (topics.key(car, f"{topics.OPERATOR_ALIVE}/*"),)
    yield Grant(operator, "operator-is-there", "ingress", ("liveliness_token",), token)
    yield Grant(operator, "who-else-operates", "ingress", ASKS_WHO, token)
    yield Grant(operator, "others-operate", "egress", ("liveliness_token",), token)
    yield from _questions(operator, "change", _keys(car, topics.PARAM, "set", "save", "restart"))

    yield from _questions(operator, "own-parts", _keys(car, topics.OWN_PARTS, "show", "forget"))
    yield from _questions(operator, "logs", _keys(car, topics.LOGS, "list", "get"))
    yield from _questions(admin, "configure", _keys(car, topics.PARAM, "configure"))
    yield from _questions(admin, "record", (topics.key(car, topics.RECORD), topics.key(car, f"{topics.LOGS}/trim")))


def planner_grants(car: str, name: str, ros: RosAccess | None) -> Iterator[Grant]:
    """Yield the rights of one planner: the key of its own name, and nothing else; ROS 2's also has /drive."""
    keys = [topics.planner_key(car, name)]
    if ros is not None and ros.drive and name == ROS2_PLANNER:
        keys.append(ros.drive)
    yield Grant(Role.PLANNER, f"plan-{name}", "ingress", ("put",), tuple(keys))
    yield Grant(Role.PLANNER, f"plan-{name}-heard", "egress", ("declare_subscriber",), tuple(keys))


def ros_grants(ros: RosAccess) -> Iterator[Grant]:
    """Yield the rights with the car's ROS 2 keys: viewers see graph and topics, and cannot invent nodes."""
    viewer, graph = Role.VIEWER, f"{GRAPH}/{ros.domain}/**"
    yield Grant(viewer, "ros-wants", "ingress", ("declare_subscriber",), (f"{ros.domain}/**",))
    yield Grant(viewer, "ros-topics", "egress", ("put",), ros.published)
    yield Grant(viewer, "ros-who-is-there", "ingress", ASKS_WHO, (graph,))
    yield Grant(viewer, "ros-car-is-there", "egress", ("liveliness_token",), (graph,))
    caches = tuple(f"{key}/{LATCHED_SUFFIX}" for key in ros.latched)
    yield Grant(viewer, "ros-late-ask", "ingress", ("query", *ASKS_WHO), caches)
    yield Grant(viewer, "ros-late-answer", "egress", ("declare_queryable", "liveliness_token"), caches)
    yield Grant(viewer, "ros-late-message", "egress", ("reply",), ros.latched)  # the cache replies by the topic's key


def _keys(car: str, service: str, *verbs: str) -> tuple[str, ...]:
    return tuple(topics.key(car, f"{service}/{verb}") for verb in verbs)


def _questions(role: Role, name: str, keys: tuple[str, ...]) -> Iterator[Grant]:
    """Yield the two grants by which a role queries and only the car replies."""
    yield Grant(role, f"{name}-ask", "ingress", ("query",), keys)
    yield Grant(role, f"{name}-answer", "egress", ("declare_queryable", "reply"), keys)


def rule(name: str, flows: Sequence[str], messages: Sequence[str], keys: Sequence[str]) -> dict[str, Any]:
    """Return one rule of zenoh's access control; there are only rules that allow."""
    return {
        "id": name,
        "permission": "allow",
        "flows": list(flows),
        "messages": list(messages),
        "key_exprs": list(keys),
    }


def session_base(mode: str, protocols: list[str]) -> dict[str, Any]:
    """Return the common part of both ends: no discovery on the network, and silence is detected within a second."""
    return {
        "mode": mode,
        "scouting": {"delay": 0, "multicast": {"enabled": False}, "gossip": {"enabled": False}},
        "transport": {
            "link": {"protocols": protocols, "tx": {"lease": LEASE_MS, "keep_alive": KEEP_ALIVES_PER_LEASE}},
            "shared_memory": {"enabled": False},
        },
    }
