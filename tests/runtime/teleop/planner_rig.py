"""The planners' desk beside the operator's, under the real arbitration in virtual time, and a planner outside."""

import pytest

from tests.runtime import operator_rig
from tests.runtime.operator_rig import BEAT_S, CAR_SESSION, Client
from wallride.runtime.arbitration.command import Source
from wallride.runtime.settings.tree import load_settings
from wallride.runtime.teleop.planners import PlannerDesk
from wallride.runtime.wire import topics
from wallride.runtime.wire.teleop import Input, Press

STEP_S = BEAT_S
EXPIRY_S = 0.2
DRIVES = Press.MANUAL
ORDER = load_settings(None, ["planners.enabled=true"]).effective_order()
GID, OTHER_GID = bytes(16), bytes(range(16))


class Planner(Client):
    """A planner outside: numbers its commands and echoes what it heard."""

    def __init__(self, rig, name, session=1):
        super().__init__(rig, name, session)
        self.car_session = CAR_SESSION
        rig.clients.append(self)

    def make(self, flags=DRIVES, **changes):
        fields = {"input": Input.SCRIPT, "speed_mps": 1.5, "steering_rad": 0.2, "name": ""}
        return super().make(flags, **{**fields, **changes})

    def send(self, flags=DRIVES, **changes):
        payload = self.make(flags, **changes)
        self.rig.send(self.name, payload)
        return payload


class Rig(operator_rig.Rig):
    """Both desks at a real queue; safety consents, and the follower always wants 1 m/s."""

    planner_desk = None

    def __init__(self, permit="always", names=("slam", "nn", "ros2")):
        super().__init__(permit, ORDER)
        self.planner_desk = PlannerDesk(
            names, EXPIRY_S, self.queue, self.permit, self.desk.beats, self.desk.rearm, lambda: self.now_s, CAR_SESSION
        )

    def tick(self):
        super().tick()
        if self.planner_desk is not None:
            self.planner_desk.tick()

    def drive(self, planner, seconds=0.1, **changes):
        for _ in range(round(seconds / STEP_S)):
            self.wait(STEP_S)
            planner.send(**changes)

    def send(self, name, payload):
        self.planner_desk.receive(topics.planner_key("car1", name), payload, self.now_s)

    def refused_of(self, name):
        return self.planner_desk.status()["planners"][name]["refused"]


def driven(rig):
    return rig.decision.driver, rig.decision.speed_mps, rig.decision.steering_rad


PLANNED = (Source.PLANNER, pytest.approx(1.5), pytest.approx(0.2))
