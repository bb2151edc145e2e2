"""Text of others is printed as words, and only by one function."""

import ast
import io
from pathlib import Path

import pytest

from wallride.runtime.host.terminal_text import CLEAR_SCREEN, one_line, say

ROOT = Path(__file__).resolve().parents[3]
PRINTS_OF_ITS_OWN = {
    "wallride/reference/__init__.py", "wallride/new/options.py", "wallride/cli.py", "wallride/logs_options.py",
    "wallride/bringup/doctor_options.py", "wallride/bringup/import_options.py", "wallride/report_options.py",
    "runtime/host/terminal_text.py", "runtime/kernel/__main__.py",
}  # fmt: skip
"""Files that print what they wrote themselves, drawings, or settings as TOML, which is escaped already."""


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("wall ahead, 6° left", "wall ahead, 6° left"),
        ("\x1b[2J", r"\x1b[2J"),
        ("a\nb\r\tc", r"a\nb\r\tc"),
        ("\x9b1m\u2028\ud800", r"\x9b1m\u2028\ud800"),
        ("x" * 30, "x" * 17 + "..."),
        ("\n" * 30, r"\n" * 8 + "\\" + "..."),
        (3, "3"),
    ],
)
def test_a_text_is_one_printable_line(text, line):
    assert one_line(text, 20) == line


def test_a_screen_of_ours_is_cleared_and_nothing_else_is():
    out = io.StringIO()
    say(f"{CLEAR_SCREEN}one\ntwo {CLEAR_SCREEN}", file=out)
    assert out.getvalue() == CLEAR_SCREEN + "one\ntwo " + r"\x1b[H\x1b[2J" + "\n"


def test_commands_print_by_say():
    found = set()
    for folder in ("clients", "wallride", "runtime"):
        for path in (ROOT / folder).rglob("*.py"):
            text = path.read_text()
            if "print" in text and any(getattr(node, "id", "") == "print" for node in ast.walk(ast.parse(text))):
                found.add(path.relative_to(ROOT).as_posix())
    assert found <= PRINTS_OF_ITS_OWN
