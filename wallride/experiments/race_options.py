"""Options of `wallride lab races`."""

import argparse
from pathlib import Path

from wallride.failure import later
from wallride.line_options import add_reserve
from wallride.parser import Commands, add_jobs, add_json, add_set, at_least, number
from wallride.sim_options import add_car

WHAT = "laps on the maps of courses by several laws: times beside theory and published ones, errors, stops, contacts"
TRACKS = (7, 23)
"""Seeds of the generated tracks."""
FEWEST_LAPS = 3
"""The third lap is the first that counts."""


def add(experiments: Commands) -> None:
    """Add the command."""
    races = experiments.add_parser(
        "races",
        help=WHAT,
        description=f"{WHAT[:1].upper()}{WHAT[1:]}. Each course is mapped by one lap of `ball` at 2 m/s, its line is"
        " computed, and every law races on it with the pose that the car finds.",
    )
    races.add_argument(
        "--method", default="ball,line", metavar="A,B",
        help="laws, e.g. ball,line,line+none, or MODULE:CLASS of your own (default: ball,line)",
    )  # fmt: skip
    races.add_argument("--maps", type=Path, metavar="DIR", help="folder of ROS maps (default: data/maps nearby)")
    races.add_argument(
        "--tracks", type=_seeds, default=TRACKS, metavar="N,N", help="seeds of generated tracks (default: 7,23)"
    )
    races.add_argument(
        "--only", metavar="A,B", help="courses by name or pattern, e.g. levine,track*; an unknown name lists all"
    )
    races.add_argument("--laps", type=at_least(FEWEST_LAPS), default=5, metavar="N", help="laps of a race (default: 5)")
    races.add_argument(
        "-o", dest="output", type=Path, metavar="DIR",
        help="folder for the maps of the laps, which are kept and taken again (default: none)",
    )  # fmt: skip
    races.add_argument(
        "--box", choices=("standing", "moving", "sudden"), default="",
        help="a box in the way of every race: on the line or beside it; crossing it or going along it; or appearing"
        " 0.3 to 0.9 m before the car: is it touched, and harder than after a full brake? (default: none)",
    )  # fmt: skip
    _add_conditions(races)
    add_reserve(races)
    add_set(races)
    add_jobs(races)
    add_json(races, "the figures of every race")
    races.set_defaults(
        run=later("wallride.sim.races.command", "sim", "the simulator needs"),
        quick=False,
        side="left",
        own_parts="none",
        speeds=None,
    )


def _add_conditions(races: argparse.ArgumentParser) -> None:
    races.add_argument("--mu", metavar="MU,MU", help="true friction (default: .8)")
    races.add_argument(
        "--speed", dest="speed_mps", type=number(0.3, 8.0), default=6.0, metavar="MPS",
        help="highest speed of line and car (default: 6)",
    )  # fmt: skip
    races.add_argument(
        "--assumed", type=number(0.3, 3.0), default=1.0, metavar="RATIO",
        help="friction that line and follower assume, over the true one (default: 1)",
    )  # fmt: skip
    races.add_argument(
        "--delay", dest="delay_s", type=number(0.0, 0.2), default=0.0, metavar="S",
        help="delay of the servo on top of its usual 20 ms (default: 0)",
    )  # fmt: skip
    races.add_argument(
        "--stiffness", type=number(0.3, 3.0), default=1.0, metavar="RATIO",
        help="true stiffness of the tyres over the assumed one (default: 1)",
    )  # fmt: skip
    add_car(races)
    races.add_argument(
        "--seed", type=at_least(0), default=7000, metavar="N",
        help="first seed of the noise of races; that of the mapped laps is fixed (default: 7000)",
    )  # fmt: skip
    races.add_argument(
        "--seeds", default="1", metavar="K|A:B", help="number of seeds from the first on, or A to before B (default: 1)"
    )


def _seeds(text: str) -> tuple[int, ...]:
    """Return the seeds of an option's text; none for an empty one."""
    parts = [part.strip() for part in text.split(",") if part.strip()]
    if not all(part.isdecimal() for part in parts):
        raise argparse.ArgumentTypeError("write whole numbers with commas between them")
    return tuple(dict.fromkeys(map(int, parts)))
