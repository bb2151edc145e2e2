"""The rehearsal goes the whole way and leaves no trace."""

import asyncio
import itertools
import logging
import math

import numpy as np
import pytest

from drivers.api import Drive, Scan
from runtime.app import Car
from runtime.rehearsal import FIRST_S, GIVE_UP_S, MARGIN_S, Rehearsal
from runtime.settings import Settings
from sim.twins import BEAMS, MemoryBus, MemoryLidar, MemoryMotor
from sim.virtual_time import run_virtual

SETTINGS = Settings.model_validate({"operator": {"permit": "always"}, "recording": {"enabled": False}})

SCAN = (Scan(0.0, 0.0, -2.35, 0.00436, 0.02, 30.0, np.full(BEAMS, 2.0, np.float32), 0), None)


def corridor(now_s):
    """A wall 1 m to the left that comes and goes a little, nothing ahead."""
    bearing_rad = np.radians(0.25) * (np.arange(BEAMS) - BEAMS // 2)
    side_m = 1.0 + 0.1 * np.sin(3 * now_s)
    with np.errstate(divide="ignore"):
        return np.where(np.abs(np.sin(bearing_rad)) > 0.1, side_m / np.abs(np.sin(bearing_rad)), 9.0).astype(np.float32)


class Drill:
    """A car that drives for a second; with rehearsals or without."""

    def __init__(self, *, decode=lambda: None, rehearse=True):
        self.sent = []
        self.decoded_s = []
        self.scanned_s = []

        async def main():
            loop = asyncio.get_running_loop()
            self.motor = MemoryMotor(loop.time)
            lidar = MemoryLidar(self._scan, loop.time)
            self.car = car = Car(SETTINGS, lidar, self.motor, MemoryBus(loop.time, listened_to=False), loop.time)
            if rehearse:

                def decode_again():
                    self.decoded_s.append(loop.time())
                    decode()

                car.rehearse(decode_again, self.sent.append)
            stop = asyncio.Event()
            loop.call_later(1.0, stop.set)
            await car.drive(stop)

        run_virtual(main())

    def _scan(self, now_s):
        self.scanned_s.append(now_s)
        return corridor(now_s)

    @property
    def rehearsal(self) -> Rehearsal:
        assert self.car.rehearsal is not None
        return self.car.rehearsal


def test_the_answers_are_the_same_whether_it_rehearses_or_not():
    def wire(drill):
        return [(round(at_s, 9), drive) for at_s, drive in drill.motor.wire]

    assert wire(Drill()) == wire(Drill(rehearse=False))


def test_it_drives_like_the_car_and_reaches_no_wire():
    drill = Drill()
    assert len(drill.sent) > 30
    real = drill.motor.wire[len(drill.motor.wire) // 2 :]
    assert max(drive.speed_mps for drive in drill.sent) == pytest.approx(
        max(drive.speed_mps for _, drive in real), abs=0.2
    )


def test_it_comes_just_before_a_scan():
    drill = Drill()
    due_s = np.array(drill.scanned_s)
    for decoded_s in drill.decoded_s[:-1]:
        assert MARGIN_S - 1e-6 < np.min(np.abs(due_s - decoded_s)) < MARGIN_S + FIRST_S + 1e-6


def test_an_error_in_it_is_said_once_and_the_car_drives_on(caplog):
    def broken():
        raise ZeroDivisionError

    with caplog.at_level(logging.ERROR):
        drill = Drill(decode=broken)
    assert drill.rehearsal.failed
    assert [record.message for record in caplog.records if "rehearsal" in record.message] == [
        "the rehearsal failed and is left out from here on; scans are answered as before, but slower"
    ]
    assert drill.sent == []
    assert any(drive.speed_mps > 0 for _, drive in drill.motor.wire)


def test_it_follows_the_settings():
    drill = Drill()
    slower = Settings.model_validate(
        {"operator": {"permit": "always"}, "wall_follow": {"speed_mps": 0.5}, "safety": {"binds_teleop": True}}
    )
    drill.car.apply(slower, ["wall_follow.speed_mps"])
    assert drill.rehearsal.laws.wall_follow.speed_mps == 0.5
    assert drill.rehearsal.voices.order == slower.effective_order()


def test_what_it_sends_is_a_drive():
    assert all(isinstance(drive, Drive) for drive in Drill().sent)


def ready():
    """A rehearsal, with what it has decoded and sent, and a clock to be set."""
    drill = Drill()
    drill.sent.clear()
    drill.decoded_s.clear()
    drill.rehearsal.took_s = FIRST_S
    return drill, drill.rehearsal


def test_it_begins_as_early_as_it_lately_took_and_not_at_all_when_that_is_too_long():
    _, rehearsal = ready()
    assert rehearsal.lead_s == pytest.approx(FIRST_S + MARGIN_S)
    times_s = itertools.count(0.0, 0.0005)  # each look at the clock is half a millisecond later
    rehearsal.clock = lambda: next(times_s)
    for _ in range(100):
        rehearsal.run(*SCAN, due_s=math.inf)
    assert rehearsal.lead_s == pytest.approx(0.002 + MARGIN_S, abs=1e-5)
    rehearsal.took_s = 0.01
    assert rehearsal.lead_s == math.inf


@pytest.mark.parametrize(("left_s", "decoded", "sent"), [(0.0, 1, 0), (0.0012, 1, 0), (0.01, 1, 1)])
def test_no_piece_is_begun_when_the_scan_is_about_to_come(left_s, decoded, sent):
    drill, rehearsal = ready()
    times_s = itertools.count(1.0, 0.0005)
    rehearsal.clock = lambda: next(times_s)
    rehearsal.run(*SCAN, due_s=1.0 + GIVE_UP_S + left_s)
    assert (len(drill.decoded_s), len(drill.sent)) == (decoded, sent)
