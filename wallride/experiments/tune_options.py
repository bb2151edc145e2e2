"""Options of `wallride lab tune`."""

import argparse
from pathlib import Path

from wallride.failure import needs
from wallride.parser import Commands, add_jobs, add_set, at_least
from wallride.sim_options import add_car

WHAT = "tune settings, or those of your own law, with Optuna: one cost over scenarios, resumable, judged on others"


def add(experiments: Commands) -> None:
    """Add the command."""
    tune = experiments.add_parser("tune", help=WHAT, description=f"{WHAT[:1].upper()}{WHAT[1:]}.")
    tune.add_argument("--method", default="ball", metavar="LAW", help="law; MODULE:CLASS of your own (default: ball)")
    tune.add_argument(
        "--param", dest="parameters", action="append", default=[], metavar="NAME[=LOW:HIGH]",
        help="setting to tune, from half to twice its value without a range (repeatable; default: the law's gains)",
    )  # fmt: skip
    add_set(tune)
    add_car(tune)
    tune.add_argument("--trials", type=at_least(1), default=200, metavar="N", help="trials in all (default: 200)")
    tune.add_argument(
        "-o", dest="output", type=Path, default=Path("lab-tune"), metavar="DIR",
        help="folder of the study, tuned.toml and tuning.html; a study there goes on (default: lab-tune)",
    )  # fmt: skip
    tune.add_argument("--only", metavar="A,B", help="courses to tune on, e.g. t1,t5 (default: all)")
    tune.add_argument(
        "--seed", type=at_least(0), default=0, metavar="N", help="seed of sampler and conditions (default: 0)"
    )
    add_jobs(tune)
    tune.add_argument("--on", default="", metavar="ADDRESS", help="Ray cluster, as of `lab sweep`")
    tune.set_defaults(run=_run)


def _run(options: argparse.Namespace) -> int:
    with needs("sim", "the simulator needs"):
        import wallride.sim.lab.command  # noqa: F401 - which extra is missing
    with needs("tune", "tuning needs"):
        from wallride.sim.tuning.command import run
    return run(options)
