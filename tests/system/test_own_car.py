"""Whoever starts a car gets that car: ports that are held or refused aloud, simulators side by side, Ctrl-C.

All of it in real processes, because the faults lay between processes: two that start at the same moment.
"""

import asyncio
import json
import os
import random
import signal
import socket
import time
from pathlib import Path

import pytest

from tests.promises import promise
from tests.runtime.recording.reading import streamed
from tests.waiting import until
from wallride.runtime.host.address_file import read_address
from wallride.runtime.wire.ports import free_endpoint
from wallride.sim.live.runtime_process import RuntimeProcess, WallrideProcess
from wallride.sim.scenario.simulated_car import saved_settings

STRAY = ("Traceback", "asyncio", "Exception ignored", "never retrieved", "Event loop is closed", "KeyboardInterrupt")


def sim(folder, name, *options, world="corridor"):
    """Return a headless simulation that writes its summary and its recordings into files of this name."""
    return WallrideProcess([
        "sim", world, "--headless", "--json", str(folder / f"{name}.json"),
        "--set", f"recording.folder={folder / name}", *options,
    ])  # fmt: skip


def wanting(endpoint):
    """Return the options with which a simulation prefers a port, as it prefers the default one."""
    return ("--set", f"telemetry.listen={endpoint}", "--set", "telemetry.any_port=true")


def summary(folder, name):
    return json.loads((folder / f"{name}.json").read_text())


def run_at(endpoint, folder, name):
    """Return a car without devices that wants this port."""
    return WallrideProcess([
        "run", "config/sim.toml", "--set", f"telemetry.listen={endpoint}", "--set", f"car.name={name}",
        "--set", "lidar.address=tcp://127.0.0.1:1", "--set", f"motor.address=serial://{folder}/no-motor",
        "--set", f"recording.folder={folder / name}", "--address-file", str(folder / f"{name}.address"),
    ])  # fmt: skip


async def settled(processes, folder, within_s=30.0):
    """Wait until each has ended or has said where it is; returns those that go on."""
    async with asyncio.timeout(within_s):
        while True:
            on = [p for p in processes if p.exit_code is None]
            told = [read_address(folder / f"{name}.address") for name in processes.values()]
            if sum(one is not None for one in told) + len(processes) - len(on) >= len(processes):
                return on
            await asyncio.sleep(0.05)


async def test_of_two_cars_that_want_one_port_one_holds_it_and_the_other_says_which(tmp_path):
    endpoint = free_endpoint()
    cars = {run_at(endpoint, tmp_path, name): name for name in ("left", "right")}
    try:
        await asyncio.gather(*(car.start() for car in cars))
        on = await settled(cars, tmp_path)
        (loser,) = set(cars) - set(on)
        assert await loser.wait() == 2
        winner = cars[on[0]]
        address = read_address(tmp_path / f"{winner}.address")
        assert address is not None
        assert loser.log[-1].startswith(
            f"wallride: {endpoint} is taken by the car {winner} (session {address.session})"
        )
        assert "--set telemetry.listen=" in loser.log[-1]
        assert not list((tmp_path / cars[loser]).glob("*.mcap")), "it recorded, so it had begun to drive"
        assert address.endpoint == endpoint
    finally:
        await asyncio.gather(*(car.end() for car in cars))


async def test_a_port_of_another_program_is_refused_too(tmp_path):
    with socket.socket() as owner:
        owner.bind(("127.0.0.1", 0))
        owner.listen()
        endpoint = f"tcp/127.0.0.1:{owner.getsockname()[1]}"
        car = sim(tmp_path, "car", "--duration", "5", "--set", f"telemetry.listen={endpoint}")
        await car.start()
        assert await car.wait() == 2
    assert car.log[-1].startswith(f"wallride: {endpoint} is taken by another program; end it first")
    assert not (tmp_path / "car.json").exists()


@pytest.mark.timeout(120)
async def test_two_simulators_started_together_each_report_their_own_car(tmp_path):
    lengths_s = {"short": 3.0, "long": 7.0}
    port = wanting(free_endpoint())
    cars = {name: sim(tmp_path, name, "--duration", str(length_s), *port) for name, length_s in lengths_s.items()}
    try:
        await asyncio.gather(*(car.start() for car in cars.values()))
        codes = await asyncio.gather(*(car.wait() for car in cars.values()))
    finally:
        await asyncio.gather(*(car.end() for car in cars.values()))
    assert codes == [0, 0], [list(car.log) for car in cars.values()]
    found = {name: summary(tmp_path, name) for name in cars}
    assert found["short"]["session"] != found["long"]["session"]
    for told in found.values():
        # The other's account would be four seconds of scans longer or shorter.
        assert abs(told["scans_sent"] - told["scans_driven"]) < 60, found
        assert told["distance_m"] > 0.3, found


@pytest.mark.timeout(120)
async def test_of_a_simulator_and_a_car_started_together_each_has_its_own_or_ends_with_2(tmp_path):
    endpoint = free_endpoint()
    simulator = sim(tmp_path, "sim", "--duration", "3", *wanting(endpoint))
    car = run_at(endpoint, tmp_path, "real")
    try:
        await asyncio.gather(simulator.start(), car.start())
        assert await simulator.wait() == 0, list(simulator.log)
        told = read_address(tmp_path / "real.address")
        if told is None:
            assert await car.wait() == 2
            assert f"taken by the car sim (session {summary(tmp_path, 'sim')['session']})" in car.log[-1]
        else:
            assert told.endpoint == endpoint
            assert told.session != summary(tmp_path, "sim")["session"]
            assert any("wallride teleop --connect tcp/127.0.0.1:" in line for line in simulator.log)
    finally:
        await asyncio.gather(simulator.end(), car.end())
    told_sim = summary(tmp_path, "sim")
    assert told_sim["distance_m"] > 0.3, told_sim


async def test_a_run_without_telemetry_says_so_in_words_and_by_its_exit_code(tmp_path):
    car = sim(tmp_path, "car", "--duration", "1", "--set", "telemetry.enabled=false")
    await car.start()
    assert await car.wait() == 1
    assert car.log[-1] == (
        "wallride: drove without telemetry: telemetry.enabled is false; winners and faults are not known"
    )
    told = summary(tmp_path, "car")
    assert told["winners"] is None
    assert told["faults"] is None, "an empty list would read as: no faults"


@pytest.mark.timeout(120)
@pytest.mark.parametrize("seed", range(2))
async def test_ctrl_c_at_any_moment_is_time_is_up(seed, tmp_path):
    await interrupted(random.Random(seed).uniform(0.0, 4.0), tmp_path)


async def interrupted(driving_s, folder):
    """Press Ctrl-C after the car has driven for so long; everything must end in order."""
    plot = folder / "plot.png"
    car = sim(folder, "car", "--duration", "60", "--plot", str(plot))
    try:
        await car.start()
        await until(lambda: any("in another terminal" in line for line in car.log), 30)
        await asyncio.sleep(driving_s)
        os.killpg(car.pid, signal.SIGINT)  # as a terminal does it
        async with asyncio.timeout(40):
            assert await car.wait() == 0, list(car.log)
    finally:
        await car.end()
    said = "\n".join(car.log)
    assert not [word for word in STRAY if word in said], said
    assert "wallride sim: corridor" in said, "no summary"
    told = summary(folder, "car")
    assert told["telemetry"] == "heard"
    assert told["duration_s"] <= driving_s + 5.0
    assert plot.read_bytes()[:4] == b"\x89PNG"
    recordings = list((folder / "car").glob("*.mcap"))  # one of the drive, and a black box of each stop
    assert recordings
    for recording in recordings:
        assert recording.read_bytes().endswith(b"\x89MCAP0\r\n"), f"{recording.name} has no end"
        assert len(streamed(recording.read_bytes())) > 10
    return told


async def test_a_second_ctrl_c_kills(tmp_path):
    car = sim(tmp_path, "car", "--duration", "60")
    try:
        await car.start()
        await until(lambda: any("in another terminal" in line for line in car.log), 30)
        os.killpg(car.pid, signal.SIGINT)
        await asyncio.sleep(0.05)
        os.killpg(car.pid, signal.SIGINT)
        asked_s = time.monotonic()
        assert await car.wait() in {130, -signal.SIGINT}, list(car.log)  # a shell says 130 for both
        promise("a second Ctrl-C", time.monotonic() - asked_s, 5.0)
    finally:
        await car.end()
    assert not [word for word in STRAY if word in "\n".join(car.log)], list(car.log)


async def test_what_is_saved_in_a_simulation_goes_to_a_file_of_the_users(tmp_path):
    tracked, own = Path("config/sim.toml").read_text(), saved_settings(Path("config/sim.toml"))
    endpoint = free_endpoint()
    car = sim(tmp_path, "car", "--duration", "60", "--set", f"telemetry.listen={endpoint}")
    try:
        await car.start()
        await until(lambda: any("in another terminal" in line for line in car.log), 30)
        said = []
        for words in (("set", "wall_follow.kp=11"), ("save",)):
            asking = WallrideProcess(["param", *words, "--connect", endpoint])
            await asking.start()
            assert await asking.wait() == 0, list(asking.log)
            said.append("\n".join(asking.log))
        assert f"saved to {own}: wall_follow.kp" in said[-1]
    finally:
        car.kill(signal.SIGINT)
        await car.wait()
        text = own.read_text()
        own.unlink()
    assert Path("config/sim.toml").read_text() == tracked
    assert [line for line in text.splitlines() if "=" in line] == ["kp = 11.0"]


async def test_the_emulated_devices_alone_serve_a_car_that_is_started_by_hand(tmp_path):
    devices = WallrideProcess(
        [
            "emulate",
            "corridor",
            "--duration",
            "60",
            "--folder",
            str(tmp_path / "ports"),
            "--port",
            "0",
            "--lidar",
            "both",
        ]
    )
    car = None
    try:
        await devices.start()
        await until(lambda: sum(line.startswith("--set ") for line in devices.log) >= 2, 30)
        lines = [line.removeprefix("--set ") for line in devices.log if line.startswith("--set ")]
        assert [line.partition("=")[0] for line in lines] == ["lidar.address", "motor.address"]
        assert (tmp_path / "ports" / "car.toml").is_file()
        for _ in range(2):  # and for the next one after it
            told = tmp_path / "address"
            settings = [*lines, f"telemetry.listen={free_endpoint()}", f"recording.folder={tmp_path}"]
            car = RuntimeProcess(Path("config/sim.toml"), settings, ["--address-file", str(told)])
            await car.start()
            await until(lambda car=car: any("lidar ready" in line for line in car.log), 40)
            assert await car.stop() == 0
            assert devices.exit_code is None
    finally:
        devices.kill(signal.SIGINT)
        if car is not None:
            await car.end()
    assert await devices.wait() == 0
    assert not [word for word in STRAY if word in "\n".join(devices.log)]
