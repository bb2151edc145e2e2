"""`wallride.connect` at cars on real sessions, and `open_recording` at files."""

import asyncio
import itertools
import math
import subprocess
import sys

import numpy as np
import pytest

import wallride
from tests.clients.speaking_car import speaking_car
from tests.clients.teleop.test_app import FakeCar
from tests.clients.test_logs import Car as CarWithRecorder
from tests.clients.test_parameters import Car as CarWithParameters
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.remote.values import OdometrySample, ScanSample
from wallride.runtime.wire.network import RefusedError
from wallride.runtime.wire.teleop import Press


def in_thread(function):
    """Run a script's code beside the car's loop."""
    return asyncio.to_thread(function)


async def test_topics_come_as_values_for_plain_loops():
    async with speaking_car() as bus:

        def script():
            with wallride.connect("car1", at=bus.endpoint) as car:
                scans = [scan for scan, _ in zip(car.topic("scan"), range(3), strict=False)]
                both = {topic for (topic, _), _ in zip(car.topics("odom", "distance_error"), range(6), strict=False)}
                return car.name, scans, both, car.latest("status")["car"]

        name, scans, both, status = await in_thread(script)
    assert (name, status) == ("car1", "car1")
    assert all(isinstance(scan, ScanSample) for scan in scans)
    assert [a.stamp_s < b.stamp_s for a, b in itertools.pairwise(scans)] == [True, True]
    assert both == {"odom", "distance_error"}


async def test_topics_come_as_values_for_async_loops():
    async with speaking_car() as bus, await in_thread(lambda: wallride.connect(at=bus.endpoint)) as car:
        got = []
        async for odom in car.topic("odom", newest=True):
            got.append(odom)
            if len(got) == 2:
                break
        assert [type(one) for one in got] == [OdometrySample, OdometrySample]


async def test_mistakes_are_clear_errors():
    async with speaking_car() as bus:

        def script():
            with wallride.connect(at=bus.endpoint) as car:
                with pytest.raises(ConnectionProblemError, match="scam is not a topic; there are scan"):
                    car.topic("scam")
                with pytest.raises(ConnectionProblemError, match=r"car1 says nothing on imu for 0\.1 s"):
                    car.latest("imu", timeout_s=0.1)
                with (
                    pytest.raises(ConnectionProblemError, match=r"does it still run\? \(wallride status\)"),
                    car.record(),
                ):
                    pass
            car.close()  # once more does no harm
            with pytest.raises(ConnectionProblemError, match="no car car9"):
                wallride.connect("car9", at=bus.endpoint)

        await in_thread(script)
    with pytest.raises(ConnectionProblemError, match=r"(?s)(?=.*does a car run here).*another place: at=;"):
        await in_thread(lambda: wallride.connect(at="tcp/127.0.0.1:9"))
    with pytest.raises(ConnectionProblemError, match=r"car=5, at=None: both are text"):
        wallride.connect(5)  # type: ignore[arg-type]  # as a script without types may


async def test_a_closed_connection_says_so_to_whoever_goes_on_with_it():
    async with FakeCar() as car:

        def script():
            remote = wallride.connect(at=car.bus.endpoint)
            odom = remote.topic("odom")
            with remote.drive() as hand:
                hand.send(0.5, 0.1)
                remote.close()
                for call in (
                    lambda: hand.send(0.5, 0.1),
                    hand.release,
                    hand.e_stop,
                    lambda: remote.topic("odom"),
                    lambda: remote.parameters["wall_follow.kp"],
                    remote.drive().__enter__,
                    remote.plan("slam").__enter__,
                    remote.record().__enter__,
                ):
                    with pytest.raises(ConnectionProblemError, match="was closed; connect again"):
                        call()
            assert list(odom) == []

        await in_thread(script)
        heard = len(car.commands)
        await asyncio.sleep(0.1)
        assert len(car.commands) == heard, "an open block ends with the connection"
        assert Press.GOODBYE not in car.flags, "as a lost operator: the car stops"


async def test_closing_in_another_thread_ends_what_waits():
    async with FakeCar() as car:
        car.beating = False  # so that the block waits for its beginning
        remote = await in_thread(lambda: wallride.connect(at=car.bus.endpoint))
        odom = remote.topic("odom")
        waiting = [
            asyncio.create_task(in_thread(wait))
            for wait in (
                remote.drive().__enter__,
                lambda: remote.parameters["wall_follow.kp"],
                lambda: [remote.latest("imu")],
                lambda: list(odom),
            )
        ]
        await asyncio.sleep(0.2)
        assert not any(task.done() for task in waiting)
        async with asyncio.timeout(2.0):
            await in_thread(remote.close)
            *errors, values = await asyncio.gather(*waiting, return_exceptions=True)
    for error in errors:
        assert isinstance(error, ConnectionProblemError)
        assert "was closed" in str(error)
    assert values == []


async def test_parameters_are_a_mapping_of_the_driving_car(tmp_path):
    async with CarWithParameters(tmp_path) as car:

        def script():
            with wallride.connect(at=car.endpoint) as remote:
                parameters = remote.parameters
                assert parameters["wall_follow.kp"] == 13.5
                parameters["wall_follow.kp"] = 2.5
                parameters.update({"wall_follow.kd": 1.5, "wall_follow.side": "right"})
                assert parameters["wall_follow.side"] == "right"
                assert parameters.describe("wall_follow.k")["wall_follow.kp"]["value"] == 2.5
                assert "safety.grip_mu" in list(parameters)
                with pytest.raises(RefusedError, match="wall_follow"):
                    parameters["wall_follow.kp"] = -1
                parameters.save()

        await in_thread(script)
        assert "kp = 2.5" in car.file.read_text()


@pytest.mark.parametrize(
    ("start", "asked", "before", "after"),
    [
        ("always", None, "always", "always"),
        ("request", None, "request", "request"),
        ("request", True, "asked for", "asked for"),
        ("always", False, "asked not to", "asked not to"),
    ],
)
async def test_after_a_recording_the_car_records_as_before(tmp_path, start, asked, before, after):
    async with CarWithRecorder(tmp_path, start=start) as car:
        car.recorder.listen()
        if asked is not None:
            car.recorder.request(on=asked)

        def script():
            with wallride.connect(at=car.endpoint) as remote:
                assert car.recorder.status()["why"] == before
                with remote.record() as state:
                    assert (state["on"], state["why"]) == (True, "asked for")
                return car.recorder.status()["why"]

        assert await in_thread(script) == after


ENDS_WITHOUT_CLOSING = """
import sys, wallride
car = wallride.connect(at=sys.argv[1])
for odom in car.topic("odom"):
    1 / 0
"""


async def test_a_script_that_ends_with_an_error_ends_with_its_own_exit_code():
    async with speaking_car() as bus:
        for _ in range(3):  # without the orderly end five of six were aborted
            process = await asyncio.create_subprocess_exec(
                sys.executable, "-c", ENDS_WITHOUT_CLOSING, bus.endpoint, stderr=asyncio.subprocess.PIPE
            )
            _, said = await process.communicate()
            assert said.decode().splitlines()[-1] == "ZeroDivisionError: division by zero"
            assert process.returncode == 1


CLOSES_AT_EXIT = """
import atexit, sys, wallride
car = wallride.connect(at=sys.argv[1])
atexit.register(car.close)
sys.exit(3)
"""


async def test_a_script_may_close_the_connection_when_the_interpreter_ends():
    async with speaking_car() as bus:
        process = await asyncio.create_subprocess_exec(
            sys.executable, "-c", CLOSES_AT_EXIT, bus.endpoint, stderr=asyncio.subprocess.PIPE
        )
        _, said = await process.communicate()
    assert said.decode() == ""
    assert process.returncode == 3


def test_the_package_imports_nothing_before_it_is_asked():
    code = (
        "import sys, wallride; print([name for name in ('zenoh', 'numpy', 'wallride.clients') if name in sys.modules])"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


@pytest.mark.parametrize("content", [b"", b"not a recording", b"\x89MCAP0\r\n"])
def test_a_file_that_holds_no_car_is_a_clear_error(tmp_path, content):
    file = tmp_path / "drive.mcap"
    file.write_bytes(content)
    with pytest.raises(ConnectionProblemError, match="holds no message of a car"):
        wallride.open_recording(file)
    with pytest.raises(ConnectionProblemError, match="cannot be read"):
        wallride.open_recording(tmp_path / "nothing.mcap")


def test_points_are_computed_in_numpy():
    scan = ScanSample(0.0, 0.0, math.pi / 2, 0.0, 10.0, np.array([1.0, 2.0, math.nan]))
    np.testing.assert_allclose(scan.points_m, [[1.0, 0.0, math.nan], [0.0, 2.0, math.nan]], atol=1e-12)


def test_the_errors_are_at_the_front_door():
    for name in wallride.__all__:
        assert callable(getattr(wallride, name))
    with pytest.raises(AttributeError, match="has no attribute 'Mistake'"):
        _ = wallride.Mistake
