"""What a person does with the page: watch, take control, drive by touch."""

import asyncio
import contextlib
import time

from wallride.runtime.teleop.status import OperatorState
from wallride.runtime.wire.teleop import Command, Input, Press

SCREENS = {"desk": (1400, 900, False), "phone": (390, 844, True), "phone sideways": (844, 390, True)}


async def opened(tab, url, screen="desk", *, dark=False):
    """Open the page on one of the screens."""
    width, height, mobile = SCREENS[screen]
    await tab.call("Emulation.setTouchEmulationEnabled", enabled=mobile)
    await tab.look(width=width, height=height, mobile=mobile, dark=dark)
    await tab.go(url)


async def watching(tab, scene, screen="desk", *, dark=False):
    """Open the page and wait until it shows the car."""
    await opened(tab, scene.url, screen, dark=dark)
    await tab.until("window.wallride && wallride.timings.count > 3 && wallride.link.newest.beat.number > 0")


async def operate(car):
    """Be another operator's client, who drives by hand."""
    sequence = 0
    while True:
        sequence += 1
        held = Press.MANUAL if sequence > 5 else Press(0)
        command = Command(99, sequence, 0xCAFE, car.beat.beat, held, Input.SCRIPT, 0, 0.5, 0.0, "rival")
        car.desk.receive("", command.pack(), time.monotonic())
        await asyncio.sleep(0.02)


async def drive_by_touch(tab, car):
    """Hold the drive pad and pull it up until the car drives."""
    x, y = await tab.middle("#touch")
    for _ in range(4):
        await tab.touch("touchStart", (x, y))
        await asyncio.sleep(0.1)
        for i in range(1, 6):
            await tab.touch("touchMove", (x, y - 14 * i))
        with contextlib.suppress(AssertionError):  # the page stood still for a moment, so the car wants a release
            await car.until(lambda: drives_by_hand(car), "the touch drives the car", within_s=2)
            return
        await tab.touch("touchEnd")
        await asyncio.sleep(0.5)
    raise AssertionError(f"the touch does not drive the car; {car.desk.view()}")


async def insist(car, press, release, condition, what):
    """Hold something until it works. On a busy machine a page stands still now and then; then the car wants a release.

    Returns how long the hold that worked took.
    """
    for _ in range(6):
        await press()
        with contextlib.suppress(AssertionError):
            return await car.until(condition, what, within_s=3)
        await release()
        await asyncio.sleep(0.5)
    raise AssertionError(f"never: {what}; {car.desk.view()}")


async def stops_and_stays(car, since_s):
    """Wait until the car stands and see that it goes on to; return how long after a time it was told to."""
    await car.until(lambda: car.speed_mps == 0, "it stops", within_s=3)
    took_s = car.stopped_at_s(since_s) - since_s
    await asyncio.sleep(0.6)
    assert car.speed_mps == 0, "and stays so"
    return took_s


async def hold_pad(tab, car):
    """Hold the drive pad until this page operates the car."""
    await take_control(tab)
    await tab.touch("touchStart", await tab.middle("#touch"))
    await car.until(lambda: car.desk.view().operator == "ann@laptop", "this page operates")


def drives_by_hand(car):
    """Autonomy may drive before; what counts is the hand."""
    return car.speed_mps > 0.3 and car.desk.view().standing is OperatorState.MANUAL


async def take_control(tab):
    await tab.click("#drive")
    await tab.until("document.querySelector('#pilot-state').textContent === 'ready'")
