"""The wheel holds `wallride` alone, and works from a folder with modules of the same names as its folders."""

import re
import shutil
import subprocess
import sys
import sysconfig
import venv
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
FOREIGN = ("clients", "drivers", "runtime", "config", "tests")
REFUSES = 'raise SystemExit("this is the student\'s")\n'
PROGRAM = """
import wallride, wallride.clients.remote.car, wallride.drivers.api, wallride.runtime.app
import wallride.sim.virtual.closed_loop
print(wallride.__file__)
"""


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    folder = tmp_path_factory.mktemp("wheel")
    subprocess.run(
        [sys.executable, "-m", "pip", "wheel", "--quiet", "--no-deps", "--no-build-isolation", "-w", folder, ROOT],
        check=True,
    )  # fmt: skip
    (path,) = folder.glob("*.whl")
    return path


@pytest.fixture(scope="module")
def installed(wheel, tmp_path_factory):
    """Return the Python of an environment with the wheel; what it needs comes from this one."""
    folder = tmp_path_factory.mktemp("environment")
    venv.create(folder, symlinks=True)
    python = folder / "bin" / "python"
    (site,) = folder.glob("lib/python*/site-packages")
    (site / "needed.pth").write_text(sysconfig.get_path("purelib"))  # the links to a checkout there are not followed
    subprocess.run(
        [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", "--no-deps", wheel], check=True
    )
    return python


@pytest.fixture
def student(tmp_path):
    """Return a folder with a student's own files of our folders' names."""
    (tmp_path / "sim.py").write_text(REFUSES)
    for name in FOREIGN:
        (tmp_path / name).mkdir()
        (tmp_path / name / "__init__.py").write_text(REFUSES)
    return tmp_path


def test_the_wheel_holds_one_package_and_is_typed(wheel):
    names = zipfile.ZipFile(wheel).namelist()
    assert {name.partition("/")[0].partition("-")[0] for name in names} == {"wallride"}
    assert {"wallride/py.typed", "wallride/runtime/app.py", "wallride/sim/world/casting.c"} <= set(names)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler here")
def test_the_compiled_functions_are_in_the_wheel_and_need_no_compiler(installed, tmp_path):
    done = subprocess.run(
        [installed, "-m", "wallride.runtime.kernel"], cwd=tmp_path, env={"PATH": str(tmp_path)}, capture_output=True,
        text=True, check=True,
    )  # fmt: skip
    told = re.fullmatch(r"(\d+) of (\d+) functions of the hot path are compiled\n", done.stdout)
    assert told is not None, done.stdout
    assert told[1] == told[2]


def test_it_is_imported_beside_a_students_files(installed, student):
    done = subprocess.run([installed, "-c", PROGRAM], cwd=student, capture_output=True, text=True, check=True)
    assert Path(done.stdout.strip()).is_relative_to(installed.parents[1])


def test_the_simulated_car_drives_beside_a_students_files(installed, student):
    for name in ("signal", "random"):  # of Python's own modules, too
        (student / f"{name}.py").write_text(REFUSES)
    command = [installed.with_name("wallride"), "sim", "loop", "--headless", "--duration", "2", "--json", "-"]
    done = subprocess.run(command, cwd=student, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    assert '"collided": false' in done.stdout


def test_the_notice_names_each_package_whose_message_types_the_wheel_holds(wheel):
    inside = zipfile.ZipFile(wheel)
    (notice,) = (inside.read(name).decode() for name in inside.namelist() if name.endswith("/NOTICE"))
    types = inside.read("wallride/runtime/ros/types.msg").decode()
    packages = set(re.findall(r"^=== (\w+)/", types, re.MULTILINE))
    assert len(packages) > 5
    assert packages <= set(re.findall(r"\w+", notice))


def test_the_first_program_of_the_docs_is_typed_against_an_installed_wheel(installed, tmp_path):
    text = (ROOT / "docs" / "python.md").read_text()
    program = text.split("```python\n", 1)[1].split("```")[0]
    (tmp_path / "program.py").write_text(program + "\nreveal_type(wallride.connect())\n")
    mypy = [sys.executable, "-m", "mypy", "--strict", "--config-file=", "--python-executable", installed, "program.py"]
    done = subprocess.run(mypy, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert "wallride.clients.remote.car.RemoteCar" in done.stdout
    assert done.returncode == 0, done.stdout
