"""The reference pages of settings, topics, commands and states, written from the code: `python -m wallride.reference`.

`pages` returns them; `tests/docs/test_reference.py` fails when the files in docs/reference are not the same.
"""

import argparse
import json
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Final

from pydantic import BaseModel

from wallride.cli import build_parser
from wallride.reference.wire import wire_sections
from wallride.runtime.arbitration.driving_state import (
    BATTERY_CLEARED_BY,
    CLEARED_BY,
    OWN_LAW_CLEARED_BY,
    PLANNER_CLEARED_BY,
    STATE_OF,
    DrivingState,
    Observation,
)
from wallride.runtime.control.method_settings import METHODS, OWN_METHODS, name_of
from wallride.runtime.control.own_laws.law_class import OWN_TAG
from wallride.runtime.parameters.catalogue import Parameter, catalogue
from wallride.runtime.parameters.policy import Effect
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.settings.devices import DEFAULT_DRIVERS, DRIVERS, OWN_DRIVERS
from wallride.runtime.settings.telemetry import RatesHz
from wallride.runtime.settings.tree import Settings
from wallride.runtime.wire import topics

FOLDER: Final = Path(__file__).resolve().parents[2] / "docs" / "reference"
COMMAND: Final = "python -m wallride.reference"
HEAD: Final = f"<!-- Written by `{COMMAND}`: edit the code, not this page. -->\n"
EVERY_HZ: Final = 200.0
"""The rate setting that means "every one"."""

MEANINGS: Final[Mapping[str, str]] = {
    **{name: topic.meaning for name, topic in topics.TELEMETRY.items()},
    topics.BEAT: "the car's heartbeat, which every operator command echoes",
}
OWN_TYPES: Final[Mapping[str, str]] = {
    **dict.fromkeys(topics.JSON_TOPICS, "JSON object"),
    topics.BEAT: "binary, 55 bytes, below",
}
OWN_RATES: Final[Mapping[str, str]] = {
    topics.BEAT: "`operator.beat_hz`; of 50 Hz with a lidar of 40 Hz one before each scan; a third of it while no"
    " operator is heard",
}
TO_THE_CAR: Final[Sequence[tuple[str, str, str, str]]] = (
    (topics.COMMAND, "put, binary, 60 bytes", "operator", "the operator's inputs, 20 to 100 times a second"),
    (
        f"{topics.PLANNER}/NAME/command",
        "put, binary, 60 bytes",
        "planner NAME",
        "a planner's drive, 20 to 100 times a second (docs/planners.md)",
    ),
    (f"{topics.PARAM}/list", "query, JSON", "viewer", "every setting with value, range, unit and description"),
    (f"{topics.PARAM}/get", "query, JSON", "viewer", "values of settings"),
    (f"{topics.PARAM}/history", "query, JSON", "viewer", "the latest changes"),
    (f"{topics.PARAM}/set", "query, JSON", "operator", "changes settings, all of a request or none"),
    (f"{topics.PARAM}/save", "query, JSON", "operator", "writes the changes to the settings file"),
    (f"{topics.PARAM}/restart", "query, JSON", "operator", "starts a car that stands anew, by its settings file"),
    (f"{topics.PARAM}/configure", "query, JSON", "admin", "writes settings that take effect after a restart as well"),
    (f"{topics.LOGS}/list", "query, JSON", "operator", "the recordings on the car"),
    (f"{topics.LOGS}/get", "query, JSON; the answer is bytes", "operator", "a piece of a recording"),
    (f"{topics.LOGS}/trim", "query, JSON", "admin", "deletes the oldest recordings"),
    (topics.RECORD, "query, JSON", "admin", "starts and stops a recording"),
    (f"{topics.OWN_PARTS}/show", "query, JSON", "operator", "parts of the car that its lidar sees"),
    (
        f"{topics.OWN_PARTS}/forget",
        "query, JSON",
        "operator",
        "deletes them, so that they are learnt again; refused while the car moves",
    ),
    (
        topics.SIMULATOR,
        "query, JSON",
        "any program on the computer",
        "changes the world of a simulated car; simulator only",
    ),
)
"""Key, kind, least role that may use it (with keys, docs/security.md), meaning."""
EFFECTS: Final[Mapping[Effect, str]] = {
    Effect.NOW: "next scan",
    Effect.STANDING: "standing",
    Effect.RESTART: "restart",
}


def pages() -> dict[str, str]:
    """Return the text of every page by file name."""
    return {
        "settings.md": settings_page(),
        "topics.md": topics_page(),
        "commands.md": commands_page(),
        "states.md": states_page(),
    }


def settings_page() -> str:
    """Return every setting of every law: default, range with its unit, effect of a change, and description."""
    lines = [
        HEAD,
        "# Settings\n",
        "One table per section of `car.toml`. Set one for a drive with `--set SECTION.KEY=VALUE`, or on a driving",
        "car with `wallride param set SECTION.KEY=VALUE`. *Obeyed*: when a live change takes effect: from the next",
        "scan on, only while the car stands, or after a restart. *Looser*: the direction of change for which the car",
        "has to stand, because it reduces a margin of safety (`operator.loosen_safety_while_driving`). Ranges without",
        "a unit are ratios or counts.\n",
    ]
    for title, chosen in _sections(catalogue(Settings())):
        lines += [f"## {title}\n", "| setting | default | range | obeyed | looser | meaning |", "| --- " * 6 + "|"]
        lines += [_setting_row(parameter) for parameter in chosen]
        lines.append("")
    return "\n".join(lines)


def _sections(default: Mapping[str, Parameter]) -> Iterator[tuple[str, list[Parameter]]]:
    """Yield each section with its settings; those of other laws after those of the default laws."""
    for section in dict.fromkeys(name.rpartition(".")[0] for name in default):
        chosen = [parameter for name, parameter in default.items() if name.rpartition(".")[0] == section]
        choices = {f"{section}.method": "method", **{f"{one}.driver": "driver" for one in DRIVERS if one == section}}
        choice = next((p for p in chosen if p.name in choices), None)
        if choice is None:
            yield section, chosen
        else:
            yield f"{section}, {choices[choice.name]} = {json.dumps(choice.default)}", chosen
        if section in DRIVERS:
            yield from _other_drivers(section)
    for section, laws in METHODS.items():
        others = {name_of(law): law for law in (*laws, OWN_METHODS[section])}
        del others[str(default[f"{section}.method"].default)]
        yield from _others(section, "method", others)


def _other_drivers(section: str) -> Iterator[tuple[str, list[Parameter]]]:
    """Yield the settings of a device's drivers other than the default one."""
    built_in = {str(model.model_fields["driver"].default): model for model in DRIVERS[section]}
    del built_in[DEFAULT_DRIVERS[section]]
    yield from _others(section, "driver", {**dict(sorted(built_in.items())), OWN_TAG: OWN_DRIVERS[section]})


def _others(section: str, choice: str, models: Mapping[str, type[BaseModel]]) -> Iterator[tuple[str, list[Parameter]]]:
    """Yield a section's settings by each model of a choice."""
    for name, model in models.items():
        known = catalogue(Settings().model_copy(update={section: model.model_construct()})).items()
        yield f'{section}, {choice} = "{name}"', [one for key, one in known if key.rpartition(".")[0] == section]


def _setting_row(parameter: Parameter) -> str:
    cells = (
        f"`{parameter.name.rpartition('.')[2]}`",
        f"`{json.dumps(parameter.default)}`",
        parameter.range_words(),
        EFFECTS[parameter.effect],
        str(parameter.loosens),
        parameter.words,
    )
    return _row(cells)


def topics_page() -> str:
    """Return every key that a car publishes or answers: type, rate, meaning."""
    rates = RatesHz().model_dump()
    lines = [
        HEAD,
        "# Topics\n",
        "All keys begin with `wallride/CAR/`; the car's name is `car.name`. Types are ROS 2 messages in CDR unless",
        "said. The rate is the default of `telemetry.rates_hz`, an upper limit: a topic is never sent more often than",
        "there is news (of most topics the newest, 20 to 25 times a second), and not at all without a subscriber.",
        "Listen with `wallride topic list|hz|bw|echo`.\n",
        "## From the car\n",
        "| topic | type | rate | meaning |",
        "| --- " * 4 + "|",
    ]
    for topic, meaning in MEANINGS.items():
        kind = OWN_TYPES.get(topic) or f"`{TYPES[topic]}`"
        rate = OWN_RATES.get(topic) or _rate(rates[topic])
        lines.append(_row((f"`{topic}`", kind, rate, meaning)))
    lines += ["", "## To the car\n", "| key | kind | role | meaning |", "| --- " * 4 + "|"]
    lines += [_row((f"`{key}`", kind, role, meaning)) for key, kind, role, meaning in TO_THE_CAR]
    lines += [
        "",
        "`alive` and `operator/alive/SESSION` are liveliness tokens: present while a car, or an operator, is there.",
        "Time stamps in JSON are seconds on the car's monotonic clock; a number that does not exist is `null`.",
        "",
        *wire_sections(),
    ]
    return "\n".join(lines)


def _rate(rate_hz: float) -> str:
    return "every one" if rate_hz >= EVERY_HZ else f"{rate_hz:g} Hz"


STATE_MEANINGS: Final[Mapping[DrivingState, str]] = {
    DrivingState.STARTING: "the process is up, and nothing has been decided yet",
    DrivingState.WAITING: "lidar or motor is not ready; the reason names it and what is wrong",
    DrivingState.DISARMED: "no operator drives or permits autonomy; the reason says what ended the last permit",
    DrivingState.ARMED: "a human or autonomy may move the car, and no motion is asked for",
    DrivingState.DRIVING: "the car moves as its driver asks",
    DrivingState.LIMITED: "the car moves, slower than its driver asks; the reason names the limit",
    DrivingState.STOPPED: "the car is held: by safety, by the battery, or by a driver that is silent or stuck",
    DrivingState.ESTOPPED: "an operator pressed the e-stop; it is latched",
    DrivingState.FAULT: "the motor controller reported a fault, or contradicts the lidar; it is latched",
}


def states_page() -> str:
    """Return the car's states: meaning, what clears each, and what leads to each."""
    lines = [
        HEAD,
        "# States\n",
        "The state of the car in one word, in `condition` of the topic `status`, in `wallride status` and on the page,",
        "always with its reason and what clears it. It describes what arbitration decided and changes nothing.",
        "`state` beside it only says whether the car moves (`driving`, `standing`, `no motor`): use `condition`.\n",
        "| state | meaning | cleared by |",
        "| --- " * 3 + "|",
        *(_row((f"`{state}`", STATE_MEANINGS[state], cleared_by(state))) for state in DrivingState),
        "",
        "## What leads to each\n",
        "At every decision the first of these observations that applies names the state, whatever it was before.\n",
        "| observation | state |",
        "| --- | --- |",
        *(_row((seen, f"`{STATE_OF[seen]}`")) for seen in Observation),
        "",
    ]
    return "\n".join(lines)


def cleared_by(state: DrivingState) -> str:
    """Return what clears a state, whatever holds the car in it."""
    words = CLEARED_BY[state] or "-"
    if state is not DrivingState.STOPPED:
        return words
    others = (
        ("the battery", BATTERY_CLEARED_BY),
        ("a planner", PLANNER_CLEARED_BY),
        ("a law of yours", OWN_LAW_CLEARED_BY),
    )
    return f"{words}. {' '.join(f'By {what}: {ends}.' for what, ends in others)}".removesuffix(".")


def commands_page() -> str:
    """Return every command with its arguments and options."""
    lines = [
        HEAD,
        "# Commands\n",
        "`wallride COMMAND --help` says the same. Exit codes: 0 done, 2 a mistake that the message explains, 130",
        "Ctrl-C; commands with other codes name them.\n",
    ]
    for command in _commands(build_parser()):
        lines += command
    return "\n".join(lines)


def _commands(parser: argparse.ArgumentParser, summary: str = "", depth: int = 1) -> Iterator[list[str]]:
    """Yield the lines of each command, a parent before its children."""
    children = None
    rows = []
    for action in parser._actions:  # noqa: SLF001 - argparse has no public list of its options
        if isinstance(action, argparse._SubParsersAction):  # noqa: SLF001 - nor a public name for this
            children = action
        elif action.dest != "help" and action.help is not argparse.SUPPRESS:
            rows.append(_option_row(action))
    if depth > 1 or rows:
        lines = [f"{'#' * min(depth, 3)} {parser.prog}\n" if depth > 1 else "## Everywhere\n"]
        said = parser.description or summary
        if depth > 1 and said:
            lines.append(f"{said[:1].upper()}{said[1:].rstrip('.')}.\n")
        if rows:
            lines += ["| argument | meaning |", "| --- | --- |", *rows, ""]
        yield lines
    if children is not None:
        helps = {choice.dest: choice.help or "" for choice in children._choices_actions}  # noqa: SLF001 - as above
        for name, child in children.choices.items():
            yield from _commands(child, helps.get(name, ""), depth + 1)


def _option_row(action: argparse.Action) -> str:
    values = action.metavar if action.metavar is not None else action.dest.upper()
    if action.choices is not None and action.metavar is None:
        values = "|".join(map(str, action.choices))
    value = " ".join(values) if isinstance(values, tuple) else str(values)
    if not action.option_strings:
        name = f"[{value}]" if action.nargs in {"?", "*"} else value
    else:
        name = ", ".join(action.option_strings) + ("" if action.nargs == 0 else f" {value}")
    words = (action.help or "") % {"default": action.default, "prog": "wallride"}
    return _row((f"`{name.replace('|', chr(92) + '|')}`", words))


def _row(cells: Sequence[str]) -> str:
    """Return one line of a table; a bar within a cell would end it."""
    escaped = (cell if f"{chr(92)}|" in cell else cell.replace("|", f"{chr(92)}|") for cell in cells)
    return f"| {' | '.join(' '.join(cell.split()) for cell in escaped)} |"


def main() -> None:
    """Write the pages."""
    FOLDER.mkdir(exist_ok=True)
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
        print(f"docs/reference/{name}")
