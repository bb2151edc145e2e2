"""The compiled functions under AddressSanitizer and UndefinedBehaviorSanitizer.

Run: python -m benchmarks.sanitize [--seconds 60] [--seed 1] [--planted]

Builds the extension with both sanitizers from a copy of the sources in a temporary folder, and runs there, under the
runtime library of AddressSanitizer: for half of the time the tests that compare C with Python, then the functions
with the arguments of hostile rooms, each changed at random (NaN, infinities, empty arrays, other lengths, other types).
The first finding ends it, with exit code 1. --planted: builds in an out-of-bounds read, which must be found.
Where there is no compiler or no library, it says so and ends with exit code 0.
"""

import argparse
import math
import os
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Final

from wallride.runtime.kernel import build as kernel_build

ROOT: Final = Path(__file__).resolve().parents[1]
SANITIZED: Final = (
    "-O1", "-g", "-fno-omit-frame-pointer", "-fsanitize=address,undefined,float-cast-overflow",
    "-fno-sanitize-recover=all", "-ffp-contract=off", "-shared", "-fPIC",
)  # fmt: skip
COPIED: Final = ("clients", "drivers", "runtime", "sim", "tests", "wallride", "benchmarks")
LIBRARIES: Final = ("libasan.so", "libubsan.so")
PLANTED_IN: Final = Path("runtime/kernel/perception/view.c")
PLANTED_AT: Final = "i >= 1 && fabs(range[i] - range[i - 1])"
PLANTED: Final = "fabs(range[i] - range[i - 1])"
MIN_RANDOM_S: Final = 10.0
GIVE_UP_S: Final = 600.0


def main() -> int:
    """Build, test, and feed the functions."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seconds", type=float, default=60.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--planted", action="store_true", help="build in an error, which must be found")
    options = parser.parse_args()
    libraries = _libraries()
    if isinstance(libraries, str):
        print(f"sanitizers: skipped, {libraries}")
        return 0
    with tempfile.TemporaryDirectory(prefix="sanitize-") as folder:
        copy = _copy(Path(folder))
        if options.planted:
            _plant(copy)
        kernel_build.FLAGS = SANITIZED  # type: ignore[misc]
        kernel_build.build(copy, copy / "drivers" / kernel_build.FILE)
        surroundings = {
            **os.environ,
            "PYTHONPATH": str(copy),
            "PYTHONMALLOC": "malloc",  # each object has an allocation of its own, with its own bounds
            "LD_PRELOAD": " ".join(libraries),
            "ASAN_OPTIONS": "detect_leaks=0:exitcode=99",
            "UBSAN_OPTIONS": "print_stacktrace=1",
        }
        began_s = time.monotonic()
        failed = "" if options.planted else _run(_tests(), copy, surroundings, options.seconds / 2)
        left_s = max(MIN_RANDOM_S, options.seconds - (time.monotonic() - began_s))
        feeding = [sys.executable, "-m", "tests.runtime.kernel.hostile", str(left_s), str(options.seed)]
        failed = failed or _run(feeding, copy, surroundings)
    if options.planted:
        is_found = "heap-buffer-overflow" in failed
        print("sanitizers: the planted error is", "found" if is_found else f"NOT FOUND\n{failed}")
        return 0 if is_found else 1
    print(failed or f"sanitizers: nothing found in {time.monotonic() - began_s:.0f} s")
    return 1 if failed else 0


def _libraries() -> list[str] | str:
    """Return the runtime libraries of the sanitizers, or why there are none."""
    compiler = os.environ.get("CC", "cc").split()[0]
    if shutil.which(compiler) is None:
        return "there is no C compiler (apt install gcc python3-dev)"
    found = []
    for name in LIBRARIES:
        path = subprocess.run([compiler, f"-print-file-name={name}"], capture_output=True, text=True, check=False)
        if not Path(path.stdout.strip()).is_absolute():
            return f"the compiler has no {name} (apt install gcc)"
        found.append(str(Path(path.stdout.strip()).resolve()))
    return found


def _copy(folder: Path) -> Path:
    hidden = shutil.ignore_patterns("__pycache__", "_accelerated*", "*.webp", "figures", "data")
    for name in COPIED:
        shutil.copytree(ROOT / name, folder / name, ignore=hidden, symlinks=True)
    shutil.copy(ROOT / "pyproject.toml", folder)
    return folder


def _plant(copy: Path) -> None:
    path = copy / PLANTED_IN
    text = path.read_text(encoding="utf-8")
    if PLANTED_AT not in text:
        raise SystemExit(f"{PLANTED_IN} has no `{PLANTED_AT}` any more: plant the error elsewhere")
    path.write_text(text.replace(PLANTED_AT, PLANTED), encoding="utf-8")


def _tests() -> list[str]:
    names = "alike or refused or drives"
    return [
        sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", "-p", "no:randomly", "-p", "no:xdist",
        "-o", "timeout=0", "-k", names, "tests/runtime/kernel",
    ]  # fmt: skip


def _run(command: list[str], copy: Path, surroundings: dict[str, str], ended_after_s: float = math.inf) -> str:
    """Return what a command said when it failed, "" when it did not. ended_after_s: when it has run long enough."""
    try:
        done = subprocess.run(
            command, cwd=copy, env=surroundings, capture_output=True, text=True, check=False,
            timeout=min(ended_after_s, GIVE_UP_S),
        )  # fmt: skip
    except subprocess.TimeoutExpired as error:
        if ended_after_s > GIVE_UP_S:
            return f"{' '.join(command)}: no end within {GIVE_UP_S:g} s"
        said = error.stdout.decode(errors="replace") if isinstance(error.stdout, bytes) else error.stdout or ""
        print(f"the tests ran for {ended_after_s:g} s without a finding: {said.strip().splitlines()[-1:]}", flush=True)
        return ""
    print(done.stdout.strip().splitlines()[-1] if done.stdout.strip() else "", flush=True)
    return "" if done.returncode == 0 else f"{done.stdout[-4000:]}\n{done.stderr[-6000:]}"


if __name__ == "__main__":
    raise SystemExit(main())
