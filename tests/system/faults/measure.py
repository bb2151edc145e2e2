"""Runs every row of the fault matrix three times in a row, and writes the longest reactions into docs/faults.md.

Run: python -m tests.system.faults.measure [--busy] [--runs 3]

--busy: beside a busy loop on each core, with the scheduling that the car's unit asks for. Figures of earlier
measurements under the same load are replaced. A test that did not pass every time at the first attempt is printed; the
exit code is then 1.
"""

import argparse
import contextlib
import json
import os
import subprocess
import sys
import xml.etree.ElementTree as ET
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.system.faults import document
from tests.system.faults.matrix import INJECTED, MATRIX
from wallride.runtime.host.scheduling import PRIORITY_VARIABLE

MAX_RUN_S = 1200
MAX_TEST_S = 150
HOG = """
import os, sys, time
os.sched_setaffinity(0, {int(sys.argv[1])})
end_s = time.monotonic() + float(sys.argv[2])
while time.monotonic() < end_s: pass
"""


@contextlib.contextmanager
def hogs(seconds: float, *, wanted: bool) -> Iterator[None]:
    """Keep each core busy for at most that long."""
    cores = sorted(os.sched_getaffinity(0)) if wanted else []
    running = [subprocess.Popen([sys.executable, "-c", HOG, str(core), str(seconds)]) for core in cores]
    try:
        yield
    finally:
        for hog in running:
            hog.kill()
            hog.wait()


def run(report: Path, environment: dict[str, str]) -> dict[str, bool]:
    """Run the tests of every row once; return whether each passed, by its name."""
    rows = dict.fromkeys(fault.test for fault in MATRIX if fault.test != INJECTED)
    injected = "tests/system/faults/test_faults.py"
    command = [sys.executable, "-m", "pytest", injected, *rows, "-q", "-n", "0", f"--timeout={MAX_TEST_S}"]
    subprocess.run(
        [*command, f"--junitxml={report}"], env=environment, cwd=document.ROOT, timeout=MAX_RUN_S, check=False
    )
    cases = ET.parse(report).getroot().iter("testcase")  # noqa: S314 - written by pytest
    return {f"{case.attrib['classname']}.{case.attrib['name']}": len(case) == 0 for case in cases}


def main() -> int:
    """Measure, and print each test that did not pass every time."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--busy", action="store_true")
    parser.add_argument("--runs", type=int, default=3)
    options = parser.parse_args()
    kept = {key: s for key, s in document.read_figures().items() if key.startswith(document.BUSY) != options.busy}
    document.FIGURES.write_text(json.dumps(kept), encoding="utf-8")
    environment = os.environ | {"FAULTS_MEASURED": str(document.FIGURES), "WALLRIDE_RERUNS": "0"}
    if options.busy:
        environment |= {"FAULTS_BUSY": "1", PRIORITY_VARIABLE: "20"}
    passes: Counter[str] = Counter()
    with TemporaryDirectory() as folder, hogs(options.runs * MAX_RUN_S, wanted=options.busy):
        for number in range(options.runs):
            passes.update(run(Path(folder) / f"{number}.xml", environment))
    document.PAGE.write_text(document.page(document.read_figures()), encoding="utf-8")
    failed = {name: times for name, times in passes.items() if times < options.runs}
    sys.stdout.write(f"{len(passes) - len(failed)} of {len(passes)} passed {options.runs} times of {options.runs}\n")
    sys.stdout.writelines(f"{name}: {times} times\n" for name, times in failed.items())
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
