"""What `wallride lab` understands. Only definitions: the lab itself is imported when it is asked for."""

import argparse
from pathlib import Path

EXPERIMENTS = {
    "walls": "the report's starts and more courses: error, settling, contacts, beside the physical limit",
    "safety": "the report's 28 sudden obstacles: stopped, or the impact beside what physics allows",
    "hazards": "things in the way of a navigator that ignores them, and drives in which a stop is needless",
    "laps": "lap time and error on the loop and on maps",
}


def add(parser: argparse.ArgumentParser) -> None:
    """Add the experiments and their options."""
    experiments = parser.add_subparsers(dest="experiment", required=True, metavar="EXPERIMENT")
    for name, what in EXPERIMENTS.items():
        _add_options(experiments.add_parser(name, help=what, description=what.capitalize() + "."), maps=name == "laps")


def _add_options(parser: argparse.ArgumentParser, *, maps: bool) -> None:
    parser.add_argument(
        "--method", default="ball", metavar="A,B", help="laws, e.g. ball,report,ball+none (default: ball)"
    )
    parser.add_argument("--speeds", metavar="V,V", help="requested speeds in m/s (default: 1,2,3,4)")
    parser.add_argument("--mu", metavar="MU,MU", help="true friction (default: .5,.8,1)")
    parser.add_argument("--side", metavar="SIDE,SIDE", help="side of the followed wall (default: left,right)")
    parser.add_argument("--seed", type=int, default=1000, metavar="N", help="first seed of all noise (default: 1000)")
    parser.add_argument("--seeds", type=int, default=1, metavar="K", help="how many seeds, from the first (default: 1)")
    parser.add_argument("--jobs", type=int, metavar="N", help="processes (default: one per core)")
    parser.add_argument("--json", metavar="FILE|-", help="write every cell's figures as JSON")
    parser.add_argument("--plot", type=Path, metavar="DIR", help="draw a picture of every run into a directory")
    parser.add_argument("--quick", action="store_true", help="a few cells only, as a first impression")
    if maps:
        parser.add_argument("--maps", type=Path, metavar="DIR", help="folder of ROS maps (default: data/maps nearby)")
