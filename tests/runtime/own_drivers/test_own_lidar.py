"""A lidar's driver of the user: what it may deliver, and what becomes of each of its mistakes."""

import asyncio
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from tests.own_drivers import HEAD
from tests.waiting import until
from wallride.doctor.lidar import LidarReport, judge_lidar
from wallride.drivers.api import Health, LinkState, Scan
from wallride.drivers.scan_check import ScanCheck
from wallride.runtime.arbitration.inbox import Inbox
from wallride.runtime.lidars import own_driver_mistakes
from wallride.runtime.own_drivers import driver_class
from wallride.runtime.own_drivers.lidar import OwnLidar
from wallride.runtime.own_drivers.places import GIVEN_UP_S, HangWatch, calling_place, holding_place
from wallride.runtime.own_drivers.settings import OwnLidarSettings
from wallride.runtime.parameters.catalogue import catalogue
from wallride.runtime.settings.tree import Settings, SettingsError, load_settings, to_toml
from wallride.sim.virtual.virtual_time import run_virtual

DRIVER = """class Driver:
    def __init__(self, settings, clock):
        self.clock, self.health, self.number = clock, Health(), 0

    def scan(self, **changes):
        self.number += 1
        now_s = self.clock()
        ranges_m = np.full(121, 1 + self.number % 7 / 10, np.float32)
        return replace(Scan(now_s, now_s, -1.8, 0.03, 0.1, 10.0, ranges_m, self.number), **changes)

    async def run(self, on_scan):
        self.health.link = LinkState.READY
        for _ in range(20):
            on_scan(self.scan())
            await asyncio.sleep(0.025)
        {then}
        while True:
            on_scan(self.scan())
            await asyncio.sleep(0.025)
"""
LOST = """
    async def lost(self):
        await asyncio.Event().wait()
"""
LINE = (HEAD + DRIVER).partition("{then}")[0].count("\n") + 1
"""Of `then` in the file."""
MISTAKES = {
    "raises": ("raise ValueError('lost it')", "raised ValueError: lost it"),
    "ends": ("return", "ended its run, which has no end"),
    "cancels": ("raise asyncio.CancelledError", "cancelled its own run"),
    "exits": ("raise SystemExit(3)", "raised SystemExit: 3"),
    "type": ("on_scan([1.0, 2.0])", "delivered a list where a Scan is needed"),
    "again": ("scan = self.scan(); on_scan(scan); on_scan(scan)", "repeats a scan"),
    "back": ("t = self.clock() - 0.08; on_scan(self.scan(stamp_s=t, received_s=t))", "jumped back in time by 0.055 s"),
    "future": ("on_scan(self.scan(received_s=self.clock() + 900))", "received 900 s in the future"),
    "ahead": ("on_scan(self.scan(stamp_s=self.clock() + 0.5))", "stamped a scan 0.5 s after it was received"),
    "nan": ("on_scan(self.scan(stamp_s=math.nan))", "delivered stamp_s that is no finite number"),
    "numpy": ("on_scan(self.scan(range_max_m=np.float32(9)))", "no finite number but a numpy.float32: float(...)"),
    "infinite": ("on_scan(self.scan(ranges_m=np.full(121, np.inf, np.float32)))", "a beam of inf m, farther than"),
    "zero": ("on_scan(self.scan(ranges_m=np.zeros(121, np.float32)))", "a beam of 0 m, nearer than"),
    "float64": ("on_scan(self.scan(ranges_m=np.ones(121)))", "no array (n,) of float32"),
    "circle": ("on_scan(self.scan(angle_step_rad=0.08))", "delivered a field of 550 deg"),
    "masked": ("on_scan(self.scan(ranges_m=np.ma.masked_less(np.ones(121, np.float32), 2)))",
               "delivered ranges_m as a MaskedArray: fill it with NaN"),
    "no left": ("on_scan(self.scan(ranges_m=np.ones(100, np.float32)))",
                "sees from -103 to 67 degrees, and a car needs -90 to 90"),
    "coarse": ("on_scan(self.scan(angle_step_rad=0.036, ranges_m=np.ones(101, np.float32)))",
               "has a beam every 2.1 degrees, and a car needs 2 degrees or less"),
    "blind near": ("on_scan(self.scan(range_min_m=1.0))",
                   "sees nothing nearer than 1 m, and a car needs 0.3 m or less"),
    "descends": ("on_scan(self.scan(angle_step_rad=-0.03))", "an angle_step_rad of 0 or less"),
    "field": ("on_scan(self.scan(angle_min_rad=-1.6))", "changed its field by 11 deg"),
    "number": ("on_scan(self.scan(sequence=3))", "delivered scan 3 after scan"),
    "health": ("self.health = 'fine'", "its health is a str, not a Health"),
}  # fmt: skip


def lidar(name, clock, **changes):
    return OwnLidar(OwnLidarSettings(driver=name, **changes), clock=clock)


def driven(name, duration_s=3.0, **changes):
    """Run a driver for some virtual seconds; return the scans and the conditions, each with its time."""

    async def main():
        clock = asyncio.get_running_loop().time
        one, scans, seen = lidar(name, clock, **changes), [], []
        task = asyncio.create_task(one.run(lambda scan: scans.append((clock(), scan))))
        while clock() < duration_s:
            await asyncio.sleep(0.02)
            health = one.health
            seen.append((clock(), health.link, health.message))
            if task.done():
                break
        task.cancel()
        await asyncio.wait({task})
        return scans, seen, one, task

    return run_virtual(main())


def fault_in(seen):
    """Return when a driver was faulty first, and what was said of it."""
    return next((at_s, message) for at_s, link, message in seen if link is LinkState.FAULTY)


@pytest.mark.parametrize("what", MISTAKES)
def test_a_mistake_ends_the_scans_at_once_is_told_with_its_line_and_the_driver_is_made_anew(driver_file, what):
    then, words = MISTAKES[what]
    name = driver_file(DRIVER.format(then=then))
    scans, seen, one, _ = driven(name)
    first_s, message = fault_in(seen)
    assert first_s < 0.65
    assert message.startswith(name)
    assert words in message
    stated = what in {"ends", "cancels", "health"}  # no line of theirs is at fault
    assert f"{name.partition(':')[0]}.py:{LINE}" in message or stated
    assert not [at_s for at_s, _ in scans if first_s < at_s < first_s + 0.9]
    assert [at_s for at_s, _ in scans if at_s > first_s + 0.9]
    assert one.health.counts["restart"] >= 1


def test_what_is_right_passes_unchanged_numbered_anew_and_read_only(driver_file):
    scans, seen, _, _ = driven(driver_file(DRIVER.format(then="pass")), 2.0)
    assert len(scans) > 70
    assert [scan.sequence for _, scan in scans] == list(range(len(scans)))
    assert not scans[0][1].ranges_m.flags.writeable
    assert {link for _, link, _ in seen[1:]} == {LinkState.READY}


@pytest.mark.parametrize(("period_s", "is_taken"), [(0.15, True), (0.3, False)])
def test_a_lidar_that_turns_too_slowly_is_refused_and_single_losses_are_not(driver_file, period_s, is_taken):
    then = f"for _ in range(9): on_scan(self.scan()); await asyncio.sleep({period_s})"
    _, seen, _, _ = driven(driver_file(DRIVER.format(then=then)), 2.4, degraded_after_s=1.0)
    told = [message for _, link, message in seen if link is LinkState.FAULTY]
    assert bool(told) is not is_taken
    assert is_taken or "turns at 3.3 Hz, and a car needs 5 Hz or more: set its motor faster (" in told[0]
    then = "for _ in range(20): on_scan(self.scan()); await asyncio.sleep(0.025 if _ % 5 else 0.3)"
    _, seen, _, _ = driven(driver_file(DRIVER.format(then=then)), 2.4, degraded_after_s=1.0)
    assert not [message for _, link, message in seen if link is LinkState.FAULTY]


@pytest.mark.parametrize(
    ("first_rad", "step_rad", "count"), [(0.0, 0.01745329, 360), (-3.14159, 0.0087266, 720), (-1.5708, 0.0087266, 360)]
)
def test_a_whole_turn_from_any_bearing_and_half_a_turn_one_step_short_are_fields_enough(first_rad, step_rad, count):
    ranges_m = np.ones(count, np.float32)
    assert not ScanCheck().fault(Scan(1.0, 1.0, first_rad, step_rad, 0.28, 10.0, ranges_m, 0), 1.0)


def test_a_scan_is_copied_into_plain_numbers(driver_file):
    then = "class Mine(float): pass\n        on_scan(self.scan(stamp_s=np.float64(self.clock()), range_max_m=Mine(9)))"
    scans, _, _, _ = driven(driver_file(DRIVER.format(then=then)), 1.0)
    assert 9.0 in [scan.range_max_m for _, scan in scans]
    assert {type(number) for _, scan in scans for number in (scan.stamp_s, scan.range_max_m)} == {float}


def test_a_driver_that_hangs_is_told_with_the_line_at_which_it_waits(driver_file):
    name = driver_file(DRIVER.format(then="await asyncio.Event().wait()"))
    _, seen, _, _ = driven(name)
    at_s, message = fault_in(seen)
    assert 0.9 < at_s < 1.05
    assert message.startswith(f"{name}: no scan for 0.5 s (it waits in {name.partition(':')[0]}.py:{LINE})")


def test_a_driver_that_hangs_within_until_lost_is_told_with_the_line_of_its_own_work(driver_file):
    work = "\n    async def talk(self):\n        await asyncio.Event().wait()\n"
    name = driver_file(DRIVER.format(then="await until_lost(self, self.talk())") + LOST + work)
    line = (HEAD + DRIVER + LOST + work).count("\n")
    _, seen, _, _ = driven(name)
    assert fault_in(seen)[1].startswith(f"{name}: no scan for 0.5 s (it waits in {name.partition(':')[0]}.py:{line})")


def test_old_scans_are_dropped_and_told(driver_file):
    late = "self.scan(stamp_s=self.clock() - 0.2)"
    name = driver_file(DRIVER.format(then=f"\n        while True: on_scan({late}); await asyncio.sleep(0.025)\n"))
    _, seen, _, _ = driven(name)
    assert "jumped back in time" in fault_in(seen)[1], "0.2 s back is before the scan that was delivered last"
    wait = "await asyncio.sleep(0.3)"
    name = driver_file(DRIVER.format(then=f"{wait}\n        while True: on_scan({late}); await asyncio.sleep(0.025)\n"))
    scans, seen, one, _ = driven(name)
    assert max(at_s for at_s, _ in scans) < 0.6
    assert one.health.counts["stale"] > 20
    assert "no usable scan for 0.5 s; the last came 0.20 s late" in seen[-1][2] or "no usable scan" in seen[-1][2]


def test_an_object_that_was_given_up_delivers_no_more(driver_file):
    """It swallows its cancellation and goes on beside the new one."""
    then = "on_scan(None)\n        while not OVER:\n            try: on_scan(self.scan()); await asyncio.sleep(0.025)\n"
    then += "            except asyncio.CancelledError: pass\n"
    name = driver_file("OVER = []\n" + DRIVER.format(then=then))

    async def main():
        clock = asyncio.get_running_loop().time
        one, scans = lidar(name, clock), []
        task = asyncio.create_task(one.run(scans.append))
        await asyncio.sleep(1.8)
        seen = [(len(scans), one.left_behind, one.health.message)]
        await asyncio.sleep(0.5)
        seen.append((len(scans), one.left_behind, one.health.message))
        sys.modules[name.partition(":")[0]].OVER.append(1)
        task.cancel()
        await asyncio.wait({task})
        await asyncio.sleep(0.1)  # for the one that was left behind to see that it is over
        return seen

    before, after = run_virtual(main())
    assert before == after
    assert after[1]
    assert "delivered a NoneType" in after[2]


def test_what_the_car_raises_passes_through_and_is_no_fault_of_the_driver(driver_file):
    name = driver_file(DRIVER.format(then="pass"))

    async def main():
        one = lidar(name, asyncio.get_running_loop().time)

        def fail(_scan):
            raise ZeroDivisionError

        await one.run(fail)

    with pytest.raises(ZeroDivisionError):
        run_virtual(main())


def test_a_scan_from_another_thread_is_refused(driver_file):
    then = "one = threading.Thread(target=lambda: on_scan(self.scan())); one.start(); one.join()"
    _, seen, _, _ = driven(driver_file(DRIVER.format(then=then)))
    assert "from another thread: use loop.call_soon_threadsafe" in fault_in(seen)[1]


async def test_a_driver_that_blocks_the_loop_is_told_with_its_line(driver_file):
    name = driver_file(DRIVER.format(then="time.sleep(0.6)"))
    one = lidar(name, time.monotonic)
    task = asyncio.create_task(one.run(lambda _scan: None))
    await until(lambda: one.health.link is LinkState.FAULTY)
    task.cancel()
    await asyncio.wait({task})
    assert f"{name} held the car up for 0." in one.health.message


def test_a_line_that_does_not_return_is_told_once_and_ends_the_process_at_last(caplog):
    ended = []
    watch = HangWatch(Path("x.py"), lambda: 0.0, ended.append)
    watch.end()
    for late_s, line in ((0.5, 7), (1.2, None), (1.3, 7), (5.0, 7), (0.5, 7), (1.1, 8)):
        watch._note(late_s, f"x.py:{line}" if line else "")
    assert caplog.messages == [
        "x.py:7 has held the car up for 1.3 s, and does yet", "x.py:8 has held the car up for 1.1 s, and does yet",
    ]  # fmt: skip
    watch._note(GIVEN_UP_S + 1.0, "")  # no line of the driver is at work: the computer is busy, or the car's own code
    assert len(caplog.messages) == 2
    watch._note(GIVEN_UP_S + 1.1, "x.py:8")
    assert caplog.messages[2] == "x.py:8 has held the car up for 11 s: the process ends"
    assert not ended  # the words have to be written yet
    watch._note(GIVEN_UP_S + 1.2, "x.py:8")
    assert ended == [1]


def test_a_law_that_hangs_inside_a_delivery_is_not_what_the_driver_holds_up(driver_file):
    """A scan delivered in a callback is answered inside `on_scan`, with the driver's lines below on the stack."""
    callback = "asyncio.get_running_loop().call_soon(lambda: on_scan(self.scan())); await asyncio.sleep(9)"
    name, places = driver_file(DRIVER.format(then=callback)), []

    async def main():
        one, inbox = lidar(name, asyncio.get_running_loop().time), Inbox()

        async def law():
            while True:
                await inbox.get()
                frame, file = sys._getframe(), one._run.driver.file
                places.append((calling_place(file), holding_place(frame, file)))

        tasks = [asyncio.create_task(law()), asyncio.create_task(one.run(inbox.put))]
        await asyncio.sleep(1)
        for task in tasks:
            task.cancel()
        await asyncio.wait(tasks)

    run_virtual(main())
    assert places[-1][0].endswith(f":{LINE}"), "delivered in a callback, and answered inside it"
    assert {holding for _, holding in places} == {""}


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("class Other: pass", "has no class Driver; it has Other"),
        ("class Driver: pass", "class Driver has no method run; write async def run(self, on_scan)"),
        ("class Driver:\n    def run(self, on_scan): pass", "write async def run(self, on_scan)"),
        ("class Driver:\n    async def run(self): pass", "has no method run"),
        ("class Driver:\n    async def run(self, on_scan): pass", "must be made from (settings, clock)"),
        ("import nothing_like_that", "ModuleNotFoundError"),
    ],
)
def test_a_wrong_class_is_told_before_a_port_is_opened(driver_file, text, words):
    name = driver_file(text)
    with pytest.raises(SettingsError) as told:
        load_settings(None, [f"lidar.driver={name}"], drivers=True)
    assert words in str(told.value)
    assert f"{name.partition(':')[0]}.py" in str(told.value)


def test_its_settings_are_checked_listed_and_named(driver_file):
    text = "class Own(DriverSettings):\n    gain: float = 1.5\n    '''Its gain [rad/m].'''\n"
    name = driver_file(text + DRIVER.format(then="pass").replace("class Driver:", "class Driver:\n    Settings = Own"))
    settings = load_settings(None, [f"lidar.driver={name}", "lidar.own.gain=2"], drivers=True)
    listed = catalogue(settings)
    assert listed["lidar.own.gain"].unit == "rad/m"
    assert name in listed["lidar.driver"].allowed
    assert "[lidar.own]\ngain = 2.0" in to_toml(settings)
    with pytest.raises(SettingsError, match=r"lidar\.own\.gian is not a setting; did you mean lidar.own.gain"):
        load_settings(None, [f"lidar.driver={name}", "lidar.own.gian=2"], drivers=True)
    with pytest.raises(SettingsError, match=r"lidar\.own\.gain = 'much'"):
        load_settings(None, [f"lidar.driver={name}", "lidar.own.gain=much"], drivers=True)


def test_without_the_file_settings_are_read_and_no_code_runs(driver_file):
    settings = load_settings(None, ["lidar.driver=not_there:Driver", "lidar.own.gain=2", "motor.driver=nor_there:M"])
    assert Settings.model_validate(settings.model_dump()) == settings


def test_an_installed_package_gives_a_name(driver_file, monkeypatch):
    name = driver_file(DRIVER.format(then="pass"))
    monkeypatch.setattr(driver_class, "installed", lambda section: {"acme": name} if section == "lidar" else {})
    settings = load_settings(None, ["lidar.driver=acme"], drivers=True)
    assert settings.lidar.driver == "acme"
    assert driver_class.known_driver("lidar", "acme") is not None
    with pytest.raises(SettingsError, match=r"lidar.driver = 'acne'"):
        load_settings(None, ["lidar.driver=acne"], drivers=True)


def test_a_constructor_that_raises_is_told_by_check_with_its_line(driver_file):
    name = driver_file(DRIVER.format(then="pass").replace("self.number = clock", "self.number = 1 / 0, clock"))
    settings = load_settings(None, [f"lidar.driver={name}"], drivers=True)
    assert "raised ZeroDivisionError" in own_driver_mistakes(settings.lidar, settings.motor)[0]
    assert ".py:9)" in own_driver_mistakes(settings.lidar, settings.motor)[0]


def test_a_driver_with_a_fault_is_no_other_device(driver_file):
    """Else the car would ask how the new one is mounted."""
    then = "self.health.identity = 'LD 7'; on_scan(self.scan()); await asyncio.sleep(0.1); raise ValueError"
    _, _, one, _ = driven(driver_file(DRIVER.format(then=then)), 0.8)
    assert one.health.link is LinkState.FAULTY
    assert one.health.identity == "LD 7"


@pytest.mark.parametrize("then", ["self.health.message = ''", "pass"])
def test_a_driver_without_a_message_is_told_by_its_identity(driver_file, then):
    name = driver_file(DRIVER.format(then=f"self.health.identity = 'LD 7'; {then}"))
    scans, seen, _, _ = driven(name, 1.0)
    assert seen[-1][1:] == (LinkState.READY, "LD 7")
    looked_at = LidarReport(Health(*seen[-1][1:], identity="LD 7"), [scan for _, scan in scans])
    assert judge_lidar(looked_at)[0].words == "LD 7"


def test_a_driver_that_hangs_for_long_is_made_anew(driver_file):
    scans, _, one, _ = driven(driver_file(DRIVER.format(then="await asyncio.Event().wait()")), 8.0)
    assert one.health.counts["restart"] == 1
    assert [at_s for at_s, _ in scans if 6.0 < at_s < 7.5]
