"""The built-in drivers pass the conformance kit against their emulators; so do those that `wallride new` writes."""

import tempfile
from pathlib import Path

import numpy as np

from tests.drivers.conformance.emulated import Emulated
from wallride.drivers.conformance import LidarConformance, MotorConformance
from wallride.drivers.conformance.bench import room_m
from wallride.drivers.conformance.port import now_s
from wallride.drivers.hokuyo.driver import Hokuyo
from wallride.drivers.hokuyo.settings import HokuyoSettings
from wallride.drivers.rplidar.driver import Rplidar
from wallride.drivers.rplidar.settings import RplidarSettings
from wallride.drivers.vesc.app_config import RECOMMENDED_TIMEOUT_S
from wallride.drivers.vesc.codec import MOTOR_PACKETS, Packet
from wallride.drivers.vesc.driver import Vesc
from wallride.drivers.vesc.settings import VescSettings
from wallride.drivers.ydlidar.driver import Ydlidar
from wallride.drivers.ydlidar.settings import YdlidarSettings
from wallride.new import lidar_driver_test, motor_driver_test
from wallride.sim.devices import rplidar, ydlidar
from wallride.sim.devices.rplidar import RplidarDevice
from wallride.sim.devices.scip import ScipEmulator
from wallride.sim.devices.turning import TurningEmulator
from wallride.sim.devices.vesc import VescEmulator
from wallride.sim.devices.ydlidar import YdlidarDevice

_RNG = np.random.default_rng(4)


def millimetres(bearing_rad, nothing):
    """Return the room as a sensor measures it."""
    noisy_m = room_m(bearing_rad) + _RNG.normal(0.0, 0.003, bearing_rad.size)
    return np.nan_to_num(np.rint(noisy_m * 1000), nan=nothing).astype(np.int64)


class ScipBench(Emulated):
    def __init__(self):
        super().__init__(ScipEmulator(clock=now_s), Path(tempfile.mkdtemp()))
        self.due_s = 0.0

    async def start(self):
        self.port = await self.device.start_tcp()

    async def unplug(self):
        self.device.refuse()
        self.device.disconnect()

    async def replug(self):
        await self.unplug()
        self.device.listen_again()

    def driver(self):
        return Hokuyo(HokuyoSettings(address=f"tcp://127.0.0.1:{self.port}"), clock=now_s)

    def step(self, now_s):
        if now_s >= self.due_s:
            self.due_s = max(self.due_s + 0.025, now_s)
            model = self.device.sensor.model
            bearing_rad = (np.arange(model.beam_count) + model.first_step - model.front_step) * np.radians(0.25)
            self.device.publish(millimetres(bearing_rad, 65533), round(now_s * 1000) % (1 << 24))


class TurningBench(Emulated):
    def __init__(self, device, driver, settings):
        super().__init__(TurningEmulator(device, clock=now_s), Path(tempfile.mkdtemp()))
        self.address = f"serial://{self.folder / 'lidar'}"
        self.made = lambda: driver(settings(address=self.address), clock=now_s)

    async def start(self):
        self.device.start_serial(self.folder / "lidar")

    @property
    def connected(self):
        """A serial line does not tell: whether the sensor still measures does."""
        return self.device.device.streaming and self.device.connected

    def driver(self):
        return self.made()

    def step(self, now_s):
        self.device.advance(now_s, lambda rays: millimetres(rays.bearing_rad, 0))


class TestHokuyo(LidarConformance):
    def bench(self):
        return ScipBench()


class TestRplidar(LidarConformance):
    def bench(self):
        return TurningBench(RplidarDevice(rplidar.C1), Rplidar, RplidarSettings)


class TestYdlidar(LidarConformance):
    def bench(self):
        return TurningBench(YdlidarDevice(ydlidar.G4), Ydlidar, YdlidarSettings)


class VescBench(Emulated):
    has_no_timeout = False

    def __init__(self):
        folder = Path(tempfile.mkdtemp())
        super().__init__(VescEmulator(folder / "vesc", clock=now_s, timeout_s=RECOMMENDED_TIMEOUT_S), folder)
        self.wiring = VescSettings()
        self.way_m, self.stepped_s = 0.0, now_s()

    @property
    def silence(self):
        return self.device.silent

    @silence.setter
    def silence(self, on):
        self.device.silent = on

    connected = True

    async def start(self):
        self.device.start()

    def send(self, data):
        self.device.write(data)

    def driver(self):
        return Vesc(VescSettings(address=f"serial://{self.folder / 'vesc'}"), clock=now_s)

    def step(self, now_s):
        speed_mps = self.commanded[0] or 0.0
        self.way_m += speed_mps * (now_s - self.stepped_s)
        self.stepped_s = now_s
        gain = self.wiring.speed_to_erpm_gain
        self.device.report(erpm=round(speed_mps * gain), tachometer=round(self.way_m * gain / 10))

    def driven_mps(self, now_s):
        demand = self.device.demand(now_s)
        return demand.value / self.wiring.speed_to_erpm_gain if demand.kind == "speed" else None

    @property
    def commanded(self):
        wire = [payload for _, payload in self.device.wire if payload[0] in MOTOR_PACKETS]
        last = next((one for one in reversed(wire)), b"\0")
        value = int.from_bytes(last[1:5], "big", signed=True)
        speed_mps = value / self.wiring.speed_to_erpm_gain if last[0] == Packet.SET_RPM else None
        steering_rad = (self.device.servo - self.wiring.steering_to_servo_offset) / self.wiring.steering_to_servo_gain
        return speed_mps, steering_rad, len(wire)


class TestVesc(MotorConformance):
    def bench(self):
        return VescBench()


class TestWrittenLidar(lidar_driver_test.TestLidarDriver):
    """As the file that `wallride new` writes."""


class TestWrittenMotor(motor_driver_test.TestMotorDriver):
    """As the file that `wallride new` writes."""


def test_damage_is_told_by_both_protocols():
    lidar_driver_test.test_a_damaged_frame_is_none()
    motor_driver_test.test_a_damaged_line_is_none()
