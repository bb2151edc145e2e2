"""Laps, gaps and positions in virtual time: overtakes, stops, late cars, lost links, restarts, drifting odometry."""

import math

import pytest

from wallride.clients.connection import ConnectionProblemError
from wallride.clients.fleet.lap_timer import MAX_HIDDEN, StartLine, line_between
from wallride.clients.fleet.race import Order, RaceControl
from wallride.clients.fleet.race_command import lines_of, table

RADIUS_M = 3.0
ROUND_M = math.tau * RADIUS_M
LINE = line_between((-0.0, 1.0), (0.0, -1.0))
STATUS_S = 0.1


class Racer:
    """A car on a circle that passes the origin of its odometry heading for +x. way_m: driven."""

    def __init__(self, name, speed_mps, *, way_m=0.0, clock_s=0.0, delay_s=0.0, drift_rad=0.0):
        self.name, self.speed_mps, self.way_m = name, speed_mps, way_m
        self.clock_s, self.delay_s, self.drift_rad = clock_s, delay_s, drift_rad
        self.session, self.heard = "0a", True
        self.origin_m = way_m

    def status(self, now_s):
        angle_rad = self.way_m / RADIUS_M
        x_m, y_m = RADIUS_M * math.sin(angle_rad), RADIUS_M * (1 - math.cos(angle_rad))
        turned_rad = self.drift_rad * self.way_m / ROUND_M
        odom = {
            "x_m": x_m * math.cos(turned_rad) - y_m * math.sin(turned_rad),
            "y_m": x_m * math.sin(turned_rad) + y_m * math.cos(turned_rad),
            "yaw_rad": math.remainder(angle_rad + turned_rad, math.tau),
        }
        return {"session": self.session, "stamp_s": now_s + self.clock_s, "odom": odom}


class Track:
    """The cars, race control and one clock."""

    def __init__(self, *racers, line=LINE):
        self.race = RaceControl({"": line} if line is not None else None)
        self.racers, self.now_s, self.step = racers, 0.0, 0

    def run(self, seconds):
        for _ in range(round(seconds / STATUS_S)):
            self.step += 1
            self.now_s = self.step * STATUS_S
            for racer in self.racers:
                racer.way_m += racer.speed_mps * STATUS_S
                if racer.heard:
                    self.race.take(racer.name, racer.status(self.now_s), self.now_s + racer.delay_s)
        return self

    def row(self, name, order=Order.LAPS):
        return next(one for one in self.race.standings(self.now_s, order) if one.car == name)

    def names(self, order=Order.LAPS):
        return [one.car for one in self.race.standings(self.now_s, order)]


def test_a_lap_takes_the_way_round_over_the_speed_between_two_statuses():
    track = Track(Racer("a", 2.0, way_m=-0.55)).run(0.55 / 2.0 + 3.02 * ROUND_M / 2.0)
    row = track.row("a")
    assert row.laps == 3
    assert row.best_s == pytest.approx(ROUND_M / 2.0, abs=0.005), "the crossing lies within a step of 0.1 s"
    assert (row.gap_s, row.note, row.unseen) == (0.0, "", 0)


def test_a_line_without_points_is_where_the_car_stands():
    racer = Racer("a", 0.0, way_m=5.0)
    track = Track(racer, line=None).run(4.0)
    assert (track.row("a").note, track.row("a").laps) == ("has not started", 0)
    racer.speed_mps = 2.0
    track.run(2.05 * ROUND_M / 2.0)
    assert track.row("a").laps == 2
    assert track.row("a").best_s == pytest.approx(ROUND_M / 2.0, abs=0.01)


def test_an_overtaking_car_becomes_first_when_it_crosses_the_line_before_the_other():
    slow, fast = Racer("slow", 1.5, way_m=-1.0), Racer("fast", 1.5, way_m=-2.0)
    track = Track(slow, fast).run(1.2 * ROUND_M / 1.5)
    assert track.names() == ["slow", "fast"]
    assert track.row("fast").gap_s == pytest.approx(1.0 / 1.5, abs=0.02)
    fast.speed_mps = 2.5
    track.run(ROUND_M / 1.5)
    assert track.names() == ["fast", "slow"]
    assert track.row("fast").gap_s == 0.0
    assert track.row("slow").gap_s > 0.0 or track.row("slow").laps_down


def test_time_goes_on_against_a_car_that_stops_and_a_whole_lap_is_said():
    leader, stopped = Racer("leader", 2.0, way_m=-0.5), Racer("stopped", 2.0, way_m=-1.5)
    lap_s = ROUND_M / 2.0
    track = Track(leader, stopped).run(1.2 * lap_s)
    assert track.row("stopped").gap_s == pytest.approx(0.5, abs=0.02)
    stopped.speed_mps = 0.0
    track.run(4.0)
    assert track.row("stopped").gap_s == pytest.approx(0.5, abs=0.02), "it may still come in time"
    assert track.row("stopped").note == "stands for 4 s"
    track.run(lap_s)
    later_s = track.row("stopped").gap_s
    assert later_s is not None
    track.run(1.0)
    assert track.row("stopped").gap_s == pytest.approx(later_s + 1.0, abs=0.01), "a second per second"
    track.run(lap_s)
    assert (track.row("stopped").gap_s, track.row("stopped").laps_down) == (None, 1)
    track.run(lap_s)
    assert track.row("stopped").laps_down == 2


def test_a_lapped_car_stays_lapped_when_it_crosses_the_line_itself():
    leader, slow = Racer("leader", 3.0, way_m=-0.5), Racer("slow", 1.0, way_m=-0.5)
    track = Track(leader, slow).run(1.1 * ROUND_M / 1.0)
    row = track.row("slow")
    assert row.laps == 1
    assert row.laps_down == 2, "three laps against one at the slow car's crossing"


def test_a_car_that_joins_late_is_last_and_its_best_lap_counts():
    early, late = Racer("early", 1.5, way_m=-0.5), Racer("late", 2.5, way_m=-0.5)
    late.heard, late.speed_mps = False, 0.0
    track = Track(early, late).run(2.1 * ROUND_M / 1.5)
    late.heard, late.speed_mps = True, 2.5
    track.run(1.3 * ROUND_M / 2.5)
    assert track.names() == ["early", "late"]
    assert track.row("late").laps == 1
    assert track.row("late").laps_down >= 1
    assert track.names(Order.BEST) == ["late", "early"]
    assert track.row("early", Order.BEST).gap_s == pytest.approx(ROUND_M / 1.5 - ROUND_M / 2.5, abs=0.02)


def test_laps_that_a_lost_link_hid_are_reckoned_and_said():
    racer = Racer("a", 2.0, way_m=-0.5)
    lap_s = ROUND_M / 2.0
    track = Track(racer).run(2.3 * lap_s)
    assert (track.row("a").laps, track.row("a").unseen) == (2, 0)
    racer.heard = False
    track.run(1.2 * lap_s)
    assert track.row("a").note.startswith("not heard for")
    racer.heard = True
    track.run(lap_s)
    row = track.row("a")
    assert (row.laps, row.unseen) == (4, 2), "the two whose ends were not both seen"
    assert row.best_s == pytest.approx(lap_s, abs=0.01)
    track.run(lap_s)
    assert (track.row("a").laps, track.row("a").unseen) == (5, 2), "then as before"


def test_a_link_lost_within_a_lap_costs_nothing():
    racer = Racer("a", 2.0, way_m=-0.5)
    track = Track(racer).run(1.2 * ROUND_M / 2.0)
    racer.heard = False
    track.run(2.5)
    racer.heard = True
    track.run(ROUND_M / 2.0)
    assert (track.row("a").laps, track.row("a").unseen) == (2, 0)


@pytest.mark.parametrize("known", [True, False])
def test_a_silence_that_begins_behind_the_line_and_ends_before_it_hides_no_crossing_that_was_seen(known):
    racer = Racer("a", 1.0, way_m=-0.5)
    track = Track(racer).run(0.7 + known * ROUND_M)
    for lap in (1, 2):
        for seconds, racer.heard in ((3.0, True), (ROUND_M - 4.4, False), (1.5, True)):
            track.run(seconds)
        row = track.row("a")
        assert (row.laps, row.unseen) == (lap + known, 0 if known else lap)
        assert row.last_s == pytest.approx(ROUND_M, abs=0.01)


def test_a_car_that_rocks_on_the_line_or_backs_over_it_drives_no_laps():
    racer = Racer("a", 2.0, way_m=-0.5)
    track = Track(racer).run(1.02 * ROUND_M / 2.0 + 0.25)
    assert track.row("a").laps == 1
    for speed_mps in (-2.0, 2.0) * 5:
        racer.speed_mps = speed_mps
        track.run(0.6)
    assert track.row("a").laps == 1
    racer.speed_mps = -2.0
    track.run(2.5)
    racer.speed_mps = 2.0
    track.run(3.0)
    assert track.row("a").laps == 1, "back over the line and forward again, 5 m each"
    track.run(ROUND_M / 2.0)
    assert track.row("a").laps == 2


def test_neither_the_clock_of_a_car_nor_a_slow_link_is_in_its_lap_times():
    plain, odd = Racer("plain", 2.0, way_m=-0.5), Racer("odd", 2.0, way_m=-0.5, clock_s=-5e4)
    track = Track(plain, odd)
    for k in range(200):
        odd.delay_s = 0.02 if k % 10 == 0 else 0.3
        track.run(STATUS_S)
    assert track.row("odd").last_s == pytest.approx(track.row("plain").last_s, abs=1e-6)
    behind = next(one for one in track.race.standings(track.now_s) if one.position == 2)
    assert behind.gap_s == pytest.approx(0.02, abs=0.005), "the link's shortest time, not its longest"


def test_a_restarted_program_keeps_its_laps_and_loses_the_one_under_way():
    racer = Racer("a", 2.0, way_m=-0.5)
    track = Track(racer).run(1.5 * ROUND_M / 2.0)
    racer.session = "0b"
    track.run(ROUND_M / 2.0)
    assert (track.row("a").laps, track.row("a").note) == (1, "its odometry began anew")
    track.run(ROUND_M / 2.0)
    assert track.row("a").laps == 2


def test_a_pose_that_jumps_is_odometry_that_began_anew_and_no_lap():
    track = Track(Racer("a", 2.0, way_m=-0.5)).run(1.9 * ROUND_M / 2.0)
    assert track.row("a").laps == 1
    track.racers[0].way_m += ROUND_M / 2
    track.run(0.5)
    assert (track.row("a").laps, track.row("a").note) == (1, "its odometry began anew")


@pytest.mark.parametrize("drift_rad", [-0.12, 0.12])
def test_the_line_goes_along_with_odometry_that_turns(drift_rad):
    """7 degrees a lap: after 20 laps the way has turned by 140 degrees, away from where the line was."""
    track = Track(Racer("a", 2.0, drift_rad=drift_rad), line=None).run(20.5 * ROUND_M / 2.0)
    row = track.row("a")
    assert row.laps in {20, 21}
    assert row.last_s == pytest.approx(ROUND_M / 2.0, abs=0.6)


def test_a_message_that_a_second_route_brings_late_changes_nothing():
    racer = Racer("a", 2.0, way_m=-0.5)
    track, late = Track(racer), []
    for _ in range(250):
        late.append(racer.status(track.now_s))
        track.run(STATUS_S)
        if len(late) > 3:
            track.race.take("a", late[-3], track.now_s)
    assert (track.row("a").laps, track.row("a").note) == (2, "")


def test_what_is_no_status_is_left_out():
    race = RaceControl()
    good = Racer("a", 1.0).status(0.0)
    for broken in (
        {},
        {**good, "odom": None},
        {**good, "stamp_s": None},
        {**good, "odom": {**good["odom"], "x_m": 1e999}},
        {**good, "odom": {**good["odom"], "yaw_rad": 1e300}},
        {**good, "stamp_s": 10**400},
    ):
        race.take("a", broken, 0.0)
    assert race.standings(0.0) == []


def test_a_car_with_an_odd_clock_does_not_fill_the_memory_with_laps():
    racer = Racer("a", 2.0)
    track = Track(racer).run(35.0)
    assert track.row("a").laps == 2
    racer.clock_s, racer.way_m = 9e8, racer.way_m + 3.0
    track.run(10.0)
    assert 2 < track.row("a").laps <= 2 + MAX_HIDDEN + 1


def test_a_new_race_begins_with_no_laps():
    track = Track(Racer("a", 2.0, way_m=-0.5)).run(1.2 * ROUND_M / 2.0)
    track.race.begin()
    track.run(0.2)
    assert track.row("a").laps == 0


def test_a_line_of_two_points_is_crossed_by_its_width_and_in_its_direction():
    line = line_between((0.0, 1.0), (0.0, -1.0))
    crossing = line.crossing((-0.3, 0.5), (0.1, 0.5))
    assert crossing is not None
    assert crossing.share == pytest.approx(0.75)
    assert crossing.forward
    back = line.crossing((0.1, -0.5), (-0.3, -0.5))
    assert back is not None
    assert not back.forward
    assert line.crossing((-0.3, 1.1), (0.1, 1.1)) is None, "past its end"
    with pytest.raises(ValueError, match="two different points"):
        line_between((1.0, 1.0), (1.0, 1.0))


def test_lines_are_read_by_car_and_a_wrong_one_is_refused_in_words():
    lines = lines_of(["0,1,0,-1", "car2=2,1,2,-1"])
    assert isinstance(lines[""], StartLine)
    assert lines[""].yaw_rad == pytest.approx(0.0)
    assert lines[""].half_width_m == 1.0
    assert lines["car2"].x_m == 2.0
    for wrong in ("0,1,0", "0,1,0,b", "0,0,0,0", "0,1,0,nan"):
        with pytest.raises(ConnectionProblemError, match=r"X1,Y1,X2,Y2"):
            lines_of([wrong])


def test_the_table_has_a_line_for_each_car_and_explains_its_signs():
    racer = Racer("a", 2.0, way_m=-0.5)
    track = Track(racer, Racer("b", 1.0, way_m=-0.5)).run(1.3 * ROUND_M / 2.0)
    racer.heard = False
    track.run(1.2 * ROUND_M / 2.0)
    racer.heard = True
    track.run(ROUND_M / 2.0)
    head, first, second, sign, mute = table(track.race.standings(track.now_s), ["c"])
    assert head.split() == ["car", "laps", "last", "best", "gap"]
    assert first.split()[:3] == ["1", "a", "3~"]
    assert second.split()[:5] == ["2", "b", "1", "18.85", "18.85"]
    assert sign.startswith("~ ")
    assert mute.split() == ["c", "says", "nothing"]
