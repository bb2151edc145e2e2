"""Fingerprint of a function: of its syntax tree and of those of everything of ours that it uses.

Comments, docstrings, annotations and layout are not part of it, nor are the values of constants that are handed to C.
Only source files are read; nothing is imported.
"""

import ast
import hashlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Final

PACKAGE: Final = "wallride"
DIGITS: Final = 16
DECORATORS: Final = frozenset({"accelerated", "accelerable"})
_METHODS: Final = "()"
_LEFT_OUT: Final = frozenset({"ctx", "kind", "returns", "annotation", "type_comment", "type_params"})


def file_of(module: str) -> Path:
    """Return the file of a module of ours, "wallride.drivers.link" for one, below the folder that holds `drivers`."""
    return Path(*module.removeprefix(f"{PACKAGE}.").split(".")).with_suffix(".py")


@dataclass(frozen=True, slots=True)
class Fingerprint:
    """digest: hash of the function. modules: of its parts. constants: those of them that are passed to C."""

    digest: str
    modules: tuple[str, ...]
    constants: tuple[str, ...]


@dataclass
class Module:
    """What a source file binds at its top level: statements by name, and imports as (module, name or None)."""

    name: str
    tree: ast.Module
    statements: dict[str, ast.stmt] = field(default_factory=dict)
    imports: dict[str, tuple[str, str | None]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        """Sort the statements."""
        for statement in self.tree.body:
            if isinstance(statement, ast.ImportFrom) and statement.module:
                for one in statement.names:
                    self.imports[one.asname or one.name] = statement.module, one.name
            elif isinstance(statement, ast.Import):
                self.imports.update({one.asname or one.name: (one.name, None) for one in statement.names})
            else:
                self.statements.update(dict.fromkeys(bound_by(statement), statement))

    @cached_property
    def accelerated(self) -> tuple[str, ...]:
        """Names of the functions with an equivalent in C."""
        functions = (one for one in self.tree.body if isinstance(one, ast.FunctionDef))
        return tuple(one.name for one in functions if any(_is_ours(way) for way in one.decorator_list))


class Sources:
    """Reads the source files below a folder, each once. passed: constants that C gets from Python, "module.NAME"."""

    def __init__(self, root: Path, passed: frozenset[str] = frozenset()) -> None:
        self._root = root
        self._passed = passed
        self._modules: dict[str, Module | None] = {}

    def module(self, name: str) -> Module | None:
        """Return a module of ours by its dotted name; None where there is no such file."""
        if name not in self._modules:
            path = self._root / file_of(name)
            self._modules[name] = Module(name, ast.parse(path.read_bytes())) if path.is_file() else None
        return self._modules[name]

    def origin(self, module: str, name: str) -> tuple[str, str] | None:
        """Return where a name of a module is defined, (module, name), through imports; None outside of our files."""
        found = self.module(module)
        while found is not None and name not in found.statements:
            if name not in found.imports:
                return None
            where, what = found.imports[name]
            if what is None:
                return None
            if (inner := self.module(f"{where}.{what}")) is not None:
                return inner.name, ""
            found, name = self.module(where), what
        return None if found is None else (found.name, name)

    def fingerprint(self, module: str, name: str) -> Fingerprint:
        """Return the fingerprint of a function, KeyError where there is none."""
        texts: dict[str, str] = {}
        constants: set[str] = set()
        modules: set[str] = set()
        waiting = [(module, name)]
        while waiting:
            where, what = waiting.pop()
            called = f"{where}.{what}"
            if called in texts or called in constants:
                continue
            modules.add(where)
            if called in self._passed:
                constants.add(called)
                continue
            found = self.module(where)
            if found is None:
                raise KeyError(called)
            part = _part_of(found, what)
            texts[called] = "".join(_text_of(part))
            for statement in part:
                waiting.extend(self._used_by(found, statement))
                waiting.extend(self._annotated_by(found, statement))
        parts = [f"{called} {texts[called]}" for called in sorted(texts)] + sorted(constants)
        digest = hashlib.sha256("\n".join(parts).encode()).hexdigest()[:DIGITS]
        return Fingerprint(digest, tuple(sorted(modules)), tuple(sorted(constants)))

    def _annotated_by(self, module: Module, statement: ast.stmt) -> Iterator[tuple[str, str]]:
        """Yield the methods of the classes of a function's parameters: it may call them."""
        if isinstance(statement, ast.FunctionDef):
            arguments = (one.annotation for one in ast.walk(statement.args) if isinstance(one, ast.arg))
            names = {one.id for part in arguments if part for one in ast.walk(part) if isinstance(one, ast.Name)}
            for name in sorted(names):
                origin = self.origin(module.name, name)
                found = self.module(origin[0]) if origin else None
                if origin and found and isinstance(found.statements.get(origin[1]), ast.ClassDef):
                    yield origin[0], origin[1] + _METHODS

    def _used_by(self, module: Module, statement: ast.stmt) -> Iterator[tuple[str, str]]:
        own = _parameters_of(statement)
        for node in _nodes_of(statement):
            if isinstance(node, ast.Name) and node.id in own:
                continue
            if isinstance(node, ast.Name):
                origin = self.origin(module.name, node.id)
                if origin is not None and origin[1]:
                    yield origin
            elif isinstance(node, ast.Attribute) and isinstance(node.value, ast.Name):
                inside = self.origin(module.name, node.value.id)
                if inside is not None and not inside[1]:
                    origin = self.origin(inside[0], node.attr)
                    if origin is not None and origin[1]:
                        yield origin


def bound_by(statement: ast.stmt) -> Iterator[str]:
    """Yield the names that a statement of a module binds."""
    if isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef):
        yield statement.name
    elif isinstance(statement, ast.Assign | ast.AnnAssign):
        targets = statement.targets if isinstance(statement, ast.Assign) else [statement.target]
        for target in targets:
            yield from (one.id for one in ast.walk(target) if isinstance(one, ast.Name))


def _part_of(module: Module, what: str) -> list[ast.stmt]:
    """Return what is bound to a name; of a class that is only annotated, its methods."""
    if not what.endswith(_METHODS):
        return [module.statements[what]]
    body = getattr(module.statements[what.removesuffix(_METHODS)], "body", [])
    return [one for one in body if isinstance(one, ast.FunctionDef)]


def _parameters_of(statement: ast.stmt) -> frozenset[str]:
    """Return the names that are a function's own; a parameter whose default may be a global of that name is not."""
    if not isinstance(statement, ast.FunctionDef | ast.AsyncFunctionDef) or statement.args.defaults:
        return frozenset()
    return frozenset(one.arg for one in ast.walk(statement.args) if isinstance(one, ast.arg))


def _is_ours(decorator: ast.expr) -> bool:
    named = decorator.func if isinstance(decorator, ast.Call) else decorator
    return isinstance(named, ast.Name) and named.id in DECORATORS


def _parts_of(node: ast.AST) -> Iterator[tuple[str, object]]:
    """Yield the fields of a node that decide what it does, in order."""
    for name, value in ast.iter_fields(node):
        if name in _LEFT_OUT or value is None or value == []:
            continue
        if name == "decorator_list":
            yield name, [part for one in value for part in (_arguments_of(one) if _is_ours(one) else [one])]
        elif name == "body" and isinstance(value, list):  # without docstrings
            yield (
                name,
                [one for one in value if not (isinstance(one, ast.Expr) and isinstance(one.value, ast.Constant))],
            )
        else:
            yield name, value


def _arguments_of(decorator: ast.expr) -> list[ast.expr]:
    return [one.value for one in decorator.keywords] if isinstance(decorator, ast.Call) else []


def _text_of(part: object) -> Iterator[str]:
    """Yield a syntax tree as text that is the same in every version of Python."""
    if isinstance(part, ast.AST):
        yield f"{type(part).__name__}("
        for name, value in _parts_of(part):
            yield f"{name}="
            yield from _text_of(value)
        yield ")"
    elif isinstance(part, list):
        yield "["
        for one in part:
            yield from _text_of(one)
            yield ","
        yield "]"
    else:
        yield repr(part)


def _nodes_of(part: object) -> Iterator[ast.AST]:
    if isinstance(part, ast.AST):
        yield part
        for _, value in _parts_of(part):
            yield from _nodes_of(value)
    elif isinstance(part, list):
        for one in part:
            yield from _nodes_of(one)
