"""The faults of the user's laws and drivers, told from the car's status."""

import pytest

from wallride.runtime.settings.tree import Settings
from wallride.runtime.wire import topics
from wallride.sim.live.listener import LONGEST_S, Listener
from wallride.sim.live.user_code import NO_USER_CODE, UserCode

LAW, DRIVER = "my_laws:Law", "my_lidar:Driver"
FAULT = f"{LAW} raised ValueError: lost (my_laws.py:3)"


def status(session="1", **gates):
    return {"session": session, "gates": {"lidar": "", "motor": "", **gates}, "output": {"reason": "wall"}}


@pytest.mark.parametrize(
    ("said", "found"),
    [
        (status(navigation=FAULT), {FAULT}),
        (status(lidar=f"faulty: {DRIVER} raised E (a.py:1)"), {f"{DRIVER} raised E (a.py:1)"}),
        (status(lidar=f"faulty: {DRIVER}: no scan for 5.1 s"), {f"{DRIVER}: no scan for 5.1 s"}),
        ({"output": {"reason": f"{FAULT}; permit again"}}, {FAULT}),
        (status(navigation=LAW), set()),  # its own reason where it gives none
        (status(navigation="other_laws:Law raised E"), set()),
        (status(lidar="absent: cable", permit=f"{FAULT}; permit again"), set()),
        ({"output": None, "gates": None}, set()),
    ],
)
def test_a_fault_names_its_part_first(said, found):
    assert UserCode((LAW,), DRIVER).faults_in(said) == found
    assert NO_USER_CODE.faults_in(said) == set()


def test_the_beginnings_of_a_fault_are_counted():
    listener = Listener("tcp/127.0.0.1:1", "car1", "1", UserCode((LAW,)))
    key = topics.key("car1", topics.STATUS)
    for gates in ({}, {"navigation": FAULT}, {"navigation": FAULT}, {}, {"navigation": FAULT}):
        listener._on_sample(key, topics.encode(status(**gates)), 0.0)
    listener._on_sample(key, topics.encode(status(session="2", safety=FAULT.replace("lost", "other"))), 0.0)
    assert listener.own_faults == {FAULT: 2}


def test_a_fault_that_goes_on_with_another_number_has_not_begun_again():
    listener = Listener("tcp/127.0.0.1:1", "car1", "1", UserCode((), DRIVER))
    key, silent = topics.key("car1", topics.STATUS), f"{DRIVER}: no scan for %s (it waits in my_lidar.py:%d)"
    for text, line in (("0.5 s", 40), ("0.6 s", 40), ("2 s", 40), ("2 s", 44)):
        listener._on_sample(key, topics.encode(status(lidar=f"faulty: {silent % (text, line)}")), 0.0)
    assert listener.own_faults == {silent % ("0.5 s", 40): 1, silent % ("2 s", 44): 1}


def test_for_how_long_the_car_decided_for_which_reason_is_summed():
    listener = Listener("tcp/127.0.0.1:1", "car1", "1")
    key = topics.key("car1", topics.STATUS)
    for stamp_s, reason in ((5.0, "wall"), (5.5, "wall"), (6.0, "wall ahead"), (9.0, "wall"), (9.5, "wall")):
        told = {"session": "1", "stamp_s": stamp_s, "output": {"reason": reason}}
        listener._on_sample(key, topics.encode(told), 0.0)
    assert listener.reasons_s == {"wall": 1.5, "wall ahead": LONGEST_S}


def test_the_built_in_parts_are_none_of_the_users():
    assert UserCode.of(Settings()) == NO_USER_CODE
