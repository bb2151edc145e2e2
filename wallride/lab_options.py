"""Options of `wallride lab`. The lab is imported when the command runs."""

import argparse
from pathlib import Path

from wallride.experiments import race_options, report_options, tune_options
from wallride.failure import later
from wallride.parser import Commands, add_jobs, add_json, add_set, at_least, number, writable_path
from wallride.sim_options import add_car
from wallride.sweeps import options as sweep_options

EXPERIMENTS = {
    "walls": "the report's five tests and more courses: error, settling, contacts, beside the physical limit",
    "safety": "obstacles at the report's 28 speeds and distances: stopped, or the impact beside what physics allows",
    "hazards": "obstacles before a driver that ignores them, and drives that need no stop",
    "laps": "lap time and error on the loop and on maps",
    "window": "dirt on the lidar's window: beams found, missed and falsely masked",
    "covers": "a covered or silent lidar, from the start or while driving: contacts that a brake avoids",
    "rooms": "clutter and people in the way: contacts, stuck cars, time until driving resumes",
    "stories": "the whole process in virtual time: laps, pulled cables, dirt, people, dead ends",
}
FIT = "estimates a real car's delay, servo, noise, trim and own parts from recordings, for `sim` and `lab`"
WITH_SETTINGS = ("walls", "safety", "hazards", "laps")
"""Experiments whose cars take settings, and whose simulated car can be another one, as `wallride lab fit` found it."""


def add(parser: argparse.ArgumentParser) -> None:
    """Add the experiments and their options."""
    experiments = parser.add_subparsers(dest="experiment", required=True, metavar="EXPERIMENT")
    report_options.add(experiments)
    tune_options.add(experiments)
    race_options.add(experiments)
    for name, what in EXPERIMENTS.items():
        parser = add_experiment(experiments, name, what, fixed=name == "stories")
        if name in WITH_SETTINGS:
            add_set(parser)
            add_car(parser)
            parser.add_argument(
                "--own-parts",
                metavar="KIND",
                help="parts of the car that its lidar sees (default: a kind on every odd seed)",
            )
        if name in {"walls", "laps"}:
            add_distance(parser)
        if name in {"laps", "rooms"}:
            parser.add_argument("--generated", action="store_true", help="generated courses instead, from the seeds")
        if name == "laps":
            add_maps(parser)
    _add_fit(experiments.add_parser("fit", help=FIT, description=FIT[:1].upper() + FIT[1:] + "."))
    sweep_options.add(experiments)


def add_experiment(experiments: Commands, name: str, what: str, *, fixed: bool) -> argparse.ArgumentParser:
    """Add an experiment. fixed: laws, speeds, floors, sides and seeds are its own."""
    parser = experiments.add_parser(name, help=what, description=what[:1].upper() + what[1:] + ".")
    run = later("wallride.sim.lab.command", "sim", "the simulator needs")
    parser.set_defaults(run=run, conditions=None, condition=[], own_parts=None)
    if fixed:
        parser.set_defaults(method="ball", speeds=None, mu=None, side=None, seed=1000, seeds=1)
    else:
        _add_variations(parser)
    _add_outputs(parser)
    return parser


def add_distance(parser: argparse.ArgumentParser) -> None:
    """Add the wanted distance."""
    parser.add_argument("--distance", metavar="M", help="wanted distance to the wall in m (default: 1)")


def add_maps(parser: argparse.ArgumentParser) -> None:
    """Add the folder of maps."""
    parser.add_argument("--maps", type=Path, metavar="DIR", help="folder of ROS maps (default: data/maps nearby)")


def _add_fit(parser: argparse.ArgumentParser) -> None:
    parser.set_defaults(run=later("wallride.sim.fit.command", "sim", "the simulator needs"))
    parser.add_argument("files", type=Path, nargs="+", metavar="FILE", help="recordings of one car's drives")
    parser.add_argument(
        "--out",
        type=writable_path,
        metavar="FILE.toml",
        help="write a file for --conditions of `wallride sim` and `lab`",
    )
    parser.add_argument(
        "--wheelbase", type=number(0.05, 2.0), default=0.33, metavar="M", help="wheelbase as configured (default: 0.33)"
    )
    parser.add_argument("--topic", metavar="NAME", help="which lidar, when a file holds several")


def _add_variations(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--method",
        default="ball",
        metavar="A,B",
        help="laws, e.g. ball,report,ball+none, or MODULE:CLASS of your own (default: ball)",
    )
    parser.add_argument("--speeds", metavar="V,V", help="requested speeds in m/s (default: 1,2,3,4)")
    parser.add_argument("--mu", metavar="MU,MU", help="true friction (default: .5,.8,1)")
    parser.add_argument("--side", metavar="SIDE,SIDE", help="side of the followed wall (default: left,right)")
    parser.add_argument(
        "--seed", type=at_least(0), default=1000, metavar="N", help="first seed of all noise (default: 1000)"
    )
    parser.add_argument(
        "--seeds", default="1", metavar="K|A:B", help="number of seeds from the first on, or A to before B (default: 1)"
    )


def _add_outputs(parser: argparse.ArgumentParser) -> None:
    add_jobs(parser)
    add_json(parser, "the figures of every run")
    parser.add_argument("--plot", type=Path, metavar="DIR", help="draw a picture of every run into a directory")
    parser.add_argument(
        "--only", metavar="A,B", help="courses by name or pattern, e.g. t1,rough*; an unknown name lists all"
    )
    parser.add_argument("--quick", action="store_true", help="a few runs only, as a first impression")
