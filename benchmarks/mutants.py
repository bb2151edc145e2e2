"""Breaks the rules of a stop one by one, and sees whether their tests notice: `python benchmarks/mutants.py [TARGET]`.

Every comparison, operator, number, `min`, `not` and statement in the functions of the modules below is changed once,
and the module's own tests run against the changed one, in a forked process that has everything else imported. A mutant
that no test notices survives; those that are no fault are explained in `EQUAL`. Exit code 1 when fewer than 95 % of
the others are killed.

A target takes a minute of a core, beside other work three; the number of mutants is in benchmarks/README.md.
"""

import argparse
import ast
import copy
import importlib.abc
import importlib.util
import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from importlib.machinery import ModuleSpec
from pathlib import Path
from types import ModuleType
from typing import Final

ROOT: Final = Path(__file__).resolve().parents[1]
FIRST_TIMEOUT_S: Final = 600.0
MIN_TIMEOUT_S: Final = 20.0
TIMES_LONGER: Final = 4
"""A mutant that takes so much longer than the module as it is has been noticed: it hangs."""
MIN_KILLED: Final = 0.95
ARBITRATION: Final = "tests/runtime/arbitration/"


@dataclass(frozen=True)
class Target:
    """A module, the functions of it that are changed ("" for all), and the tests that must notice."""

    module: str
    tests: Sequence[str]
    functions: Sequence[str] = ()


TARGETS: Final[Mapping[str, Target]] = {
    "queue": Target(
        "wallride.runtime.arbitration.queues", (f"{ARBITRATION}test_queues.py", f"{ARBITRATION}test_inbox.py")
    ),
    "command queue": Target("wallride.runtime.arbitration.command_queue", (f"{ARBITRATION}test_command_queue.py",)),
    "arbitration": Target("wallride.runtime.arbitration.command", (f"{ARBITRATION}test_command.py",)),
    "permit": Target("wallride.runtime.arbitration.permit", (f"{ARBITRATION}test_permit.py",)),
    "emergency stop": Target("wallride.runtime.arbitration.emergency_stop", (f"{ARBITRATION}test_emergency_stop.py",)),
    "states": Target("wallride.runtime.arbitration.driving_state", (f"{ARBITRATION}test_driving_state.py",)),
    "limiter": Target("wallride.runtime.control.limiter", ("tests/runtime/control/test_limiter.py",)),
    "battery": Target("wallride.runtime.control.battery", ("tests/runtime/control/test_battery.py",)),
    "VESC's frames": Target("wallride.drivers.vesc.calibration", ("tests/drivers/vesc/test_calibration.py",)),
    "VESC's stop": Target(
        "wallride.drivers.vesc.driver",
        ("tests/drivers/vesc/test_stop_in_time.py", "tests/drivers/vesc/test_calibration.py"),
        (
            "send",
            "braked_instead",
            "brake_now",
            "_frames",
            "_must_brake",
            "_hang_up",
            "latch_fault",
            "clear_fault",
            "_tell_condition",
        ),
    ),
    "mux": Target(
        "wallride.runtime.tasks.mux", ("tests/runtime/tasks/test_mux.py",), ("step", "_decide", "decide_now", "tick")
    ),
    "emergency manoeuvre": Target(
        "wallride.runtime.control.safety.emergency_manoeuvre",
        ("tests/runtime/control/safety/test_manoeuvre_choice.py",),
    ),
}
EQUAL: Final[Mapping[str, str]] = {
    "runtime/control/limiter.py without `return wanted_mps`": "what follows gives the same",
    "runtime/control/limiter.py `abs(wanted_mps) <= abs(last_mps)` -> `abs(wanted_mps) < abs(last_mps)`": "as above",
    "drivers/vesc/calibration.py `wanted_a < settings.brake_current_a` -> `wanted_a <= settings.brake_current_a`": (
        "the frame of the same current is the same frame"
    ),
    **{
        f"runtime/tasks/mux.py without `stages.{stage}()`": "how long the stages take is shown, and decides nothing"
        for stage in ("mux.begin", "mux.end", "write.begin", "write.end")
    },
    "runtime/tasks/mux.py `self._clock() - queue.last_put_s >= self._silent_after_s` -> "
    "`self._clock() - queue.last_put_s > self._silent_after_s`": "the same but for the last bit of a time",
    "drivers/vesc/driver.py `state.speed_mps * speed_mps < 0` -> `state.speed_mps * speed_mps <= 0`": (
        "neither is 0: one is no stop, the other above the limit"
    ),
    "drivers/vesc/driver.py `state.speed_mps * speed_mps` -> `state.speed_mps / speed_mps`": "of the same sign",
    "runtime/control/safety/emergency_manoeuvre.py `True` -> `False`": "both have always the same length",
    "runtime/arbitration/driving_state.py without `return ''`": "nothing is no missing device, too",
    "runtime/control/battery.py `0.0` -> `1.0`": "1 V is as far below every limit as 0 V",
    "runtime/control/battery.py `False` -> `True`": "what is reset already is reset again",
    "runtime/control/battery.py without `return self`": "pydantic warns, and a warning is an error in the suite",
}
"""Mutants that change nothing that a car could notice: the mutant as it is printed, and why."""

SWAPPED: Final[Mapping[type[ast.AST], type[ast.AST]]] = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.And: ast.Or, ast.Or: ast.And,
    ast.Add: ast.Sub, ast.Sub: ast.Add, ast.Mult: ast.Div, ast.Div: ast.Mult,
}  # fmt: skip
CALLED: Final = {"min": "max", "max": "min", "any": "all", "all": "any"}


@dataclass(frozen=True)
class Mutant:
    """One change: the module's changed tree, and its place and kind in words."""

    words: str
    line: int
    tree: ast.Module


def mutants(target: Target) -> Iterator[Mutant]:
    """Yield each change of a module."""
    path = ROOT / f"{target.module.replace('.', '/')}.py"
    tree = ast.parse(path.read_text(encoding="utf-8"))
    places = [(number, node) for number, node in enumerate(ast.walk(tree)) if node in _chosen(tree, target.functions)]
    for number, node in places:
        for index, (words, _) in enumerate(_changes(node)):
            changed = copy.deepcopy(tree)
            twin = next(found for at, found in enumerate(ast.walk(changed)) if at == number)
            _changes(twin)[index][1]()
            line = getattr(node, "lineno", 0)
            yield Mutant(f"{path.relative_to(ROOT / 'wallride')} {words}", line, ast.fix_missing_locations(changed))


def _chosen(tree: ast.Module, functions: Sequence[str]) -> set[ast.AST]:
    """Return the nodes inside the functions; of all functions where none is named."""
    found = (node for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef))
    return {
        node
        for function in found
        if not functions or function.name in functions
        for node in (function, *(inner for statement in function.body for inner in ast.walk(statement)))
    }


def _changes(node: ast.AST) -> list[tuple[str, Callable[[], None]]]:
    """Return the changes of one node: what it becomes, and a function that does it."""
    match node:
        case ast.Compare(ops=[op, *_]) if type(op) in SWAPPED:
            return [_swap(node, "ops", [SWAPPED[type(op)](), *node.ops[1:]])]
        case ast.BoolOp(op=op) | ast.BinOp(op=op) if type(op) in SWAPPED:
            return [_swap(node, "op", SWAPPED[type(op)]())]
        case ast.UnaryOp(op=ast.Not()):
            return [_swap(node, "operand", ast.UnaryOp(ast.Not(), node.operand))]
        case ast.Constant(value=bool(value)):
            return [_swap(node, "value", not value)]
        case ast.Constant(value=int(value) | float(value)):
            return [_swap(node, "value", value + 1)]
        case ast.Call(func=ast.Name(id=name)) if name in CALLED:
            return [_swap(node, "func", ast.Name(CALLED[name], ast.Load()))]
        case ast.If() | ast.While() | ast.For() | ast.With() | ast.Try() | ast.FunctionDef() | ast.AsyncFunctionDef():
            return _without_statements(node)
    return []


def _swap(node: ast.AST, field: str, value: object) -> tuple[str, Callable[[], None]]:
    before = ast.unparse(node)
    changed = copy.copy(node)
    setattr(changed, field, value)
    return f"`{before}` -> `{ast.unparse(ast.fix_missing_locations(changed))}`", lambda: setattr(node, field, value)


def _without_statements(node: ast.AST) -> list[tuple[str, Callable[[], None]]]:
    """Return the removal of each statement of a block that does something."""
    found: list[tuple[str, Callable[[], None]]] = []
    for field in ("body", "orelse", "finalbody"):
        block = getattr(node, field, [])
        for index, statement in enumerate(block):
            is_text = isinstance(statement, ast.Expr) and isinstance(statement.value, ast.Constant)
            if isinstance(statement, ast.Expr | ast.Assign | ast.AugAssign | ast.Return) and not is_text:
                words = f"without `{ast.unparse(statement)}`"
                found.append((words, partial(block.__setitem__, index, ast.Pass())))
    return found


class _MutantLoader(importlib.abc.MetaPathFinder, importlib.abc.Loader):
    """Imports one module from a changed tree."""

    def __init__(self, module: str, tree: ast.Module) -> None:
        self._module = module
        self._tree = tree

    def find_spec(self, name: str, _path: object, _target: object = None) -> ModuleSpec | None:
        """Claim the module."""
        if name != self._module:
            return None
        path = ROOT / f"{name.replace('.', '/')}.py"
        return importlib.util.spec_from_file_location(name, path, loader=self)

    def exec_module(self, module: ModuleType) -> None:
        """Run the changed code."""
        exec(compile(self._tree, str(module.__file__), "exec"), module.__dict__)  # noqa: S102 - that is the point


def survives(target: Target, tree: ast.Module, timeout_s: float) -> bool:
    """Run the tests of a target against a tree, in a process of its own; True when none notices."""
    child = os.fork()
    if child == 0:
        _test(target, tree)
    give_up_s = time.monotonic() + timeout_s
    while time.monotonic() < give_up_s:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            return os.waitstatus_to_exitcode(status) == 0
        time.sleep(0.01)
    os.kill(child, signal.SIGKILL)
    os.waitpid(child, 0)
    return False


def _test(target: Target, tree: ast.Module) -> None:
    """Run the tests and end this process with their verdict."""
    import hypothesis
    import pytest

    code = 1
    try:
        sys.meta_path.insert(0, _MutantLoader(target.module, tree))
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        hypothesis.settings.register_profile(
            "mutants", deadline=None, max_examples=25, database=None, derandomize=True,
            suppress_health_check=list(hypothesis.HealthCheck),
            phases=(hypothesis.Phase.explicit, hypothesis.Phase.generate),  # a mutant is killed by any example
        )  # fmt: skip
        options = [
            "--hypothesis-profile=mutants",  # after the suite's own
            "-x",
            "-q",
            "-p",
            "no:cacheprovider",
            "-p",
            "no:xdist",
            "-p",
            "no:rerunfailures",
            "-o",
            "markers=flaky",
            "-W",
            "ignore",
        ]
        code = int(pytest.main([*options, *target.tests]))
    finally:
        os._exit(code)


def main() -> int:
    """Run every target; print the survivors."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").split("\n", maxsplit=1)[0])
    parser.add_argument("targets", nargs="*", metavar="TARGET", help=f"of: {', '.join(TARGETS)} (default: all)")
    options = parser.parse_args()
    os.chdir(ROOT)
    sys.path.insert(0, str(ROOT))
    __import__("numpy"), __import__("pydantic"), __import__("hypothesis"), __import__("pytest_asyncio")
    enough = True
    for name in options.targets or TARGETS:
        target = TARGETS[name]
        path = ROOT / f"{target.module.replace('.', '/')}.py"
        began_s = time.monotonic()
        if not survives(target, ast.parse(path.read_text(encoding="utf-8")), FIRST_TIMEOUT_S):
            parser.error(f"{name}: its tests fail without any change")
        timeout_s = max(MIN_TIMEOUT_S, TIMES_LONGER * (time.monotonic() - began_s))
        found = [mutant for mutant in mutants(target) if mutant.words not in EQUAL]
        alive = [f"line {mutant.line}: {mutant.words}" for mutant in found if survives(target, mutant.tree, timeout_s)]
        killed = 1 - len(alive) / len(found)
        enough = enough and killed >= MIN_KILLED
        print(f"{name}: {len(found) - len(alive)} of {len(found)} killed, {killed:.1%}", flush=True)
        for words in alive:
            print(f"  survives  {words}", flush=True)
    return 0 if enough else 1


if __name__ == "__main__":
    raise SystemExit(main())
