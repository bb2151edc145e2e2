"""Drivers of the user for tests: files with names of their own, and a process that has loaded none before."""

import itertools

import pytest

from wallride.runtime.own_drivers import driver_class

NUMBERS = itertools.count()
HEAD = """import asyncio, math, signal, threading, time
import numpy as np
from dataclasses import replace
from wallride.drivers.own import *
from wallride.drivers.own import DriverSettings, Drive

"""


@pytest.fixture
def driver_file(tmp_path, monkeypatch):
    """Return a function that writes text into a new module and returns "module:Driver". Its first line is line 7."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(driver_class, "_loaded", {})
    monkeypatch.setattr("sys.path", [*__import__("sys").path])
    monkeypatch.setattr("wallride.runtime.host.user_module._folders", [])

    def write(text):
        name = f"own_driver_{next(NUMBERS)}"
        (tmp_path / f"{name}.py").write_text(HEAD + text)
        return f"{name}:Driver"

    return write
