"""The examples of docs/python.md, each as a user runs it, against the simulated car and its recording."""

import asyncio
import csv
import json
import math
import os
import re
import sys
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader

import wallride
from tests.docs.test_source_rules import ROOT
from wallride.clients.remote.values import ScanSample
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.live.runtime_process import WallrideProcess

pytestmark = pytest.mark.timeout(120)
EXAMPLES = ROOT / "docs" / "examples"
MAX_AWAY_M = 0.35
"""Pure pursuit cuts corners; the recorded drive itself keeps 0.5 m from the wall."""


@asynccontextmanager
async def simulated(folder, *assignments):
    """Yield the address of a simulated car that is there."""
    endpoint = free_endpoint()
    settings = [f'telemetry.listen=["{endpoint}"]', f"recording.folder={folder}", *assignments]
    sim = WallrideProcess(
        ["sim", "loop", "--headless", "--duration", "100", *(part for one in settings for part in ("--set", one))]
    )
    await sim.start()
    try:
        async with asyncio.timeout(30):
            while not await asyncio.to_thread(is_there, endpoint):
                await asyncio.sleep(0.2)
        yield endpoint
    finally:
        await sim.stop()


def is_there(endpoint):
    try:
        wallride.connect(at=endpoint).close()
    except wallride_problem():
        return False
    return True


def wallride_problem():
    from wallride.clients.connection import ConnectionProblemError

    return ConnectionProblemError


async def run(name, *arguments, at="", folder=None):
    process = await asyncio.create_subprocess_exec(
        sys.executable, str(EXAMPLES / name), *map(str, arguments), cwd=folder,
        env={**os.environ, "WALLRIDE_CONNECT": at, "MPLBACKEND": "agg"},
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.STDOUT,
    )  # fmt: skip
    output, _ = await process.communicate()
    assert process.returncode == 0, output.decode()
    return output.decode()


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """A recording of twelve seconds of the simulated car, and the log that was written meanwhile."""
    folder = tmp_path_factory.mktemp("drive")

    async def record():
        async with simulated(folder, "operator.permit=always") as endpoint:
            await run("log.py", 12, folder / "live.csv", at=endpoint)

    asyncio.run(record())
    file = min(Path(folder).glob("*.mcap"))  # a stop that a busy computer causes has a black box, numbered behind it
    return file, folder / "live.csv"


def rows(file):
    with file.open() as table:
        return [{name: float(value) for name, value in row.items()} for row in csv.DictReader(table)]


async def test_the_log_of_a_car_and_of_its_recording_tell_of_the_same_drive(drive, tmp_path):
    recording, live = drive
    await run("log.py", 8, tmp_path / "file.csv", recording)
    for logged in (rows(live), rows(tmp_path / "file.csv")):
        assert len(logged) > 50
        assert max(row["speed_mps"] for row in logged) > 0.8
        assert any(math.isfinite(row["distance_error_m"]) for row in logged)
    by_stamp = {row["stamp_s"]: row for row in rows(tmp_path / "file.csv")}
    shared = [(row, by_stamp[row["stamp_s"]]) for row in rows(live) if row["stamp_s"] in by_stamp]
    assert len(shared) > 20
    assert all((a["x_m"], a["y_m"]) == (b["x_m"], b["y_m"]) for a, b in shared)


async def test_the_plot_is_a_picture(drive, tmp_path):
    await run("plot.py", drive[0], tmp_path / "drive.png")
    assert (tmp_path / "drive.png").read_bytes()[:4] == b"\x89PNG"


def test_a_recording_reads_like_a_car_also_when_it_is_torn(drive, tmp_path):
    car = wallride.open_recording(drive[0])
    scans = list(car.topic("scan"))
    assert len(scans) > 300
    assert isinstance(car.latest("scan"), ScanSample)
    assert car.latest("scan").stamp_s == scans[-1].stamp_s
    assert car.parameters["operator.permit"] == "always"
    assert {"scan", "odom", "status", "decision"} <= set(car.topic_names)
    with pytest.raises(wallride_problem(), match="holds nothing on beat"):
        car.topic("beat")
    torn = tmp_path / "torn.mcap"
    torn.write_bytes(drive[0].read_bytes()[: drive[0].stat().st_size // 2])
    assert 50 < len(list(wallride.open_recording(torn).topic("scan"))) < len(scans)


@pytest.mark.parametrize("share", [0.0, 0.5])
def test_a_damaged_piece_of_a_recording_is_left_out_with_a_warning(drive, tmp_path, share):
    with drive[0].open("rb") as file:
        chunks = make_reader(file).get_summary().chunk_indexes
    middle, data = chunks[int(share * len(chunks))], bytearray(drive[0].read_bytes())
    at = middle.chunk_start_offset + middle.chunk_length // 2
    data[at : at + 8] = bytes(255 - byte for byte in data[at : at + 8])
    damaged = tmp_path / "damaged.mcap"
    damaged.write_bytes(data)
    whole = list(wallride.open_recording(drive[0]).topic("odom"))
    with pytest.warns(UserWarning, match="messages are damaged and left out"):
        left = list(wallride.open_recording(damaged).topic("odom"))
    assert whole[-1].stamp_s == left[-1].stamp_s
    assert 0 < len(left) < len(whole)


async def test_a_recording_is_read_by_async_loops_too(drive):
    async with wallride.open_recording(drive[0]) as car:
        stamps_s = [value.stamp_s async for _, value in car.topics("odom", "output")]
    assert len(stamps_s) > 100


async def test_pure_pursuit_drives_along_the_recorded_path(drive, tmp_path):
    async with simulated(tmp_path, "operator.permit=required") as endpoint:
        await run("pure_pursuit.py", drive[0], 10, at=endpoint)
        state = await asyncio.to_thread(standing, endpoint)
    assert state == "nobody"  # the wire's value for no winner: the source said goodbye
    path = places(drive[0])
    (file,) = tmp_path.glob("*.mcap")
    driven = places(file)
    assert np.hypot(*np.diff(driven, axis=0).T).sum() > 5.0, "metres"
    away_m = [np.hypot(*(path - place).T).min() for place in driven]
    assert max(away_m) < MAX_AWAY_M


async def test_an_asyncio_program_drives_by_hand_and_ends_in_order(tmp_path):
    async with simulated(tmp_path, "operator.permit=required") as endpoint:
        await run("async_drive.py", 4, at=endpoint)
        state = await asyncio.to_thread(standing, endpoint)
    assert state == "nobody"
    (file,) = tmp_path.glob("*.mcap")
    driven = places(file)
    assert np.hypot(*np.diff(driven, axis=0).T).sum() > 0.3, "metres"


def standing(endpoint):
    with wallride.connect(at=endpoint) as car:
        return car.latest("status")["operator"]["standing"]


def places(file):
    return np.array([(odom.x_m, odom.y_m) for odom in wallride.open_recording(file).topic("odom")])


async def test_the_notebook_runs_from_its_first_cell_to_its_last(tmp_path):
    cells = json.loads((ROOT / "docs" / "first-drive.ipynb").read_text(encoding="utf-8"))["cells"]
    assert all(cell.get("outputs", []) == [] for cell in cells), "kept without outputs: they age"
    code = "\n\n".join("".join(cell["source"]) for cell in cells if cell["cell_type"] == "code")
    script = tmp_path / "first_drive.py"
    script.write_text(code.replace("SECONDS_S = 10.0", "SECONDS_S = 3.0"))
    async with simulated(tmp_path, "operator.permit=always", "recording.start=always") as endpoint:
        said = await run(script, at=endpoint, folder=tmp_path)
    driven_m, *errors_cm = (float(found) for found in re.findall(r"([\d.]+) (?:m in|cm)", said))
    assert 1.0 <= driven_m < 1.2
    assert len(errors_cm) == 2, said
    assert all(0.0 <= error_cm < 60.0 for error_cm in errors_cm), said
    assert list(tmp_path.glob("drives/sim/*.mcap"))
