"""The compiled functions are found, built, used and left: when the Python is no longer what they were made for."""

import shutil

import numpy as np
import pytest

from drivers import twin
from runtime import kernel
from runtime.control.perception import view
from runtime.control.safety import moving_obstacles
from runtime.control.wall_following import followed_wall, wall_fit


def test_compiled_functions_are_called_without_a_step_in_between(compiled, as_it_was):
    before = followed_wall.find_followed_wall
    twin.use(compiled)
    assert followed_wall.find_followed_wall is compiled["find_followed_wall"]
    twin.use({"view_scan": compiled["view_scan"]})
    assert followed_wall.find_followed_wall is before
    assert view.view_scan is compiled["view_scan"]


def test_wrong_arguments_are_refused_and_crash_nothing(compiled):
    wrong = (
        (),
        (None,),
        (1, 2, 3),
        ("text",) * 9,
        (np.zeros(3),) * 12,
        (np.zeros((2, 2)),) * 11,
        (np.zeros(0, int),) * 7,
    )
    for function in compiled.values():
        for given_ in wrong:
            with pytest.raises((TypeError, ValueError, OverflowError, IndexError)):
                function(*given_)


def test_arrays_of_different_lengths_are_refused(compiled):
    short, long_m, flags = np.zeros(3), np.zeros(9), np.zeros(9, np.bool_)
    with pytest.raises(ValueError, match="different lengths"):
        compiled["solid_places"](short, long_m, flags)
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


def test_the_twins_were_written_for_the_python_that_is_here():
    stale = [
        module.__name__ for module in kernel.MODULES if kernel.fingerprint(module) != kernel._sealed()[module.__name__]
    ]
    assert not stale, "after the twins do the same and these tests pass: python -m runtime.kernel"


def test_every_function_that_may_have_a_twin_has_one(compiled):
    assert set(compiled) == set(twin.PLAIN)


def test_who_changes_a_law_drives_his_own(compiled, monkeypatch, as_it_was):
    fingerprint = kernel.fingerprint
    monkeypatch.setattr(kernel, "fingerprint", lambda module: "" if module is moving_obstacles else fingerprint(module))
    found = kernel.use()
    assert found.functions == set(compiled) - {"find_small_clusters"}
    assert "runtime.control.safety.moving_obstacles changed" in found.words


def test_who_changes_what_a_law_calls_drives_it_as_well(compiled, monkeypatch, as_it_was):
    fingerprint = kernel.fingerprint
    monkeypatch.setattr(kernel, "fingerprint", lambda module: "" if module is wall_fit else fingerprint(module))
    for _ in range(2):  # the second time, what it calls is compiled
        left = set(compiled) - kernel.use().functions
        assert {"fit_wall_line", "find_followed_wall", "roll_ball"} <= left
        assert left.isdisjoint({"drive_along_ball", "view_scan", "sweep_arc", "decode_samples"})


def test_constants_come_from_the_python():
    known = dict(kernel.constants())
    assert known["VIEW_DIRT_NEARER_THAN_M"] == view.DIRT_NEARER_THAN_M
    assert known["WALL_FIT_GATES_M_2"] == 0.06
    assert known["PREDICTION_STEP_S"] == 0.015


def test_without_a_compiler_python_answers_and_says_so(monkeypatch, tmp_path, as_it_was):
    monkeypatch.setenv("CC", str(tmp_path / "no-such-compiler"))
    found = kernel.use()
    assert not found.functions
    assert "apt install" in found.words


def test_the_numpy_that_runs_is_the_one_it_is_built_for(monkeypatch, as_it_was):
    """Debian's Python has an older numpy's headers among its own: what is built with those cannot be loaded."""
    asked = []
    monkeypatch.setattr(kernel, "built", lambda *sources, folders, extra: asked.append(folders))
    assert not kernel.use().functions
    assert asked[0][0] == np.get_include()


def test_what_cannot_be_loaded_is_named(monkeypatch, tmp_path, as_it_was):
    wrong = tmp_path / "kernel.so"
    wrong.write_bytes(b"not a library")
    monkeypatch.setattr(kernel, "built", lambda *sources, folders, extra: wrong)
    found = kernel.use()
    assert not found.functions
    assert str(wrong) in found.words


def test_it_can_be_switched_off(monkeypatch, as_it_was):
    monkeypatch.setenv(kernel.SWITCH, "0")
    assert not kernel.use().functions
    assert not twin.in_use()


def test_a_twin_needs_a_name_of_its_own():
    def view_scan():
        return None

    with pytest.raises(ValueError, match="view_scan"):
        twin.twin(view_scan)


@pytest.mark.skipif(shutil.which("cc") is None, reason="there is no C compiler here")
def test_it_is_built_once(monkeypatch, tmp_path, compiled, as_it_was):
    monkeypatch.setenv("CACHE_DIRECTORY", str(tmp_path))
    assert kernel.use().functions
    built = list((tmp_path / "wallride").iterdir())
    assert len(built) == 1
    at = built[0].stat().st_mtime_ns
    assert kernel.use().functions
    assert built[0].stat().st_mtime_ns == at
