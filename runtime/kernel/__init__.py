"""Compiled twins of the hot functions (`drivers.twin`), built on the car itself and used where available.

A twin is used only while its Python function, and everything that it calls, has the text for which it was written
(`seal.json`): a changed law runs in Python, more slowly. `python -m runtime.kernel` renews the seal after both have
been updated.
"""

import hashlib
import importlib.util
import json
import os
import sys
import sysconfig
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from importlib.machinery import ExtensionFileLoader
from pathlib import Path
from types import ModuleType
from typing import Final

import numpy as np

from drivers import twin
from drivers.hokuyo import codec, ranges
from runtime.control.perception import geometry, noise_bias, odometry, view, window_dirt
from runtime.control.safety import (
    footprint,
    lidar_sectors,
    manoeuvre_rollout,
    moving_obstacles,
    no_return_regions,
    rear_memory,
    thin_obstacles,
)
from runtime.control.wall_following import (
    ball_drive,
    ball_law,
    ball_path,
    followed_wall,
    prediction,
    speed_profile,
    wall_fit,
    wall_track,
)
from runtime.kernel.build import built
from runtime.realtime.prefetch import Prefetch

SWITCH: Final = "WALLRIDE_COMPILED"
MODULES: Final = (
    codec, ranges, ball_drive, ball_law, ball_path, rear_memory, no_return_regions, thin_obstacles, footprint,
    geometry, manoeuvre_rollout, moving_obstacles, followed_wall, noise_bias, odometry, view, prediction,
    window_dirt, speed_profile, lidar_sectors, wall_fit, wall_track,
)  # fmt: skip
HERE: Final = Path(__file__).parent
SEAL: Final = HERE / "seal.json"


@dataclass(frozen=True, slots=True)
class Kernel:
    """State of the compiled functions. functions: names of those in use. words: their state in a sentence.

    prefetch: has the processor fetch the cache lines at some addresses, an array of intp, (n,); None without a library.
    """

    functions: frozenset[str]
    words: str
    prefetch: Prefetch | None = None


def use() -> Kernel:
    """Use the compiled functions where available; build them first where there is no library yet."""
    if os.environ.get(SWITCH) == "0":
        return _without(f"{SWITCH}=0")
    sealed = _sealed()
    edited = [module for module in MODULES if fingerprint(module) != sealed.get(module.__name__)]
    try:
        library = _library()
    except ImportError as error:
        return _without(str(error))
    own = {module.__name__ for module in MODULES if not called_by(module).isdisjoint(edited)}
    names = [name for name, plain in twin.PLAIN.items() if plain.__module__ not in own and hasattr(library, name)]
    twin.use({name: getattr(library, name) for name in names})
    words = f"{len(names)} of {len(twin.PLAIN)} functions of the hot path are compiled"
    if edited:
        words += f"; {', '.join(module.__name__ for module in edited)} changed since, and run as they are written"
    return Kernel(twin.in_use(), words, library.prefetch)


def called_by(module: ModuleType) -> set[ModuleType]:
    """Return the module and those of the sealed ones whose functions and classes it uses, at first or second hand."""
    called = {module}
    waiting = [module]
    while waiting:
        names = vars(waiting.pop())
        theirs = {getattr(twin.PLAIN.get(name, thing), "__module__", None) for name, thing in names.items()}
        new = [other for other in MODULES if other.__name__ in theirs and other not in called]
        called.update(new)
        waiting.extend(new)
    return called


def _without(why: str) -> Kernel:
    twin.use({})
    return Kernel(frozenset(), f"the hot path runs in Python ({why})")


def fingerprint(module: ModuleType) -> str:
    """Return what changes with every change of a module's text."""
    return hashlib.sha256(Path(str(module.__file__)).read_bytes()).hexdigest()


def seal() -> None:
    """Say that the twins do what the Python does that is here now. The tests compare them."""
    SEAL.write_text(json.dumps({module.__name__: fingerprint(module) for module in MODULES}, indent=2) + "\n")


def _sealed() -> Mapping[str, str]:
    return dict(json.loads(SEAL.read_text())) if SEAL.is_file() else {}


def _library() -> ModuleType:
    """Return the compiled functions; ImportError says why there are none."""
    # numpy's own first: a distribution's Python has another, older numpy's headers among its own
    include = np.get_include(), sysconfig.get_paths()["include"]
    sources = {path.name: path.read_text() for path in sorted(HERE.glob("*.[ch]"))}
    sources["constants.h"] = "".join(f"#define {name} {value!r}\n" for name, value in constants())
    path = built("kernel", sources, folders=include, extra=(sys.version, np.__version__))
    if path is None:
        raise ImportError("no C compiler with Python's headers, or it failed: apt install gcc python3-dev")
    loader = ExtensionFileLoader("_kernel", str(path))
    spec = importlib.util.spec_from_file_location("_kernel", path, loader=loader)
    try:
        module = importlib.util.module_from_spec(spec) if spec is not None else None
    except ImportError as error:
        raise ImportError(f"{path} was built and cannot be loaded: {error}") from error
    if module is None:
        raise ImportError(f"{path} was built and cannot be loaded")
    loader.exec_module(module)
    return module


def constants() -> Iterator[tuple[str, float]]:
    """Yield the numbers of the modules as C knows them: module and name, MOVERS_JUMP_M; of a tuple each one."""
    for module in MODULES:
        for name, value in vars(module).items():
            if not name.isupper():
                continue
            called = f"{module.__name__.rpartition('.')[2]}_{name.lstrip('_')}".upper()
            if isinstance(value, int | float) and not isinstance(value, bool):
                yield called, value
            elif isinstance(value, tuple) and all(isinstance(part, int | float) for part in value):
                yield from ((f"{called}_{place}", part) for place, part in enumerate(value))
