"""The tables of reasons in docs/laws.md say what the code says, and leave no reason out."""

import ast
import re
from pathlib import Path

import pytest

from wallride.runtime.teleop.rejections import Refusal

ROOT = Path(__file__).resolve().parents[2]
RUNTIME = ROOT / "runtime"
PLACES = (
    *(RUNTIME / "control").rglob("*.py"),
    *(RUNTIME / "arbitration").rglob("*.py"),
    *(RUNTIME / "tasks" / f"{name}.py" for name in ("battery", "health", "mux", "safety", "scan_speed", "wall_follow")),
    RUNTIME / "live_stack.py",
    RUNTIME / "teleop" / "desk.py",
    RUNTIME / "teleop" / "planners.py",
)
"""Modules that decide, or that stop the car, and so say why."""
OTHER_TEXT = frozenset(
    {
        # the states and what clears them are on docs/reference/states.md, written from the code
        "driving_state.py",
        # a range in words; an error of the programmer; errors at the start
        "vehicle.py", "inbox.py", "law_class.py",
    }
)  # fmt: skip
NO_REASONS = frozenset(
    {
        # consent: never the reason of a decision
        "operator permits", "permit not required", "window clean",
        # sentences on the window in the status, beside the reason
        "are dirty: clean the window", "see nothing: uncover or clean the window",
        "see the car itself, or dirt, and are ignored", ".+ beams around .+ deg .+",
        "almost no beam has an echo: uncover or clean the lidar",
        "the lidar allows .+ m/s: .+", ".+.+ deg a beam, .+ m",
        "the wheels go on at .+ m/s although the car brakes: cut the motor's power",
        # why a promised path is not believed, in the status: the arc is judged then, and gives the reason
        "the promised path is not believed: .+ (.+ times)", "it left its path", "it took its path back",
        "its path is no numbers", "its path does not begin at the car", "its path has gaps",
        "its path is shorter than a stop", "no wheels steer so", "faster than the floor's grip",
        "the wheels were locked", "it is of another scan", "the command leads elsewhere", "the command is faster",
        "no room to brake from its path",
        # what tells the heading of odom, in the status
        "gyro", "steering: .+", "no inertial sensor", "the gyro is silent",
        "the gyro's bias is not known: let the car stand for a second",
        "the inertial sensor is not level: enter its mounting in VESC Tool",
        "the gyro does not agree with the steering: is its mounting entered in VESC Tool?",
        " .+ times in a row",  # a part of a reason
        "the wheels turn and the scan stands (wheels in the air?): it does not back out",
        # counted and logged: the command is not obeyed, and the car does what it did before
        "release everything first, then press", "an unreadable command", "an operator without a name",
        "another operator drives; take over, or wait", ".+ said goodbye", ".+ reset the e-stop",
        ".+ was lost: no fresh command and no goodbye", "sent before this car was heard, or for an earlier start of it",
        "echoes a beat that was not sent lately", "the link is slow, or was away for a while",
        "planner hold",  # the name of a source
        "planner .+", "planner .+: .+", "planner .+ has the car", "planner .+ said goodbye",
        ".+: no fresh command and no goodbye",
        "not newer than the last of its session", "said goodbye; start the client again", "close some of the clients",
    }
)  # fmt: skip


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


def sentences(tree):
    """Yield the strings of a module but for docstrings, texts of exceptions and lines of the log."""
    for node in ast.walk(tree):
        for name, value in ast.iter_fields(node):
            kept = [part for part in value if not is_aside(part)] if isinstance(value, list) else value
            setattr(node, name, kept)
    yield from strings(tree)


def is_aside(node):
    """Tell whether a statement is a docstring, raises, or logs."""
    if isinstance(node, ast.Raise):
        return True
    if not isinstance(node, ast.Expr):
        return False
    call = node.value
    logs = isinstance(call, ast.Call) and isinstance(call.func, ast.Attribute) and ast.unparse(call.func.value) == "log"
    return logs or isinstance(call, ast.Constant)


def without_kind(reason):
    """Return a reason without the kind of refusal that the desk puts before its advice."""
    kind, _, advice = reason.partition(": ")
    return advice if kind in set(Refusal) else reason


def undocumented(source, reasons):
    """Return the sentences of a source that are no reason of the page, as patterns without escapes."""
    found = {pattern(text) for text in sentences(ast.parse(source))}
    found = {words for words in found if re.search(r"[a-z]{2,}.*[ :]", words)}
    missing = {words for words in found if not any(re.fullmatch(words, without_kind(reason)) for reason in reasons)}
    return {re.sub(r"\\(.)", r"\1", words) for words in missing} - NO_REASONS


def rows():
    """Return the reasons of each row of the tables, and its last cell."""
    page = (ROOT / "docs" / "laws.md").read_text(encoding="utf-8")
    table = page[page.index("## Reasons") :].split("\n### ")[0]
    cells = [line.strip("|").split("|") for line in table.splitlines() if line.startswith("| `")]
    return [(re.findall(r"`([^`]+)`", row[0]), row[-1].strip()) for row in cells]


def documented():
    """Return the reasons of the tables."""
    return [reason for reasons, _ in rows() for reason in reasons]


def said_in(where):
    """Return the patterns of the strings of a place: a function of a file, a file or a folder."""
    function, name = re.fullmatch(r"(?:`(_\w+)` in )?`([\w/]+(?:/|\.py))`", where).groups()
    path = ROOT / name if name.startswith("runtime/") else RUNTIME / "control" / name
    trees = [ast.parse(file.read_text(encoding="utf-8")) for file in (path.rglob("*.py") if path.is_dir() else [path])]
    if function:
        defined = [node for tree in trees for node in ast.walk(tree) if isinstance(node, ast.FunctionDef)]
        trees = [node for node in defined if node.name == function]
    return {pattern(text) for tree in trees for text in strings(tree)}


def test_every_reason_of_the_tables_is_in_the_code():
    said = {pattern(text) for file in PLACES for text in strings(ast.parse(file.read_text(encoding="utf-8")))}
    said = {re.compile(words) for words in said if re.search(r"[a-z]{3}", words) or words == ".+; permit again"}
    reasons = [*documented(), "made up: wall ahead"]
    assert [one for one in reasons if not any(words.fullmatch(without_kind(one)) for words in said)] == [
        "made up: wall ahead"
    ]


@pytest.mark.parametrize(("reasons", "where"), rows(), ids=lambda value: value[0] if isinstance(value, list) else "")
def test_the_place_that_a_row_names_says_its_reasons(reasons, where):
    said = {words for words in said_in(where) if words != ".+"}
    absent = [one for one in reasons if not any(re.fullmatch(words, without_kind(one)) for words in said)]
    assert not absent, f"{where} does not say {absent}: name the file that does in docs/laws.md"


@pytest.mark.parametrize("file", PLACES, ids=lambda file: str(file.relative_to(ROOT)))
def test_every_reason_of_the_code_is_in_the_tables(file):
    if file.name in OTHER_TEXT:
        return
    missing = undocumented(file.read_text(encoding="utf-8"), documented())
    assert missing == set(), "add it to Reasons in docs/laws.md, or to NO_REASONS of this test if it is none"


def test_a_reason_that_is_not_in_the_tables_is_found():
    source = """
def look(x):
    \'\'\'Docstring: no reason.\'\'\'
    log.info("a line of the log")
    if not x:
        raise ValueError("an error of the caller")
    return Verdict(0.0, 0.0, f"made up: {x} ahead" if x else "wall ahead")
"""
    assert undocumented(source, documented()) == {"made up: .+ ahead"}
