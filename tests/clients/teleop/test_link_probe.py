"""Steady heartbeats do not make a link fast: what is seen may be old, and teleop says so instead of "ready"."""

import json
import math

import pytest

from tests.clients.teleop.scenes import Drive, hands
from tests.runtime.observed import HandClock
from wallride.clients.teleop.advice import PAD_NAMES, AdviceLevel, advise
from wallride.clients.teleop.link_probe import PATIENCE, QUESTION, LinkProbe
from wallride.clients.teleop.screen import CarState, lines
from wallride.runtime.wire.network import RefusedError

ANSWER = json.dumps({"values": {PATIENCE: 0.3}}).encode()


def probe_of(clock, *answers):
    """A probe whose questions take a time each, and are answered or not."""
    left = list(answers)

    async def ask(question):
        assert question == QUESTION
        took_s, answer = left.pop(0)
        clock.now_s += took_s
        if isinstance(answer, Exception):
            raise answer
        return [answer] if answer else []

    return LinkProbe(ask, lambda: clock.now_s)


async def test_the_round_trip_is_that_of_the_last_answer_with_the_cars_patience():
    clock = HandClock()
    probe = probe_of(clock, (0.06, ANSWER), (0.4, ANSWER))
    assert math.isnan(probe.takes_s(clock.now_s))
    await probe.measure()
    assert probe.takes_s(clock.now_s) == pytest.approx(0.06)
    await probe.measure()
    assert probe.takes_s(clock.now_s) == pytest.approx(0.4)
    assert probe.patience_s == 0.3


@pytest.mark.parametrize("failure", [b"", RefusedError("no"), TimeoutError(), ConnectionError()])
async def test_a_question_without_an_answer_makes_the_link_slower_by_the_second(failure):
    clock = HandClock()
    probe = probe_of(clock, (0.06, ANSWER), (3.0, failure), (3.0, failure), (0.1, ANSWER))
    for _ in range(3):
        await probe.measure()
    assert probe.takes_s(clock.now_s) == pytest.approx(6.0)
    await probe.measure()
    assert probe.takes_s(clock.now_s) == pytest.approx(0.1)


async def test_an_answer_that_cannot_be_read_still_has_a_round_trip():
    clock = HandClock()
    probe = probe_of(clock, (0.06, b"[]"))
    await probe.measure()
    assert probe.takes_s(clock.now_s) == pytest.approx(0.06)
    assert math.isnan(probe.patience_s)


@pytest.mark.parametrize(
    ("link_s", "patience_s", "slow"),
    [(0.06, 0.2, False), (math.nan, math.nan, False), (0.25, math.nan, True), (0.25, 0.3, False), (2.0, 0.2, True)],
)
def test_a_link_slower_than_the_cars_patience_is_never_ready(link_s, patience_s, slow):
    drive = Drive()
    drive.pilot.know_link(link_s, patience_s)
    drive.hold(hands())
    advice = advise(drive.situation)
    assert (advice.state == "LINK SLOW") is slow
    if slow:
        assert advice.mood is AdviceLevel.STOPPED
        assert f"up to {link_s:.1f} s old" in advice.next_step
    shown = "-" if math.isnan(link_s) else f"{link_s * 1000:.0f} ms"
    assert any(f"round trip {shown}" in row for row in lines("car1", drive.situation, advice, CarState(), PAD_NAMES))
