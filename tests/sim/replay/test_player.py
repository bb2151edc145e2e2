"""A recording on a timeline: played at any speed, paused, scrubbed; and the keys that do it."""

import pytest

from tests.runtime.observed import HandClock
from wallride.runtime.wire import topics
from wallride.sim.replay.drive_log import DriveLog, LoggedMessage
from wallride.sim.replay.keys import names, press
from wallride.sim.replay.player import FASTEST, Player


def message(at_s, topic=topics.STATUS):
    return LoggedMessage(topic, "", 1_000_000_000_000 + round(at_s * 1e9), f"{topic} {at_s}".encode())


@pytest.fixture
def clock():
    return HandClock()


def player_of(clock, **options):
    log = DriveLog("made", [message(at_s / 10, topic) for at_s in range(101) for topic in (topics.STATUS, topics.SCAN)])
    log.messages += [message(0.05, "tape"), message(0.05, "log"), message(0.05, "settings")]
    return Player(log, clock, **options)


def played(player, clock, seconds, step_s=0.01):
    found = []
    for _ in range(round(seconds / step_s)):
        clock.now_s += step_s
        found += player.due()
    return found


def test_everything_is_played_once_and_in_order(clock):
    player = player_of(clock)
    found = played(player, clock, 11)
    assert len(found) == 202
    assert found == sorted(found, key=lambda message: message.stamp_ns)
    assert {message.topic for message in found} == {topics.STATUS, topics.SCAN}
    assert player.ended


@pytest.mark.parametrize(("speed", "expected"), [(0.5, 5.0), (1.0, 10.0), (2.0, 20.0)])
def test_speed_is_speed(clock, speed, expected):
    player = player_of(clock, speed=speed)
    assert len(played(player, clock, 1.0)) == pytest.approx(2 * expected, abs=4)
    assert player.position_s == pytest.approx(speed)


def test_a_pause_stands_still_and_goes_on_from_there(clock):
    player = player_of(clock)
    played(player, clock, 2)
    player.paused = True
    assert played(player, clock, 3) == []
    player.paused = False
    played(player, clock, 1)
    assert player.position_s == pytest.approx(3.0, abs=0.02)


def test_a_jump_shows_the_picture_of_that_moment_even_while_paused(clock):
    player = player_of(clock)
    player.paused = True
    player.seek(5.05)
    assert {message.payload for message in player.due()} == {b"status 5.0", b"scan 5.0"}
    assert player.due() == []
    player.seek(-3)
    assert player.position_s == 0.0
    player.seek(99)
    assert player.position_s == player.duration_s == 10.0


def test_a_player_that_was_held_up_does_not_fire_all_it_missed(clock):
    player = player_of(clock)
    clock.now_s += 60
    assert len(player.due()) < 14


def test_it_begins_anew_where_it_is_asked_to(clock):
    player = player_of(clock, loops=True)
    found = played(player, clock, 25)
    assert not player.ended
    assert 480 <= len(found) <= 520


@pytest.mark.parametrize(
    ("wish", "status"),
    [
        ({"pause": True}, {"paused": True}),
        ({"speed": 2}, {"speed": 2.0}),
        ({"seek_s": 7.5}, {"position_s": 7.5}),
        ({"seek_s": 1, "pause": True, "speed": 0.5}, {"position_s": 1.0, "paused": True, "speed": 0.5}),
        ({}, {"paused": False, "duration_s": 10.0}),
    ],
)
def test_questions_are_obeyed(clock, wish, status):
    player = player_of(clock)
    player.handle_request(wish)
    assert status.items() <= player.status().items()


@pytest.mark.parametrize(
    "wish",
    [
        {"stop": 1}, {"pause": 1}, {"speed": 0}, {"speed": "fast"}, {"speed": 1e9}, {"seek_s": float("nan")},
        {"seek_s": True}, [1], None,
    ],
)  # fmt: skip
def test_nonsense_is_refused_and_changes_nothing(clock, wish):
    player = player_of(clock)
    before = player.status()
    with pytest.raises(ValueError, match=r"ask for|is true or false|is a number|write an object"):
        player.handle_request(wish)
    assert player.status() == before


def test_a_log_with_nothing_to_show_has_no_length(clock):
    player = Player(DriveLog("empty", [message(0.0, "tape")]), clock)
    assert (player.duration_s, player.due(), player.picture()) == (0.0, [], [])


def test_keys_are_found_in_what_a_terminal_sends():
    assert names(b" \x1b[C\x1bOD\x1b[6~\x1b[5~\x1b[H+=-q") == [
        "space", "right", "left", "page down", "page up", "home", "+", "+", "-", "q",
    ]  # fmt: skip
    assert names(b"\x1b[99zx\xff") == []


def test_keys_steer(clock):
    player = player_of(clock)
    assert press(player, "space")
    assert player.paused
    press(player, "right")
    assert player.position_s == 5.0
    press(player, "page up")
    assert player.position_s == 0.0
    press(player, "page down")
    press(player, "home")
    assert player.position_s == 0.0
    for _ in range(20):
        press(player, "+")
    assert player.speed == FASTEST
    press(player, "-")
    assert player.speed == FASTEST / 2
    assert not press(player, "q")


def test_the_picture_of_any_moment_has_the_map_from_the_beginning(clock):
    log = DriveLog("made", [message(0.1, topics.MAP), *(message(at_s) for at_s in range(60))])
    player = Player(log, clock)
    for position_s in (50.0, 0.05):
        player.seek(position_s)
        assert (topics.MAP in {one.topic for one in player.picture()}) == (position_s > 0.1)
