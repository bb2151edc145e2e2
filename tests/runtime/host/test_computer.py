"""The computer's temperature and throttling, from trees of files as kernels make them."""

import asyncio
import math
import resource

import pytest

from tests.waiting import until
from wallride.runtime.host.computer import HOT_C, read_computer
from wallride.runtime.tasks.computer import NO_DESCRIPTOR, ComputerWatch


class Tree:
    """A /sys of a test; "__" in a name stands for a slash."""

    def __init__(self, root):
        self.root = root

    def __call__(self, **files):
        for name, text in files.items():
            path = self.root / name.replace("__", "/")
            path.parent.mkdir(parents=True, exist_ok=True)
            path.write_text(f"{text}\n")


@pytest.fixture
def tree(tmp_path):
    return Tree(tmp_path)


def zone(tree, number, kind, milli_c, **trips):
    place = f"class__thermal__thermal_zone{number}__"
    named = {f"{place}trip_point_{index}_{what}": text for index, trip in enumerate(trips.items())
             for what, text in zip(("type", "temp"), trip, strict=True)}  # fmt: skip
    return tree(**{f"{place}type": kind, f"{place}temp": milli_c}, **named)


def test_a_computer_without_sensors_says_nothing(tmp_path):
    reading = read_computer(tmp_path)
    assert math.isnan(reading.temperature_c)
    assert reading.trouble(reading) == ""


def test_the_hottest_zone_counts_and_dead_sensors_do_not(tree):
    zone(tree, 0, "CPU-therm", 54500)
    zone(tree, 1, "PLL-therm", -256000)
    zone(tree, 2, "CV0-therm", "")
    zone(tree, 3, "tj-thermal", 61250, active=51000, passive=70000, critical=104000)
    reading = read_computer(tree.root)
    assert (reading.temperature_c, reading.zone, reading.hot_c) == (61.25, "tj-thermal", 70.0)
    zone(tree, 0, "CPU-therm", 90000)
    hot = read_computer(tree.root)
    assert (hot.zone, hot.hot_c) == ("CPU-therm", HOT_C)
    assert hot.trouble(hot) == "the computer is hot (CPU-therm): give it air, or lower its power mode"


def test_a_lowered_clock_is_named_and_a_fan_is_none(tree):
    tree(class__thermal__cooling_device0__type="pwm-fan", class__thermal__cooling_device0__cur_state=3)
    assert read_computer(tree.root).slowed == ()
    tree(class__thermal__cooling_device1__type="thermal-cpufreq-0", class__thermal__cooling_device1__cur_state=2)
    tree(class__thermal__cooling_device2__type="Processor", class__thermal__cooling_device2__cur_state=0)
    reading = read_computer(tree.root)
    assert reading.slowed == ("thermal-cpufreq-0",)
    assert "is slowed down (thermal-cpufreq-0)" in reading.trouble(reading)


@pytest.mark.parametrize(
    ("flags", "slowed", "weak"), [("50000", (), False), ("50005", ("cpu",), True), ("1", (), True)]
)
def test_a_raspberry_pis_flags_of_now_count_and_those_of_the_past_do_not(tree, flags, slowed, weak):
    (tree.root / "devices/platform/soc/soc:firmware").mkdir(parents=True)
    (tree.root / "devices/platform/soc/soc:firmware/get_throttled").write_text(flags)
    reading = read_computer(tree.root)
    assert (reading.slowed, reading.under_voltage) == (slowed, weak)


def test_a_jetsons_over_current_events_are_said_when_they_come_not_when_they_came(tree, caplog):
    watch = ComputerWatch(lambda: read_computer(tree.root))
    for count, words in ((7, ""), (7, ""), (9, "the computer draws too much current"), (9, "")):
        tree(class__hwmon__hwmon3__oc1_event_cnt=count, class__hwmon__hwmon3__oc2_event_cnt=1)
        watch.take(read_computer(tree.root))
        assert watch.trouble.startswith(words)
        assert bool(watch.trouble) is bool(words)
    assert watch.status()["over_current"] == 10
    assert [record.levelname for record in caplog.records if "current" in record.message] == ["WARNING"]


def test_without_a_descriptor_the_computer_says_nothing(tree):
    zone(tree, 0, "CPU-therm", 41000)
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (0, hard))
    try:
        read = read_computer(tree.root)
    finally:
        resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert math.isnan(read.temperature_c)


def test_used_up_descriptors_are_counted_and_named_when_they_begin(tree, caplog):
    watch = ComputerWatch(lambda: read_computer(tree.root))
    soft, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    for most in (soft, 0, 0, soft):
        resource.setrlimit(resource.RLIMIT_NOFILE, (most, hard))
        try:
            watch.look_at_descriptors()
        finally:
            resource.setrlimit(resource.RLIMIT_NOFILE, (soft, hard))
    assert watch.status()["refusing"] == 2
    assert [record.message for record in caplog.records] == [NO_DESCRIPTOR]


async def test_the_watch_reads_by_itself(tree):
    zone(tree, 0, "x86_pkg_temp", 40000)
    watch = ComputerWatch(lambda: read_computer(tree.root))
    assert math.isnan(watch.reading.temperature_c)
    watching = asyncio.create_task(watch.watch())
    await until(lambda: watch.status()["zone"] == "x86_pkg_temp")
    watching.cancel()
