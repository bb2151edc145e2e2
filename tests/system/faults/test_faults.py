"""The fault matrix holds: every injected fault in its bound, every named test exists, and the page is current."""

import ast
import os
from pathlib import Path

import pytest

from tests.system.bench import bench
from tests.system.faults import document, matrix
from tests.system.faults.injected import INJECTED, VESC_TIMEOUT_S, suffer
from tests.system.faults.matrix import MATRIX
from tests.system.socket_motor import SocketVesc
from wallride.sim.devices.vesc import VescEmulator

ROWS = {fault.key: fault for fault in MATRIX if fault.test == matrix.INJECTED}


@pytest.mark.parametrize("key", list(ROWS))
async def test_an_injected_fault_is_braked_for_within_its_bound_and_afterwards_the_car_moves_as_promised(key, tmp_path):
    fault, injected = ROWS[key], INJECTED[key]
    settings = (f"recording.folder={tmp_path / 'recordings'}", *injected.settings)
    motor, program = motor_and_program(injected.program)
    async with bench(tmp_path, *settings, timeout_s=VESC_TIMEOUT_S, motor=motor, program=program) as car:
        figure_s = await suffer(car, injected)
    if path := os.environ.get("FAULTS_MEASURED"):
        document.note(Path(path), key, figure_s)
    assert fault.bound_s is not None
    assert figure_s <= fault.bound_s


def motor_and_program(program: str) -> tuple[type[VescEmulator], str]:
    """Return controller and program; over a socket when busy: a terminal's bytes wait for a worker of the kernel."""
    if "FAULTS_BUSY" not in os.environ:
        return VescEmulator, program
    return SocketVesc, "tests.system.socket_motor" if program == "wallride" else program


def test_what_is_injected_is_what_the_matrix_names():
    assert set(ROWS) == set(INJECTED)
    assert len({fault.key for fault in MATRIX}) == len(MATRIX)


@pytest.mark.parametrize("fault", [fault for fault in MATRIX if fault.key not in ROWS], ids=lambda fault: fault.key)
def test_the_test_of_a_row_exists(fault):
    path, _, name = fault.test.partition("::")
    tree = ast.parse((document.ROOT / path).read_text(encoding="utf-8"))
    assert name in {node.name for node in ast.walk(tree) if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)}


def test_the_page_is_current_apart_from_the_figures():
    written = document.PAGE.read_text(encoding="utf-8")
    current = document.page(document.read_figures())
    assert document.without_figures(written) == document.without_figures(current), f"run  {document.COMMAND}"
    assert document.without_figures(current) != current, "it has figures"
