"""A driver for a motor controller that speaks lines: a letter, whole numbers, and a checksum."""

import asyncio
import contextlib
import math

from wallride.drivers import own

MAX_LINE = 80


class MotorDriverSettings(own.DriverSettings):
    """Settings; they stand in the settings file below [motor.own]."""

    address: str = "serial:///dev/ttyACM0?baud=115200"
    """Address: serial:///dev/NAME?baud=RATE or tcp://127.0.0.1:PORT"""


class MotorDriver:
    """Implements what a motor's driver of one's own needs of `Motor` in wallride.drivers.api; the car does the rest."""

    Settings = MotorDriverSettings
    emulator = "wallride.new.motor_emulator:MotorDevice"  # for `wallride sim`

    def __init__(self, settings: MotorDriverSettings, clock: own.Clock) -> None:
        self.settings, self.clock = settings, clock
        self.health = own.Health()
        self.state: own.MotorState | None = None
        self.link: own.ByteLink | None = None
        self.steering_rad = 0.0
        self.buffer = b""

    async def run(self) -> None:
        """Maintain the connection; a brake is the last command of each."""
        while True:
            try:
                self.link = link = await own.open_link(own.parse_address(self.settings.address), self.clock)
                try:
                    await own.until_lost(link, self.poll(link))
                finally:
                    with contextlib.suppress(own.LinkLost):
                        link.write(line("B", self.steering_rad))
                    self.state = self.link = None
                    link.close()
            except own.LinkLost as lost:
                self.health.link, self.health.message = own.LinkState.ABSENT, str(lost)
            await asyncio.sleep(0.3)

    def send(self, drive: own.Drive) -> bool:
        """Write one command at once: a speed, or a brake."""
        if self.link is None or self.state is None:
            return False
        finite = math.isfinite(drive.speed_mps + drive.steering_rad)
        self.steering_rad = drive.steering_rad if finite else self.steering_rad
        brakes = drive.speed_mps == 0 or not finite
        try:
            self.link.write(line("B", self.steering_rad) if brakes else line("D", self.steering_rad, drive.speed_mps))
        except own.LinkLost:
            return False
        return True

    async def poll(self, link: own.ByteLink) -> None:
        """Ask for the state 50 times a second until the link is lost, or silent."""
        self.buffer, asked_s = b"", self.clock()
        link.listen(self.on_bytes)
        while self.clock() - (asked_s if self.state is None else self.state.stamp_s) < 0.5:
            link.write(line("?"))
            await asyncio.sleep(0.02)
        raise own.LinkLost(f"{link.address}: no answer (power? cable?)")

    def on_bytes(self, chunk: bytes, read_at_s: float) -> None:
        """Take reports: "S", speed [mm/s], way [mm], voltage [mV]."""
        *lines, self.buffer = (self.buffer + chunk).split(b"\n")
        self.buffer = self.buffer[-MAX_LINE:]
        for numbers in filter(None, map(read, lines)):
            if numbers[0] == "S" and len(numbers) == 4:
                speed_mps, distance_m, voltage_v = (int(number) / 1000 for number in numbers[1:])
                self.state = own.MotorState(read_at_s, speed_mps, distance_m, self.steering_rad, voltage_v)
                self.health.link, self.health.identity = own.LinkState.READY, "example motor controller"
                self.health.message = self.health.identity


def line(letter: str, *numbers: float) -> bytes:
    """Return a line: numbers in thousandths, and the sum of its bytes."""
    text = " ".join([letter, *(str(round(number * 1000)) for number in numbers)]).encode()
    return text + b" *%d\n" % (sum(text) % 251)


def read(text: bytes) -> list[str]:
    """Return letter and numbers of a line; empty for a damaged one."""
    body, _, check = text.rpartition(b" *")
    if check != b"%d" % (sum(body) % 251):
        return []
    words = body.decode("ascii", "replace").split(" ")
    return words if all(word.lstrip("-").isdecimal() for word in words[1:]) else []
