"""Our process and the report's nodes on ROS 1, in turn, with the same scans. Run benchmarks/ros1/setup.sh first.

From the repository:
`python benchmarks/ros1/compare.py [--rounds 3] [--seconds 15] [--loaded ordinary|fifo] [--donkey PYTHON] [--json FILE]
[--plot DIR]`, where PYTHON is that of a venv with donkeycar in it. --loaded: one process per core computes meanwhile,
and car and nodes have ordinary scheduling, or FIFO; what stands for other computers always has FIFO. Needs root.

Ours is timed from the lidar's last byte to the motor's first, drivers, telemetry and a subscriber included. The peers
are timed message to message, without any driver, by a C++ client.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np

from wallride.sim.bench import measure
from wallride.sim.bench.command import machine
from wallride.sim.bench.course import BenchScans, make_course
from wallride.sim.bench.measure import ProcessMeter, median_of
from wallride.sim.bench.rig import FIFO_PRIORITY, another_computer

HERE = Path(__file__).resolve().parent
NODES = str(HERE / "build" / "nodes")
RUNTIME_PYTHON = "/usr/bin/python3"
"""Interpreter of Debian's packages: Debian's Python."""
ROLES = ("wall_follower", "safety", "mux")
PORT = 11399
PEERS: Mapping[str, tuple[bool, list[list[str]]]] = {
    "rospy, 3 nodes": (False, [[RUNTIME_PYTHON, str(HERE / "nodes.py"), role] for role in ROLES]),
    "roscpp, 3 nodes": (False, [[NODES, role] for role in ROLES]),
    "roscpp, 3 nodes, nodelay": (True, [[NODES, role] for role in ROLES]),
    "roscpp, 1 process": (False, [[NODES, *ROLES]]),
}
OURS = "wallride, drivers included"


def main() -> None:
    """Measure each in turn, and print medians and ratios."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--seconds", type=float, default=15.0)
    parser.add_argument("--loaded", choices=("ordinary", "fifo"))
    parser.add_argument("--donkey", metavar="PYTHON")
    parser.add_argument("--json", type=Path)
    parser.add_argument("--plot", type=Path)
    options = parser.parse_args()
    if not Path(NODES).exists():
        sys.exit("run benchmarks/ros1/setup.sh first")
    course = make_course()
    runs: dict[str, list[dict[str, Any]]] = {}
    with ExitStack() as stack:
        if options.loaded:
            load(stack, fifo=options.loaded == "fifo")
        scans = Path(stack.enter_context(tempfile.TemporaryDirectory())) / "scans"
        write_scans(scans, course)
        for round_number in range(options.rounds):
            runs.setdefault(OURS, []).append(ours(options.seconds))
            for name, (nodelay, commands) in PEERS.items():
                runs.setdefault(name, []).append(peer(scans, commands, options.seconds, nodelay=nodelay))
            if options.donkey:
                runs.setdefault("donkeycar, loop at 100 Hz", []).append(donkey(scans, options.donkey, options.seconds))
            print(f"round {round_number + 1} of {options.rounds}, load {os.getloadavg()[0]:.1f}", file=sys.stderr)
    samples_ms = {name: [ms for run in some for ms in run.pop("samples_ms")] for name, some in runs.items()}
    medians = {name: median_of(some) for name, some in runs.items()}
    print_table(medians)
    if options.json:
        options.json.write_text(json.dumps({**machine(), "medians": medians, "runs": runs}, indent=2) + "\n")
    if options.plot:
        from wallride.sim.bench.picture import histogram

        histogram(options.plot / "peers.png", "scan to drive command, side by side", samples_ms)


def load(stack: ExitStack, *, fifo: bool) -> None:
    """Let a process per core compute, and schedule this one before them; what it starts, too, where fifo."""
    for _ in range(os.cpu_count() or 1):
        start(stack, [sys.executable, "-c", "while True: pass"], os.environ)
    inherited = 0 if fifo else os.SCHED_RESET_ON_FORK
    os.sched_setscheduler(0, os.SCHED_FIFO | inherited, os.sched_param(FIFO_PRIORITY))


def ours(seconds: float) -> dict[str, Any]:
    """Return latency, onsets and cost of the unmodified process, telemetry on, one subscriber."""
    plan = measure.MeasurementPlan(seconds=seconds, onsets=round(seconds * measure.RATE_HZ / measure.ONSET_EVERY))
    found, cost = measure.latency(plan), measure.cpu(plan)
    return {
        **{key: found[key] for key in ("p50", "p99", "p99_9", "samples_ms")},
        "onsets": found["onsets"]["onsets"],
        "slipped": found["onsets"]["slipped"],
        **{key: cost[key] for key in ("cores", "pss_mib")},
    }


def peer(scans: Path, commands: Sequence[Sequence[str]], seconds: float, *, nodelay: bool) -> dict[str, Any]:
    """Return the same of nodes on a master of their own."""
    environment = {**os.environ, "ROS_MASTER_URI": f"http://127.0.0.1:{PORT}", "ROS_IP": "127.0.0.1"}
    environment.pop("PYTHONPATH", None)
    count = str(round(seconds * measure.RATE_HZ))
    with ExitStack() as stack:
        home = stack.enter_context(tempfile.TemporaryDirectory())
        environment["ROS_HOME"] = environment["ROS_LOG_DIR"] = home
        start(stack, [RUNTIME_PYTHON, "/usr/bin/rosmaster", "--core", "-p", str(PORT)], environment)
        time.sleep(1.0)
        start(
            stack, [RUNTIME_PYTHON, "-c", f"import rospy; rospy.set_param('/tcp_nodelay', {nodelay})"], environment
        ).wait()
        nodes = [start(stack, command, environment) for command in commands]
        client = [str(HERE / "build" / "client"), str(scans), str(measure.RATE_HZ), "120"]
        links = str(min(2, len(nodes)))
        free = client_run(stack, [*client, "0", "0", count, links], environment, nodes)
        scares = [str(measure.ONSET_EVERY), str(measure.ONSET_LENGTH)]
        scared = client_run(stack, [*client, *scares, count, links], environment, [])
    p50, p99, p99_9 = np.percentile(free["latency_ms"], [50, 99, 99.9])
    return {
        "p50": p50,
        "p99": p99,
        "p99_9": p99_9,
        "samples_ms": free["latency_ms"],
        "onsets": scared["onsets"],
        "slipped": scared["slipped"],
        "cores": free["cores"],
        "pss_mib": free["pss_mib"],
    }


def donkey(scans: Path, python: str, seconds: float) -> dict[str, Any]:
    """Return the same of donkeycar's vehicle loop; the CPU is that of its one process, lidar thread included."""
    script = str(HERE.parent / "donkeycar" / "loop.py")
    count = round(seconds * measure.RATE_HZ)
    command = [python, script, str(scans), str(measure.RATE_HZ), "100", str(count)]
    with ExitStack() as stack:
        process = start(stack, command, {name: text for name, text in os.environ.items() if name != "PYTHONPATH"})
        time.sleep(4.0)
        meter = ProcessMeter([process.pid])
        time.sleep(max(1.0, seconds - 4.0))
        cost = meter.stop()
        out, error = process.communicate()
    if process.returncode:
        sys.exit(f"donkeycar ended with {process.returncode}: {error}")
    samples_ms = json.loads(out.splitlines()[-1])["latency_ms"]
    p50, p99, p99_9 = np.percentile(samples_ms, [50, 99, 99.9])
    return {
        "p50": p50, "p99": p99, "p99_9": p99_9, "samples_ms": samples_ms, "onsets": 0, "slipped": 0,
        "cores": cost.cores, "pss_mib": cost.pss_mib,
    }  # fmt: skip


def client_run(
    stack: ExitStack, command: Sequence[str], environment: Mapping[str, str], nodes: Sequence[subprocess.Popen[str]]
) -> dict[str, Any]:
    """Run the client to its end; with nodes, return their cost from after its warm-up."""
    client = start(stack, command, environment)
    os.sched_setaffinity(client.pid, another_computer())  # before it starts threads: it sleeps a second first
    if os.sched_getscheduler(0) & ~os.SCHED_RESET_ON_FORK == os.SCHED_FIFO:
        os.sched_setscheduler(client.pid, os.SCHED_FIFO, os.sched_param(FIFO_PRIORITY))
    time.sleep(4.0)
    meter = ProcessMeter([node.pid for node in nodes])
    # The client keeps its results until the end, so there is nothing to read while it measures.
    cost = None
    while client.poll() is None:
        time.sleep(0.05)
        if cost is None and time.monotonic() - meter.began_s > 0.7 * float(command[-2]) / measure.RATE_HZ - 1:
            cost = meter.stop()
    out, error = client.communicate()
    if client.returncode or cost is None:
        sys.exit(f"the client ended with {client.returncode}: {error}")
    return {**json.loads(out), "cores": cost.cores, "pss_mib": cost.pss_mib}


def start(stack: ExitStack, command: Sequence[str], environment: Mapping[str, str]) -> subprocess.Popen[str]:
    """Start a process that is ended with the stack."""
    process = subprocess.Popen(
        command,
        env=dict(environment),
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )

    def end() -> None:
        process.kill()
        process.communicate()

    stack.callback(end)
    return process


def write_scans(file: Path, course: BenchScans) -> None:
    """Write the input of client.cpp."""
    header = np.array([course.model.beam_count, len(course.free), len(course.blocked)], np.int32)
    file.write_bytes(header.tobytes() + (course.ranges_mm / np.float32(1000)).astype(np.float32).tobytes())


def print_table(medians: Mapping[str, Mapping[str, Any]]) -> None:
    """Print a line per competitor, and ours as a share of each."""
    print(
        f"{'ms, medians':<28}{'p50':>8}{'p99':>8}{'p99.9':>8}{'cores':>8}{'PSS MiB':>9}{'slipped':>9}{'of onsets':>11}"
    )
    for name, row in medians.items():
        times = "".join(f"{row[column]:8.3f}" for column in ("p50", "p99", "p99_9"))
        print(f"{name:<28}{times}{row['cores']:8.3f}{row['pss_mib']:9.1f}{row['slipped']:9.0f}{row['onsets']:11.0f}")
    own = medians[OURS]
    for name, row in medians.items():
        if name != OURS:
            ratios = ", ".join(
                f"{column} {own[column] / row[column]:.2f}" for column in ("p50", "p99", "cores", "pss_mib")
            )
            print(f"ours / {name}: {ratios}")


if __name__ == "__main__":
    main()
