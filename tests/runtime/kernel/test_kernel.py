"""The C functions refuse wrong arguments, are of the C and the Python that is here, and give way to an edited law."""

import functools
import importlib.util
import os
import re
import shutil
import subprocess
import sys
import sysconfig

import numpy as np
import pytest

from tests.compiled_laws import put_c_in_place
from wallride.drivers import accelerated
from wallride.drivers.accelerated import FUNCTIONS, ROOT
from wallride.runtime import kernel
from wallride.runtime.control.perception import view
from wallride.runtime.control.perception.obstacles import rear_memory
from wallride.runtime.kernel.build import FILE, BuildError, _headers, build
from wallride.runtime.kernel.survey import Survey, c_digest, read_seal

survey = functools.cache(lambda: Survey(ROOT))
headers = functools.cache(lambda: _headers(survey()))
SEAL_AGAIN = "after the C does the same and these tests pass: wallride build-kernel --seal"
NEAR = "runtime/control/perception/obstacles/rear_memory.py"


@pytest.fixture(autouse=True)
def the_source_is_surveyed_once(monkeypatch):
    monkeypatch.setattr("wallride.runtime.kernel.build._headers", lambda _survey: headers())


def test_wrong_arguments_are_refused_and_crash_nothing(compiled):
    arrays = (np.zeros(3),) * 12, (np.zeros((2, 2)),) * 11, (np.zeros(0, int),) * 7
    for function in compiled.values():
        for given_ in ((), (None,), (1, 2, 3), ("text",) * 9, *arrays):
            with pytest.raises((TypeError, ValueError, OverflowError, IndexError)):
                function(*given_)


def test_arrays_of_different_lengths_are_refused(compiled):
    short, long_m, flags = np.zeros(3), np.zeros(9), np.zeros(9, np.bool_)
    with pytest.raises(ValueError, match="different lengths"):
        compiled["solid_places"](short, long_m, flags)
    with pytest.raises(ValueError, match="find_small_clusters: arrays of different lengths"):
        compiled["find_small_clusters"](flags, short, 0.004)
    with pytest.raises(ValueError, match="different lengths"):
        compiled["find_dark_regions"](flags, flags, short, 0.0, 0.1, 0.0, 1.0)
    for beam in (9, -1):
        with pytest.raises(IndexError, match=f"no beam {beam}"):
            compiled["learn_noise_m"](0.01, long_m, long_m, np.array([0, beam]))
        with pytest.raises(IndexError, match=f"no beam {beam}"):
            compiled["roll_ball"](long_m, long_m, flags, np.array([0, beam]), None, *[0.0] * 8, (1.0,) * 5)
    with pytest.raises(ValueError, match="at least 5 circles"):
        compiled["roll_ball"](long_m, long_m, flags, np.array([0]), None, *[0.0] * 8, (1.0,) * 4)
    with pytest.raises(ValueError, match="at least three circles"):
        compiled["drive_along_ball"]((1.0,), (1.0,), (True,), (True,), *[0.0] * 12)
    beams = np.zeros(2, np.intp)
    for lengths in ((3, 9, 9), (9, 3, 9), (9, 9, 3)):
        x_m, range_m, echo = (np.ones(length) for length in lengths)
        with pytest.raises(ValueError, match="wall_beside: arrays of different lengths"):
            compiled["find_followed_wall"](
                x_m, long_m, range_m, flags, echo > 2, 0, 9, 0, 1.0, *[beams] * 3, 0.0, 0.0, 1.0
            )
    with pytest.raises(ValueError, match="counted from 0"):
        compiled["find_followed_wall"](*[long_m] * 3, *[flags] * 2, 0, 9, -1, 1.0, *[beams] * 3, 0.0, 0.0, 1.0)
    for outside in (np.array([0, 9]), np.array([-1, 0])):
        with pytest.raises(IndexError, match="outside the scan"):
            compiled["find_followed_wall"](
                *[long_m] * 3, ~flags, flags, 0, 9, 0, 1.0, outside, beams, beams, 0.0, 0.0, 1.0
            )


def test_the_c_was_written_for_the_python_that_is_here():
    found, sealed = {name: one.digest for name, one in survey().functions.items()}, read_seal(ROOT)
    assert {name for name in found.keys() | sealed.keys() if found.get(name) != sealed.get(name)} == set(), SEAL_AGAIN


def test_what_is_built_is_the_c_that_is_here(compiled):
    assert accelerated.sealed()["c"] == c_digest(ROOT), "make, or wallride build-kernel"


def test_every_accelerated_function_has_its_c(compiled):
    of_the_car = {name for name in survey().functions if not name.startswith("wallride.sim.")}
    assert {f"{one.python.__module__}.{name}" for name, one in FUNCTIONS.items()} >= of_the_car
    assert set(compiled) == set(FUNCTIONS)


@pytest.fixture(scope="module")
def checkout(compiled, tmp_path_factory):
    """A copy of the source with the extension in it; edits are undone."""
    copy = tmp_path_factory.mktemp("checkout") / "wallride"
    copy.mkdir()
    (copy / "__init__.py").touch()
    for package in ("drivers", "runtime", "sim"):
        shutil.copytree(ROOT / package, copy / package, ignore=shutil.ignore_patterns("__pycache__"))
    return copy


@pytest.fixture
def edited(checkout):
    """Replace text in a file of the copy, and return what a program there prints."""
    before = {}

    def edit(name, old, new, program="import wallride.runtime.kernel.__main__"):
        path = checkout / name
        before[path] = path.read_text()
        assert old in before[path]
        path.write_text(before[path].replace(old, new))
        surroundings = {**os.environ, "PYTHONPATH": str(checkout.parent), "PYTHONDONTWRITEBYTECODE": "1"}
        surroundings.pop(accelerated.SWITCH, None)
        command = [sys.executable, "-c", program]
        return subprocess.run(
            command, env=surroundings, cwd=checkout.parent, capture_output=True, text=True, check=True
        ).stdout

    yield edit
    for path, text in before.items():
        path.write_text(text)


def test_an_edited_comment_or_docstring_costs_nothing(edited, compiled):
    said = edited(
        NEAR, '    """Return in odom, (k,), the solid', '    # closer\n    """Return, in odom, (k,), the solid'
    )
    assert said == f"{len(compiled)} of {len(compiled)} functions of the hot path are compiled\n"


PLACES = """
from types import SimpleNamespace
import numpy as np
from wallride.drivers.accelerated import in_c
from wallride.runtime.control.perception.obstacles.rear_memory import find_near_places
far = np.array([1.0, 2.0, 3.0])
view = SimpleNamespace(x_m=far, y_m=0 * far, solid=far > 0, ranges_m=far)
print("find_near_places" in in_c(), find_near_places(view, 0j, 0.0).size)
"""


def test_a_changed_number_costs_nothing_and_reaches_the_c(edited):
    assert edited(NEAR, "NEAR_M = 1.6", "NEAR_M = 2.5", PLACES) == "True 2\n"


def test_an_edited_law_drives_in_python_with_its_callers_alone_and_says_so(edited, compiled):
    said = edited(NEAR, "(view.ranges_m < NEAR_M)", "(view.ranges_m <= NEAR_M)")
    assert said == (
        f"{len(compiled) - 1} of {len(compiled)} functions of the hot path are compiled; "
        "in Python: find_near_places (edited since its C was sealed)\n"
    )


def test_what_calls_an_edited_function_drives_in_python_too(edited):
    said = edited("runtime/control/perception/geometry.py", "x_m.take(which)", "x_m[which]")
    assert "in Python: find_near_places, find_thin_places, solid_places (edited since its C was sealed)" in said


CASTS = """
import numpy as np
from wallride.sim.world import compiled, grid, segments
from wallride.sim.world.pose import Pose
wall = segments.SegmentGeometry(np.array([[2.0, -1.0, 2.0, 0.0]])).cast(0.0, 0.0, np.array([1e-6]))
cells = grid.GridGeometry(np.zeros((9, 9), bool), 0.1, Pose(0, 0, 0)).cast(0.5, 0.5, np.array([0.0]))
print(*(compiled.by_c(one) is not None for one in (segments.cast_walls, grid.cast_cells)), wall[0], round(cells[0], 3))
"""


@pytest.mark.parametrize(("name", "old", "new", "said"), [
    ("segments.py", "def box(", "# a box\ndef box(", "True True inf 0.4"),
    ("segments.py", "_END_SLACK_M = 1e-9", "_END_SLACK_M = 1e-3", "True True 2.000000000001 0.4"),
    ("segments.py", "x0 + share * ex - cx", "x0 - cx + share * ex", "True True inf 0.4"),
    ("segments.py", "distance >= 0.0", "distance >= 0.5", "False True inf 0.4"),
    ("free_rectangles.py", "travelled[beam] = now", "travelled[beam] = 1 * now", "True False inf 0.4"),
    ("grid.py", "march(along / cell_m, across / cell_m, dx, dy)", "march(along / cell_m, across / cell_m, dx, dy) / 2",
     "True False inf 0.2"),
])  # fmt: skip
def test_an_edited_cast_of_the_simulator_is_cast_in_python(edited, name, old, new, said):
    assert edited(f"sim/world/{name}", old, new, CASTS) == f"{said}\n"


def test_a_number_that_the_c_is_laid_out_for_needs_another_build(edited):
    said = edited("runtime/control/wall_following/prediction.py", "MAX_TOLD = 12", "MAX_TOLD = 13")
    assert "in Python: predict_motion (" in said
    assert "MAX_TOLD was 12 when it was built: wallride build-kernel" in said


def test_a_number_that_is_none_for_c_leaves_the_python(edited):
    said = edited("runtime/control/perception/view.py", "RIM_BEAMS = 2", "RIM_BEAMS = 2.5")
    assert "RIM_BEAMS was a whole number when it was built" in said


def test_constants_come_from_the_python():
    known = {name: kind for one in survey().constants for name, kind in zip(one.names, one.kinds, strict=True)}
    assert known["VIEW_DIRT_NEARER_THAN_M"] == known["WALL_FIT_GATES_M_2"] == "real"
    assert known["VIEW_RIM_BEAMS"] == "whole"
    assert known["PREDICTION_MAX_TOLD"] == "fixed"


def test_wrong_slots_of_constants_are_refused(compiled):
    set_constant = accelerated.extension().set_constant
    for given_ in ((-1, 0.0), (10**6, 0.0), (0, "text"), (0,), ("text", 0.0)):
        with pytest.raises((TypeError, IndexError)):
            set_constant(*given_)


def test_it_can_be_switched_off(edited):
    program = "import os; os.environ['WALLRIDE_COMPILED'] = '0'; import wallride.runtime.kernel.__main__"
    assert edited(NEAR, "NEAR_M", "NEAR_M", program) == "the hot path runs in Python (WALLRIDE_COMPILED=0)\n"


def test_without_the_extension_python_answers_and_says_what_to_do(edited, checkout):
    kept = checkout / "drivers" / FILE
    hidden = kept.rename(checkout / "hidden")
    try:
        said = edited(NEAR, "NEAR_M", "NEAR_M")
        (checkout / "drivers" / FILE).write_bytes(b"not a library")
        broken = edited(NEAR, "NEAR_M", "NEAR_M")
    finally:
        hidden.rename(kept)
    assert said == "the hot path runs in Python (not built: wallride build-kernel)\n"
    assert "it cannot be loaded" in broken


def test_without_a_compiler_the_build_says_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setenv("CC", str(tmp_path / "no-such-compiler"))
    with pytest.raises(BuildError, match="apt install gcc python3-dev"):
        build(ROOT, tmp_path / FILE)
    assert not list(tmp_path.iterdir())


def test_without_a_compiler_that_of_the_package_index_is_taken(monkeypatch, tmp_path):
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setenv("PATH", str(tmp_path))
    if importlib.util.find_spec("ziglang") is None:
        with pytest.raises(BuildError, match="pip install ziglang"):
            build(ROOT, tmp_path / FILE)
    (tmp_path / "ziglang.py").write_text("import sys; sys.exit(f'asked for {sys.argv[1]}')")
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    with pytest.raises(BuildError, match="the C compiler failed\nasked for cc"):
        build(ROOT, tmp_path / FILE)


def test_a_compiler_that_fails_leaves_nothing_behind(monkeypatch, tmp_path):
    broken = tmp_path / "cc"
    broken.write_text("#!/bin/sh\necho Python.h: No such file >&2; exit 1\n")
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    with pytest.raises(BuildError, match="apt install python3-dev"):
        build(ROOT, tmp_path / FILE)
    assert list(tmp_path.iterdir()) == [broken]


@pytest.mark.skipif(shutil.which("gcc") is None, reason="there is no gcc here")
@pytest.mark.slow
def test_the_c_has_no_warnings(tmp_path):
    for name, text in headers().items():
        (tmp_path / name).write_text(text)
    foreign = (f"-isystem{folder}" for folder in (np.get_include(), sysconfig.get_paths()["include"]))
    files = [*(ROOT / "runtime/kernel").rglob("*.c"), ROOT / "sim/world/casting.c"]
    strict = "-fsyntax-only", "-Wall", "-Wextra", "-Wconversion", f"-I{tmp_path}", f"-I{ROOT / 'runtime/kernel'}"
    said = subprocess.run(["gcc", *strict, *foreign, *map(str, files)], capture_output=True, text=True, check=True)
    assert said.stderr == ""


def test_tests_of_an_edited_law_run_its_python_too(compiled, monkeypatch):
    fits = accelerated.Accelerated.compiled

    def edited(one):
        if one.python.__name__ == "find_near_places":
            raise accelerated.UnfitError("edited since its C was sealed")
        return fits(one)

    monkeypatch.setattr(accelerated.Accelerated, "compiled", edited)
    put_c_in_place(monkeypatch)
    assert rear_memory.find_near_places is FUNCTIONS["find_near_places"].python
    assert view.view_scan is not FUNCTIONS["view_scan"].python


def test_the_state_names_every_function_that_runs_in_python(compiled):
    assert kernel.state().in_python == dict.fromkeys(FUNCTIONS, "WALLRIDE_COMPILED=0")


def test_each_function_is_in_the_file_of_its_modules_name():
    for name in survey().functions:
        *folders, module, function = re.sub(r"^wallride\.(drivers|runtime\.control|runtime)\.", "", name).split(".")
        of_the_car = "/".join(["runtime/kernel", *folders, f"{module}.c"])
        file = ROOT / ("sim/world/casting.c" if "world" in folders else of_the_car)
        assert f"KERNEL({function})" in file.read_text()


def test_a_function_needs_a_name_of_its_own():
    def view_scan():
        return None

    with pytest.raises(ValueError, match="view_scan"):
        accelerated.accelerated(view_scan)
