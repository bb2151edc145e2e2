"""The conformance kit catches what it is for: drivers with one flaw each fail the test that is about it."""

import asyncio
import contextlib
import math
from dataclasses import replace
from unittest import mock

import numpy as np
import pytest

from wallride.drivers.conformance import EmulatorBench, LidarConformance, MotorConformance
from wallride.new import lidar_emulator, motor_driver, motor_emulator
from wallride.new.lidar_driver import LidarDriver
from wallride.new.motor_driver import MotorDriver, line


class Changed(LidarDriver):
    """Passes every scan on through `change`."""

    def change(self, scan):
        return scan

    async def run(self, on_scan):
        await super().run(lambda scan: on_scan(self.change(scan)))


class Mirrored(Changed):
    def change(self, scan):
        return replace(scan, ranges_m=scan.ranges_m[::-1])


class Millimetres(Changed):
    def change(self, scan):
        return replace(scan, ranges_m=scan.ranges_m * 1000, range_max_m=200.0)


class Infinite(Changed):
    def change(self, scan):
        return replace(scan, ranges_m=np.nan_to_num(scan.ranges_m, nan=np.inf))


class Arrival(Changed):
    """Stamps what waited with its arrival."""

    def change(self, scan):
        self.sequence += 1
        return replace(scan, stamp_s=scan.received_s + self.sequence * 1e-7)


class Gives(LidarDriver):
    """Gives up after the first loss."""

    async def run(self, on_scan):
        link_state = self.health
        task = asyncio.ensure_future(super().run(on_scan))
        while not (task.done() or (self.sequence and link_state.link == "absent")):
            await asyncio.sleep(0.01)
        task.cancel()
        await asyncio.Event().wait()


class Repeats(LidarDriver):
    """Repeats its last scan every 50 ms."""

    async def run(self, on_scan):
        last = []

        async def again():
            while True:
                await asyncio.sleep(0.05)
                if last:
                    now_s = self.clock()
                    self.sequence += 1000
                    on_scan(replace(last[-1], stamp_s=now_s, received_s=now_s, sequence=self.sequence))

        def take(scan):
            last.append(scan)
            self.sequence = max(self.sequence, scan.sequence)
            on_scan(scan)

        await asyncio.gather(super().run(take), again())


class Swallows(LidarDriver):
    """Swallows whatever comes: a cancellation, an error of the car."""

    async def run(self, on_scan):
        def quiet(scan):
            with contextlib.suppress(Exception):
                on_scan(scan)

        while True:
            with contextlib.suppress(asyncio.CancelledError):
                await super().run(quiet)
            await asyncio.sleep(0.2)
            if getattr(self, "over", False):
                return


def fails(test, kit, bench):
    """Run one test of the kit against a bench; it must fail."""
    one = type("Kit", (kit,), {"bench": lambda _self: bench()})()
    with pytest.raises((AssertionError, ValueError, TimeoutError)):
        getattr(one, test)()


@pytest.mark.parametrize(
    ("flawed", "test"),
    [
        (Mirrored, "test_it_shows_the_room_the_right_way_round"),
        (Millimetres, "test_it_shows_the_room_the_right_way_round"),
        (Infinite, "test_it_shows_the_room_the_right_way_round"),
        (Arrival, "test_what_waited_is_as_old_as_its_measurement"),
        (Gives, "test_it_reconnects_for_ever"),
        (Repeats, "test_silence_is_noticed_and_nothing_is_repeated"),
        (Swallows, "test_an_error_of_the_car_is_not_swallowed"),
    ],
)
def test_a_flaw_of_a_lidars_driver_is_caught(flawed, test):
    made = []

    class Noted(flawed):  # type: ignore[valid-type]
        def __init__(self, settings, clock):
            super().__init__(settings, clock)
            made.append(self)

    try:
        fails(test, LidarConformance, lambda: EmulatorBench(Noted, lidar_emulator.LidarDevice()))
    finally:
        for one in made:
            one.over = True


class Renews(MotorDriver):
    """Sends the last command again and again."""

    async def poll(self, link):
        async def again():
            while True:
                await asyncio.sleep(0.1)
                link.write(line("D", 0.1, 1.0))

        await asyncio.gather(super().poll(link), again())


class Coasts(MotorDriver):
    """Lets a stop roll out."""

    def send(self, drive):
        return True if drive.speed_mps == 0 else super().send(drive)


class Leaves(MotorDriver):
    """Leaves without a brake."""

    async def run(self):
        with mock.patch.object(
            motor_driver, "line", lambda letter, *numbers: b"" if letter == "B" else line(letter, *numbers)
        ):
            await super().run()


class Backwards(MotorDriver):
    def send(self, drive):
        return super().send(replace(drive, steering_rad=-drive.steering_rad))


class Trusts(MotorDriver):
    """Takes a number that is none for 1 m/s."""

    def send(self, drive):
        return super().send(drive if math.isfinite(drive.speed_mps) else replace(drive, speed_mps=1.0))


class Remembers(MotorDriver):
    """Shows its last report after the loss."""

    @property
    def state(self):
        return self.kept

    @state.setter
    def state(self, state):
        self.kept = state or getattr(self, "kept", None)


@pytest.mark.parametrize(
    ("flawed", "test"),
    [
        (Renews, "test_nothing_is_repeated"),
        (Coasts, "test_zero_brakes_at_once"),
        (Leaves, "test_it_brakes_on_every_way_out"),
        (Backwards, "test_it_drives_and_reports"),
        (Trusts, "test_numbers_that_are_none_do_not_move_it"),
        (Remembers, "test_it_reconnects_for_ever_and_does_not_move_by_itself"),
    ],
)
def test_a_flaw_of_a_motors_driver_is_caught(flawed, test):
    fails(test, MotorConformance, lambda: EmulatorBench(flawed, motor_emulator.MotorDevice()))


class Endless(motor_emulator.MotorDevice):
    """Has no command timeout."""

    def feed(self, data, now_s):
        self._commanded_s = now_s
        return super().feed(data, now_s)


class Admitted(Endless):
    has_no_timeout = True


@pytest.mark.parametrize("emulator", [Endless, Admitted])
def test_a_controller_without_a_timeout_is_caught_unless_it_says_so(emulator):
    one = type("Kit", (MotorConformance,), {"bench": lambda _self: EmulatorBench(MotorDriver, emulator())})()
    admitted = emulator is Admitted
    with contextlib.nullcontext() if admitted else pytest.raises(AssertionError, match="write has_no_timeout = True"):
        one.test_it_stops_by_itself()
