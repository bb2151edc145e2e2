"""Laws of the user for tests: files with names of their own, and a process that has loaded none before."""

import itertools

import pytest

HEAD = "import math, sys, time\nfrom wallride.laws import Guidance, Limit, LawSettings\n"
NUMBERS = itertools.count()


@pytest.fixture
def law_file(tmp_path, monkeypatch):
    """Return a function that writes a class body into a new module and returns "module:Law".

    The body's first line is line 4 of the file.
    """
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [*__import__("sys").path])
    monkeypatch.setattr("wallride.runtime.host.user_module._folders", [])

    def write(body, *, head=HEAD):
        name = f"own_law_{next(NUMBERS)}"
        lines = "".join(f"    {line}\n" for line in body.splitlines())
        (tmp_path / f"{name}.py").write_text(f"{head}class Law:\n{lines}")
        return f"{name}:Law"

    return write


INIT = "def __init__(self, settings, car): self.settings, self.scans = settings, 0\n"
STRAIGHT = INIT + "def follow(self, scan, state): return Guidance(1.0, 0.0, 1.0)\n"
EASY = INIT + "def limit(self, scan, state): return Limit()\n"


def follow(answer):
    """Return the body of a follower that answers with this expression, on line 5."""
    return f"{INIT}def follow(self, scan, state): return {answer}\n"


def limit(answer):
    """Return the body of a safety law that answers with this expression, on line 5."""
    return f"{INIT}def limit(self, scan, state): return {answer}\n"
