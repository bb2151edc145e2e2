"""The operator drives, is lost in every way, comes back late; and the car does what is safe each time.

WALLRIDE_REPEATS=50 repeats each loss so often, and the figures are printed with pytest -s.
"""

import asyncio
import os
import signal
import statistics
import sys
import time

import pytest

from tests.system.bench import BLOCKED_MM
from tests.system.operated import operated

REPEATS = int(os.environ.get("WALLRIDE_REPEATS", "2"))
WITHIN_S = 0.25
AWAY_S = 3.0
"""How long the link, or the operator's process, stands still; what it says meanwhile comes late and in one burst."""
BACK_S = 1.0
"""How long a car is watched after the link is back."""


async def kill(scene, operator):
    operator.kill(signal.SIGKILL)


async def freeze(scene, operator):
    operator.kill(signal.SIGSTOP)


async def thaw(scene, operator):
    operator.kill(signal.SIGCONT)


async def cut(scene, operator):
    scene.radio.stall()


async def mend(scene, operator):
    scene.radio.recover()


async def nothing(scene, operator):
    pass


@pytest.mark.timeout(60 + 15 * REPEATS)
@pytest.mark.parametrize(
    ("lose", "bring_back", "permit"),
    [(kill, nothing, "always"), (freeze, thaw, "required"), (cut, mend, "always")],
)
async def test_a_lost_operator_stops_the_car_and_nobody_else_goes_on(tmp_path, lose, bring_back, permit):
    took_s, said_s = [], []
    async with operated(tmp_path, f"operator.permit={permit}") as scene:
        for number in range(REPEATS):
            operator = await scene.drive_by_hand(name=f"ann{number}")
            await lose(scene, operator)
            last_s = scene.radio.last_command_s
            brake_s = await scene.brake_after(last_s)
            took_s.append(brake_s - last_s)
            await scene.car.until(lambda: scene.standing() == "operator lost", "the car says so", 2.0)
            said_s.append(time.monotonic() - last_s)
            await asyncio.sleep(AWAY_S - WITHIN_S)
            await bring_back(scene, operator)
            await asyncio.sleep(BACK_S)
            assert not scene.moves_after(brake_s), "nothing moves until the operator acts"
            operator.kill()
            await operator.wait()
            scene.radio.recover()
    report(f"{lose.__name__}, permit {permit}: braking", took_s)
    report(f"{lose.__name__}, permit {permit}: the car says so", said_s)
    assert max(took_s) <= WITHIN_S


def report(what, times_s):
    """Show the figures with `pytest -s`."""
    sys.stdout.write(
        f"\n{what}: {len(times_s)} times, median {statistics.median(times_s):.3f} s, worst {max(times_s):.3f} s"
    )


async def test_a_release_stops_the_car_at_once(tmp_path):
    took_s = []
    async with operated(tmp_path, "operator.permit=required") as scene:
        for number in range(REPEATS):
            operator = await scene.operator(
                "0,,0,0", "0.1,manual,0,0", "0.2,manual,1,0", "1.5,,0,0", "2.5,,0,0", leaves=True
            )
            await scene.car.until(lambda: scene.car.wheel_mps > 1.9, "driving by hand", 20.0)
            driven_s = time.monotonic()
            brake_s = await scene.brake_after(driven_s, 5.0)
            took_s.append(brake_s - max(at_s for at_s in scene.moves_after(driven_s - 1.0) if at_s < brake_s))
            assert await operator.wait() == 0
            assert not scene.moves_after(brake_s), f"run {number}"
    report("released: after the last command to move", took_s)
    assert max(took_s) < 0.05


async def test_where_no_permit_is_needed_autonomy_goes_on_after_a_release(tmp_path):
    async with operated(tmp_path, "operator.permit=always", "wall_follow.speed_mps=0.5") as scene:
        await scene.operator("0,,0,0", "0.1,manual,0,0", "0.2,manual,1,0", "1.5,,0,0", "3.5,,0,0", leaves=True)
        await scene.car.until(lambda: scene.car.wheel_mps > 1.9, "driving by hand", 20.0)
        await scene.car.until(lambda: 0.4 < scene.car.wheel_mps < 0.6, "autonomy drives on", 10.0)


@pytest.mark.parametrize("bound", [False, True])
async def test_the_human_overrides_navigation_and_safety_unless_safety_binds_him(tmp_path, bound):
    async with operated(tmp_path, "operator.permit=always", f"safety.binds_teleop={str(bound).lower()}") as scene:
        await scene.car.until_driving()
        scene.car.scan_mm = BLOCKED_MM
        await scene.car.until(lambda: scene.car.wheel_mps < 0.05, "safety stops navigation")
        await scene.operator("0,,0,0", "0.1,manual,0,0", "0.2,manual,1,0")
        await scene.car.until(lambda: scene.standing() == "manual", "the human drives", 20.0)
        if bound:
            await asyncio.sleep(1.0)
            assert scene.car.wheel_mps < 0.05
        else:
            await scene.car.until(lambda: scene.car.wheel_mps > 1.9, "the human overrides", 5.0)


async def test_of_two_operators_one_drives_and_the_other_is_told_who(tmp_path):
    async with operated(tmp_path, "operator.permit=required") as scene:
        await scene.drive_by_hand(name="ann")
        bob = await scene.operator("0,,0,0", "0.1,manual,0,0", "0.2,manual,-1,0", name="bob")
        await scene.car.until(lambda: any("ann" in line for line in bob.log), "bob is told who drives", 20.0)
        await asyncio.sleep(0.5)
        assert scene.car.wheel_mps > 1.8
        assert scene.status["operator"]["operator"] == "ann"
        taking = await scene.operator(
            "0,,0,0", "0.2,take_over,0,0", "2,,0,0", "2.2,manual,0,0", "2.4,manual,0.5,0", name="cat"
        )
        await scene.car.until(lambda: scene.status["operator"]["operator"] == "cat", "cat takes over", 20.0)
        await scene.brake_after(time.monotonic() - 0.5)
        await scene.car.until(lambda: 0.9 < scene.car.wheel_mps < 1.1, "cat drives", 20.0)
        assert taking.exit_code is None


async def test_an_e_stop_holds_until_it_is_reset_on_purpose(tmp_path):
    async with operated(tmp_path, "operator.permit=always") as scene:
        await scene.car.until_driving()
        pressed = await scene.operator("0,,0,0", "0.2,estop,0,0", "0.5,,0,0", "1,,0,0", leaves=True)
        await scene.car.until(lambda: scene.standing() == "e-stop", "e-stop", 20.0)
        assert await pressed.wait() == 0
        stopped_s = await scene.brake_after(0.0)
        await asyncio.sleep(1.0)
        assert not scene.moves_after(time.monotonic() - 0.9)
        assert scene.car.first_brake_s(stopped_s) < float("inf")
        await scene.operator("0,,0,0", "0.3,reset,0,0", "2,,0,0", "2.3,autonomy,0,0")
        await scene.car.until(lambda: scene.car.wheel_mps > 0.9, "autonomy drives again", 20.0)
