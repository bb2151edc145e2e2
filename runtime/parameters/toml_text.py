"""Values in the text of a TOML file, set and removed in place; all other text stays as it is. Pure.

One way for every shape of a file: a section written in several places, dotted keys, inline tables. The text is taken
for valid TOML, which `tomllib` has said before. An inline table has no room for comments, and becomes dotted keys where
a comment is to be put into it.
"""

import itertools
import json
import re
import tomllib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

KeyPath = tuple[str, ...]

_KEY = re.compile(r"""[ \t]*(?:"((?:[^"\\]|\\.)*)"|'([^']*)'|([A-Za-z0-9_-]+))[ \t]*""")
_STRINGS = (r'"""(?:[^\\]|\\.)*?"{3,5}', r"'''.*?'{3,5}", r'"(?:[^"\\]|\\.)*"', r"'[^']*'")
_STRING = re.compile("|".join(_STRINGS), re.DOTALL)
_BARE = re.compile(r"[A-Za-z0-9_-]+")
_COMMENT = re.compile(r"[ \t]*(#[^\r\n]*)?")


@dataclass(frozen=True, slots=True)
class Statement:
    """One `key = value`, by its places in the text.

    table: of the header above. path: the whole name. key, value, end: begin of the key, begin and end of the value.
    within: the inline table that it is in.
    """

    table: KeyPath
    path: KeyPath
    key: int
    value: int
    end: int
    within: "Statement | None" = None


@dataclass(frozen=True, slots=True)
class Header:
    """One `[table]`; `start` and `end` of its line in the text."""

    table: KeyPath
    start: int
    end: int


def statements(text: str) -> list[Statement]:
    """Return all statements in order; of an inline table first the whole, then what is in it."""
    return [one for one in _parts(text) if isinstance(one, Statement)]


def set_value(text: str, path: KeyPath, value: object, comment: str | None = None) -> str:
    """Return the text with a value; comment: in place of the one behind it, None: that one stays."""
    found = _find(text, path)
    if found is None:
        return _added(text, path, _written(value) + (f" # {comment}" if comment else ""), plain=not comment)
    if found.within is not None and comment is not None:
        return set_value(_spread(text, found), path, value, comment)
    after = text[found.end :]
    if comment is not None:
        old = _comment(text, found)
        space = old[: old.index("#")] if "#" in old else " "
        after = f"{space}# {comment}" * bool(comment) + after[len(old) :]
    return text[: found.value] + _written(value) + after


def remove(text: str, path: KeyPath) -> str:
    """Return the text without a value, and without the header that would have nothing below it."""
    found = _find(text, path)
    if found is None:
        return text
    if found.within is not None:
        return remove(_spread(text, found), path)
    start, end = text.rfind("\n", 0, found.key) + 1, _line_end(text, found.end)
    text = text[:start] + text[end:]
    parts = [*_parts(text), Header((), len(text), len(text))]
    for one, following in itertools.pairwise(parts):
        if isinstance(one, Header) and one.table == found.table and isinstance(following, Header):
            below = text[one.end : following.start]
            if not below.strip() and one.table and "#" not in text[one.start : one.end]:
                return (text[: one.start] + text[following.start :].lstrip("\r\n")).rstrip("\n") + "\n"
    return text


def comments(text: str) -> dict[KeyPath, str]:
    """Return the comment behind each value, without its sign; "" for none."""
    found = [one for one in statements(text) if one.within is None]
    return {one.path: _comment(text, one).strip().removeprefix("#").strip() for one in found}


def holds(text: str, path: KeyPath) -> bool:
    """Tell whether the text has a value of this name."""
    return _find(text, path) is not None


def _find(text: str, path: KeyPath) -> Statement | None:
    return next((one for one in statements(text) if one.path == path), None)


def _comment(text: str, of: Statement) -> str:
    found = _COMMENT.match(text, of.end)
    return found.group() if found is not None else ""


def _added(text: str, path: KeyPath, written: str, *, plain: bool) -> str:
    """Return the text with a statement more, where its section is; a new section is put at the end."""
    *section, key = path
    parts = list(_parts(text))
    above = [one for one in parts if isinstance(one, Statement) and path[: len(one.path)] == one.path]
    if above:  # the section, or one that it is in, is an inline table
        inline, name = above[-1], ".".join(map(_bare, path[len(above[-1].path) :]))
        if text[inline.value] != "{":
            raise ValueError(f"{'.'.join(inline.path)} is a value, not a section")
        if plain and (inner := text[inline.value + 1 : inline.end - 1].strip()):
            return f"{text[: inline.value]}{{ {inner}, {name} = {written} }}{text[inline.end :]}"
        return _spread(text, inline, f"{name} = {written}")
    header = next((one for one in parts if isinstance(one, Header) and one.table == tuple(section)), None)
    if header is not None or not section:
        mine = [one for one in parts if isinstance(one, Statement) and one.table == tuple(section)]
        at = _line_end(text, mine[-1].end) if mine else header.end if header is not None else 0
        return _inserted(text, at, f"{_bare(key)} = {written}")
    dotted = [one for one in parts if isinstance(one, Statement) and _dotted_into(one, tuple(section))]
    if dotted:
        last = dotted[-1]
        name = ".".join(map(_bare, path[len(last.table) :]))
        return _inserted(text, _line_end(text, last.end), f"{name} = {written}")
    space = "" if not text else "\n" if text.endswith("\n") else "\n\n"
    return f"{text}{space}[{'.'.join(map(_bare, section))}]\n{_bare(key)} = {written}\n"


def _dotted_into(one: Statement, section: KeyPath) -> bool:
    """Tell whether a statement has made a section, or one below it, by a dotted key."""
    return one.within is None and len(one.table) < len(section) and one.path[: len(section)] == section


def _inserted(text: str, at: int, line: str) -> str:
    before = text[:at] if not at or text[:at].endswith("\n") else f"{text[:at]}\n"
    return f"{before}{line}\n{text[at:]}"


def _spread(text: str, inside: Statement, more: str = "") -> str:
    """Return the text with the inline table in which a statement is, or which it is, as dotted keys, one a line.

    more: a statement to be added to it.
    """
    table = inside
    while table.within is not None:
        table = table.within

    def name(one: Statement) -> str:
        return ".".join(map(_bare, one.path[len(table.table) :]))

    leaves = [one for one in statements(text) if _is_in(one, table) and text[one.value] != "{"]
    lines = [f"{name(one)} = {text[one.value : one.end]}" for one in leaves]
    if more:
        lines.append(f"{name(inside)}.{more}")
    comment = _comment(text, table).strip()
    indent = text[text.rfind("\n", 0, table.key) + 1 : table.key]
    lines = [*([comment] if comment else []), *lines]
    end = table.end + len(_comment(text, table))
    return text[: table.key] + f"\n{indent}".join(lines) + text[end:]


def _is_in(one: Statement, table: Statement) -> bool:
    while one.within is not None:
        if one.within == table:
            return True
        one = one.within
    return False


def _line_end(text: str, at: int) -> int:
    found = text.find("\n", at)
    return len(text) if found < 0 else found + 1


def _written(value: object) -> str:
    """Return a value as TOML; a string, number, boolean or list of them in JSON is also one in TOML."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


def _bare(key: str) -> str:
    return key if _BARE.fullmatch(key) else json.dumps(key)


def _parts(text: str) -> Iterator[Header | Statement]:
    """Yield headers and statements in the order of the text."""
    at = 0
    table: KeyPath = ()
    while at < len(text):
        if text[at] in " \t\r\n":
            at += 1
        elif text[at] == "#":
            at = _line_end(text, at)
        elif text[at] == "[":
            start, many = at, text.startswith("[[", at)
            table, at = _name(text, at + 1 + many)
            at = _line_end(text, at)
            table = (*table, "[]") if many else table
            yield Header(table, start, at)
        else:
            found = list(_statement(text, at, table, (), None))
            yield from found
            at = found[0].end


def _statement(text: str, at: int, table: KeyPath, above: KeyPath, within: Statement | None) -> Iterator[Statement]:
    name, equals = _name(text, at)
    value = equals + 1
    while text[value] in " \t":
        value += 1
    end = _value_end(text, value)
    whole = Statement(table, (*(above or table), *name), at, value, end, within)
    yield whole
    if text[value] == "{":
        inner = value + 1
        while text[inner := _past_space(text, inner, ",")] != "}":
            found = list(_statement(text, inner, table, whole.path, whole))
            yield from found
            inner = found[0].end


def _name(text: str, at: int) -> tuple[KeyPath, int]:
    """Read a dotted key; return it and the place behind it."""
    parts: list[str] = []
    while (found := _KEY.match(text, at)) is not None:
        basic, literal, bare = found.groups()
        if basic is not None:
            literal = str(tomllib.loads(f'key = "{basic}"')["key"])
        parts.append(bare if literal is None else literal)
        at = found.end()
        if text[at] != ".":
            break
        at += 1
    return tuple(parts), at


def _value_end(text: str, at: int) -> int:
    if (string := _STRING.match(text, at)) is not None:
        return string.end()
    if text[at] not in "[{":
        found = re.compile(r"[^,\]}#\r\n]*").match(text, at)
        return at + len(found.group().rstrip()) if found is not None else at
    closing, at = {"[": "]", "{": "}"}[text[at]], at + 1
    while text[at := _past_space(text, at, ",")] != closing:
        if closing == "}":
            _, at = _name(text, at)
            at = _past_space(text, at + 1)
        at = _value_end(text, at)
    return at + 1


def _past_space(text: str, at: int, more: Sequence[str] = "") -> int:
    """Return the place behind white space, comments, and `more`."""
    while text[at] in " \t\r\n" or text[at] == "#" or text[at] in more:
        at = _line_end(text, at) if text[at] == "#" else at + 1
    return at
