"""The whole car, and what it is told that cannot be: in virtual time in a world, and on real wires."""

import math
import time
from pathlib import Path

import pytest

from tests.promises import promise
from tests.system.bench import STARTS_WITHIN_S, Bench, bench
from tests.tiers import slow
from wallride.drivers.vesc.codec import Packet
from wallride.runtime.control.perception.plausibility import BACKWARDS, TURNED
from wallride.sim.lab.stories import Story, tell
from wallride.sim.world.beams import LidarSettings
from wallride.sim.world.worlds import load_world

BRAKE_WITHIN_S = 0.25
"""0.1 s on a quiet machine; a loaded one answers later, and speed is no matter of this test."""
MAX_MORE_KB = 20_000


def swap_phases(play):
    play.motor.phases_swapped = True


@pytest.mark.parametrize(("world", "most_m"), [("loop", 0.9), ("u_turn", 1.5)])
def test_a_car_with_two_phases_swapped_stands_after_half_a_metre_and_says_what_to_do(world, most_m):
    """Once: also without an operator the phases do not swap back, and there is no retry.

    A car that turns at once, as far as its servo lets it, looks for longer like one whose lidar is askew.
    """
    story = Story(world, 5.0, lambda _: [], speed_mps=1.0, permit="always", events=((0.0, swap_phases),))
    told = tell(story)
    start = load_world(world).start
    backwards_m = [start.x_m - pose.x_m for pose in told.pose]
    assert 0.3 < max(backwards_m) < most_m
    assert told.reasons[-1] == f"motor fault: {BACKWARDS}"
    assert abs(told.speed_mps[-1]) < 0.05


@pytest.mark.parametrize(
    ("world", "yaw_deg"),
    [
        *(("dead_end", 90), ("loop", -60), ("cluttered", 180)),
        *slow(("dead_end", -60), ("dead_end", 180), ("loop", 90), ("loop", 180), ("cluttered", 90), ("cluttered", -60)),
    ],
)
def test_a_car_whose_lidar_is_turned_stands_after_half_a_metre_for_good(world, yaw_deg):
    """Also without an operator: no try brings it nearer to what it does not see."""
    turned = LidarSettings(noise_std_m=0.02).model_copy(update={"mount_yaw_rad": math.radians(yaw_deg)})
    start = load_world(world).start
    told = tell(Story(world, 5.0, lambda _: [], speed_mps=1.0, lidar=turned, permit="always", backs_out=False))
    assert told.reasons[-1] == (f"motor fault: {BACKWARDS}" if yaw_deg == 180 else TURNED)
    assert told.contact_mps is None
    if world != "dead_end" or yaw_deg != 180:  # in parallel walls, what is behind looks like what is ahead
        assert math.hypot(told.pose[-1].x_m - start.x_m, told.pose[-1].y_m - start.y_m) < 0.6


def test_a_car_whose_phases_are_right_is_not_held():
    told = tell(Story("loop", 4.0, lambda _: [], speed_mps=1.0, permit="always"))
    assert not [reason for reason in told.reasons if "fault" in reason]
    assert max(told.speed_mps) > 0.8


def memory_kb(car: Bench) -> int:
    status = Path(f"/proc/{car.runtime.pid}/status").read_text()
    return int(next(line for line in status.splitlines() if line.startswith("VmRSS")).split()[1])


@pytest.mark.parametrize("erpm", [10**6, 2**31 - 1])
async def test_an_impossible_speed_is_a_brake_no_hang_and_no_memory(tmp_path, erpm):
    async with bench(tmp_path, "safety.method=swept", "safety.backs_out=false") as car:
        await car.until_driving()
        before_kb = memory_kb(car)
        begun_s = time.monotonic()
        car.vesc.shown_erpm = erpm
        await car.until(lambda: time.monotonic() >= begun_s + 0.3, "0.3 s of it")
        car.vesc.shown_erpm = None
        took_s = car.first_brake_s(begun_s) - begun_s
        await car.until_driving()
        assert memory_kb(car) - before_kb < MAX_MORE_KB
        promise("braking for an impossible speed", took_s, BRAKE_WITHIN_S)


@pytest.mark.parametrize(
    ("trouble", "words"),
    [("backwards", "runs backwards: swap two phases"), ("counter_stopped", "speed and distance counter disagree")],
)
async def test_a_controller_that_contradicts_itself_is_held_with_the_remedy_in_the_log(tmp_path, trouble, words):
    async with bench(tmp_path) as car:
        setattr(car.vesc, trouble, True)
        await car.until(lambda: any(words in line for line in car.runtime.log), "the fault is said", STARTS_WITHIN_S)
        await car.until(lambda: car.motor_commands()[-1][1][0] == Packet.SET_CURRENT_BRAKE, "braking")
