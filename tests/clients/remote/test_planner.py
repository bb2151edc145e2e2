"""A planner learns from the car's status whether it is heard: at the real desk in virtual time, and on a session."""

import asyncio
from datetime import UTC, datetime
from typing import Any

import pytest

import wallride
from tests.clients.teleop.test_app import FakeCar
from tests.runtime.teleop.planner_rig import STEP_S, Planner, Rig
from wallride.clients.keys.authority import Authority
from wallride.clients.remote.acceptance import ACCEPTED_WITHIN_S, Acceptance
from wallride.clients.remote.driver import DriveRefusedError
from wallride.clients.remote.hand import ScriptedHand
from wallride.clients.remote.planner import PlanRefusedError, RemotePlanner
from wallride.runtime.wire import topics
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.ports import free_endpoint
from wallride.runtime.wire.zenoh_config import Person, Role, Tls, car_config

STATUS_S = 0.1


class Entering:
    """A script that begins to plan at a desk, and hears a status ten times a second."""

    def __init__(self, rig, name="slam", session=1):
        self.rig, self.planner = rig, Planner(rig, name, session)
        self.acceptance = Acceptance("car1", name)
        self.hear()
        self.acceptance.begin(rig.now_s)

    def hear(self):
        self.acceptance.hear({"planners": self.rig.planner_desk.status()}, self.rig.now_s)

    def run(self, seconds, *senders, **changes):
        for _ in range(round(seconds / STATUS_S)):
            for _ in range(round(STATUS_S / STEP_S)):
                self.rig.wait(STEP_S)
                for planner in senders:
                    planner.send(**changes)
            self.hear()
        return self.acceptance.refused


@pytest.mark.parametrize("permit", ["always", "required"])
def test_what_the_desk_takes_is_accepted_with_and_without_a_permit(permit):
    slam = Entering(Rig(permit))
    assert slam.run(0.2, slam.planner) == ""
    assert slam.acceptance.accepted


def test_a_name_that_the_car_does_not_list_is_answered_with_those_that_it_lists():
    entering = Entering(Rig(), "slma")
    assert "lists no planner slma; its planners.names: slam, nn, ros2" in entering.acceptance.refused
    assert "planners.enabled = true" in Entering(Rig(names=()), "slam").acceptance.refused


@pytest.mark.parametrize("status", [b"", b"3", b'{"planners": 3}', b'{"planners": {"planners": {"slam": {}}}}'])
def test_a_status_that_cannot_be_read_is_dropped(status):
    thread: Any = None
    planner = RemotePlanner(thread, thread, "car1", "slam", ScriptedHand(2.0, 0.3))
    planner._acceptance.hear({"planners": {"planners": {"slam": {"accepted": 0, "refused": {}}}}}, 0.0)
    planner._acceptance.begin(0.0)
    planner._on_status("wallride/car1/status", status, 0.1)
    assert not planner._acceptance.accepted


def test_a_planner_that_is_not_heard_is_told_the_likely_cause_in_time():
    silent = Entering(Rig())
    assert silent.run(ACCEPTED_WITHIN_S - STATUS_S) == ""
    assert "certificate of slam and the role planner" in silent.run(0.2)
    assert not silent.acceptance.accepted


def test_a_planner_that_is_refused_is_told_what_the_car_counts():
    stale = Entering(Rig())
    assert "refuses the commands of planner slam: for another start" in stale.run(0.6, stale.planner, car_session=7)


def test_of_two_programs_with_one_name_the_second_is_told():
    rig = Rig()
    first = Planner(rig, "slam", session=9)
    rig.beat()
    rig.drive(first)
    second = Entering(rig)
    assert "another program plans on car1 as slam" in second.run(0.6, first, second.planner)
    assert not second.acceptance.accepted


def test_below_a_more_urgent_planner_a_planner_is_accepted_too():
    rig = Rig()
    slam = Planner(rig, "slam", session=9)
    rig.beat()
    nn = Entering(rig, "nn")
    nn.run(0.2, slam, nn.planner)
    assert nn.acceptance.accepted


class PlannedCar(FakeCar):
    """A car with a status that lists slam, and counts what comes from it where it hears it."""

    def __init__(self, *, hears, bus=None):
        super().__init__()
        self.bus = bus or self.bus
        self.accepted = 0
        if hears:
            self.bus.subscribe(topics.planner_key("car1", "slam"), self._on_plan)

    def _on_plan(self, *_):
        self.accepted += 1

    async def say(self):
        while True:
            own = {"live": False, "accepted": self.accepted, "refused": {}}
            status = {"planners": {"driving": "", "lost": "", "planners": {"slam": own}}}
            self.bus.put(topics.key("car1", topics.STATUS), topics.encode(status))
            await asyncio.sleep(STATUS_S)


@pytest.mark.parametrize(
    ("hears", "name", "reason"),
    [
        (True, "slma", "lists no planner slma"),
        (False, "slam", "certificate of slam and the role planner"),
        (True, "slam", ""),
    ],
)
async def test_a_planner_that_is_not_obeyed_learns_it_on_entering(hears, name, reason):
    async with PlannedCar(hears=hears) as car:
        saying = asyncio.create_task(car.say())

        def script():
            with wallride.connect(at=car.bus.endpoint) as remote, remote.plan(name) as plan:
                plan.send(1.0, 0.1)

        try:
            if reason:
                with pytest.raises(PlanRefusedError, match=reason):
                    await asyncio.to_thread(script)
            else:
                await asyncio.to_thread(script)
                assert car.accepted > 1
        finally:
            saying.cancel()


async def test_a_car_without_a_status_cannot_be_planned_for(monkeypatch):
    monkeypatch.setattr("wallride.clients.remote.planner.READY_WITHIN_S", 0.3)
    async with FakeCar() as car:

        def script():
            with wallride.connect(at=car.bus.endpoint) as remote, remote.plan("slam"):
                pass

        with pytest.raises(PlanRefusedError, match="status, which lists its planners, does not come"):
            await asyncio.to_thread(script)


@pytest.fixture(scope="module")
def keys(tmp_path_factory):
    """Folders of keys: of the car, of two planners, and of a viewer."""
    folder, now = tmp_path_factory.mktemp("keys"), datetime.now(UTC)
    ours = Authority.make("car1", now)
    authority = Authority(ours)
    pairs = {name: authority.certify_person(name, "admin", now, 365) for name in ("slam", "nn", "bob")}
    pairs["car"] = authority.certify_car("car1", ["127.0.0.1"], now, 365)
    for name, pair in pairs.items():
        (folder / name).mkdir()
        (folder / name / "ca.pem").write_bytes(ours.certificate_pem)
        (folder / name / f"{name}.pem").write_bytes(pair.certificate_pem)
        (folder / name / f"{name}.key").write_bytes(pair.key_pem)
        (folder / name / f"{name}.key").chmod(0o600)
    return folder


PEOPLE = (Person("slam", Role.PLANNER), Person("nn", Role.PLANNER), Person("bob", Role.VIEWER))


@pytest.mark.parametrize("whose", ["nn", "bob", "slam"])
async def test_a_certificate_that_may_not_is_named_as_the_likely_cause(keys, whose):
    tls = Tls(keys / "car" / "ca.pem", keys / "car" / "car.pem", keys / "car" / "car.key")
    place = free_endpoint().replace("tcp/", "tls/")
    async with PlannedCar(hears=True, bus=Bus(car_config([place], tls, PEOPLE, "car1"))) as car:
        saying = asyncio.create_task(car.say())

        def enter(block):
            with block as source:
                source.send(1.0, 0.1)

        def script():
            with wallride.connect("car1", at=place, keys=keys / whose) as remote:
                if whose == "slam":
                    enter(remote.plan("slam"))
                else:
                    with pytest.raises(PlanRefusedError, match="certificate of slam and the role planner"):
                        enter(remote.plan("slam"))
                with pytest.raises(DriveRefusedError, match="certificate's role operator"):
                    enter(remote.drive())

        try:
            await asyncio.to_thread(script)
        finally:
            saying.cancel()
