"""YAML as ROS's own loaders take it, which disagree: tabs, double keys, several documents; every foreign file bounded.

Built from the parser's events, which need no recursion: of a file that only nests or refers the beginning is enough.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

MAX_BYTES: Final = 256 << 10
MAX_DEPTH: Final = 50
MAX_VALUES: Final = 50_000
_TAB: Final = re.compile(r"(?m)(?<=\S)[ ]*\t[ \t]*|^[ \t]*\t[ \t]*(?=#|$)")
"""Tabs that are no indentation: libyaml and yaml-cpp take them as spaces."""
_INT: Final = re.compile(r"[-+]?(?:0x[0-9a-fA-F]+|0o?[0-7]+|0|[1-9][0-9_]*)")
_FLOAT: Final = re.compile(
    r"[-+]?(?:\.[0-9]+|[0-9][0-9_]*\.?[0-9]*)(?:[eE][-+]?[0-9]+)?|[-+]?\.(?:inf|Inf|INF)|\.(?:nan|NaN|NAN)"
)
_WORDS: Final = {
    "true": True, "yes": True, "on": True, "false": False, "no": False, "off": False, "null": None, "~": None, "": None,
}  # fmt: skip
MERGE: Final = "<<"


class YamlFileError(ValueError):
    """A file that is no YAML, or too much of it; the text names file, line, and key."""


@dataclass(slots=True)
class YamlFile:
    """documents: the values of a file, one each. notes: what to know of them, with lines."""

    documents: list[Any] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)


def read_yaml(path: Path) -> YamlFile:
    """Return the content of a file; YamlFileError for what is none, OSError when it cannot be read."""
    from ruamel.yaml import YAML
    from ruamel.yaml.error import MarkedYAMLError, YAMLError

    with path.open("rb") as file:
        content = file.read(MAX_BYTES + 1)
    if len(content) > MAX_BYTES:
        raise YamlFileError(f"{path}: has more than {MAX_BYTES >> 10} kB, which no parameter or map file of ROS has")
    building = _Building(path)
    try:
        for event in YAML(typ="safe", pure=True).parse(_TAB.sub(" ", _text(content))):
            building.take(event)
    except MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        raise building.error(f"is not YAML: {error.problem or error.context}", mark.line if mark else None) from None
    except YAMLError as error:
        raise building.error(f"is not YAML: {str(error).splitlines()[0]}") from None
    return building.found


def _text(content: bytes) -> str:
    """Return the text, whatever its editor: with a byte order mark, in UTF-16, or with an old encoding's comments."""
    if content.startswith((b"\xff\xfe", b"\xfe\xff")):
        return content.decode("utf-16", errors="replace")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:
        return content.decode("latin-1")


@dataclass(slots=True)
class _Open:
    """A mapping or sequence that is being read. key: the one whose value comes next, None before a key."""

    value: Any
    line: int
    anchor: str | None
    key: str | None = None
    size: int = 1
    lines: dict[str, int] = field(default_factory=dict)


class _Building:
    """Takes events and builds values."""

    def __init__(self, path: Path) -> None:
        self.found = YamlFile()
        self._path = path
        self._open: list[_Open] = []
        self._anchors: dict[str, tuple[Any, int]] = {}
        self._values = 0
        self._line = 0

    def error(self, words: str, line: int | None = None) -> YamlFileError:
        keys = ".".join(level.key for level in self._open if level.key is not None)
        where = f"line {(self._line if line is None else line) + 1}" + (f", {keys}" if keys else "")
        return YamlFileError(f"{self._path}, {where}: {words}")

    def take(self, event: Any) -> None:  # noqa: ANN401 - ruamel's
        self._line = event.start_mark.line if event.start_mark else self._line
        match type(event).__name__:
            case "DocumentStartEvent":
                self._anchors.clear()
            case "MappingStartEvent" | "SequenceStartEvent" as kind:
                if len(self._open) >= MAX_DEPTH:
                    raise self.error(f"nests deeper than {MAX_DEPTH} levels")
                value: Any = {} if kind.startswith("Mapping") else []
                self._open.append(_Open(value, self._line, event.anchor))
            case "MappingEndEvent" | "SequenceEndEvent":
                closed = self._open.pop()
                self._put(closed.value, closed.size, closed.anchor, counts=1)
            case "ScalarEvent":
                self._put(event.value if event.style else _plain(event.value), 1, event.anchor, counts=1)
            case "AliasEvent":
                if event.anchor not in self._anchors:
                    raise self.error(f"*{event.anchor} refers to nothing that is complete before it")
                value, size = self._anchors[event.anchor]
                self._put(value, size, counts=size)

    def _put(self, value: Any, size: int, anchor: str | None = None, *, counts: int) -> None:  # noqa: ANN401 - any
        self._values += counts
        if self._values > MAX_VALUES:
            raise self.error(f"holds more than {MAX_VALUES} values, with those that it refers to")
        if anchor is not None:
            self._anchors[anchor] = (value, size)
        if not self._open:
            self.found.documents.append(value)
            return
        above = self._open[-1]
        above.size += size
        if isinstance(above.value, list):
            above.value.append(value)
        elif above.key is None:
            above.key = value if isinstance(value, str) else str(value)
        else:
            self._enter(above, above.key, value)
            above.key = None

    def _enter(self, above: _Open, key: str, value: Any) -> None:  # noqa: ANN401 - whatever YAML holds
        if key == MERGE:
            for base in value if isinstance(value, list) else [value]:
                above.value.update(
                    {} if not isinstance(base, dict) else {k: v for k, v in base.items() if k not in above.value}
                )
            return
        if key in above.lines:
            self.found.notes.append(f"line {self._line + 1}: {key} is there a second time; this one counts")
        above.lines[key] = self._line
        above.value[key] = value


def _plain(text: str) -> object:
    """Return the value of an unquoted text, by the rules of YAML 1.1 that ROS's loaders share."""
    if text.lower() in _WORDS:
        return _WORDS[text.lower()]
    if _INT.fullmatch(text):
        digits = text.replace("_", "")
        return int(digits, 0) if not re.fullmatch(r"[-+]?0[0-7]+", digits) else int(digits, 8)
    if _FLOAT.fullmatch(text):
        return float(text.replace("_", "").lower().replace(".inf", "inf").replace(".nan", "nan"))
    return text


def number(value: object) -> float | None:
    """Return a number, also one that is written as text; None for anything else, True is none."""
    if isinstance(value, bool) or not isinstance(value, int | float | str):
        return None
    try:
        return float(value)
    except (ValueError, OverflowError):
        return None


def mappings(found: YamlFile) -> Iterator[dict[str, Any]]:
    """Yield the documents that hold something by name."""
    yield from (document for document in found.documents if isinstance(document, dict))
