"""The operator task in virtual time: beats at their rate, and silence noticed between them."""

import asyncio
import math
from itertools import pairwise

import pytest

from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import LAB_ORDER, Source
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.emergency_stop import EmergencyStop
from wallride.runtime.arbitration.permit import Permit
from wallride.runtime.realtime.periodic import PeriodicTimer
from wallride.runtime.settings.operator import OperatorSettings
from wallride.runtime.tasks.operator import DeskTicker
from wallride.runtime.teleop.desk import OperatorDesk
from wallride.runtime.wire.teleop import CarCondition, Command, Input, Press, read_beat
from wallride.sim.virtual.devices import MemoryMotor
from wallride.sim.virtual.virtual_time import run_virtual


class Bench:
    """The task with a desk, and a client that sends for a while and then falls silent."""

    def __init__(self, seconds, client_sends_until_s=0.0, *, present=True):
        self.beats = []
        self.teleop = []
        run_virtual(self._run(seconds, client_sends_until_s, present=present))

    async def _run(self, seconds, client_sends_until_s, *, present):
        clock = asyncio.get_running_loop().time
        queue = CommandQueue(LAB_ORDER, clock)
        self.motor = MemoryMotor(clock)
        self.motor.send(Drive(1.25, 0.0))
        self.motor.present = present
        e_stop = EmergencyStop(queue)
        desk = OperatorDesk(
            OperatorSettings(), queue, Permit(queue, "required"), e_stop, self.motor.clear_fault, clock, 9
        )

        def publish(payload):
            beat = read_beat(payload)
            self.beats.append((clock(), beat))
            if clock() < client_sends_until_s:
                held = Press.MANUAL if beat.beat > 5 else Press(0)
                command = Command(1, beat.beat, beat.car_session, beat.beat, held, Input.SCRIPT, speed_mps=1.0)
                desk.receive("", command.pack(), clock())
            self.teleop.append((clock(), any(word.source is Source.TELEOP for word in queue.live())))

        timer = PeriodicTimer(clock)
        timer.every(1 / 50, DeskTicker(desk, self.motor, publish).tick)
        task = asyncio.create_task(timer.run())
        await asyncio.sleep(seconds)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task


def test_while_nobody_speaks_only_every_third_beat_is_sent():
    bench = Bench(2.001)
    assert [beat.beat for _, beat in bench.beats] == list(range(1, 35))
    assert all(after - before == pytest.approx(0.06) for (before, _), (after, _) in pairwise(bench.beats))


def test_it_beats_fifty_times_a_second_for_whoever_speaks():
    bench = Bench(2.01, client_sends_until_s=10.0)
    assert [beat.beat for _, beat in bench.beats] == list(range(1, 101))
    assert all(after - before == pytest.approx(0.02) for (before, _), (after, _) in pairwise(bench.beats))
    assert bench.beats[-1][1].speed_mps == 1.25
    assert bench.beats[-1][1].car_session == 9


def test_an_unplugged_motor_has_no_speed():
    assert math.isnan(Bench(0.1, present=False).beats[0][1].speed_mps)


def test_a_client_that_falls_silent_is_lost_within_the_expiry_and_one_beat():
    bench = Bench(3.0, client_sends_until_s=1.0)
    driven_s = [at_s for at_s, speaks in bench.teleop if speaks]
    assert driven_s[-1] - driven_s[0] > 0.8
    last_sent_s = max(at_s for at_s, _ in bench.beats if at_s < 1.0)
    assert driven_s[-1] - last_sent_s < 0.2
    lost_s = next(at_s for at_s, beat in bench.beats if beat.flags & CarCondition.OPERATOR_LOST)
    assert lost_s - last_sent_s <= 0.2 + 0.02 + 1e-9
