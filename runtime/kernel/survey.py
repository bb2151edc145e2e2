"""What the C has to know of the Python: its functions, their fingerprints, and the constants that are handed over.

Read from the source files alone, so that a wheel is built without importing the car.
"""

import ast
import hashlib
import json
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final

from wallride.drivers.fingerprint import PACKAGE, Module, Sources, bound_by, file_of

PLACES: Final = "drivers/hokuyo", "runtime/calibration", "runtime/control", "runtime/ros", "sim/world"
"""Folders whose functions may be accelerated, and whose constants the C may use."""
C_FOLDERS: Final = "runtime/kernel", "sim/world"
SEAL: Final = Path("runtime/kernel/seal.json")
_WORD = re.compile(r"\b[A-Z][A-Z0-9_]*\b")
SIZES: Final = frozenset(
    {
        "GEOMETRY_ENOUGH_POINTS",
        "MANOEUVRE_ROLLOUT_HORIZON_STEPS",
        "MANOEUVRE_ROLLOUT_LOCK_STEPS",
        "MANOEUVRE_ROLLOUT_MAX_FLOORS",
        "PREDICTION_MAX_TOLD",
    }
)
"""Constants whose value the C is laid out for, such as lengths of arrays: another value needs another build."""


@dataclass(frozen=True, slots=True)
class Constant:
    """A constant of Python that C uses, VIEW_RIM_BEAMS for RIM_BEAMS of view.py; a tuple has a name for each number.

    kinds: of each number: "real", "whole" (a literal whole number), or "fixed", which is compiled in.
    """

    origin: str
    names: tuple[str, ...]
    kinds: tuple[str, ...]
    values: tuple[object, ...]


class Survey:
    """The accelerated functions below a folder, and the constants for their C."""

    def __init__(self, root: Path) -> None:
        self.root = root
        self.c_text = {path.name: path.read_text() for folder in C_FOLDERS for path in _c_files(root / folder)}
        self._sources = Sources(root)

    @cached_property
    def modules(self) -> tuple[Module, ...]:
        """All modules of PLACES."""
        paths = (path for place in PLACES for path in sorted((self.root / place).rglob("*.py")))
        names = (".".join((PACKAGE, *path.relative_to(self.root).with_suffix("").parts)) for path in paths)
        return tuple(module for name in names if (module := self._sources.module(name)) is not None)

    @cached_property
    def constants(self) -> tuple[Constant, ...]:
        """Those that the C uses, each once, in the order of the modules."""
        used = {word for text in self.c_text.values() for word in _WORD.findall(text)}
        found: list[Constant] = []
        for module in self.modules:
            for name in filter(str.isupper, module.statements):
                values = _value_of(module.statements[name], name)
                names = _names_in_c(module.name, name, len(values) if isinstance(values, tuple) else None)
                if not used.isdisjoint(names):
                    many = values if isinstance(values, tuple) else (values,)
                    kinds = tuple(_kind(called, value) for called, value in zip(names, many, strict=True))
                    found.append(Constant(f"{module.name}.{name}", names, kinds, many))
        return tuple(found)

    @cached_property
    def functions(self) -> Mapping[str, Any]:
        """Fingerprints of the accelerated functions, by "module.name"."""
        sources = Sources(self.root, frozenset(one.origin for one in self.constants))
        names = ((module.name, name) for module in self.modules for name in module.accelerated)
        return {f"{module}.{name}": sources.fingerprint(module, name) for module, name in names}

    def header(self) -> str:
        """Return constants.h: where each constant is found at run time; those that are lengths of arrays as numbers."""
        lines = [f"#define CONSTANTS {max(1, len(list(self._slots())))}"]
        for slot, (name, kind, value) in enumerate(self._slots()):
            place = {"real": f"kernel_reals[{slot}]", "whole": f"kernel_wholes[{slot}]"}
            lines.append(f"#define {name} {place.get(kind, repr(value))}")
        return "\n".join(lines) + "\n"

    def seal(self) -> dict[str, Any]:
        """Return what `wallride.drivers.accelerated` needs to know of this build."""
        sealed = read_seal(self.root)
        first, constants = 0, {}
        for one in self.constants:
            fixed = [value if kind == "fixed" else None for kind, value in zip(one.kinds, one.values, strict=True)]
            constants[one.origin] = {"kinds": list(one.kinds), "fixed": fixed, "first": first}
            first += len(one.kinds)
        functions = {
            name: {
                "seal": sealed.get(name, ""),
                "fits": found.digest == sealed.get(name),
                "modules": list(found.modules),
                "constants": list(found.constants),
            }
            for name, found in self.functions.items()
        }
        unused = constants.keys() - {name for found in self.functions.values() for name in found.constants}
        if unused:
            raise ValueError(f"no accelerated function uses {', '.join(sorted(unused))}, but its C does")
        used = sorted({module for found in self.functions.values() for module in found.modules})
        files = {module: hashlib.sha256((self.root / file_of(module)).read_bytes()).hexdigest() for module in used}
        return {"functions": functions, "constants": constants, "files": files, "c": c_digest(self.root)}

    def _slots(self) -> Iterator[tuple[str, str, object]]:
        for one in self.constants:
            yield from zip(one.names, one.kinds, one.values, strict=True)


def read_seal(root: Path) -> dict[str, str]:
    """Return the fingerprints of the functions for which the C was written."""
    path = root / SEAL
    return dict(json.loads(path.read_text())) if path.is_file() else {}


def write_seal(root: Path) -> None:
    """Say that the C does what the Python does that is here now. The tests compare them."""
    digests = {name: found.digest for name, found in sorted(Survey(root).functions.items())}
    (root / SEAL).write_text(json.dumps(digests, indent=2) + "\n")


def c_digest(root: Path) -> str:
    """Return a hash of all C sources."""
    found = hashlib.sha256()
    for folder in C_FOLDERS:
        for path in _c_files(root / folder):
            found.update(path.relative_to(root).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return found.hexdigest()


def _c_files(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.[ch]"))


def _value_of(statement: ast.stmt, name: str) -> object:
    """Return the literal value of a constant, a tuple of them for a tuple, None for what is computed."""
    if not isinstance(statement, ast.Assign | ast.AnnAssign) or statement.value is None:
        return None
    target = statement.targets[0] if isinstance(statement, ast.Assign) else statement.target
    try:
        value = ast.literal_eval(statement.value)
    except ValueError:
        return None
    if isinstance(target, ast.Tuple) and isinstance(value, tuple):  # A, B = 1, 2
        return value[list(bound_by(statement)).index(name)]
    return value


def _names_in_c(module: str, name: str, count: int | None) -> tuple[str, ...]:
    called = f"{module.rpartition('.')[2]}_{name.lstrip('_')}".upper()
    return (called,) if count is None else tuple(f"{called}_{place}" for place in range(count))


def _kind(called: str, value: object) -> str:
    if called in SIZES:
        return "fixed"
    return "whole" if isinstance(value, int) and not isinstance(value, bool) else "real"
