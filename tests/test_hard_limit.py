"""A test that swallows every cancellation fails by name in bounded time."""

import os
import subprocess
import sys
from pathlib import Path

ROOT = Path(__file__).parents[1]
PLANTED = """
import asyncio

async def go_on():
    while True:
        try:
            await asyncio.sleep(3600)
        except asyncio.CancelledError:
            pass

async def test_that_never_ends():
    await asyncio.create_task(go_on())
"""


def test_a_test_that_never_ends_ends_the_process_and_is_named(tmp_path):
    hooks = "pytest_configure, pytest_runtest_setup, pytest_runtest_call, pytest_runtest_teardown"
    (tmp_path / "conftest.py").write_text(f"from tests.hard_limit import {hooks}\n")
    (tmp_path / "pytest.ini").write_text("[pytest]\nasyncio_mode = auto\ntimeout = 0.5\n")
    (tmp_path / "test_planted.py").write_text(PLANTED)
    ended = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:xdist", "-p", "no:cacheprovider", str(tmp_path)],
        capture_output=True,
        text=True,
        timeout=50,
        check=False,
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT), "WALLRIDE_TEST_GRACE_S": "0.5"},
    )
    assert ended.returncode == 1
    assert "test_planted.py::test_that_never_ends does not end" in ended.stderr
