"""The table of reasons in docs/laws.md says what the code says, and leaves none of safety's out."""

import ast
import re
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
SWEPT = ROOT / "runtime" / "control" / "safety" / "swept.py"


def pattern(text):
    """Return what a string or f-string of the code matches; a hole of an f-string is anything."""
    parts = text.values if isinstance(text, ast.JoinedStr) else [text]
    return "".join(re.escape(str(part.value)) if isinstance(part, ast.Constant) else ".+" for part in parts)


def strings(node):
    """Yield every string and f-string below a node, not the parts of an f-string."""
    if isinstance(node, ast.JoinedStr) or (isinstance(node, ast.Constant) and isinstance(node.value, str)):
        yield node
        return
    for part in ast.iter_child_nodes(node):
        yield from strings(part)


def documented():
    """Return the reasons of the table."""
    page = (ROOT / "docs" / "laws.md").read_text(encoding="utf-8")
    table = page[page.index("## Reasons") :].split("\n### ")[0]
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    return [reason for row in rows for reason in re.findall(r"`([^`]+)`", row)]


def test_every_reason_of_the_table_is_in_the_code():
    folders = (ROOT / "runtime" / "control", ROOT / "runtime" / "arbitration")
    said = {
        pattern(text)
        for folder in folders
        for file in folder.rglob("*.py")
        for text in strings(ast.parse(file.read_text(encoding="utf-8")))
    }
    said = {words for words in said if re.search(r"[a-z]{3}", words)}
    reasons = [*documented(), "made up: wall ahead"]
    assert [one for one in reasons if not any(re.fullmatch(words, one) for words in said)] == ["made up: wall ahead"]


def test_every_reason_of_safety_is_in_the_table():
    verdicts = [
        node.args[2]
        for node in ast.walk(ast.parse(SWEPT.read_text(encoding="utf-8")))
        if isinstance(node, ast.Call) and isinstance(node.func, ast.Name) and node.func.id == "Verdict"
    ]
    said = {pattern(text) for verdict in verdicts for text in strings(verdict)}
    assert len(said) > 6
    assert {words for words in said if not any(re.fullmatch(words, reason) for reason in documented())} == {"clear"}
