"""Every `wallride` command on the pages is one that the program understands, down to its options."""

import re
import shlex
from functools import cache
from pathlib import Path

import pytest

from wallride.cli import build_parser

ROOT = Path(__file__).resolve().parents[2]
PAGES = [
    ROOT / "README.md",
    *(
        ROOT / "docs" / f"{name}.md"
        for name in (
            "bring-up", "calibration", "security", "troubleshooting", "driving", "fleet", "scenarios", "sweeps",
            "your-own-law", "planners", "ros2", "gym", "python", "scale", "faults", "architecture",
        )
    ),
]  # fmt: skip
FENCED = re.compile(r"^ *```(\w*)\n(.*?)^ *```$", re.MULTILINE | re.DOTALL)
SPAN = re.compile(r"`([^`]*)`")
COMMAND = re.compile(r"(?:sudo )?wallride [a-z]")
INDENTED = re.compile(r"^    ((?:sudo )?wallride [a-z].*)$", re.MULTILINE)
ENDS = ("#", "&", "&&", "|", ";", ">", "...")
"""Of what follows, the shell or a person takes care."""


@cache
def parser():
    return build_parser()


def commands_of(text):
    """Return the commands of a page as lists of words."""
    fenced = "\n".join(block for language, block in FENCED.findall(text) if language in {"", "sh"}).replace("\\\n", " ")
    lines = [line.strip() for line in fenced.splitlines()]
    found = [line for line in lines if line.removeprefix("sudo ").startswith("wallride ")]
    spans = (span.replace("\n", " ") for span in SPAN.findall(FENCED.sub("", text)))
    found += [*(span for span in spans if COMMAND.match(span)), *INDENTED.findall(text)]
    return [words_of(line.removeprefix("sudo ")) for line in found]


def words_of(line):
    words = []
    for word in shlex.split(line.replace("'", '"') if line.count("'") % 2 else line, comments=True):
        if word.startswith(ENDS):
            break
        words.append(word.rstrip(";").partition("|")[0])  # of a choice, the first
    return words


def why_wrong(words, capsys):
    """Return what the parser says; "" for a command that it takes, or that only lacks what a sentence leaves out."""
    try:
        parser().parse_args(words[1:])
    except SystemExit as end:
        said = capsys.readouterr().err.strip().splitlines()
        if end.code == 0 or "arguments are required" in said[-1] or "expected one argument" in said[-1]:
            return ""
        return f"{shlex.join(words)}: {said[-1]}"
    return ""


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_the_program_understands_what_the_page_says(page, capsys):
    wrong = [why_wrong(words, capsys) for words in commands_of(page.read_text(encoding="utf-8"))]
    assert [text for text in wrong if text] == []


def test_commands_are_found_and_mistakes_in_them(capsys):
    text = "`wallride status` and `wallride doctro`\n```sh\nsudo wallride keys add al \\\n  --role king   # him\n```\n"
    found = commands_of(text)
    assert found == [
        ["wallride", "keys", "add", "al", "--role", "king"],
        ["wallride", "status"],
        ["wallride", "doctro"],
    ]
    assert [bool(why_wrong(words, capsys)) for words in found] == [True, False, True]
