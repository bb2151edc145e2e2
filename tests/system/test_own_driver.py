"""A driver of the user in the whole process: it drives the emulated car, and each of its lies stops the car."""

import json
import subprocess
import sys
import time

import pytest

from tests.system.bench import bench
from tests.system.test_own_law import typed
from wallride.cli import main
from wallride.new.lidar_emulator import LidarDevice

EMULATED_HZ = LidarDevice.rate_hz
DRIVER = """import asyncio, math, time
from dataclasses import replace
import numpy as np
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.own import DriverSettings

class Own(DriverSettings):
    address: str = "tcp://127.0.0.1:1"

class Driver:
    Settings = Own

    def __init__(self, settings, clock):
        self.clock, self.count, self.kept = clock, 0, []
        self.inner = Hokuyo(HokuyoSettings(address=settings.address), clock=clock)

    @property
    def health(self):
        return self.inner.health

    async def run(self, on_scan):
        self.on_scan = on_scan
        await self.inner.run(self.take)

    def take(self, scan):
        self.count += 1
        self.kept.append(scan)
        if self.count > 80:
            {then}
        self.on_scan(scan)
"""
LIES = {
    "raises": ("raise ValueError('lost it')", "late_driver:Driver raised ValueError: lost it ("),
    "falls silent": ("return", "no scan for 0.5 s (it waits in "),
    "blocks": ("time.sleep(1.0)", "late_driver:Driver held the car up for "),
    "goes back": ("scan = replace(scan, stamp_s=scan.stamp_s - 5)", "late_driver:Driver jumped back in time by 4.9"),
}
"""One of each kind; every single one: tests/runtime/own_drivers."""


def settings(tmp_path, then):
    (tmp_path / "late_driver.py").write_text(DRIVER.format(then=then))
    return "lidar.driver=late_driver:Driver", f"process.laws_folder={tmp_path}"


@pytest.mark.parametrize("lie", LIES)
async def test_a_lie_stops_the_car_with_its_reason_and_line_and_the_process_lives(tmp_path, lie):
    then, words = LIES[lie]
    async with bench(tmp_path, *settings(tmp_path, then)) as car:
        await car.until_driving()
        await car.until(lambda: car.wheel_mps < 0.1, "standing")
        stood_s = time.monotonic()
        await car.until(lambda: any(words in text for text in car.runtime.log), f"{words!r} in the log")
        assert "late_driver.py:" in next(text for text in car.runtime.log if words in text)
        assert time.monotonic() - stood_s < 3.0
        await car.until_driving()  # it is made anew, and operator.permit is "always" here
        assert car.runtime.exit_code is None


def test_a_simulated_drive_ends_with_the_fault_of_its_driver(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(["new", "driver", "my_lidar", "--kind", "lidar"]) == 0
    file, anchor = tmp_path / "my_lidar.py", "self.sequence += 1\n"
    source = file.read_text()
    assert source.count(anchor) == 1
    then = f"                if self.sequence > 20:\n{20 * ' '}{{}}['lost']\n"
    file.write_text(source.replace(anchor, anchor + then))
    asked = ("--set", "lidar.driver=my_lidar:Driver", "--set", "telemetry.any_port=true")
    done = typed(tmp_path, "sim", "--headless", "--duration", "4", *asked)
    assert done.returncode == 1, done.stderr
    assert "wallride: my_lidar:Driver raised KeyError: 'lost' (my_lidar.py:" in done.stderr


async def test_a_scan_repeated_with_fresh_stamps_stops_the_car_after_0_3_m(tmp_path):
    then = "scan = replace(scan, ranges_m=self.kept[70].ranges_m)"
    async with bench(tmp_path, *settings(tmp_path, then)) as car:
        await car.until_driving()
        said = "the lidar repeats one scan: power-cycle it, check its cable"
        await car.until(lambda: any(said in text for text in car.runtime.log), "the sentence in the log")
        await car.until(lambda: car.wheel_mps == 0, "standing")


async def test_a_driver_that_exits_in_its_ports_callback_ends_the_process_as_an_error_with_its_line(tmp_path):
    async with bench(tmp_path, *settings(tmp_path, "raise SystemExit(0)")) as car:
        await car.until_driving()
        await car.until(lambda: car.runtime.exit_code is not None, "its exit")
        assert car.runtime.exit_code == 1
        said = "late_driver.py:30 raised SystemExit: 0 in a callback of the event loop"
        assert any(said in text for text in car.runtime.log), list(car.runtime.log)[-4:]
        await car.until(lambda: car.wheel_mps == 0, "standing after the exit")


async def test_a_line_that_never_returns_is_told_while_it_holds_the_car_up_and_ends_the_process(tmp_path):
    async with bench(tmp_path, *settings(tmp_path, "while True: pass")) as car:
        await car.until_driving()
        said = "late_driver.py:30 has held the car up for 1."
        await car.until(lambda: any(said in text for text in car.runtime.log), "the line in the log")
        await car.until(lambda: car.wheel_mps == 0, "standing")
        await car.until(lambda: car.runtime.exit_code is not None, "its end", 20.0)
        assert car.runtime.exit_code == 1
        await car.until(lambda: any("s: the process ends" in text for text in car.runtime.log), "its last words")


async def test_a_driver_that_does_not_end_does_not_keep_the_process(tmp_path):
    (tmp_path / "late_driver.py").write_text(
        "import asyncio\nfrom wallride.drivers.own import *\nclass Own(DriverSettings):\n    address: str = ''\n"
        "class Driver:\n    Settings = Own\n    def __init__(self, settings, clock): self.health = Health()\n"
        "    async def run(self, on_scan):\n        while True:\n            try: await asyncio.sleep(1)\n"
        "            except asyncio.CancelledError: pass\n"
    )
    asked = ("lidar.driver=late_driver:Driver", f"process.laws_folder={tmp_path}")
    async with bench(tmp_path, *asked) as car:
        await car.until(lambda: any("motor ready" in text for text in car.runtime.log), "ready", 20.0)
        assert await car.runtime.stop() == 0


def test_the_written_drivers_drive_the_simulator_and_pass_their_tests(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for kind in ("lidar", "motor"):
        assert main(["new", "driver", f"my_{kind}", "--kind", kind]) == 0
    assert main(["new", "driver", "my_lidar", "--kind", "lidar"]) == 2
    done = typed(
        tmp_path, "sim", "--headless", "--duration", "8", "--json", "-", "--set", "lidar.driver=my_lidar:Driver",
        "--set", "motor.driver=my_motor:Driver", "--set", "telemetry.any_port=true",
    )  # fmt: skip
    assert done.returncode == 0, done.stderr
    summary = json.loads(done.stdout)
    assert not summary["collided"]
    assert summary["distance_m"] > 5.0
    assert summary["scans_sent"] / summary["duration_s"] == pytest.approx(EMULATED_HZ, rel=0.1)
    tested = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "test_my_motor.py", "test_my_lidar.py"],
        cwd=tmp_path, capture_output=True, text=True, timeout=100, check=False,
    )  # fmt: skip
    assert tested.returncode == 0, tested.stdout
