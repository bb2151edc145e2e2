"""Young garbage is collected when somebody has time for it, and Python has no reason to do it by itself."""

import gc
import weakref

import pytest

from wallride.runtime.realtime import garbage


class Node:
    itself: "Node | None" = None


@pytest.fixture
def by_hand():
    """Let nothing but the calls collect."""
    gc.collect()
    gc.disable()
    yield
    gc.enable()


def circle():
    node = Node()
    node.itself = node
    return weakref.ref(node)


def collections():
    return [generation["collections"] for generation in gc.get_stats()]


def test_a_circle_is_collected_as_soon_as_enough_has_gathered(by_hand):
    lost = circle()
    garbage.collect_young()
    assert lost() is not None, "too little has gathered"
    kept = [[] for _ in range(garbage.YOUNG + 50)]
    garbage.collect_young()
    assert lost() is None
    assert gc.get_count()[0] < len(kept)


def test_survivors_are_looked_at_now_and_then_and_the_old_never(by_hand):
    before = collections()
    kept = []
    for _ in range(3 * (garbage.OFTEN + 2)):
        kept.append([[] for _ in range(garbage.YOUNG + 50)])
        garbage.collect_young()
    young, middle, old = (now - then for now, then in zip(collections(), before, strict=True))
    assert young > 20
    assert 2 <= middle <= 3
    assert old == 0


def test_python_would_have_waited_longer():
    assert gc.get_threshold()[0] > garbage.YOUNG
