"""The permit's words in both modes."""

import math

from tests.runtime.in_earnest import judged
from wallride.runtime.arbitration.command import LAB_ORDER, NO_LIMIT_MPS
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.permit import NOT_GRANTED, NOT_REQUIRED, Permit


def word(queue):
    """Return (may move, reason) of the permit's word, None while it is silent."""
    live = [judged(said.assessment, 1.0, 0.0) for said in queue.live()]
    return (live[0].forward_mps == NO_LIMIT_MPS, live[0].reason) if live else None


def make(mode):
    now = [0.0]
    queue = CommandQueue(LAB_ORDER, lambda: now[0])
    return now, queue, Permit(queue, mode)


def test_required_is_a_lease():
    now, queue, permit = make("required")
    assert word(queue) == (False, NOT_GRANTED)
    permit.grant(until_s=1.0)
    assert word(queue) == (True, "operator permits")
    now[0] = 1.0
    assert word(queue) is None
    permit.revoke("the lidar was lost; permit again")
    assert word(queue) == (False, "the lidar was lost; permit again")


def test_what_was_not_granted_is_not_revoked():
    _, queue, permit = make("required")
    permit.revoke("the lidar was lost; permit again")
    assert word(queue) == (False, NOT_GRANTED)


def test_always_consents_until_an_operator_refuses():
    now, queue, permit = make("always")
    now[0] = 1e9
    assert word(queue) == (True, NOT_REQUIRED)
    permit.revoke("the lidar was lost; permit again")
    assert word(queue) == (True, NOT_REQUIRED)
    permit.refuse("Ann was lost")
    assert word(queue) == (False, "Ann was lost")
    assert permit.until_s == -math.inf
    permit.rest()
    assert word(queue) == (True, NOT_REQUIRED)


def test_a_refusal_is_said_once():
    now, queue, permit = make("required")
    now[0] = 5.0
    permit.refuse(NOT_GRANTED)
    assert list(queue.ages_s().values()) == [5.0]
    permit.refuse("something else")
    assert list(queue.ages_s().values()) == [0.0]
