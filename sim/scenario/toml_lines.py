"""TOML files whose mistakes are told with file and line: `tomllib` reads them, a scan of the text finds the lines."""

import re
import tomllib
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import date, time
from pathlib import Path
from typing import Any

from wallride.runtime.host.text_file import TextFileError, read_text
from wallride.runtime.host.user_module import UserCodeError, search_beside

KeyPath = tuple[str | int, ...]
_HEADER = re.compile(r"^\s*(\[\[?)\s*([^\[\]]+?)\s*\]\]?\s*(?:#.*)?$")
_KEY = re.compile(r"""^\s*((?:[\w-]+|"[^"]*"|'[^']*')(?:\s*\.\s*(?:[\w-]+|"[^"]*"|'[^']*'))*)\s*=(.*)$""")
_PART = re.compile(r"""[\w-]+|"[^"]*"|'[^']*'""")
_TEXTS = re.compile(r'"(?:\\.|[^"\\])*"|\'[^\']*\'|#.*$')
_AT_LINE = re.compile(r"\s*\(at line (\d+), column \d+\)$")
_LONG_TEXTS = ('"""', "'''")


class FileMistakeError(ValueError):
    """A file cannot be used; the text begins with "FILE:LINE: "."""


@dataclass(frozen=True, slots=True)
class TomlText:
    """Content of a file. tree: its values. lines: the line of each key and table, from 1."""

    path: Path
    tree: dict[str, Any]
    lines: dict[KeyPath, int] = field(default_factory=dict)

    def line_of(self, place: Sequence[str | int]) -> int:
        """Return the line of a place in the tree, or of the nearest one above it that has a line."""
        for length in range(len(place), 0, -1):
            above = tuple(place[:length])
            if (line := self.lines.get(above, self.lines.get((*above, 0)))) is not None:  # of a list: its first table
                return line
        return 1

    def mistake(self, place: Sequence[str | int], words: str) -> FileMistakeError:
        """Return the error about a place."""
        return FileMistakeError(f"{self.path}:{self.line_of(place)}: {words}")

    def search_beside(self) -> None:
        """Have the user's laws and drivers looked for beside the file; FileMistakeError where others are imported."""
        try:
            search_beside(self.path)
        except UserCodeError as error:
            raise self.mistake((), str(error)) from None


def flat(tree: Mapping[str, Any], values_with: Iterable[str] = (), above: str = "") -> dict[str, Any]:
    """Return nested values by their dotted names; a table with one of the keys `values_with` is itself a value."""
    found: dict[str, Any] = {}
    for name, value in tree.items():
        if isinstance(value, Mapping) and value.keys().isdisjoint(values_with):
            found |= flat(value, values_with, f"{above}{name}.")
        else:
            found[f"{above}{name}"] = value
    return found


def read_toml(path: Path) -> TomlText:
    """Return a file's content; FileMistakeError when it cannot be read."""
    try:
        text = read_text(path)
        tree = tomllib.loads(text)
    except OSError as error:
        raise FileMistakeError(f"{path}: cannot be read ({error.strerror})") from None
    except TextFileError as error:
        raise FileMistakeError(f"{path}: is not a TOML file: {error}") from None
    except tomllib.TOMLDecodeError as error:
        found = _AT_LINE.search(str(error))
        line = found.group(1) if found else str(text.count("\n") + 1)
        raise FileMistakeError(f"{path}:{line}: is not valid TOML: {_AT_LINE.sub('', str(error))}") from None
    except (RecursionError, ValueError) as error:
        raise FileMistakeError(f"{path}: is not a TOML file ({type(error).__name__})") from None
    read = TomlText(path, tree, _lines_of(text))
    if (place := _date_in(tree)) is not None:
        raise read.mistake(place, f"{'.'.join(map(str, place))} is a date or a time; write a number or a text")
    return read


def _date_in(tree: object, above: KeyPath = ()) -> KeyPath | None:
    """Return the place of a date or time, which no key takes; None without one."""
    if isinstance(tree, date | time):
        return above
    below = tree.items() if isinstance(tree, dict) else enumerate(tree) if isinstance(tree, list) else ()
    return next((place for key, value in below if (place := _date_in(value, (*above, key))) is not None), None)


def _lines_of(text: str) -> dict[KeyPath, int]:
    """Return the lines of keys and tables. Keys inside of inline tables have the line of the table."""
    lines: dict[KeyPath, int] = {}
    tables: Counter[KeyPath] = Counter()
    table: KeyPath = ()
    open_brackets, long_text = 0, ""
    for number, line in enumerate(text.splitlines(), start=1):
        if long_text:
            long_text = "" if long_text in line else long_text
            continue
        if open_brackets <= 0 and (header := _HEADER.match(line)):
            table = _below(_parts(header.group(2)), tables)
            if header.group(1) == "[[":
                tables[table] += 1
                table = (*table, tables[table] - 1)
            lines.setdefault(table, number)
            continue
        value = line
        if open_brackets <= 0 and (key := _KEY.match(line)):
            _enter(lines, table, _parts(key.group(1)), number)
            value = key.group(2)
        long_text = next((mark for mark in _LONG_TEXTS if value.count(mark) % 2), "")
        bare = _TEXTS.sub("", value)
        open_brackets += bare.count("[") + bare.count("{") - bare.count("]") - bare.count("}")
    return lines


def _enter(lines: dict[KeyPath, int], table: KeyPath, key: KeyPath, number: int) -> None:
    """Enter a key of a table, and the tables that a dotted key makes."""
    for length in range(1, len(key) + 1):
        lines.setdefault((*table, *key[:length]), number)


def _below(name: KeyPath, tables: Counter[KeyPath]) -> KeyPath:
    """Return the path of a header below lists of tables: [fault.by] after two [[fault]] is fault, 1, by."""
    path: KeyPath = ()
    for part in name[:-1]:
        path = (*path, part)
        if tables[path]:
            path = (*path, tables[path] - 1)
    return (*path, name[-1])


def _parts(key: str) -> KeyPath:
    return tuple(part.strip("\"'") for part in _PART.findall(key))
