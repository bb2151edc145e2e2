"""The permit's words in both modes."""

import math

from runtime.arbitration.command import LAB_ORDER, NO_LIMIT_MPS
from runtime.arbitration.command_queue import CommandQueue
from runtime.arbitration.permit import NOT_GRANTED, NOT_REQUIRED, Permit


def word(voices):
    """Return (may move, reason) of the permit's word, None while it is silent."""
    live = [said.outlook.limit(1.0, 0.0) for said in voices.live()]
    return (live[0].forward_mps == NO_LIMIT_MPS, live[0].reason) if live else None


def make(mode):
    now = [0.0]
    voices = CommandQueue(LAB_ORDER, lambda: now[0])
    return now, voices, Permit(voices, mode)


def test_required_is_a_lease():
    now, voices, permit = make("required")
    assert word(voices) == (False, NOT_GRANTED)
    permit.grant(until_s=1.0)
    assert word(voices) == (True, "operator permits")
    now[0] = 1.0
    assert word(voices) is None
    permit.revoke("the lidar was lost; permit again")
    assert word(voices) == (False, "the lidar was lost; permit again")


def test_what_was_not_granted_is_not_revoked():
    _, voices, permit = make("required")
    permit.revoke("the lidar was lost; permit again")
    assert word(voices) == (False, NOT_GRANTED)


def test_always_consents_until_an_operator_refuses():
    now, voices, permit = make("always")
    now[0] = 1e9
    assert word(voices) == (True, NOT_REQUIRED)
    permit.revoke("the lidar was lost; permit again")
    assert word(voices) == (True, NOT_REQUIRED)
    permit.refuse("Ann was lost")
    assert word(voices) == (False, "Ann was lost")
    assert permit.until_s == -math.inf
    permit.rest()
    assert word(voices) == (True, NOT_REQUIRED)


def test_a_refusal_is_said_once():
    now, voices, permit = make("required")
    now[0] = 5.0
    permit.refuse(NOT_GRANTED)
    assert list(voices.ages_s().values()) == [5.0]
    permit.refuse("something else")
    assert list(voices.ages_s().values()) == [0.0]
