"""What `make test` leaves out is there, and is not what stops the car."""

import subprocess
from types import SimpleNamespace

import pytest

from tests.tiers import SLOW, TESTS, pytest_ignore_collect, slow

ALWAYS = ("drivers", "runtime/arbitration", "runtime/control", "runtime/tasks", "runtime/teleop", "system/soak")


@pytest.mark.parametrize("beginning", SLOW)
def test_what_is_left_out_is_there(beginning):
    folder, _, name = beginning.rpartition("/")
    assert list((TESTS / folder).glob(f"{name}*"))


@pytest.mark.parametrize("folder", ALWAYS)
def test_what_stops_the_car_is_never_left_out(folder, pytestconfig, monkeypatch):
    monkeypatch.setattr(pytestconfig.option, "quick", True)
    assert [path for path in (TESTS / folder).rglob("*") if pytest_ignore_collect(path, pytestconfig)] == []


@pytest.mark.parametrize("quick", [False, True])
def test_what_is_slow_in_a_file_is_left_out_by_quick_alone(quick, pytestconfig, request):
    hooks = pytestconfig.pluginmanager.get_plugin(str(TESTS / "conftest.py"))
    usual, marked = (pytest.Function.from_parent(request.node.parent, name=name, callobj=lambda: None) for name in "ab")
    marked.add_marker(slow(1)[0].marks[0])
    items, left_out = [marked, usual], []
    hook = SimpleNamespace(pytest_deselected=lambda *, items: left_out.extend(items))
    config = SimpleNamespace(getoption={"--quick": quick}.get, hook=hook)
    hooks.pytest_collection_modifyitems(items, config)
    assert left_out == [marked] * quick
    assert items == [marked] * (not quick) + [usual]


def test_make_test_is_quick_and_make_test_all_is_not():
    said = {
        target: subprocess.run(["make", "-n", target], cwd=TESTS.parent, capture_output=True, text=True, check=True)
        for target in ("test", "test-all")
    }
    assert "--quick" in said["test"].stdout
    assert "pytest" in said["test-all"].stdout
    assert "--quick" not in said["test-all"].stdout
