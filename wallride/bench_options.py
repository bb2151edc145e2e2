"""Options of `wallride bench`. The benchmarks are imported when the command runs."""

from pathlib import Path

from wallride.failure import later
from wallride.parser import Commands, add_json, add_set, at_least

MEASUREMENTS = {
    "latency": "latency from a scan's last byte to the motor's first; emulated devices, the unmodified process",
    "cpu": "CPU, memory and threads of the process at 40 Hz, with a subscriber to all topics",
    "startup": "time from the start of the process to its first motor command",
    "readers": "latency with no subscriber, one, one that stops reading, and ten",
    "loaded": "latency on loaded cores, under SCHED_FIFO; needs root",
    "rates": "highest scan rate without lost scans, and the cost of more beams",
}


def add(commands: Commands) -> None:
    """Add the command and its measurements."""
    bench = commands.add_parser("bench", help="benchmarks on this machine")
    measurements = bench.add_subparsers(dest="measurement", required=True, metavar="MEASUREMENT")
    for name, what in MEASUREMENTS.items():
        parser = measurements.add_parser(name, help=what, description=what[:1].upper() + what[1:] + ".")
        parser.set_defaults(run=later("wallride.sim.bench.command", "sim", "benchmarks need"), plot=None)
        parser.add_argument(
            "--runs", type=at_least(1), metavar="N", help="number of runs; the median is reported (default: 3)"
        )
        parser.add_argument("--short", action="store_true", help="one run of a few seconds, as a trial")
        add_json(parser, "all runs and their medians")
        if name == "latency":
            parser.add_argument("--plot", type=Path, metavar="DIR", help="draw a histogram, DIR/latency.png")
        add_set(parser, "override one of the car's settings")
