"""A car without devices for the tests of the operator's side: a clock to turn, and clients that hold things down."""

import math

from wallride.drivers.api import Drive
from wallride.runtime.arbitration.command import LAB_ORDER, DriveCommand, Source, arbitrate, consent
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.emergency_stop import EmergencyStop
from wallride.runtime.arbitration.permit import Permit
from wallride.runtime.settings.operator import OperatorSettings
from wallride.runtime.teleop.desk import OperatorDesk
from wallride.runtime.wire.teleop import Command, Input, Press, read_beat

REQUIRED = frozenset({Source.SAFETY, Source.PERMIT})
CAR_SESSION = 0xCAFE
BEAT_S = 0.02
HAND_MPS = 2.0
NOTHING = Press(0)
AUTO_MPS = 1.0


class Rig:
    """The desk between a real queue and the real arbitration, with an autonomy that always wants to drive."""

    def __init__(self, permit="required", order=LAB_ORDER, **settings):
        self.now_s = 100.0
        clock = lambda: self.now_s  # noqa: E731 - the clock is this rig's hand
        self.queue = CommandQueue(order, clock)
        self.e_stop = EmergencyStop(self.queue)
        self.permit = Permit(self.queue, permit)
        self.faults_cleared = 0
        self.desk = OperatorDesk(
            OperatorSettings(permit=permit, **settings),
            self.queue, self.permit, self.e_stop, self._clear_fault, clock, CAR_SESSION,
        )  # fmt: skip
        self.clients = []
        self.queue.put(consent(Source.SAFETY, "clear"))
        self.queue.put(DriveCommand(Source.NAVIGATION, Drive(AUTO_MPS, 0.0), None, "follows the wall"))
        self.beat()

    def _clear_fault(self):
        self.faults_cleared += 1

    def tick(self):
        self.desk.tick()

    def beat(self):
        """Tick and beat once; every client whose link is up hears it."""
        self.tick()
        self.heard = read_beat(self.desk.beat(math.nan).pack())
        for client in self.clients:
            client.hear(self.heard)
        return self.heard

    def wait(self, seconds):
        """Let time pass without any command."""
        for _ in range(round(seconds / BEAT_S)):
            self.now_s += BEAT_S
            self.beat()

    def stall(self, seconds):
        """Let time pass without even a tick of the desk: the car's process stood still."""
        self.now_s += seconds

    def client(self, name="Ann", session=None):
        """Connect one more operator's client."""
        client = Client(self, name, session or len(self.clients) + 1)
        self.clients.append(client)
        client.hear(self.heard)
        return client

    @property
    def speed_mps(self):
        """What the mux would send now."""
        return self.decision.speed_mps

    @property
    def decision(self):
        return arbitrate(self.queue.live(), REQUIRED, self.queue.order)[0]

    @property
    def standing(self):
        return str(self.desk.view().standing)

    @property
    def refused(self):
        return self.desk.view().refused


class Client:
    """Somebody's `wallride teleop`: numbers its commands and echoes what it heard."""

    def __init__(self, rig, name, session):
        self.rig, self.name, self.session = rig, name, session
        self.sequence = 0
        self.car_session = self.echo = 0
        self.deaf = False

    def hear(self, beat):
        if not self.deaf:
            self.car_session, self.echo = beat.car_session, beat.beat

    def make(self, flags=NOTHING, **changes):
        """Return a command as it would be sent now."""
        self.sequence += 1
        fields = {
            "session": self.session, "sequence": self.sequence, "car_session": self.car_session, "beat": self.echo,
            "flags": flags, "input": Input.KEYBOARD, "speed_mps": HAND_MPS, "steering_rad": 0.1, "name": self.name,
        }  # fmt: skip
        return Command(**{**fields, **changes}).pack()

    def send(self, flags=NOTHING, **changes):
        """Send what is held down, once."""
        payload = self.make(flags, **changes)
        self.rig.desk.receive("", payload, self.rig.now_s)
        return payload

    def hold(self, flags, seconds=0.1):
        """Send it at every beat for so long."""
        for _ in range(round(seconds / BEAT_S)):
            self.rig.wait(BEAT_S)
            self.send(flags)

    def click(self, flags=Press.MANUAL):
        """Release everything, then press: what it takes to be obeyed."""
        self.send()
        self.send(flags)
