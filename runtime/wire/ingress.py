"""Limits on what each client may send to the car, kept by zenoh's own threads before Python sees a message. Pure.

They count for each session apart, so that one client's flood takes nothing from another one. zenoh lets a message
through when the time since the last one that it let through is long enough: an even stream passes whole, a burst only
with its first message. A question that is held back has an empty answer at once, and clients ask again (`Bus.ask`).
"""

from collections.abc import Mapping, Sequence
from typing import Any, Final

from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import COMMAND_BYTES

COMMANDS_HZ: Final = 500.0
"""Clients send at most 100 commands a second, and their last words 5 ms apart, three times."""
QUESTIONS_HZ: Final = 10.0
CHANGES_HZ: Final = 20.0
"""A slider on the page sends its changes while it moves."""
PIECES_HZ: Final = 200.0
"""Pieces of recordings: the car itself answers them one after the other.

Each kind's highest rate is also that of the rule for all other keys: where two rules fit a key, zenoh takes one of
them, another one in another session. A lower rate there held back commands and changes of settings in one session of
five."""
MAX_QUESTION_BYTES: Final = 4096
MAX_INCOMING_B: Final = 65536
"""Maximum size of a message that zenoh puts together from fragments, 1 GiB without a limit. More than any request."""

MAX_ANSWER_B: Final = 4 << 20
"""The same for what a car sends to a client: ten times the list of 4,000 recordings."""


def downsampling(car: str) -> list[dict[str, Any]]:
    """Return the highest rates at which one client reaches the car, by key [1/s].

    The rule for all other keys is for clients on this machine: no access control holds their wildcards back.
    """
    return [
        rate_rule("commands", ["put", "delete"], {topics.key(car, topics.COMMAND): COMMANDS_HZ, "**": COMMANDS_HZ}),
        rate_rule("questions", ["query"], {**_questions(car), "**": PIECES_HZ}),
    ]


def routed_downsampling(car: str, planners: Sequence[str], share: float) -> list[dict[str, Any]]:
    """Return the highest rates at which a router reaches the car, by key [1/s].

    share: of what one client may send; more than 1, because behind a router are several. Every key has a rule of its
    own and none has two: a planner whose key also fits a rule of the operators' would take their place in it, and a
    flood of it kept the e-stop back. Other keys need no rule, because access control lets none of them in.
    """
    commands = {topics.key(car, topics.COMMAND): COMMANDS_HZ * share, **planner_rates(car, planners)}
    questions = {key: rate_hz * share for key, rate_hz in _questions(car).items()}
    return [rate_rule("commands", ["put", "delete"], commands), rate_rule("questions", ["query"], questions)]


def planner_rates(car: str, planners: Sequence[str]) -> dict[str, float]:
    """Return the highest rate of each planner's commands [1/s], by key; a planner is one client."""
    return {topics.planner_key(car, name): COMMANDS_HZ for name in planners}


def _questions(car: str) -> dict[str, float]:
    """Return the highest rate at which one client may ask [1/s], by key."""
    kinds = {
        topics.PARAM: ("list", "get", "history", "save", "configure", "restart"),
        topics.OWN_PARTS: ("show", "forget"),
        topics.LOGS: ("list", "trim"),
    }
    questions = [topics.RECORD, *(f"{kind}/{verb}" for kind, verbs in kinds.items() for verb in verbs)]
    rates = {
        **dict.fromkeys(questions, QUESTIONS_HZ),
        f"{topics.PARAM}/set": CHANGES_HZ,
        topics.SIMULATOR: CHANGES_HZ,
        f"{topics.LOGS}/get": PIECES_HZ,
    }
    return {topics.key(car, name): rate_hz for name, rate_hz in rates.items()}


def droppable_answers() -> list[dict[str, Any]]:
    """Return the rule by which an answer to a client that does not read is dropped, and the loop does not wait.

    zenoh gives an answer the quality of service of its question: by default it waits, and whatever has its priority
    waits behind it. Answers have a priority that neither telemetry nor an ordinary client's question has.
    """
    return [
        {
            "id": "droppable-answers",
            "flows": ["ingress"],
            "messages": ["query"],
            "key_exprs": ["**"],
            "overwrite": {"congestion_control": "drop", "priority": "interactive_low"},
        }
    ]


def low_pass_filter(command_bytes: int = COMMAND_BYTES) -> list[dict[str, Any]]:
    """Return the largest sizes of what a client sends [byte]. command_bytes: of the largest command that is taken."""
    return [
        _size("short-commands", ["put", "delete"], command_bytes),
        _size("short-questions", ["query"], MAX_QUESTION_BYTES),
    ]


def rate_rule(name: str, messages: list[str], by_key: Mapping[str, float], flow: str = "ingress") -> dict[str, Any]:
    """Return the rule of zenoh for the highest rates of messages [1/s], by key."""
    rules = [{"key_expr": key, "freq": rate_hz} for key, rate_hz in by_key.items()]
    return {"id": name, "flows": [flow], "messages": messages, "rules": rules}


def _size(name: str, messages: list[str], limit: int) -> dict[str, Any]:
    return {"id": name, "flows": ["ingress"], "messages": messages, "key_exprs": ["**"], "size_limit": limit}
