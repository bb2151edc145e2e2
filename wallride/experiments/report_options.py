"""Options of `wallride lab report`."""

from pathlib import Path

from wallride.failure import later
from wallride.parser import Commands, add_jobs, add_set, at_least
from wallride.sim_options import add_car

WHAT = "the lab report's evaluation as a page: its 60 errors, optima, trials and obstacles, beside another law"


def add(experiments: Commands) -> None:
    """Add the command."""
    report = experiments.add_parser("report", help=WHAT, description=f"{WHAT[:1].upper()}{WHAT[1:]}.")
    report.add_argument(
        "-o", dest="output", type=Path, default=Path("lab-report"), metavar="DIR",
        help="folder of report.html, report.md and figures.json (default: lab-report)",
    )  # fmt: skip
    report.add_argument(
        "--method",
        default="ball",
        metavar="LAW",
        help="law beside the report's; MODULE:CLASS of your own (default: ball)",
    )
    add_set(report)
    report.epilog = (
        "--set report.KEY=VALUE and --set law.KEY=VALUE are for the cars of one law alone."
        " A gain that is set is not varied."
    )
    report.add_argument("--friction", type=float, metavar="MU", help="grip of the floor (default: 0.8)")
    report.add_argument("--wild", type=float, metavar="SHARE", help="share of wild beams of the lidar (default: 0)")
    report.add_argument("--own-parts", metavar="KIND", help="parts of the car that its lidar sees (default: none)")
    add_car(report)
    report.add_argument("--seed", type=at_least(0), default=1000, metavar="N", help="seed of all noise (default: 1000)")
    add_jobs(report)
    report.set_defaults(run=later("wallride.sim.lab_report.command", "sim", "the simulator needs"))
