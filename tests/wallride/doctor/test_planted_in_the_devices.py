"""Problems planted in emulated devices, which the doctor opens: each is found, and the remedy is named."""

import asyncio
import threading
import time
from collections import deque
from functools import partial
from pathlib import Path

import pytest

from tests.sim.live.emulated import car, running
from tests.wallride.doctor.fakes import changed, healthy, link, settings
from wallride.doctor.examine import examine
from wallride.doctor.findings import Level
from wallride.doctor.lidar import judge_lidar, look_at_lidar
from wallride.doctor.wheels_up import _asked, measure_wheels_up
from wallride.sim.world.beams import LidarSettings

DEVICES = ("ports", "lidar", "motor", "access", "joystick", "computer")


async def looked_at(tmp_path, one, plant=None, groups=DEVICES, **answers):
    """Return the doctor's findings on an emulated car; plant: changes it after its start."""
    computer = changed(healthy(tmp_path / "root"), devices=Path("/"))
    async with running(one) as addresses:
        if plant is not None:
            plant(one)
        chosen = settings(f"lidar.address={addresses.lidar}", f"motor.address={addresses.motor}")
        return [finding async for finding in examine(computer, chosen, groups, **answers)]


def bad(found):
    return {one.subject: one for one in found if one.level is not Level.OK}


async def test_a_healthy_emulated_car_is_all_ok(tmp_path):
    found = await looked_at(tmp_path, car(tmp_path / "ports"))
    assert bad(found) == {}
    assert {"lidar", "lidar window", "motor", "battery", "motor timeout", "timeout brake", "servo output"} <= {
        one.subject for one in found
    }


async def test_a_healthy_lidar_on_a_serial_port_is_all_ok(tmp_path):
    found = await looked_at(tmp_path, car(tmp_path / "ports", tcp_port=None), groups=("ports", "lidar"))
    assert bad(found) == {}
    assert "UST-10LX" in next(one.words for one in found if one.subject == "lidar")


def says(text):
    def plant(one):
        one.lidars[0].sensor.state_text = text

    return plant


def silent_lidar(one):
    one.lidars[0].silence = True


def refusing_lidar(one):
    one.lidars[0].refuse()


def broken_lidar(one):
    one.lidars[0].sensor.fault, one.lidars[0].sensor.cured_by = "0L", frozenset()


def late_line(one):
    one.lidars[0].late_s = 0.3


def damaged_line(one):
    one.lidars[0].bad_checksum_every = 5


@pytest.mark.parametrize(
    ("plant", "subject", "level", "remedy"),
    [
        (silent_lidar, "lidar", Level.FAIL, "check its power"),
        (refusing_lidar, "lidar", Level.FAIL, "serves only one"),
        (broken_lidar, "lidar", Level.FAIL, "switch"),
        (late_line, "lidar", Level.FAIL, "what is slow"),
        (says("Trouble!! Error No.11"), "lidar", Level.WARN, "switch it off and on"),
        (damaged_line, "lidar line", Level.WARN, "check the cable"),
    ],
)
async def test_a_problem_of_the_lidar(plant, subject, level, remedy, tmp_path):
    found = bad(await looked_at(tmp_path, car(tmp_path / "ports"), plant, groups=("lidar",)))
    assert (found[subject].level, remedy in found[subject].remedy) == (level, True), found
    assert set(found) == {subject}


@pytest.mark.parametrize(
    ("lidar", "remedy"),
    [
        (LidarSettings(dropout_share=0.95), "wipe the window"),
        (LidarSettings(dirty_sectors=((-135.0, 135.0, 0.08),)), "uncover"),
    ],
)
async def test_a_covered_window(lidar, remedy, tmp_path):
    found = bad(await looked_at(tmp_path, car(tmp_path / "ports", lidar=lidar), groups=("lidar",)))
    assert set(found) == {"lidar window"}
    assert remedy in found["lidar window"].remedy


async def test_the_lidar_is_left_quiet_for_the_next_program(tmp_path):
    one = car(tmp_path / "ports")
    async with running(one) as addresses:
        lidar = settings(f"lidar.address={addresses.lidar}").lidar
        for _ in range(2):
            assert judge_lidar(await look_at_lidar(lidar))[0].level is Level.OK
            assert not one.lidars[0].sensor.laser_on


def vesc(**changes):
    def plant(one):
        for name, value in changes.items():
            setattr(one.vesc, name, value)

    return plant


def config(**changes):
    def plant(one):
        for name, value in changes.items():
            setattr(one.vesc.config, name, value)

    return plant


def faulty(one):
    one.vesc.inject_fault(1, fault_stop_s=60.0)


def with_voltage(voltage_v):
    def plant(one):
        one.vesc.report = partial(one.vesc.report, voltage_v=voltage_v)

    return plant


@pytest.mark.parametrize(
    ("plant", "subject", "level", "remedy"),
    [
        (vesc(silent=True), "motor", Level.FAIL, "switch the VESC's battery on"),
        (vesc(garbage=True), "motor", Level.FAIL, "another device has the same USB id"),
        (vesc(hardware_kind=1), "motor", Level.FAIL, "not another module"),
        (vesc(firmware=(3, 40)), "motor firmware", Level.WARN, "update it with VESC Tool"),
        (vesc(firmware=(2, 18)), "motor firmware", Level.WARN, "update it with VESC Tool"),
        (faulty, "motor fault", Level.FAIL, "lower the brake current"),
        (vesc(kill_switch=True), "kill switch", Level.FAIL, "release"),
        (vesc(bad_crc=True), "motor", Level.FAIL, "another device has the same USB id"),
        (with_voltage(5.1), "battery", Level.FAIL, "connect the battery"),
        (with_voltage(9.3), "battery", Level.FAIL, "charge"),
        (with_voltage(10.0), "battery", Level.WARN, "charge"),
        (config(servo_output=False), "servo output", Level.FAIL, "Enable Servo Output"),
        (config(application=4), "VESC app", Level.FAIL, "APP to use"),
        (vesc(firmware=(6, 1)), "motor timeout", Level.WARN, "Timeout 150 ms"),
    ],
)
async def test_a_problem_of_the_motor(plant, subject, level, remedy, tmp_path):
    found = bad(await looked_at(tmp_path, car(tmp_path / "ports"), plant, groups=("motor",)))
    assert (found[subject].level, remedy in found[subject].remedy) == (level, True), found


@pytest.mark.parametrize(
    ("changes", "subject", "words"),
    [
        ({"timeout_s": 1.0}, "motor timeout", "5.0 m under power"),
        ({"timeout_s": 0.0}, "motor timeout", "keeps its speed"),
        ({"brake_a": 0.0}, "timeout brake", "rolls on"),
    ],
)
async def test_what_the_vesc_does_when_this_computer_hangs(changes, subject, words, tmp_path):
    found = bad(await looked_at(tmp_path, car(tmp_path / "ports", **changes), groups=("motor",)))
    assert set(found) == {subject}
    assert found[subject].level is Level.FAIL
    assert words in found[subject].words
    assert "Timeout 150 ms, Timeout Brake Current 10 A" in found[subject].remedy


async def test_without_wheels_up_no_command_moves_the_motor(tmp_path):
    one = car(tmp_path / "ports")
    await looked_at(tmp_path, one, groups=("motor",))
    assert {payload[0] for payload in one.vesc.motor_wire()} <= {7}, "a brake is the only motor command"
    assert one.vesc.servo == 0.5, "and the servo is not moved"


def patient(addresses):
    """Return settings whose link outlasts the pauses of a busy computer."""
    return settings(f"motor.address={addresses.motor}", "motor.lost_after_s=0.6")


async def wheels_up(tmp_path, plant=None, ask=lambda _question: True, **changes):
    one = car(tmp_path / "ports", **changes)
    async with running(one) as addresses:
        if plant is not None:
            plant(one)
        return await measure_wheels_up(patient(addresses).motor, ask)


async def test_wheels_up_measures_a_healthy_car(tmp_path):
    found = await wheels_up(tmp_path, timeout_s=0.1)
    assert bad(found) == {}
    assert [one.subject for one in found] == [
        "direction", "timeout measured", "timeout brake measured", "brake", "steering",
    ]  # fmt: skip


def test_a_person_who_thinks_does_not_cost_the_link(tmp_path, monkeypatch):
    """In real time, which alone goes on while a person thinks."""
    monkeypatch.setattr("wallride.doctor.wheels_up.SPIN_UP_S", 0.8)
    monkeypatch.setattr("wallride.doctor.wheels_up.STEER_S", 0.1)

    def think(_question):
        time.sleep(1.2)  # longer than a link may be silent
        return True

    async def measured():
        one = car(tmp_path / "ports", timeout_s=0.1)
        async with running(one) as addresses:
            found = await measure_wheels_up(patient(addresses).motor, think)
            return found, [payload for _, payload in one.vesc.wire if payload[0] == 0]

    found, asked = asyncio.run(measured())
    assert bad(found) == {}
    assert len(asked) == 1, "one connection"


@pytest.mark.parametrize(
    ("plant", "ask", "changes", "subject", "remedy"),
    [
        (None, True, {"timeout_s": 1.0}, "timeout measured", "Timeout 150 ms"),
        (None, True, {"timeout_s": 0.0}, "timeout measured", "Timeout 150 ms"),
        (None, True, {"brake_a": 0.0}, "timeout brake measured", "Timeout Brake Current 10 A"),
        (vesc(backwards=True), True, {}, "direction", "invert the motor direction"),
        (vesc(phases_swapped=True), "steer", {}, "direction", "invert the motor direction in VESC Tool"),
        (vesc(kill_switch=True), True, {}, "direction", "motor detection"),
        (None, "turn", {}, "steering", "Enable the servo output"),
    ],
)
async def test_wheels_up_finds_what_only_motion_shows(plant, ask, changes, subject, remedy, tmp_path):
    answers = (lambda question: ask in question) if isinstance(ask, str) else (lambda _question: ask)
    found = bad(await wheels_up(tmp_path, plant, answers, **changes))
    assert found[subject].level is Level.FAIL, found
    assert remedy.lower() in found[subject].remedy.lower()


async def test_wheels_up_leaves_the_car_standing(tmp_path):
    one = car(tmp_path / "ports")
    async with running(one) as addresses:
        await measure_wheels_up(patient(addresses).motor, lambda _question: None)
        assert one.vesc.motor_wire()[-1][0] == 7, "its last command is a brake"


async def test_the_devices_of_a_running_car_are_left_alone(tmp_path):
    one, root = car(tmp_path / "ports"), tmp_path / "root"
    link(root, "run/systemd/units/invocation:wallride.service", "1234abcd")
    found = await looked_at(tmp_path, one)
    assert {name: "systemctl stop wallride" in each.remedy for name, each in bad(found).items()} == {"devices": True}
    assert one.vesc.wire == deque(), "nothing was sent to the motor controller"
    assert one.lidars[0].counts["client"] == 0


def test_ctrl_c_at_a_question_does_not_wait_for_the_answer():
    answered = threading.Event()
    give_up = threading.Timer(10.0, answered.set)
    give_up.start()

    async def interrupted():
        asking = asyncio.create_task(_asked(lambda _question: answered.wait(), "did the wheels turn forward?"))
        await asyncio.sleep(0.01)
        asking.cancel()
        await asyncio.wait([asking])

    asyncio.run(interrupted())
    assert not answered.is_set()
    answered.set()
    give_up.cancel()
