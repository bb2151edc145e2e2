"""Build of the C sources with the machine's own compiler: libraries are cached under a hash of all their inputs.

Nothing is installed for it and nothing needs it: without a compiler there is no library, and Python answers instead.
"""

import hashlib
import os
import platform
import shutil
import stat
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Final

# No fused multiply-add: a product is rounded as numpy rounds it. errno and floating-point traps are not used.
PLAIN_FLAGS: Final = ("-O3", "-ffp-contract=off", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC")
FLAGS: Final = ("-march=native", *PLAIN_FLAGS)
_MAX_BUILD_S: Final = 60.0
_KEPT_IN: Final = ("CACHE_DIRECTORY", "XDG_CACHE_HOME")
"""Environment variables of the cache folder: of systemd's service, and of a user."""


def built(name: str, sources: Mapping[str, str], *, folders: Sequence[str] = (), extra: object = ()) -> Path | None:
    """Return the shared library of these sources, made when there is none yet; None where it cannot be made.

    sources: text by file name; what ends in .c is compiled, the rest may be included. folders: where other headers are.
    extra: what else the result depends on.
    """
    compiler = shutil.which(os.environ.get("CC", "cc"))
    folder = private_folder()
    if compiler is None or folder is None:
        return None
    made_by = Path(compiler).stat()
    for flags in (FLAGS, PLAIN_FLAGS):  # a compiler may not know -march=native
        options = (*flags, *(f"-I{place}" for place in folders))
        depends_on = (dict(sources), compiler, made_by.st_size, made_by.st_mtime_ns, options, _processor(), extra)
        target = folder / f"{name}-{hashlib.sha256(repr(depends_on).encode()).hexdigest()[:16]}.so"
        if target.is_file() or _compiled(compiler, sources, options, target):
            return target
    return None


def _compiled(compiler: str, sources: Mapping[str, str], options: Sequence[str], target: Path) -> bool:
    with tempfile.TemporaryDirectory(dir=target.parent) as scratch:
        for name, text in sources.items():
            (Path(scratch) / name).write_text(text)
        files = [str(Path(scratch) / name) for name in sources if name.endswith(".c")]
        fresh = Path(scratch) / target.name
        try:
            subprocess.run(
                [compiler, *options, *files, "-o", str(fresh), "-lm"],
                check=True, capture_output=True, timeout=_MAX_BUILD_S,
            )  # fmt: skip
        except (OSError, subprocess.SubprocessError):
            return False
        fresh.replace(target)  # several processes may do this at once
    return True


def private_folder() -> Path | None:
    """Return where libraries are kept: a folder that only this user can write to, because its files are executed."""
    place = next((os.environ[name] for name in _KEPT_IN if os.environ.get(name)), "~/.cache")
    kept = Path(place).expanduser() / "wallride"
    try:
        kept.mkdir(mode=0o700, parents=True, exist_ok=True)
        state = kept.stat()
    except (OSError, RuntimeError):  # no home, or one that is read-only
        return None
    ours = state.st_uid == os.getuid() and not state.st_mode & (stat.S_IWGRP | stat.S_IWOTH)
    return kept if ours and os.access(kept, os.W_OK) else None


def _processor() -> str:
    """Return what -march=native depends on: a home on a network is shared by different machines."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return f"{platform.machine()} {platform.processor()}"
    told = {line for line in lines if line.startswith(("flags", "Features", "model name", "CPU part"))}
    return " ".join([platform.machine(), *sorted(told)])
