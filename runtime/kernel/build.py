"""Build of the extension module with the machine's compiler, or zig's: for a wheel, and by `wallride build-kernel`.

Nothing needs it: without a compiler there is no module, and Python answers instead.
"""

import json
import os
import shlex
import shutil
import subprocess
import sys
import sysconfig
import tempfile
from collections.abc import Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Final

from wallride.runtime.kernel.survey import C_FOLDERS, Survey

# No fused multiply-add: a product is rounded as numpy rounds it. errno and floating-point traps are not used.
FLAGS: Final = ("-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC")
NATIVE: Final = "-march=native"
FILE: Final = f"_accelerated{sysconfig.get_config_var('EXT_SUFFIX')}"
"""Name of the module's file for this Python on this machine; it lies in `drivers`."""
_MAX_BUILD_S: Final = 600.0
"""Maximum duration of a compiler run: an emulated or small computer takes minutes."""
_KEPT_CHARS: Final = 2000
_ZIG: Final = (sys.executable, "-m", "ziglang", "cc", "-fno-sanitize=undefined", "-s")
"""The compiler of the package index (clang and its headers): for machines without one, see the extra `compiler`."""


class BuildError(Exception):
    """The extension module cannot be built here; the text says why and what to do."""


def build(root: Path, target: Path, *, native: bool = False) -> None:
    """Build the module from the sources below root as the file `target`; BuildError when that is not possible.

    native: for this machine's processor only.
    """
    headers = _headers(Survey(root))
    files = [str(path) for folder in C_FOLDERS for path in sorted((root / folder).rglob("*.c"))]
    with tempfile.TemporaryDirectory() as scratch:
        for name, text in headers.items():
            (Path(scratch) / name).write_text(text)
        # numpy's own first: a distribution's Python has another, older numpy's headers among its own
        folders = scratch, str(root / "runtime/kernel"), _numpy_headers(), sysconfig.get_paths()["include"]
        made = Path(scratch) / FILE
        options = [*FLAGS, *([NATIVE] if native else []), *(f"-I{folder}" for folder in folders)]
        _compile([*_compiler(), *options, *files, "-o", str(made), "-lm"])
        _place(made, target)


def _headers(survey: Survey) -> dict[str, str]:
    try:
        seal = survey.seal()
    except ValueError as error:
        raise BuildError(str(error)) from None
    return {"constants.h": survey.header(), "seal.h": f"#define SEAL {json.dumps(json.dumps(seal))}\n"}


def _compiler() -> Sequence[str]:
    asked = shlex.split(os.environ.get("CC", "cc"))
    if asked and shutil.which(asked[0]) is not None:
        return asked
    if "CC" not in os.environ and find_spec("ziglang") is not None:
        return _ZIG
    remedy = f"apt install gcc python3-dev, or {sys.executable} -m pip install ziglang; then wallride build-kernel"
    raise BuildError(f"there is no C compiler: {remedy}")


def _numpy_headers() -> str:
    try:
        import numpy as np
    except ImportError:
        raise BuildError("numpy and its headers are not there: pip install numpy") from None
    return np.get_include()


def _compile(command: Sequence[str]) -> None:
    try:
        subprocess.run(command, check=True, capture_output=True, timeout=_MAX_BUILD_S, text=True)
    except subprocess.CalledProcessError as error:
        said = str(error.stderr).strip()[:_KEPT_CHARS]
        hint = ": apt install python3-dev, then wallride build-kernel" if "Python.h" in said else ""
        raise BuildError(f"the C compiler failed{hint}\n{said}") from None
    except (OSError, subprocess.TimeoutExpired) as error:
        raise BuildError(f"the C compiler did not run: {error}") from None


def _place(made: Path, target: Path) -> None:
    """Put the file in place in one step: a running car has the old one open."""
    fresh = target.with_name(f".{target.name}.{os.getpid()}")
    try:
        shutil.copy(made, fresh)
        fresh.replace(target)
    except OSError as error:
        raise BuildError(f"{target} cannot be written ({error.strerror}): run it as the owner of that folder") from None
    finally:
        fresh.unlink(missing_ok=True)
