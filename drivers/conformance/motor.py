"""The contract of `Motor` in `drivers/api.py`, as tests against a bench.

Reversals and latched faults are not in it: the car sees to them.
"""

import asyncio
import math
import random

from wallride.drivers.api import Drive
from wallride.drivers.conformance.bench import MotorBench
from wallride.drivers.conformance.device_run import STEP_S, DeviceConformance, DeviceRun
from wallride.drivers.conformance.port import now_s

NOTICED_S = 1.5
"""Maximum time in which a silent or lost device is no longer READY."""
AT_ONCE_S = 0.1
STOPS_S = 0.5
"""Maximum time from the last command to the stop by the device itself."""
SPEED_MPS, STEERING_RAD = 1.0, 0.15


class MotorRun(DeviceRun[MotorBench]):
    """A driver that runs against a bench."""

    async def ready(self) -> None:
        """Wait until it takes commands."""
        await self.until(lambda: self.is_ready() and self.driver.state is not None, "READY with a state")

    async def moves(self) -> None:
        """Have the wheels turn."""
        await self.ready()
        end_s = now_s() + self.patience_s
        while abs((self.bench.commanded[0] or 0.0) - SPEED_MPS) > 0.05 and now_s() < end_s:
            assert self.driver.send(Drive(SPEED_MPS, STEERING_RAD)), "send() of a device that is READY"
            await self.run_for(0.03)
        speed_mps, steering_rad, _ = self.bench.commanded
        assert speed_mps is not None, "a drive is sent as a brake"
        assert abs(speed_mps - SPEED_MPS) < 0.05, f"{SPEED_MPS:g} m/s arrives as {speed_mps:g}"
        assert abs(steering_rad - STEERING_RAD) < 0.02, (
            f"{STEERING_RAD:g} rad, to the left, arrives as {steering_rad:g}"
        )


class MotorConformance(DeviceConformance[MotorBench, MotorRun]):
    """Subclass it as TestSomething, with `bench`."""

    run_class = MotorRun

    def test_it_drives_and_reports(self) -> None:
        """Speed and steering arrive with their signs; the report is the wheels'."""

        async def body(drive: MotorRun) -> None:
            await drive.moves()
            before_m = drive.driver.state.distance_m
            for _ in range(10):
                drive.driver.send(Drive(SPEED_MPS, STEERING_RAD))
                await drive.run_for(0.03)
            state = drive.driver.state
            assert abs(state.speed_mps - SPEED_MPS) < 0.1, f"{SPEED_MPS:g} m/s is reported as {state.speed_mps:g}"
            assert state.distance_m > before_m + 0.1, "distance_m does not grow with the way"
            assert abs(state.steering_rad - STEERING_RAD) < 0.02, "steering_rad is the last steering commanded"
            assert 0 <= now_s() - state.stamp_s < 0.2, "stamp_s is no time of this clock, or an old one"
            assert drive.driver.health.identity, "health.identity says which device it is"

        self.drive(body)

    def test_nothing_is_repeated(self) -> None:
        """One command is one command: only the car may renew it, or a hung car would drive on."""

        async def body(drive: MotorRun) -> None:
            await drive.moves()
            await drive.run_for(0.05)
            before = drive.bench.commanded[2]
            assert drive.driver.send(Drive(SPEED_MPS, STEERING_RAD))
            await drive.run_for(0.5)
            assert drive.bench.commanded[2] == before + 1, "a command is sent again without being asked for"

        self.drive(body)

    def test_it_stops_by_itself(self) -> None:
        """Without a command the device stops the car: a computer that hangs sends no brake."""

        async def body(drive: MotorRun) -> None:
            await drive.moves()
            end_s = now_s() + STOPS_S
            while not drive.bench.has_no_timeout and drive.bench.driven_mps(now_s()):
                assert now_s() < end_s, (
                    f"it drives on for {STOPS_S:g} s after the last command: have the emulator's feed, which is called"
                    ' with b"" all the while, brake after the timeout of the controller; where that has none, write'
                    " has_no_timeout = True into the emulator"
                )
                await drive.run_for(STEP_S)

        self.drive(body)

    def test_zero_brakes_at_once(self) -> None:
        """A speed of exactly 0 is a brake, on the wire at once."""

        async def body(drive: MotorRun) -> None:
            await drive.moves()
            assert drive.driver.send(Drive(0.0, STEERING_RAD))
            await drive.run_for(AT_ONCE_S)
            assert drive.bench.commanded[0] is None, "0 m/s is no brake"

        self.drive(body)

    def test_numbers_that_are_none_do_not_move_it(self) -> None:
        """NaN and infinity move nothing and raise nothing."""

        async def body(drive: MotorRun) -> None:
            for bad in (Drive(math.nan, 0.0), Drive(math.inf, 0.0), Drive(1.0, math.nan)):
                await drive.moves()
                drive.driver.send(bad)
                await drive.run_for(AT_ONCE_S)
                assert drive.bench.commanded[0] is None, f"{bad} moves the motor"

        self.drive(body)

    def test_it_brakes_on_every_way_out(self) -> None:
        """The last command of a cancelled driver is a brake, and the port is closed."""

        async def body(drive: MotorRun) -> None:
            await drive.moves()
            await drive.end()
            end_s = now_s() + AT_ONCE_S
            while now_s() < end_s:
                drive.bench.step(now_s())
                await asyncio.sleep(STEP_S)
            assert drive.bench.commanded[0] is None, "the last command of a connection is no brake"
            assert not drive.driver.send(Drive(SPEED_MPS, 0.0)), "send() of a closed port answers False"

        self.drive(body)

    def test_it_reconnects_for_ever_and_does_not_move_by_itself(self) -> None:
        """Unplugged it takes no command and reports nothing; plugged in again it waits for one."""

        async def body(drive: MotorRun) -> None:
            for _ in range(3):
                await drive.moves()
                await drive.bench.unplug()
                await drive.until(lambda: not drive.is_ready(), "not READY", NOTICED_S)
                assert drive.driver.state is None, "a report of a device that is not there"
                assert not drive.driver.send(Drive(SPEED_MPS, 0.0)), "a command is taken by a device that is not there"
                await drive.bench.replug()
                before = drive.bench.commanded[2]
                await drive.ready()
                await drive.run_for(0.2)
                speed_mps, _, commands = drive.bench.commanded
                assert commands == before or speed_mps is None, "it moves by itself after a reconnection"

        self.drive(body)

    def test_silence_is_noticed(self) -> None:
        """A controller that answers no more is not READY; an old report does not count."""

        async def body(drive: MotorRun) -> None:
            await drive.ready()
            drive.bench.silence = True
            await drive.until(
                lambda: not drive.is_ready() or drive.driver.state is None
                or now_s() - drive.driver.state.stamp_s > 0.5, "silence", NOTICED_S,
            )  # fmt: skip
            drive.bench.silence = False
            await drive.ready()

        self.drive(body)

    def test_noise_on_the_line_is_survived(self) -> None:
        """Random bytes end nothing and report nothing impossible."""

        async def body(drive: MotorRun) -> None:
            await drive.ready()
            noise = random.Random(5)
            for _ in range(60):
                drive.bench.send(noise.randbytes(noise.choice([1, 7, 64, 300])))
                await drive.run_for(0.01)
                if (state := drive.driver.state) is not None:
                    assert math.isfinite(state.speed_mps + state.distance_m), "a report that is no number"
            await drive.run_for(0.5)
            await drive.moves()

        self.drive(body)
