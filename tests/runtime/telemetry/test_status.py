"""The status answers "why is it (not) moving", whatever is the matter."""

import json
import math

import pytest

from tests.runtime.in_earnest import judged
from tests.runtime.observed import HandClock, lose, make_observed, output_of, scan_at, speak
from tests.runtime.reachable import reachable
from wallride.drivers.api import Drive, MotorState
from wallride.runtime.arbitration.command import (
    LAB_ORDER,
    Decision,
    DriveCommand,
    Output,
    Source,
    SpeedLimit,
    Verdict,
    refusal,
)
from wallride.runtime.control.laws import LiveLaws
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.settings.tree import Settings
from wallride.runtime.telemetry.status import Journey, Latency, decision, said, status
from wallride.runtime.wire import topics
from wallride.sim.virtual.devices import ranges_between_walls

INF = math.inf
WALL_AHEAD = Verdict(0.0, INF, "wall ahead", 0.3)


@pytest.fixture
def observed():
    return make_observed(HandClock())


def stand(reason):
    return DriveCommand(Source.NAVIGATION, Drive(0.0, 0.0), None, reason)


def told(observed, output=None):
    """Return the status as it arrives."""
    return json.loads(topics.encode(status(observed, output, Journey(90.0))))


def test_a_driving_car_has_open_gates_and_a_winner(observed):
    speak(observed)
    said_now = told(observed, output_of(observed))
    assert said_now["state"] == "driving"
    assert set(said_now["gates"].values()) == {""}
    assert said_now["output"]["winner"] == said_now["output"]["driver"] == "navigation"
    assert (said_now["output"]["asked_mps"], said_now["output"]["allowed_mps"]) == (1.0, 1.0)
    assert (said_now["car"], said_now["version"], said_now["up_s"]) == ("car1", "9.9", 10.0)
    assert said_now["battery"] == {"voltage_v": 11.8, "current_a": 0.0}


def test_every_voice_is_told_with_its_age_in_the_muxs_order(observed):
    speak(observed)
    observed.clock.now_s += 0.25
    queue = told(observed, output_of(observed))["voices"]
    assert list(queue) == ["e-stop", "teleop", "safety", "permit", "navigation"]
    assert queue["teleop"] == {"age_s": None, "live": False}
    assert (queue["navigation"]["age_s"], queue["navigation"]["speed_mps"]) == (0.25, 1.0)
    assert queue["safety"]["reason"] == "clear"
    assert queue["safety"]["speed_mps"] is None, "no limit"


@pytest.mark.parametrize(
    ("trouble", "gate", "reason"),
    [
        (lambda o: speak(o, permit=False), "permit", "no permit"),
        (lambda o: speak(o, safety=Verdict(0.0, INF, "wall ahead", 0.3)), "safety", "wall ahead"),
        (lambda o: (speak(o), o.queue.withdraw(Source.SAFETY)), "safety", "no word"),
        (lambda o: (speak(o), o.queue.withdraw(Source.NAVIGATION)), "navigation", "no word"),
        (
            lambda o: (speak(o), o.queue.put(stand("my:Law raised ValueError"))),
            "navigation",
            "my:Law raised ValueError",
        ),
        (lambda o: (speak(o), o.queue.put(refusal(Source.ESTOP, "red button"))), "e-stop", "red button"),
        (lambda o: (speak(o), lose(o.lidar)), "lidar", "absent: cable"),
    ],
)
def test_a_closed_gate_says_why_and_the_others_are_open(observed, trouble, gate, reason):
    trouble(observed)
    gates = told(observed, output_of(observed, speed_mps=0.0, winner=None, reason="x"))["gates"]
    assert gates.pop(gate) == reason
    assert set(gates.values()) == {""}


def test_the_state_is_a_word_for_a_list(observed):
    speak(observed)
    assert told(observed)["state"] == "starting"
    assert told(observed, output_of(observed, sent_mps=0.0))["state"] == "standing"
    observed.queue.put(refusal(Source.ESTOP, "red button"))
    assert told(observed, output_of(observed))["state"] == "e-stop"
    lose(observed.lidar)
    assert told(observed)["state"] == "no lidar"
    observed.motor.present = False
    assert told(observed)["state"] == "no motor"


def test_what_is_too_slow_to_turn_the_motor_is_no_driving():
    observed = make_observed(HandClock(), slowest_mps=0.2)
    speak(observed, speed_mps=0.15)
    assert told(observed, output_of(observed, speed_mps=0.15))["state"] == "standing"
    assert told(observed, output_of(observed, speed_mps=-0.2))["state"] == "driving"


def test_a_motor_that_is_gone_has_no_battery_and_no_speed(observed):
    observed.motor.present = False
    said_now = told(observed)
    assert said_now["battery"] is said_now["speed_mps"] is None


def test_a_cap_that_decided_is_quoted_and_another_is_only_asked_about_standing():
    asked = []

    class Judge(Verdict):
        def ask(self, speed_mps, steering_rad):
            asked.append((speed_mps, steering_rad))
            return Verdict(2.0, 0.5, "window dirty")

    word = SpeedLimit(Source.SAFETY, Judge(2.0, 0.5, ""), 1.0)
    bound = Decision(-0.3, 0.1, Source.NAVIGATION, Source.SAFETY, "wall behind", 0.2)
    assert said(word, bound).speed_mps == 0.3, "a ceiling is no direction"
    assert (said(word, bound).reason, said(word, bound).measure, asked) == ("wall behind", 0.2, [])
    assert said(word, Decision(1.0, 0.1, Source.NAVIGATION, Source.NAVIGATION, "wall")).speed_mps == 2.0
    assert said(word, Decision(-1.0, 0.1, Source.NAVIGATION, Source.NAVIGATION, "wall")).speed_mps == 0.5
    assert set(asked) == {(0.0, 0.0)}


def test_a_driver_is_quoted_with_its_wish():
    heard = said(DriveCommand(Source.TELEOP, Drive(2.0, -0.1), None, "stick"), None)
    assert (heard.speed_mps, heard.steering_rad, heard.reason) == (2.0, -0.1, "stick")


def test_a_decision_tells_wish_ceiling_and_what_was_sent(observed):
    speak(observed, speed_mps=2.0, safety=Verdict(0.5, INF, "slower: wall ahead", 1.25))
    output = output_of(
        observed, speed_mps=0.5, winner=Source.SAFETY, reason="slower: wall ahead", measure=1.25, sent_mps=0.6
    )
    message = json.loads(topics.encode(decision(observed, output)))
    assert (message["asked_mps"], message["allowed_mps"], message["speed_mps"]) == (2.0, 0.5, 0.6)
    assert (message["winner"], message["driver"]) == ("safety", "navigation")
    assert message["measure"] == 1.25
    assert set(message["voices_age_s"]) == {"safety", "permit", "navigation"}


def test_latency_is_told_in_milliseconds_and_forgets_the_oldest():
    latency = Latency()
    assert latency.fields() == {"p50": None, "p99": None, "max": None}
    for i in range(1, 1001):
        latency.add(i / 1000)
    assert latency.fields() == {"p50": 801.0, "p99": 996.0, "max": 1000.0}
    for i in range(400):
        latency.add(i * 7 % 400 / 1000)  # every one once, in a wild order
    assert latency.fields() == {"p50": 200.0, "p99": 395.0, "max": 399.0}


def drive_by_hand(observed, *, order=LAB_ORDER, assessment=WALL_AHEAD, speed_mps=1.0):
    observed.queue.reorder(order)
    speak(observed)
    observed.queue.put(SpeedLimit(Source.SAFETY, assessment, observed.clock()))
    observed.queue.put(DriveCommand(Source.TELEOP, Drive(speed_mps, 0.0), None, "anna drives"))
    decided = Decision(speed_mps, 0.0, Source.TELEOP, Source.TELEOP, "anna drives")
    return Output(observed.clock(), Drive(speed_mps, 0.0), decided, delivered=True)


BOUND = (Source.ESTOP, Source.SAFETY, Source.TELEOP, Source.PERMIT, Source.NAVIGATION)


def test_what_safety_says_to_a_human_whom_it_does_not_bind_is_told(observed):
    found = told(observed, drive_by_hand(observed))["overruled"]
    assert found == {"speed_mps": 0.0, "reason": "wall ahead", "measure": 0.3}


@pytest.mark.parametrize(
    "story",
    [
        {"order": BOUND},
        {"assessment": Verdict(INF, INF, "clear")},
        {"assessment": Verdict(1.5, INF, "slower: wall ahead", 2.0)},
        {"speed_mps": -0.5},
        {"speed_mps": 0.0},
    ],
)
def test_nothing_is_overruled_where_safety_binds_or_does_not_object(observed, story):
    assert told(observed, drive_by_hand(observed, **story))["overruled"] is None


def test_autonomy_is_never_overruled(observed):
    speak(observed, safety=WALL_AHEAD)
    assert told(observed, output_of(observed))["overruled"] is None


def fast(now_s):
    return MotorState(now_s, 2.0, 2.0 * now_s, 0.0, 11.8, 0.0, 0.0, 25.0, "", timed_out=False, killed=False)


def test_asking_leaves_no_trace_in_the_law(observed):
    """The swept law remembers its own stops; what is only asked for a screen must not be among them."""
    laws = LiveLaws(Settings().wall_follow, Settings().safety, CarSettings(), observed.clock)
    ranges_m = ranges_between_walls(1.0, 1.0, 0.6)
    for _ in range(3):
        observed.clock.now_s += 0.025
        assessment = laws.look(scan_at(observed.clock.now_s, ranges_m), fast(observed.clock.now_s))
    before = reachable(assessment)
    found = told(observed, drive_by_hand(observed, assessment=assessment, speed_mps=2.0))["overruled"]
    assert "wall ahead" in found["reason"]
    assert found["speed_mps"] < 2.0
    assert reachable(assessment) == before
    judged(assessment, 2.0, 0.0)
    assert reachable(assessment) != before, "being asked in earnest does leave one"
