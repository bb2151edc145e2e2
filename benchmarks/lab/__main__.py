"""Experiments of the lab on what wallride claims of itself: corners of real buildings, and real recordings.

Run: python -m benchmarks.lab corners --method ball,prototype
     python -m benchmarks.lab recordings DIR --plot PICTURES
"""

import argparse
import sys
from pathlib import Path

from benchmarks.lab.recordings import NoRecordingsError, named_or_nearby
from wallride.lab_options import add_distance, add_experiment, add_maps
from wallride.sim.lab.command import run
from wallride.sim_options import add_car


def parsed(arguments: list[str] | None = None) -> argparse.Namespace:
    """Return the options of an experiment, and its recordings; ends the process for wrong ones."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    experiments = parser.add_subparsers(dest="experiment", required=True, metavar="EXPERIMENT")
    what = "corners of real buildings and lanes that turn: --method ball,prototype compares with a baseline"
    corners = add_experiment(experiments, "corners", what, fixed=False)
    add_car(corners)
    add_distance(corners)
    add_maps(corners)
    what = "real recordings: noise, dirt, braking at walls, needless stops"
    recordings = add_experiment(experiments, "recordings", what, fixed=True)
    recordings.add_argument(
        "folder", type=Path, nargs="?", metavar="DIR",
        help="folder of recordings, or one recording (default: data/racecar nearby)",
    )  # fmt: skip
    options = parser.parse_args(arguments)
    if options.experiment == "recordings":
        try:
            options.recordings = named_or_nearby(options.folder)
        except NoRecordingsError as error:
            parser.error(str(error))
    options.experiment = f"benchmarks.lab.{options.experiment}"
    return options


if __name__ == "__main__":
    sys.exit(run(parsed()))
