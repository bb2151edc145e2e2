"""The help shows every command once, in the group of what somebody is about to do, in any width."""

import pytest

from tests.wallride.test_options import commands
from wallride.cli import build_parser
from wallride.parser import GROUPS, OTHERS


def test_every_command_is_in_one_group_and_every_name_is_a_command():
    grouped = [name for names in GROUPS.values() for name in names]
    assert sorted(grouped) == sorted({name.split()[0] for name, _ in commands()})


@pytest.mark.parametrize("columns", ["60", "80", "200"])
def test_the_help_has_the_groups_in_order_and_each_command_once(columns, monkeypatch):
    monkeypatch.setenv("COLUMNS", columns)
    lines = build_parser().format_help().splitlines()
    titles = [line.removesuffix(":") for line in lines if line.removesuffix(":") in GROUPS]
    assert titles == list(GROUPS)
    shown = [line.split()[0] for line in lines if line.startswith("  ") and line[2] != " "]
    assert [name for name in shown if not name.startswith("-")] == [name for names in GROUPS.values() for name in names]
    assert max(map(len, lines)) <= int(columns)


def test_a_command_of_no_group_is_shown_all_the_same(monkeypatch):
    monkeypatch.setattr("wallride.parser.GROUPS", {"daily": ("run",)})
    said = build_parser().format_help()
    assert f"{OTHERS}:" in said
    assert "teleop" in said
