"""`wallride status` and `wallride cars`: the answer is in the first line."""

import asyncio
import json
import math

import pytest

from tests.clients.speaking_car import options, speaking_car
from tests.runtime.observed import HandClock, lose, make_observed, output_of, speak
from tests.waiting import until
from wallride.clients import refreshing, status
from wallride.clients.connection import ConnectionProblemError
from wallride.clients.status import headline, screen
from wallride.runtime.arbitration.command import Source, Verdict, refusal
from wallride.runtime.host.terminal_text import CLEAR_SCREEN
from wallride.runtime.settings.telemetry import RatesHz
from wallride.runtime.telemetry import status as car_status
from wallride.runtime.telemetry.status import Journey
from wallride.runtime.teleop.status import OperatorState, OperatorView
from wallride.runtime.wire import topics

VIEW = OperatorView(
    OperatorState.LOST, "anna", "00000000000000a1", 2, 120, 0.7, 0.012, "operator lost", "no operator", False, {},
    {"stale": 3, "replay": 0},
)  # fmt: skip


def arrived(observed, output):
    """Return a status as it comes off the wire."""
    return topics.decode(topics.encode(car_status.status(observed, output, Journey(0.0))))


@pytest.fixture
def observed():
    observed = make_observed(HandClock(), operator=lambda: VIEW, window=lambda: ("12 beams are dirty",))
    speak(observed)
    return observed


def test_a_driving_car_says_how_fast_and_who_decided(observed):
    assert headline(arrived(observed, output_of(observed))) == "drives 1.00 m/s: navigation: wall"


@pytest.mark.parametrize(
    ("trouble", "answer"),
    [
        (lambda o: None, "stands: safety: wall ahead, 0.31 m free"),
        (lambda o: lose(o.lidar), "stands: lidar absent: cable"),
        (lambda o: lose(o.motor), "stands: motor ready: cable"),
    ],
)
def test_a_standing_car_says_why(observed, trouble, answer):
    trouble(observed)
    if "motor" in answer:
        observed.motor.present, answer = False, "stands: motor absent: cable"
    output = output_of(observed, speed_mps=0.0, winner=Source.SAFETY, reason="wall ahead", measure=0.314)
    assert headline(arrived(observed, output)) == answer


def test_a_command_below_the_motors_least_speed_is_no_drive(observed):
    output = output_of(observed, speed_mps=0.15)
    status = arrived(observed, output)
    status |= {"speed_mps": 0.0, "condition": {"state": "stopped", "reason": "too slow", "for_s": 1.0, "clears": ""}}
    assert headline(status) == "stands: too slow"


def test_a_car_whose_wheels_turn_is_never_said_to_stand(observed):
    output = output_of(observed, speed_mps=0.0, winner=Source.ESTOP, reason="e-stop")
    status = arrived(observed, output)
    status["speed_mps"] = 1.0
    assert headline(status).startswith("brakes at 1.00 m/s: ")


def test_a_stop_is_never_minus_zero(observed):
    output = output_of(observed, speed_mps=-0.0, winner=Source.SAFETY, reason="wall ahead")
    assert "sent 0.00 m/s" in "\n".join(screen(arrived(observed, output)))


def test_before_the_first_decision_it_says_so(observed):
    assert headline(arrived(observed, None)) == "stands: nothing has been decided yet"


def test_one_screen_holds_everything_that_may_hold_the_car(observed):
    observed.queue.put(refusal(Source.ESTOP, "e-stop by anna"))
    observed.lidar.health.count("checksum", 4)
    lines = screen(arrived(observed, output_of(observed, speed_mps=0.0, winner=Source.ESTOP, reason="e-stop by anna")))
    text = "\n".join(lines)
    assert len(lines) <= 30
    assert max(map(len, lines)) <= 140
    for words in (
        "car1  stands: e-stop: e-stop by anna",
        "e-stop      CLOSED: e-stop by anna",
        "permit      open",
        "teleop        silent",
        "0.00 s ago  wants 1.00 m/s 6° left: wall",
        "no limit: clear",
        "not operated, anna was lost, round trip 12 ms, 2 clients heard, permit: no operator, stale refused 3",
        "11.8 V, 0.0 A",
        "ready: in memory; recovered since the start: 4 checksum",
        "12 beams are dirty",
        "wallride 9.9",
    ):
        assert words in text


@pytest.mark.parametrize("columns", [40, 60, 80])
def test_the_screen_fits_the_terminal_and_no_word_is_broken(observed, columns):
    observed.queue.put(refusal(Source.ESTOP, "e-stop by anna"))
    said = arrived(observed, output_of(observed, speed_mps=0.0, winner=Source.ESTOP, reason="e-stop by anna"))
    fitted, whole = screen(said, 2.5, columns), screen(said, 2.5)
    assert max(map(len, fitted)) <= columns < max(map(len, whole))
    words = [[word for line in lines for word in line.split() if "-----" not in word] for lines in (fitted, whole)]
    assert words[0] == words[1]
    assert all(line[:10].isspace() for line in fitted if line not in whole and line[:1] == " ")


def test_what_is_noticed_is_not_called_the_window(observed):
    said = arrived(observed, output_of(observed))
    said["window"] = ["my_laws:Follower raised ValueError: lost (my_laws.py:7)"]
    assert "notices   my_laws:Follower raised ValueError: lost (my_laws.py:7)" in screen(said)
    said["window"] = []
    assert "notices   none" in screen(said)


@pytest.mark.parametrize(
    ("reason", "shown"),
    [("permit not required", "permit not required"), ("no operator", "permit: no operator"), ("", "not operated")],
)
def test_the_permit_is_named_once(observed, reason, shown):
    fields = arrived(observed, output_of(observed))
    fields["operator"]["permit"] = reason
    (line,) = (line for line in screen(fields) if line.lstrip().startswith("operator"))
    assert shown in line
    assert line.count("permit") == (1 if reason else 0)


def test_the_longest_name_of_a_source_and_a_long_age_stay_apart(observed):
    said = arrived(observed, output_of(observed))
    said["voices"] = {"planner hold": {"age_s": 314.05, "live": False}}
    assert any("planner hold  314.05 s ago" in line for line in screen(said))


def test_an_old_screen_says_that_it_is_old(observed):
    fresh = arrived(observed, output_of(observed))
    assert "nothing heard for 2.5 s" in screen(fresh, 2.5)[1]
    assert not any("nothing heard" in line for line in screen(fresh, 0.2))


async def test_the_status_of_a_car_is_shown_and_given_as_json():
    async with speaking_car(safety=Verdict(math.inf, math.inf, "clear")) as car:
        parsed, said = options(car, "status")
        assert await status.run(parsed) == 0
        assert said[0].startswith("car1  drives 1.00 m/s: navigation: wall")
        parsed, said = options(car, "status", "--json")
        await status.run(parsed)
        assert json.loads(said[0])["gates"]["safety"] == ""


async def test_watching_goes_on_until_it_is_stopped(monkeypatch):
    monkeypatch.setattr("sys.stdout.isatty", lambda: True, raising=False)
    async with speaking_car() as car:
        parsed, said = options(car, "status", "--watch")
        watching = asyncio.create_task(status.run(parsed))
        await until(lambda: len(said) >= 3)
        watching.cancel()
        with pytest.raises(asyncio.CancelledError):
            await watching
    assert all(page.startswith(CLEAR_SCREEN) for page in said)


async def test_watching_into_a_pipe_says_that_the_car_is_gone(monkeypatch):
    monkeypatch.setattr(refreshing, "LINE_EVERY_S", 0.1)
    watched = []
    async with speaking_car() as car, asyncio.timeout(20):
        for how in ((), ("--json",)):
            parsed, said = options(car, "status", "--watch", *how)
            watched.append((asyncio.create_task(status.run(parsed)), said))
        while not all(said for _, said in watched):
            await asyncio.sleep(0.02)
    (_, lines), (_, messages) = watched
    while "nothing heard for" not in lines[-1]:
        await asyncio.sleep(0.02)
    for task, _ in watched:
        task.cancel()
    assert lines[-1].startswith("car1  drives 1.00 m/s: navigation: wall  !! nothing heard for")
    stamps_s = [json.loads(message)["stamp_s"] for message in messages]
    assert len(stamps_s) == len(set(stamps_s)), "a status is told once"


async def test_a_car_whose_status_is_turned_off_is_explained(monkeypatch):
    monkeypatch.setattr(status, "FIRST_WITHIN_S", 0.3)
    async with speaking_car(rates=RatesHz(status=0)) as car:
        parsed, _ = options(car, "status")
        with pytest.raises(ConnectionProblemError, match=r"its process hangs or is stopped, see its log; or telemetry"):
            await status.run(parsed)
