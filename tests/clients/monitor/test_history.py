"""What a page gets of the minutes before it was opened."""

import math

from wallride.clients.monitor.history import APART_S, MAX_CARS, MAX_HISTORY_S, NAMES, CarHistories, PlotHistory
from wallride.runtime.ros import messages
from wallride.runtime.wire import topics

STATUS = {
    "speed_mps": 0.9, "output": {"asked_mps": 1.2, "speed_mps": 1.0, "steering_rad": -0.1},
    "scan_to_motor_ms": {"p99": 2.5},
}  # fmt: skip


def test_it_keeps_what_is_plotted_with_its_age():
    history = PlotHistory()
    history.take(topics.STATUS, topics.encode(STATUS), 100.0)
    history.take(topics.DISTANCE_ERROR, messages.float32(0.25), 100.5)
    history.take_round_trip(0.012, 101.0)
    found = history.fields(102.0)
    assert set(found) == set(NAMES)
    assert {name: (line["age_ms"], line["value"]) for name, line in found.items()} == {
        "error": ([1500], [0.25]), "asked": ([2000], [1.2]), "sent": ([2000], [1.0]), "driven": ([2000], [0.9]),
        "steering": ([2000], [-0.1]), "latency": ([2000], [2.5]), "round_trip": ([1000], [12.0]),
    }  # fmt: skip


def test_it_stays_small_and_forgets_what_is_too_old():
    history = PlotHistory()
    for tick in range(round(MAX_HISTORY_S / 0.025) + 4000):
        history.take(topics.DISTANCE_ERROR, messages.float32(0.1), tick * 0.025)
    now_s = MAX_HISTORY_S + 100
    ages_ms = history.fields(now_s)["error"]["age_ms"]
    assert max(ages_ms) <= MAX_HISTORY_S * 1000
    assert len(ages_ms) <= MAX_HISTORY_S / APART_S
    assert min(b - a for a, b in zip(ages_ms[1:], ages_ms, strict=False)) >= APART_S * 1000 - 1
    assert history.fields(now_s + 2 * MAX_HISTORY_S)["error"]["age_ms"] == []


def test_what_is_no_number_is_a_gap_and_what_is_damaged_is_left_out():
    history = PlotHistory()
    history.take(topics.STATUS, topics.encode({"speed_mps": None, "output": None}), 1.0)
    history.take(topics.DISTANCE_ERROR, messages.float32(math.nan), 1.0)
    history.take(topics.STATUS, b"\xff{", 2.0)
    history.take(topics.DISTANCE_ERROR, b"\0\1", 2.0)
    history.take_round_trip(None, 1.0)
    found = history.fields(2.0)
    assert {tuple(line["value"]) for line in found.values()} == {(None,)}


def test_a_car_is_remembered_before_a_page_watches_it():
    histories = CarHistories()
    histories.take(topics.key("car1", topics.DISTANCE_ERROR), messages.float32(0.25), 100.0)
    histories.take(topics.key("car2", topics.DISTANCE_ERROR), messages.float32(0.5), 100.0)
    assert histories.of("car1").fields(101.0)["error"]["value"] == [0.25]
    assert histories.of("car2").fields(101.0)["error"]["value"] == [0.5]


def test_only_the_selected_start_of_a_car_is_remembered():
    histories = CarHistories(0xCAFE)
    for session, error_m in (("0000beef", 0.1), ("0000cafe", 0.2), ("0000beef", 0.3)):
        histories.take(topics.key("car1", topics.STATUS), topics.encode({**STATUS, "session": session}), 100.0)
        histories.take(topics.key("car1", topics.DISTANCE_ERROR), messages.float32(error_m), 100.0)
    histories.take(topics.key("car1", topics.STATUS), b"{", 101.0)
    assert histories.of("car1").fields(102.0)["error"]["value"] == [0.2]


def test_names_that_never_end_fill_no_memory():
    histories = CarHistories()
    for number in range(3 * MAX_CARS):
        histories.take(topics.key(f"car{number}", topics.DISTANCE_ERROR), messages.float32(0.25), 100.0)
    assert histories.of("car0").fields(101.0)["error"]["value"] == [0.25]
    assert histories.of(f"car{2 * MAX_CARS}").fields(101.0)["error"]["value"] == []


def test_a_status_of_other_types_is_left_out_and_the_next_one_is_kept():
    history = PlotHistory()
    for odd in ({"output": "x"}, {"output": {"asked_mps": 10**400}}, {"scan_to_motor_ms": [1]}):
        history.take(topics.STATUS, topics.encode({"speed_mps": None, **odd}), 100.0)
    history.take(topics.STATUS, topics.encode(STATUS), 110.0)
    assert history.fields(110.0)["sent"]["value"][-1] == 1.0
