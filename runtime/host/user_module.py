"""Python files of the user: where they are looked for, how they are imported, and how their mistakes are told.

Folders are appended to Python's module path, so that a file of the user never replaces a module of Python or wallride,
finds modules beside it, and is found by processes that this one spawns.
"""

import importlib
import sys
import traceback
from pathlib import Path
from types import ModuleType, TracebackType

FOREIGN = ("site-packages", "dist-packages")


class UserCodeError(ValueError):
    """Code of the user cannot be used; the text names the file, the line and the remedy."""


_folders: list[Path] = []


def search_in(folder: Path) -> None:
    """Look for files in this folder as well, after those named before."""
    absolute = folder.expanduser().absolute()
    if absolute not in _folders:
        _folders.append(absolute)
    if str(absolute) not in sys.path:
        sys.path.append(str(absolute))


def import_module(name: str) -> ModuleType:
    """Return a module, imported at the first call; UserCodeError names what is wrong with it."""
    search_in(Path.cwd())
    importlib.invalidate_caches()
    try:
        return importlib.import_module(name)
    except ModuleNotFoundError as error:
        if error.name is not None and f"{name}.".startswith(f"{error.name}."):
            raise UserCodeError(_not_found(name)) from None
        raise UserCodeError(f"{place_of(error, None)}: {_words(error)}") from None
    except (Exception, SystemExit) as error:  # noqa: BLE001 - code of the user may raise anything
        raise UserCodeError(f"{place_of(error, None)}: {_words(error)}") from None


def file_of(module: ModuleType) -> Path:
    """Return the file of a module."""
    return Path(module.__file__ or module.__name__)


def shown(path: Path) -> str:
    """Return a path as the user knows it: from the working directory on where it is below that."""
    here = Path.cwd()
    return str(path.relative_to(here)) if path.is_relative_to(here) else str(path)


def place_of(error: BaseException, file: Path | None) -> str:
    """Return "FILE:LINE" of the user's line that raised: the innermost one in `file` or its folder.

    file: None for an import, where the innermost line that belongs to no library counts.
    """
    if isinstance(error, SyntaxError) and error.filename:
        return f"{shown(Path(error.filename))}:{error.lineno}"
    lines = list(_lines(error.__traceback__))
    users = [(path, line) for path, line in lines if _is_users(path, file)]
    path, line = (users or [(file or Path(__file__), 0)])[-1]
    return f"{shown(path)}:{line}"


def told(error: BaseException) -> str:
    """Return an exception in one line: its name and message."""
    return _words(error)


def _lines(trace: TracebackType | None) -> list[tuple[Path, int]]:
    return [(Path(frame.f_code.co_filename), line) for frame, line in traceback.walk_tb(trace)]


def _is_users(path: Path, file: Path | None) -> bool:
    if any(part in FOREIGN for part in path.parts):
        return False
    if file is not None:
        return path == file or path.is_relative_to(file.parent)
    return any(path.is_relative_to(folder) for folder in _folders)


def _words(error: BaseException) -> str:
    text = error.msg if isinstance(error, SyntaxError) else str(error)
    name = type(error).__name__
    return " ".join(f"{name}: {text}".split()) if text else name


def _not_found(name: str) -> str:
    file = f"{name.replace('.', '/')}.py"
    places = ", ".join(str(folder) for folder in _folders)
    return f"there is no {file} in {places}; start wallride in its folder, or name the folder in process.laws_folder"
