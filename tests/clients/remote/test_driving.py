"""Blocks in which a script drives a car: how they begin, end and fail, and that they stop the car."""

import asyncio
import concurrent.futures
import math
import time

import pytest

import wallride
from tests.clients.monitor.fake_car import FakeCar as DeskCar
from tests.clients.teleop.test_app import FakeCar
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.remote import driver
from wallride.clients.remote.driver import DriveRefusedError
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.teleop import Press

LEFT_UNSURE = Press.GOODBYE | Press.UNSURE
STALLED = r"nothing was sent for 0\.2 s; begin anew"
NOT_TAKEN = "certificate's role operator"


def at(car, script, **options):
    """Run a script with a connection to a car, beside the car's loop."""

    def run():
        with wallride.connect(at=car.bus.endpoint, **options) as remote:
            script(remote)

    return asyncio.to_thread(run)


def send_until(hand, ends, within_s):
    """Send the same drive at the usual rate until something holds, or the time is over."""
    until_s = time.monotonic() + within_s
    while time.monotonic() < until_s and not ends():
        hand.send(0.5, 0.1)
        time.sleep(0.02)


async def test_driving_releases_first_then_presses_then_says_goodbye():
    async with FakeCar() as car:

        def script(remote):
            with remote.drive(max_speed_mps=1.0) as hand:
                send_until(hand, lambda: Press.MANUAL in car.flags[:-5], 1.0)
            with pytest.raises(DriveRefusedError, match="used once"), hand:
                pass

        await at(car, script, name="ann")
        await car.heard(Press.GOODBYE)
    first = car.flags.index(Press.MANUAL)
    assert Press(0) in car.flags[:first]
    driven = [command for _, command in car.commands if command.flags == Press.MANUAL]
    assert (driven[0].speed_mps, driven[0].steering_rad) == (0.0, 0.0), "pressed with centred sticks"
    assert (driven[-1].speed_mps, driven[-1].steering_rad) == (pytest.approx(0.5), pytest.approx(0.1))
    assert all(command.beat > 0 and command.car_session == 4 for command in driven)
    assert driven[-1].name == "ann"


async def test_a_script_that_stalls_or_fails_stops_the_car_and_gives_the_place_back_without_a_release():
    async with FakeCar() as car:

        def stall(remote):
            with remote.drive() as hand:
                hand.send(0.5, 0.1)
                time.sleep(0.6)
                assert car.flags[-1] == Press.UNSURE
                with pytest.raises(DriveRefusedError, match=STALLED):
                    hand.send(0.5, 0.1)

        def fail(remote):
            with remote.drive() as hand:
                hand.send(0.5, 0.1)
                raise ZeroDivisionError

        await at(car, stall)
        await car.heard(LEFT_UNSURE)
        assert Press.GOODBYE not in car.flags
        car.commands.clear()
        with pytest.raises(ZeroDivisionError):
            await at(car, fail)
        await car.heard(LEFT_UNSURE)
        assert Press.GOODBYE not in car.flags


async def test_a_block_that_stalls_at_its_end_ends_with_the_error():
    async with FakeCar() as car:

        def script(remote):
            with remote.drive() as hand:
                hand.send(0.5, 0.1)
                until_s = time.monotonic() + 10.0
                while Press.UNSURE not in car.flags and time.monotonic() < until_s:
                    time.sleep(0.02)

        with pytest.raises(DriveRefusedError, match=STALLED):
            await at(car, script)


async def test_a_block_of_one_command_is_obeyed_and_moves_nothing():
    async with DeskCar(free_endpoint(), permit="required") as car:

        def script(remote):
            for _ in range(5):
                with remote.drive() as hand:
                    hand.send(0.5, 0.1)

        await at(car, script)
        assert {speed_mps for _, speed_mps in car.history} == {0.0}
        assert car.desk.view().accepted > 5 * 3


@pytest.mark.parametrize("sends", [1, 5])
async def test_a_block_whose_commands_the_car_did_not_take_ends_with_an_error(sends):
    async with FakeCar(obeys=False) as car:

        def drive(remote, times):
            with remote.drive() as hand:
                for _ in range(times):
                    hand.send(0.5, 0.1)
                    time.sleep(0.02)

        def script(remote):
            with pytest.raises(DriveRefusedError, match=NOT_TAKEN):
                drive(remote, sends)
            drive(remote, 0)  # asked for nothing: nothing was refused

        await at(car, script)
        await car.heard(Press.GOODBYE)


async def test_a_long_block_learns_before_its_end_that_the_car_takes_no_command():
    async with FakeCar(obeys=False) as car:

        def script(remote):
            with remote.drive() as hand:
                send_until(hand, lambda: False, 5.0)

        with pytest.raises(DriveRefusedError, match=NOT_TAKEN):
            await at(car, script)


def e_stop(remote, times=0, error=None):
    """Press the e-stop in a block that ends at once, after some commands; `error` is raised in it."""
    with remote.drive() as hand:
        for _ in range(times):
            hand.send(0.5, 0.1)
            time.sleep(0.02)
        hand.e_stop()
        if error is not None:
            raise error


@pytest.mark.parametrize("times", [0, 10])
@pytest.mark.parametrize("error", [None, ZeroDivisionError()])
async def test_an_e_stop_reaches_the_car_although_the_block_ends_at_once(times, error):
    async with FakeCar() as car:

        def script(remote):
            if error is None:
                e_stop(remote, times)
                return
            with pytest.raises(ZeroDivisionError):
                e_stop(remote, times, error)

        await at(car, script)
        assert Press.ESTOP in car.flags


async def test_an_e_stop_is_sent_although_the_connection_is_closed_at_once():
    async with FakeCar(obeys=False) as car:

        def script(remote):
            with remote.drive() as hand:
                hand.e_stop()
                remote.close()

        await at(car, script)
        await car.heard(Press.ESTOP)


async def test_an_e_stop_that_the_car_does_not_confirm_is_an_error():
    async with FakeCar(obeys=False) as car:
        with pytest.raises(DriveRefusedError, match=r"did not confirm the e-stop .*: stop it by hand"):
            await at(car, e_stop)
        assert car.flags.count(Press.ESTOP) > 10, "repeated all the while"


async def test_an_e_stop_that_is_not_confirmed_is_said_beside_another_error_of_the_block():
    def stop_and_fail(remote):
        with remote.drive() as hand:
            hand.e_stop()
            raise ValueError("mine")

    def script(remote):
        with pytest.raises(ValueError, match="mine") as caught:
            stop_and_fail(remote)
        (note,) = caught.value.__notes__
        assert "stop it by hand" in note

    async with FakeCar(obeys=False) as car:
        await at(car, script)


async def test_a_begin_that_ctrl_c_interrupts_leaves_nothing_that_drives(monkeypatch):
    real = concurrent.futures.Future.result

    def interrupted(future, timeout=None):
        monkeypatch.undo()
        with pytest.raises(TimeoutError):
            real(future, 0.3)
        raise KeyboardInterrupt

    def script(remote):
        monkeypatch.setattr(concurrent.futures.Future, "result", interrupted)
        with pytest.raises(KeyboardInterrupt):
            remote.drive().__enter__()
        assert not [task for task in asyncio.all_tasks(remote._thread._loop) if task.get_name() == "drive"]

    async with FakeCar() as car:
        car.beating = False
        await at(car, script)


async def test_a_car_without_a_heartbeat_cannot_be_driven_and_is_sent_nothing_that_it_would_log(monkeypatch):
    monkeypatch.setattr(driver, "READY_WITHIN_S", 0.3)
    async with FakeCar() as car:
        car.beating = False

        def script(remote):
            with pytest.raises(DriveRefusedError, match="no heartbeat from the car"), remote.drive():
                pass
            with pytest.raises(DriveRefusedError, match="with block"):
                remote.drive().send(1.0, 0.0)
            with pytest.raises(ConnectionProblemError, match="must be positive"):
                remote.drive(max_speed_mps=math.nan)
            with pytest.raises(ConnectionProblemError, match="positive and finite"):
                remote.plan("slam", max_steering_rad=math.inf)

        await at(car, script)
    assert car.commands == []
