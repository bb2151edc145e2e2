"""The planners' desk under the real arbitration and operator's desk, in virtual time, and a planner outside."""

import math

import pytest

from tests.runtime.operator_rig import REQUIRED, Client
from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import DriveCommand, Source, arbitrate, consent
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.emergency_stop import EmergencyStop
from wallride.runtime.arbitration.permit import Permit
from wallride.runtime.settings.operator import OperatorSettings
from wallride.runtime.settings.tree import load_settings
from wallride.runtime.teleop.desk import OperatorDesk
from wallride.runtime.teleop.planners import PlannerDesk
from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import Command, Input, Press, read_beat

CAR_SESSION = 0xCAFE
STEP_S = 0.02
EXPIRY_S = 0.2
DRIVES = Press.MANUAL
ORDER = load_settings(None, ["planners.enabled=true"]).effective_order()
GID, OTHER_GID = bytes(16), bytes(range(16))


class Planner:
    """A planner outside: numbers its commands and echoes what it heard."""

    def __init__(self, rig, name, session=1):
        self.rig, self.name, self.session, self.sequence = rig, name, session, 0
        self.echo = 0
        rig.planners.append(self)

    def make(self, flags=DRIVES, **changes):
        self.sequence += 1
        fields = {
            "session": self.session, "sequence": self.sequence, "car_session": CAR_SESSION, "beat": self.echo,
            "flags": flags, "input": Input.SCRIPT, "speed_mps": 1.5, "steering_rad": 0.2,
        }  # fmt: skip
        return Command(**{**fields, **changes}).pack()

    def send(self, flags=DRIVES, **changes):
        payload = self.make(flags, **changes)
        self.rig.send(self.name, payload)
        return payload


class Rig:
    """Both desks at a real queue; safety consents, and the follower always wants 1 m/s."""

    def __init__(self, permit="always", names=("slam", "nn", "ros2")):
        self.now_s = 100.0
        clock = lambda: self.now_s  # noqa: E731 - the clock is this rig's hand
        self.queue = CommandQueue(ORDER, clock)
        self.permit = Permit(self.queue, permit)
        self.desk = OperatorDesk(
            OperatorSettings(permit=permit), self.queue, self.permit, EmergencyStop(self.queue), lambda: None, clock,
            CAR_SESSION,
        )  # fmt: skip
        self.planner_desk = PlannerDesk(
            names, EXPIRY_S, self.queue, self.permit, self.desk.beats, self.desk.rearm, clock, CAR_SESSION
        )
        self.planners, self.clients = [], []
        self.queue.put(consent(Source.SAFETY, "clear"))
        self.queue.put(DriveCommand(Source.NAVIGATION, Drive(1.0, 0.0), None, "follows the wall"))
        self.beat()

    def beat(self):
        self.desk.tick()
        self.planner_desk.tick()
        self.heard = read_beat(self.desk.beat(math.nan).pack())
        for client in self.clients:
            client.hear(self.heard)
        for planner in self.planners:
            planner.echo = self.heard.beat

    def wait(self, seconds):
        for _ in range(round(seconds / STEP_S)):
            self.now_s += STEP_S
            self.beat()

    def drive(self, planner, seconds=0.1, **changes):
        for _ in range(round(seconds / STEP_S)):
            self.wait(STEP_S)
            planner.send(**changes)

    def send(self, name, payload):
        self.planner_desk.receive(topics.planner_key("car1", name), payload, self.now_s)

    def operator(self):
        client = Client(self, "ann", 50)
        self.clients.append(client)
        client.hear(self.heard)
        return client

    @property
    def decision(self):
        return arbitrate(self.queue.live(), REQUIRED, self.queue.order)[0]

    def refused(self, name):
        return self.planner_desk.status()["planners"][name]["refused"]


def driven(rig):
    return rig.decision.driver, rig.decision.speed_mps, rig.decision.steering_rad


PLANNED = (Source.PLANNER, pytest.approx(1.5), pytest.approx(0.2))
