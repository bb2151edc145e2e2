"""Puts other functions in the place of the accelerated ones, for a test: this process decided for Python at import."""

import importlib
import sys
from contextlib import suppress

from wallride.drivers.accelerated import FUNCTIONS, UnfitError, sealed


def import_laws():
    """Import every accelerated function and what calls it; UnfitError where the C is not built."""
    for name in sealed()["functions"]:
        importlib.import_module(name.rpartition(".")[0])
    importlib.import_module("wallride.runtime.control.laws")


def put_in_place(monkeypatch, answers):
    """Bind these functions, by name, wherever the Python ones are bound."""
    for path, module in list(sys.modules.items()):
        names = getattr(module, "__dict__", {}) if path.startswith(("wallride", "tests", "benchmarks")) else {}
        for name in answers.keys() & names.keys():
            if names[name] is FUNCTIONS[name].python:
                monkeypatch.setattr(module, name, answers[name])


def put_c_in_place(monkeypatch):
    """Let the laws answer in C, where it is built; what was edited since then answers in Python, as in a car."""
    answers = {}
    with suppress(UnfitError):
        import_laws()
        for name, one in FUNCTIONS.items():
            with suppress(UnfitError):
                answers[name] = one.compiled()
    put_in_place(monkeypatch, answers)
