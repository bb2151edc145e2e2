"""What `wallride bench` understands. Only definitions: the benchmarks are imported when they are asked for."""

import argparse
from pathlib import Path

from wallride.failure import needs

MEASUREMENTS = {
    "latency": "from a scan's last byte to the motor's first: emulated devices outside, the unmodified process inside",
    "cpu": "CPU, memory and threads of the whole process at 40 Hz, telemetry on and heard",
    "startup": "from the start of the process to its first motor command",
    "readers": "whether readers can slow it down: none, one, one that stops reading, ten",
    "loaded": "the same latency while others want every core, under SCHED_FIFO; needs root",
    "rates": "the highest rate of scans that is held, and the cost of more beams",
}


def add(commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command and its measurements."""
    bench = commands.add_parser("bench", help="how fast it is on this machine")
    measurements = bench.add_subparsers(dest="measurement", required=True, metavar="MEASUREMENT")
    for name, what in MEASUREMENTS.items():
        parser = measurements.add_parser(name, help=what, description=what.capitalize() + ".")
        parser.set_defaults(run=run, plot=None)
        add_outputs(parser)
        if name == "latency":
            parser.add_argument("--plot", type=Path, metavar="DIR", help="draw a histogram, DIR/latency.png")
        parser.add_argument(
            "--set", dest="assignments", action="append", default=[], metavar="KEY=VALUE",
            help="override one of the car's settings (repeatable)",
        )  # fmt: skip
    sim = measurements.add_parser("sim", help="the simulator: steps a second on one core, and its error")
    sim.set_defaults(run=run)
    add_outputs(sim)


def add_outputs(parser: argparse.ArgumentParser) -> None:
    """Add what every measurement has: how often, how long, where to."""
    parser.add_argument("--runs", type=int, metavar="N", help="runs, of which the median counts (default: 3)")
    parser.add_argument("--short", action="store_true", help="a few seconds and one run, to see that it works")
    parser.add_argument("--json", metavar="FILE|-", help="write all runs and their medians as JSON")


def run(options: argparse.Namespace) -> int:
    """Measure; exit code 2 when a package of the simulator is missing, 1 when a run was broken."""
    with needs("sim", "benchmarks need"):
        if options.measurement == "sim":
            from sim.bench.simulator import run as measure
        else:
            from sim.bench.command import run as measure
    return int(measure(options))
