"""The shipped layout for Foxglove and Lichtblick shows topics and fields that there are."""

import json
import re
from pathlib import Path

import pytest

from wallride.runtime.ros.definitions import TYPES, definition
from wallride.runtime.wire import topics

LAYOUT = json.loads((Path(__file__).resolve().parents[2] / "docs" / "foxglove-layout.json").read_text())
TEXTS = {topics.STATUS, topics.DECISION}
"""In a recording and on the live server these are std_msgs/String."""


def panels_of(tree):
    if isinstance(tree, str):
        return {tree}
    assert tree["direction"] in {"row", "column"}
    return panels_of(tree["first"]) | panels_of(tree["second"])


def paths(value):
    """Yield every message path and topic of the panels' settings."""
    if isinstance(value, dict):
        for name, item in value.items():
            if name in {"value", "path", "topicPath", "topicToRender"} and isinstance(item, str):
                yield item
            elif name == "topics":
                yield from item
            else:
                yield from paths(item)
    elif isinstance(value, list):
        for item in value:
            yield from paths(item)


def field_of(text, fields):
    """Follow field names through a ros2msg definition."""
    head, *parts = re.split(r"=+\n", text)
    types = dict(part.removeprefix("MSG: ").split("\n", 1) for part in parts)
    block = head
    for field in fields:
        match = re.search(rf"^(\S+?)(\[\S*\])? {re.escape(field.split('[')[0])}$", block, re.MULTILINE)
        assert match is not None, f"no {field}"
        assert ("[" in field) == (match[2] is not None)
        block = types.get(match[1], "")


def test_every_panel_has_settings_and_a_place():
    assert panels_of(LAYOUT["layout"]) == set(LAYOUT["configById"])


@pytest.mark.parametrize("path", sorted(set(paths(LAYOUT["configById"]))))
def test_every_path_leads_to_a_field(path):
    topic, *fields = path.removeprefix("/").split(".")
    if topic in TEXTS:
        assert fields == ["data"]
        return
    field_of(definition(TYPES[topic]), fields)


def test_the_view_shows_what_a_debugger_wants_first():
    shown = {path.split(".")[0] for path in paths(LAYOUT["configById"])}
    assert {"/scan", "/wall", "/footprint", "/distance_error", "/output", "/odom", "/status"} <= shown
