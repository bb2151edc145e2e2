"""`wallride sim --cars 2` as a user runs it: both drive, each under its name, and Ctrl-C ends it in order."""

import asyncio
import json
import os
import signal
import sys
from pathlib import Path

import pytest

WITHIN_S = 60.0


@pytest.mark.timeout(150)
async def test_two_cars_drive_in_one_world_and_end_together(tmp_path):
    summary = tmp_path / "summary.json"
    environment = {**os.environ, "XDG_DATA_HOME": str(tmp_path), "XDG_STATE_HOME": str(tmp_path)}
    process = await asyncio.create_subprocess_exec(
        sys.executable, "-m", "wallride", "sim", "loop", "--cars", "2", "--headless", "--duration", "300",
        "--json", str(summary), stderr=asyncio.subprocess.PIPE, env=environment,
    )  # fmt: skip
    try:
        assert process.stderr is not None
        line = ""
        async with asyncio.timeout(WITHIN_S):
            while "WALLRIDE_CONNECT=" not in line:
                line = (await process.stderr.readline()).decode()
        endpoints = line.partition("WALLRIDE_CONNECT=")[2].strip().removesuffix("\x1b[0m").split(",")
        assert len(set(endpoints)) == 2
        children = children_of(process.pid)
        assert len(children) == 2
        await asyncio.sleep(6.0)
        process.send_signal(signal.SIGINT)
        async with asyncio.timeout(30.0):
            assert await process.wait() == 0
    finally:
        if process.returncode is None:
            process.kill()
            await process.wait()
    cars = json.loads(summary.read_text())["cars"]
    assert list(cars) == ["car1", "car2"]
    assert all(car["contacts"] == 0 and car["distance_m"] > 3.0 and car["telemetry"] == "" for car in cars.values())
    assert not [pid for pid in children if Path(f"/proc/{pid}").exists()], "no runtime is left behind"


def children_of(pid):
    found = Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8")
    return [int(child) for child in found.split()]
