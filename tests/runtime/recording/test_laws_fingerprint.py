"""The laws' fingerprint: the same for the same source, another one for every change of what decides."""

import shutil

import pytest

from wallride.runtime.recording import laws_fingerprint as module
from wallride.runtime.recording.laws_fingerprint import PACKAGE, law_files, laws_fingerprint


@pytest.fixture
def copy(tmp_path, monkeypatch):
    """A copy of the runtime, and what computes its fingerprint anew."""
    laws_fingerprint()  # of the real one, before the package is another
    package = tmp_path / "runtime"
    shutil.copytree(PACKAGE, package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(module, "PACKAGE", package)
    return package, laws_fingerprint.__wrapped__


def test_the_same_source_has_the_same_fingerprint_wherever_it_lies(copy):
    _, compute = copy
    assert compute() == laws_fingerprint()


@pytest.mark.parametrize(
    "name", ["control/safety/swept.py", "kernel/wall_following/ball_path.c", "arbitration/command.py"]
)
def test_a_change_of_what_decides_changes_it(copy, name):
    package, compute = copy
    path = package / name
    path.write_text(path.read_text() + "\n")
    assert compute() != laws_fingerprint()


def test_what_does_not_decide_does_not_count(copy):
    package, compute = copy
    (package / "app.py").write_text("")
    (package / "control" / "__pycache__").mkdir()
    (package / "control" / "__pycache__" / "swept.pyc").write_text("")
    assert compute() == laws_fingerprint()
    assert all("__pycache__" not in path.parts for path in law_files(package))
