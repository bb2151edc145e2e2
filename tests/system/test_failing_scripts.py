"""A script that fails in its block at a real car: the car stops at once, and the next block has the place."""

import asyncio
import time
from contextlib import suppress

import wallride
from tests.system.operated import CAR, operated
from wallride.drivers.vesc.codec import Packet

STOPS_WITHIN_S, TAKEN_WITHIN_S = 0.05, 0.5
SECOND_MPS = 0.4


def sent(scene, since_s, *, moving):
    """Return when the first motor command since a moment that does, or does not, ask for a speed was on the wire."""
    commands = scene.car.motor_commands(since_s)
    return next(at_s for at_s, payload in commands if (payload[0] == Packet.SET_RPM and any(payload[1:])) is moving)


def fails_and_begins_anew(entrance, block, speed_mps, seconds):
    """Return when the first block failed, when the second one had the place, and when that one ended.

    block: makes a block of a car. seconds: for which the first one sends; 0: it fails before its first command.
    """
    with wallride.connect(CAR, at=entrance) as car:
        with suppress(ZeroDivisionError), block(car) as hand:
            until_s = time.monotonic() + seconds
            while (failed_s := time.monotonic()) < until_s:
                hand.send(speed_mps, 0.0)
                time.sleep(0.02)
            raise ZeroDivisionError
        with block(car) as hand:
            taken_s = time.monotonic()
            while time.monotonic() < taken_s + 0.5:
                hand.send(SECOND_MPS, 0.0)
                time.sleep(0.02)
        return failed_s, taken_s, time.monotonic()


async def failed(scene, block, speed_mps=0.0, seconds=0.0):
    """Let a script fail and begin anew; return the times from its failure to the stop and to its next block [s]."""
    failed_s, taken_s, ended_s = await asyncio.to_thread(
        fails_and_begins_anew, scene.entrance, block, speed_mps, seconds
    )
    stopped_s = sent(scene, failed_s, moving=False)
    assert [at_s for at_s in scene.moves_after(stopped_s) if at_s < taken_s] == [], "it moved between the blocks"
    assert sent(scene, taken_s, moving=True) < ended_s, "the next block drives"
    return stopped_s - failed_s, taken_s - failed_s


async def test_an_exception_at_3_mps_stops_the_car_at_once_and_the_next_block_drives(tmp_path):
    async with operated(tmp_path, "operator.permit=required") as scene:
        await scene.car.until(lambda: bool(scene.status), "its status")
        failing = asyncio.create_task(failed(scene, lambda car: car.drive(max_speed_mps=3.0), 3.0, 2.5))
        await scene.car.until(lambda: scene.car.wheel_mps > 2.9, "driving at 3 m/s")
        stopped_after_s, taken_after_s = await failing
        assert stopped_after_s < STOPS_WITHIN_S
        assert taken_after_s < TAKEN_WITHIN_S


async def test_a_drive_block_that_fails_before_its_first_press_stops_a_car_that_drives_by_itself(tmp_path):
    async with operated(tmp_path) as scene:  # no permit is needed here
        await scene.car.until_driving()
        stopped_after_s, taken_after_s = await failed(scene, lambda car: car.drive())
        assert stopped_after_s < STOPS_WITHIN_S
        assert taken_after_s < TAKEN_WITHIN_S


async def test_a_plan_block_that_fails_before_its_first_plan_stops_the_car_and_gives_its_name_back(tmp_path):
    async with operated(tmp_path, "planners.enabled=true", 'planners.names=["slam"]') as scene:
        await scene.car.until_driving()
        stopped_after_s, taken_after_s = await failed(scene, lambda car: car.plan("slam"))
        assert stopped_after_s < STOPS_WITHIN_S
        assert taken_after_s < TAKEN_WITHIN_S
        await scene.car.until_driving()  # the second block's goodbye gives the car back to the follower
