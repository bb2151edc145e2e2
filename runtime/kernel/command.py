"""`wallride build-kernel`: build the compiled functions, and seal them."""

import subprocess
import sys
from collections.abc import Iterator

from wallride.drivers.accelerated import ROOT
from wallride.runtime.kernel.build import FILE, BuildError, build
from wallride.runtime.kernel.survey import write_seal


def run(*, native: bool, seal: bool) -> Iterator[str]:
    """Build into the installed package, and yield what was done and what runs in C; BuildError when it is not possible.

    native: for this machine's processor only. seal: declare before that the C does what the Python does.
    """
    if seal:
        write_seal(ROOT)
    target = ROOT / "drivers" / FILE
    build(ROOT, target, native=native)
    yield f"built {target}"
    told = subprocess.run(
        [sys.executable, "-P", "-m", "wallride.runtime.kernel"], capture_output=True, text=True, check=False
    )
    if told.returncode:
        raise BuildError(f"it was built and cannot be used: {told.stderr.strip().splitlines()[-1]}")
    yield told.stdout.strip()
