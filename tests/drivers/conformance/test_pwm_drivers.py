"""The motors by servo pulses pass the conformance kit, each against its emulated board with an ESC behind it."""

import tempfile
from pathlib import Path

from tests.drivers.conformance.emulated import Emulated
from wallride.drivers.conformance import MotorConformance
from wallride.drivers.conformance.port import now_s
from wallride.drivers.maestro.driver import Maestro
from wallride.drivers.maestro.settings import MaestroSettings
from wallride.drivers.pca9685.driver import Pca9685
from wallride.drivers.pca9685.settings import Pca9685Settings
from wallride.drivers.pwm.speed import EstimatedSpeed
from wallride.sim.devices.esc import EmulatedEsc, EscModel
from wallride.sim.devices.maestro import MaestroEmulator
from wallride.sim.devices.pca9685 import Pca9685Chip

ARMING_S = 0.25
MODEL = EscModel(armed_after_s=0.15)


class PwmBench:
    """Wheels that follow at once; their speed reaches the driver as the scans' would."""

    def __init__(self):
        self.esc = EmulatedEsc(MODEL)
        self.made = None

    def made_driver(self, driver):
        self.made = driver
        return driver

    def step(self, now_s):
        self.esc.wheels_mps = self.esc.speed_mps or 0.0
        if self.made is not None:
            self.made.learn(EstimatedSpeed(now_s, self.esc.wheels_mps, 0.05))


class Pca9685Bench(PwmBench):
    has_no_timeout = True

    def __init__(self):
        super().__init__()
        self.chip = Pca9685Chip(self.esc, clock=now_s)

    @property
    def silence(self):
        return self.chip.unplugged

    @silence.setter
    def silence(self, on):
        self.chip.unplugged = on

    @property
    def connected(self):
        return self.chip.open_buses > 0

    @property
    def commanded(self):
        return self.esc.speed_mps, self.esc.steering_rad, self.esc.pulses

    async def start(self):
        self.chip.unplugged = False

    async def unplug(self):
        self.chip.unplugged = True
        self.chip.brown_out()

    replug = start
    close = unplug

    def send(self, data):
        """Nothing comes by itself on a bus whose master is the computer."""

    def driver(self):
        return self.made_driver(Pca9685(Pca9685Settings(arming_s=ARMING_S), open_bus=self.chip.open, clock=now_s))


class MaestroBench(Emulated, PwmBench):
    has_no_timeout = False

    def __init__(self):
        PwmBench.__init__(self)
        Emulated.__init__(self, MaestroEmulator(self.esc, clock=now_s), Path(tempfile.mkdtemp()))

    @property
    def commanded(self):
        return self.esc.speed_mps, self.esc.steering_rad, self.device.counts["command"]

    def driven_mps(self, now_s):
        self.device.demand(now_s)
        return self.esc.speed_mps

    async def start(self):
        self.device.start_serial(self.folder / "maestro")

    def driver(self):
        address = f"serial://{self.folder / 'maestro'}"
        return self.made_driver(Maestro(MaestroSettings(address=address, arming_s=ARMING_S), clock=now_s))


class TestPca9685(MotorConformance):
    def bench(self):
        return Pca9685Bench()


class TestMaestro(MotorConformance):
    def bench(self):
        return MaestroBench()
