"""Thousands of payloads that are no commands, or not quite: counted, refused, never raised, hardly logged."""

import random
import tracemalloc

import pytest

from tests.runtime.operator_rig import Rig
from tests.runtime.wire.test_teleop import SPOILT, with_bytes
from wallride.runtime.teleop.sessions import MAX_SESSIONS
from wallride.runtime.wire.teleop import COMMAND_BYTES, Malformed, Press, read_command

ROUNDS = 6_000
MUTATED = 4_000
PLACES = list(SPOILT.values())


def spoilt(dice, good):
    """Return noise, a part of a command, more than one, or one with a wrong place in it."""
    kinds = (
        lambda: dice.randbytes(dice.choice([0, 1, 4, 55, 59, 60, 61, 64, 1000])),
        lambda: good[: dice.randrange(COMMAND_BYTES)],
        lambda: good + dice.randbytes(dice.randrange(1, 100)),
        lambda: with_bytes(good, 24, bytes([dice.randrange(128, 256) & ~0b0111])),
        lambda: with_bytes(good, 25, bytes([dice.randrange(4, 256)])),
        *[lambda: with_bytes(good, *dice.choice(PLACES))] * 4,
    )
    return dice.choice(kinds)()


def test_malformed_payloads_are_counted_and_refused(caplog):
    dice = random.Random(4)
    rig = Rig("always")
    before = rig.decision
    for _ in range(ROUNDS):
        rig.now_s += 0.0025
        good = rig_command(rig, dice.choice([Press(0), Press.MANUAL, Press.RESET, Press.TAKE_OVER, Press.GOODBYE]))
        rig.desk.receive("", spoilt(dice, good), rig.now_s)
    assert rig.refused == {"malformed": ROUNDS}
    assert repr(rig.decision) == repr(before)  # its measure is NaN, which equals nothing
    assert rig.desk.view().sessions == 0
    assert len(caplog.records) < 10


def test_mutated_commands_never_raise_and_take_no_memory(caplog):
    """Any byte of a good command may differ: what still reads as a command is judged as one."""
    dice = random.Random(5)
    rig = Rig("required")
    tracemalloc.start()
    for i in range(MUTATED):
        if i % 20 == 0:
            rig.now_s += 0.02
            rig.beat()
        data = bytearray(rig_command(rig, Press(dice.randrange(128))))
        for _ in range(dice.randrange(3)):
            data[dice.randrange(COMMAND_BYTES)] = dice.randrange(256)
        rig.desk.receive("", bytes(data), rig.now_s)
        if i == MUTATED // 10:
            settled, _ = tracemalloc.get_traced_memory()
    grown = tracemalloc.get_traced_memory()[0] - settled
    tracemalloc.stop()
    view = rig.desk.view()
    assert view.accepted + sum(view.refused.values()) >= MUTATED
    assert view.sessions <= MAX_SESSIONS
    assert grown < 80_000
    assert len(caplog.records) < 120, "few kinds, each at most once in a second of 12"


@pytest.mark.parametrize("seed", range(5))
def test_whatever_is_read_is_a_command_that_packs_to_the_same_bytes(seed):
    dice = random.Random(seed)
    rig = Rig()
    for _ in range(2000):
        data = bytearray(rig_command(rig, Press(dice.randrange(128))))
        data[dice.randrange(COMMAND_BYTES)] ^= 1 << dice.randrange(8)
        try:
            command = read_command(bytes(data))
        except Malformed:
            continue
        assert command.pack() == bytes(data)


def rig_command(rig, flags):
    """Return a command as a client that has heard the newest beat would send it."""
    client = rig.client() if not rig.clients else rig.clients[0]
    return client.make(flags)
