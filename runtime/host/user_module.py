"""Python files of the user: where they are looked for, how they are imported, and how their mistakes are told.

Folders are appended to Python's module path, so that a file of the user never replaces a module of Python or wallride,
finds modules beside it, and is found by processes that this one spawns. A process of root loads nothing from a folder
that others may change: no law, no module that a law imports, and no package that happens to be missing.
"""

import ast
import importlib
import os
import sys
import traceback
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from importlib.machinery import ModuleSpec, PathFinder
from pathlib import Path
from types import ModuleType, TracebackType
from typing import Final

from wallride.runtime.host.ownership import changed_by_others, is_root
from wallride.runtime.host.stop_signals import STOP_SIGNALS_HELD

FOREIGN = ("site-packages", "dist-packages")
CODE = (".py", ".pyc", ".so")


class UserCodeError(ValueError):
    """Code of the user cannot be used; the text names the file, the line and the remedy."""


_folders: list[Path] = []
_beside: list[Path] = []


def search_in(folder: Path) -> None:
    """Look for files in this folder as well, after those named before."""
    resolved = folder.expanduser().resolve()
    if resolved not in _folders:
        _folders.append(resolved)
    if str(resolved) not in sys.path and not untrusted(resolved):
        sys.path.append(str(resolved))


def search_beside(file: Path) -> None:
    """Look for files beside this one, which means those; UserCodeError where others of their names are imported."""
    folder = file.absolute().parent.resolve()
    search_in(folder)
    if folder not in _beside:
        _beside.append(folder)
    refuse_others_than_in(folder)


def refuse_others_than_in(folder: Path) -> None:
    """UserCodeError where a module that is in this folder is imported already, from another one."""
    for module in tuple(sys.modules.values()):
        known = Path(getattr(module, "__file__", None) or "")
        if known.parent in _folders and known.parent != folder and (folder / known.name).is_file():
            raise UserCodeError(
                f"{shown(known)} is imported already, and {shown(folder / known.name)} has the same name: begin a"
                " command, or a notebook's kernel, for each"
            )


def untrusted(folder: Path) -> str:
    """Return why a process of root loads nothing from a folder; "" where it may, or is no process of root."""
    if not is_root():
        return ""
    if not folder.is_dir():
        return f"{folder} is no folder"
    with os.scandir(folder) as found:
        code = [
            Path(one.path) for one in found if one.name.endswith(CODE) or (one.name.isidentifier() and one.is_dir())
        ]
    return next(filter(None, map(changed_by_others, (folder, *code))), "")


def import_module(name: str) -> ModuleType:
    """Return a module, imported at the first call; UserCodeError names what is wrong with it."""
    search_in(Path.cwd())
    places = dict.fromkeys([Path.cwd().resolve(), *_beside])
    if len(found := [folder for folder in places if (folder / f"{name}.py").is_file()]) > 1:
        raise UserCodeError(f"{name}.py is in {found[0]} and in {found[1]}: move or rename one")
    importlib.invalidate_caches()
    with as_user_code_error():
        try:
            _guard_imports_of_root()
            return importlib.import_module(name)
        except ModuleNotFoundError as error:
            if error.name is not None and f"{name}.".startswith(f"{error.name}."):
                raise UserCodeError(_not_found(name)) from None
            raise


@contextmanager
def as_user_code_error(*passed: type[Exception]) -> Iterator[None]:
    """Make a UserCodeError with its line of what code of the user raises; errors of these classes pass."""
    passing: tuple[type[Exception], ...] = (UserCodeError, *passed)
    try:
        yield
    except passing:
        raise
    except BaseException as error:
        if is_of_the_process(error):
            raise
        raise UserCodeError(f"{place_of(error, None)}: {told(error)}") from None


def files_of(name: str, file: Path) -> tuple[Path, ...]:
    """Return the file of a module and those of the user that it imports, and they, anywhere in their code."""
    found, waiting = {file}, [(name, file)]
    while waiting:
        for wanted in _imported(*waiting.pop()):
            place = _place_of_module(wanted)
            if place is not None and place not in found:
                found.add(place)
                waiting.append((wanted, place))
    return tuple(sorted(found))


def _imported(name: str, file: Path) -> Iterator[str]:
    """Yield the names that a module may import, a package before what is in it; none where it is no source."""
    try:
        nodes = list(ast.walk(ast.parse(file.read_bytes())))
    except (OSError, SyntaxError, ValueError):
        return
    package = name if file.name == "__init__.py" else name.rpartition(".")[0]
    wanted = [alias.name for node in nodes if isinstance(node, ast.Import) for alias in node.names]
    for node in nodes:
        if isinstance(node, ast.ImportFrom):
            above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
            base = ".".join(filter(None, [*above, node.module]))
            wanted += [base, *(f"{base}.{alias.name}" for alias in node.names)]
    for full in filter(None, wanted):
        yield from _prefixes(full)


def _place_of_module(name: str) -> Path | None:
    """Return the file of a module in the user's folders; None where none of them has it, and for a bare folder."""
    spec, folders = None, [str(folder) for folder in _folders]
    for prefix in _prefixes(name):
        spec = PathFinder.find_spec(prefix, folders) if prefix != "wallride" else None
        if spec is None:
            return None
        folders = list(spec.submodule_search_locations or [])
    return Path(spec.origin) if spec is not None and spec.has_location and spec.origin else None


def _prefixes(name: str) -> Iterator[str]:
    """Yield the packages of a dotted name from the outermost on, and the name."""
    parts = name.split(".")
    return (".".join(parts[: count + 1]) for count in range(len(parts)))


def file_of(module: ModuleType) -> Path:
    """Return the file of a module."""
    return Path(module.__file__ or module.__name__)


def shown(path: Path) -> str:
    """Return a path as the user knows it: from the working directory on where it is below that."""
    try:
        here = Path.cwd()
    except OSError:  # it was deleted
        return str(path)
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


def place_of(error: BaseException, file: Path | None) -> str:
    """Return "FILE:LINE" of the user's line that raised: the innermost one in `file` or its folder.

    file: None for an import, where the innermost line that belongs to no library counts.
    """
    if isinstance(error, SyntaxError) and type(error.filename) is str and type(error.lineno) is int:
        return f"{shown(Path(error.filename))}:{error.lineno}"
    lines = list(_lines(error.__traceback__))
    users = [(path, line) for path, line in lines if _is_users(path, file)]
    path, line = (users or [(file or Path(__file__), 0)])[-1]
    return f"{shown(path)}:{line}"


def told(error: BaseException) -> str:
    """Return an exception in one printable line: its name and message."""
    try:
        text = error.msg if isinstance(error, SyntaxError) else str(error)
        name = type(error).__name__
        return shown_text(" ".join(f"{name}: {text}".split()) if text else name)
    except BaseException as second:
        if is_of_the_process(second):
            raise
        return "an exception that cannot be shown"


def shown_text(text: str) -> str:
    """Return a text with a question mark for what no terminal and no file can take."""
    return text if text.isprintable() else "".join(one if one.isprintable() else "?" for one in text)


def is_of_the_process(error: BaseException) -> bool:
    """Tell whether an exception out of code of the user may be a Ctrl-C, which Python raises wherever it runs.

    It may not be where the signals have handlers of their own, as in a car.
    """
    return isinstance(error, KeyboardInterrupt) and not STOP_SIGNALS_HELD


def _lines(trace: TracebackType | None) -> list[tuple[Path, int]]:
    return [(Path(frame.f_code.co_filename), line) for frame, line in traceback.walk_tb(trace)]


def _is_users(path: Path, file: Path | None) -> bool:
    if path == file:
        return True
    if any(part in FOREIGN for part in path.parts):
        return False
    if file is not None:
        return path.is_relative_to(file.parent)
    return any(path.is_relative_to(folder) for folder in _folders)


class _RootsImports:
    """Lets root import no module that others may change, but for those of Python's installation and of wallride.

    Every module counts, at any depth, and each folder of a package, which needs no file: Python may find it by a path
    of its own, PYTHONPATH for one.
    """

    def find_spec(
        self, name: str, path: Sequence[str] | None = None, _target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return None, for the other finders to go on; UserCodeError for a module that root does not load."""
        found = PathFinder.find_spec(name, path) if is_root() else None
        if found is None or name.partition(".")[0] == "wallride":
            return None
        for place in map(Path, filter(None, (found.origin, *(found.submodule_search_locations or ())))):
            installed = any(place.is_relative_to(prefix) for prefix in (sys.prefix, sys.base_prefix))
            if place.exists() and not installed and (why := changed_by_others(place)):
                raise UserCodeError(_refused(place, why))
        return None


_ROOTS_IMPORTS: Final = _RootsImports()


def _guard_imports_of_root() -> None:
    if is_root() and _ROOTS_IMPORTS not in sys.meta_path:
        sys.meta_path.insert(0, _ROOTS_IMPORTS)


def _refused(file: Path, why: str) -> str:
    return (
        f"{file} is not loaded by root, because {why}; run this as another user, or move the law to a folder that root"
        " alone may change, such as /etc/wallride/laws"
    )


def _not_found(name: str) -> str:
    file = f"{name.replace('.', '/')}.py"
    for folder in _folders:
        if (folder / file).exists() and (why := untrusted(folder)):
            return _refused(folder / file, why)
    places = ", ".join(str(folder) for folder in _folders)
    return f"there is no {file} in {places}; start wallride in its folder, or name the folder in process.laws_folder"
