"""The extras of pyproject.toml: each package pinned, and those of an installed car enough to make a map."""

import subprocess
import sys
import tomllib
from importlib.metadata import distributions
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

from wallride.deploy.closure import CarPlatform, reach, read_pins

ROOT = Path(__file__).resolve().parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
EXTRAS = {"": PROJECT["project"]["dependencies"], **PROJECT["project"]["optional-dependencies"]}
MAKES_MAPS = ("wallride.sim.mapping.command", "wallride.sim.mapping.pose_command", "wallride.sim.racing.command")
WITHOUT = """
import importlib, sys

class Missing:
    def find_spec(self, name, path=None, target=None):
        if name.partition(".")[0] in LEFT_OUT:
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Missing())
for name in MAKES_MAPS:
    importlib.import_module(name)
from wallride.cli import main
sys.exit(main(["line", "loop", "-o", sys.argv[1]]))
"""


def of_wallride():
    """Return what pyproject.toml requires, as a wheel's metadata has it."""
    for extra, packages in EXTRAS.items():
        for package in packages:
            wanted = Requirement(package)
            if extra:
                marker = f"({wanted.marker}) and " if wanted.marker else ""
                wanted = Requirement(f"{str(wanted).partition(';')[0]}; {marker}extra == '{extra}'")
            yield wanted


def of_a_car(machine):
    """Return the normalized names of all packages of an installed car."""
    known: dict[str, list[Requirement]] = {"wallride": list(of_wallride())}
    for one in distributions():
        known.setdefault(canonicalize_name(one.name), [Requirement(text) for text in one.requires or ()])
    car = CarPlatform(machine, (2, 36), sys.version_info[:3])
    return set(reach([Requirement("wallride[car]")], known, car.environment())[0])


@pytest.mark.parametrize("extra", EXTRAS)
def test_every_package_of_every_extra_is_pinned(extra):
    pins = read_pins((ROOT / "constraints.txt").read_text(encoding="utf-8"))
    names = [Requirement(package).name for package in EXTRAS[extra]]
    assert [name for name in names if name != "wallride" and canonicalize_name(name) not in pins] == []


@pytest.mark.parametrize(("machine", "makes_maps"), [("x86_64", True), ("aarch64", True), ("armv7l", False)])
def test_a_car_has_what_maps_need_where_there_are_wheels_for_it(machine, makes_maps):
    needed = of_a_car(machine)
    of_maps = {"scipy", "clarabel", "matplotlib"}
    assert of_maps & needed == (of_maps if makes_maps else set())
    assert {"rosbags", "ruamel-yaml", "aiohttp", "cryptography"} < needed


def test_an_installed_car_makes_a_map_s_line_with_no_other_package(tmp_path):
    """The packages that the car does not have cannot be imported; the picture is drawn, too."""
    needed = of_a_car("x86_64")
    left_out = set()
    for one in distributions():
        if canonicalize_name(one.name) not in needed:
            left_out |= {str(file).partition("/")[0].removesuffix(".py") for file in one.files or ()}
    left_out -= {"wallride", "..", "__pycache__", "numpy", "google"}
    assert {"optuna", "hypothesis"} < left_out, "of this computer"
    program = f"LEFT_OUT, MAKES_MAPS = {left_out!r}, {MAKES_MAPS!r}\n{WITHOUT}"
    line = tmp_path / "loop.line.csv"
    command = [sys.executable, "-c", program, str(line)]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=100, check=False)
    assert done.returncode == 0, done.stderr
    assert line.is_file()
    assert line.with_suffix(".png").stat().st_size > 10_000
