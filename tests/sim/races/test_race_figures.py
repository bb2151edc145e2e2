"""Figures and table of races, of drives whose truth is known."""

import math
from dataclasses import replace
from itertools import product

import numpy as np
import pytest

from tests.runtime.control.line_following.lines import circle
from tests.runtime.observed import scan_at
from wallride.runtime.arbitration.command import NO_LIMIT_MPS, Source, Verdict
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.lab.cell import course_name
from wallride.sim.lab.courses.sudden import FREE, BrakingGuard
from wallride.sim.lab.figures import common
from wallride.sim.lab.safety import DISTANCES_M
from wallride.sim.races.boxes import LEAST_MPS, MOVING, STANDING, SUDDEN, box_figures, with_box
from wallride.sim.races.mapped_lap import WHEELS, KeyframePoses
from wallride.sim.races.race_cell import RaceCell, case_of, figures_of, lap_begins, not_raced
from wallride.sim.races.race_table import COLUMNS, tables
from wallride.sim.virtual.closed_loop import FirstContact, SimulatedRun, SimulatedStop
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world

LINE = circle(3.0)
LAP_SCANS = 100
SAME = KeyframePoses(np.zeros((1, 3)), np.zeros((1, 3)))


def cell(course="loop", law="line+swept", seed=0, **more):
    return RaceCell("races", course, law, 6.0, 0.8, "left", seed, **more)


def run_of(laps, radius_m=3.0, stops=(), contact=None):
    """Return a drive round the circle, LAP_SCANS scans of 0.1 s each a lap."""
    count = round(laps * LAP_SCANS) + 1
    turn = math.tau * np.arange(count) / LAP_SCANS
    pose = np.column_stack([radius_m * np.cos(turn), radius_m * np.sin(turn), turn + math.pi / 2])
    pairs, ones = np.ones((count, 2)), np.ones(count)
    return SimulatedRun(
        case_of(cell(), load_world("loop"), LINE), 0.1 * np.arange(count), pose, pairs, pairs, pairs, 0 * ones, ones,
        ones, 0 * ones, laps * LINE.length_m, list(stops), contact, ["race line"] * count,
    )  # fmt: skip


def row(one=None, **more):
    one = one or cell()
    run = run_of(5.0)
    figures = {"reason": "", "theory_s": 9.0, **figures_of(run, LINE, SAME)}
    return one.named(common(run) | figures | more)


def test_laps_begin_where_the_start_line_is_passed():
    run = run_of(3.3)
    places = run.pose[:, 0] + 1j * run.pose[:, 1]
    assert lap_begins(places, LINE) == pytest.approx([0, LAP_SCANS, 2 * LAP_SCANS, 3 * LAP_SCANS], abs=1)


def test_times_and_errors_are_those_of_the_laps_that_count():
    figures = figures_of(run_of(5.2, radius_m=3.1), LINE, SAME)
    assert figures["laps_driven"] == len(figures["lap_times_s"]) == 5
    assert figures["lap_s"] == pytest.approx(10.0, abs=0.11)
    assert figures["rms_m"] == pytest.approx(0.1, abs=0.002)
    assert figures["p99_m"] == pytest.approx(0.1, abs=0.002)


def test_a_race_that_ends_early_has_no_lap_that_counts():
    figures = figures_of(run_of(2.5), LINE, SAME)
    assert (figures["laps_driven"], figures["lap_s"], figures["rms_m"], figures["p99_m"]) == (2, None, None, None)


def test_only_safetys_stops_of_a_moving_car_are_hard_ones():
    stops = [
        SimulatedStop(1.0, "too near ahead", Source.SAFETY, 0.1, 4.0),
        SimulatedStop(2.0, "too near ahead", Source.SAFETY, 0.1, 0.1),
        SimulatedStop(3.0, "no word", Source.NAVIGATION, 0.1, 4.0),
    ]
    figures = figures_of(run_of(5.0, stops=stops), LINE, SAME)
    assert (figures["hard_stops"], figures["hard_stops_at"]) == (1, [[1.0, 4.0, "too near ahead"]])


def test_true_poses_are_put_on_the_map_by_the_keyframes_around_them():
    true = np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [50.0, 0.0, 0.0], [51.0, 0.0, 0.0]])
    found = np.array([[5.0, 5.0, 0.1], [5.0 + math.cos(0.1), 5.0 + math.sin(0.1), 0.1], [0, 0, 0], [1, 0, 0]])
    poses = KeyframePoses(true, found)
    at = complex(5.0, 5.0) + 0.5 * np.exp(0.1j)
    assert poses.of(np.array([[0.5, 0.0, 0.2]]), keyframes=2)[0] == pytest.approx([at.real, at.imag, 0.3])
    assert SAME.of(np.array([[2.0, 3.0, 0.4]]))[0] == pytest.approx([2.0, 3.0, 0.4])


def test_wrong_assumptions_are_those_of_the_true_car():
    usual, case = VehicleSettings(), case_of(cell(delay_s=0.02, stiffness=0.7), load_world("loop"), LINE)
    assert case.vehicle.steering_delay_s == pytest.approx(usual.steering_delay_s + 0.02)
    assert case.vehicle.cornering_front_per_rad == pytest.approx(0.7 * usual.cornering_front_per_rad)
    assert case.vehicle.cornering_rear_per_rad == pytest.approx(0.7 * usual.cornering_rear_per_rad)
    assert case.vehicle.grip_mu == 0.8
    assert case.wiring is not None
    assert case.wiring.speed_share == pytest.approx(1 / WHEELS)


def test_a_row_has_the_laws_figures_beside_published_ones():
    levine = row(cell("/data/maps/levine.yaml"), rms_m=0.03, p99_m=0.08, hard_stops=1)
    other = row(cell("/data/maps/levine.yaml", seed=1), rms_m=0.04, p99_m=0.12, lap_s=12.0)
    ball = row(cell("/data/maps/levine.yaml", "ball+swept"))
    (table,) = tables([levine, other, ball])
    by_line, by_wall = (dict(zip(COLUMNS, line, strict=True)) for line in table.rows)
    assert (by_line["course"], by_line["law"], by_line["laps"]) == ("levine", "line+swept", "10")
    assert (by_line["theory s"], by_line["published s"]) == ("9.00", "16")
    assert (by_line["error rms cm"], by_line["p99 cm"]) == ("3.5", "12")
    assert (by_line["hard stops"], by_line["contacts"]) == ("1", "0")
    assert (by_wall["theory s"], by_wall["error rms cm"], by_wall["p99 cm"]) == ("-", "-", "-")
    notes = "\n".join(table.notes)
    assert "line+swept: 10 laps, 0 contacts, 1 hard stops per 10 laps" in notes
    assert "levine: a real car: the University of Pennsylvania's full mark" in notes


def test_contacts_races_that_end_early_and_courses_without_a_race_are_told():
    touched = run_of(2.5, contact=FirstContact(25.0, 3.0, Pose(0.0, 0.0, 0.0)))
    figures = {"reason": "", "theory_s": 9.0, **figures_of(touched, LINE, SAME)}
    short = cell("track:seed=7").named(common(touched) | figures)
    refused = row(cell("/maps/gbr.yaml"), map_refused="the map is refused: the ring is open; drive the lap again")
    (table,) = tables([short, not_raced(cell("/maps/hall.yaml"), "no way round"), refused])
    assert [line[0] for line in table.rows] == ["track:seed=7", "gbr"]
    assert table.rows[0][COLUMNS.index("contacts")] == "1"
    assert table.rows[0][COLUMNS.index("lap s")] == "-"
    notes = "\n".join(table.notes)
    assert "track:seed=7, line+swept, seed 0: 2 laps, then a contact" in notes
    assert "hall: not raced: no way round" in notes
    assert "gbr: raced, although the map is refused: the ring is open" in table.notes


def test_the_title_names_what_is_not_as_assumed():
    plain, wrong = (tables([row(one)])[0].title for one in (cell(), cell(assumed=1.2, delay_s=0.02, stiffness=0.7)))
    assert plain == "mu 0.8: 5 laps, at most 6 m/s"
    assert wrong == f"{plain}, friction assumed 1.2 times as high, servo +20 ms, tyres 0.7 times as stiff"


@pytest.mark.parametrize(
    ("course", "name"), [("/far/levine.yaml", "levine"), ("levine.yaml", "levine"), ("loop", "loop")]
)
def test_a_course_has_a_short_name(course, name):
    assert course_name(course) == name


def test_a_box_stands_on_the_line_or_beside_it_where_the_map_lies_in_the_world():
    turned = KeyframePoses(np.array([[10.0, 0.0, 0.5]]), np.array([[0.0, 0.0, 0.0]]))
    asides = set()
    for seed in range(12):
        case = replace(case_of(cell(seed=seed), load_world("loop"), LINE), seed=seed)
        (box,) = with_box(case, STANDING, LINE, turned).obstacles
        place = (complex(box.appearance.pose.x_m, box.appearance.pose.y_m) - 10.0) * np.exp(-0.5j)
        on = LINE.nearest(place)
        asides.add(round(on.aside_m, 1))
        assert on.along_m >= 0.39 * LINE.length_m, "the car has its speed there"
        assert math.remainder(box.appearance.pose.yaw_rad - 0.5 - on.yaw_rad, math.tau) == pytest.approx(0.0, abs=0.05)
    assert asides <= {-0.2, -0.1, 0.0, 0.1, 0.2}
    assert len(asides) > 1


def test_a_moving_box_crosses_the_line_or_goes_ahead_on_it_when_the_car_comes():
    alone, ways = run_of(1.2), set()
    for seed in range(12):
        case = replace(case_of(cell(seed=seed), load_world("loop"), LINE), seed=seed)
        ((box,), (there,)) = (
            with_box(case, kind, LINE, SAME, alone if kind == MOVING else None).obstacles for kind in (MOVING, STANDING)
        )
        motion, began, place = box.motion, box.appearance.pose, there.appearance.pose
        speed_mps = math.hypot(motion.x_mps, motion.y_mps)
        assert 0.3 <= speed_mps <= 1.0
        at = LINE.nearest(complex(place.x_m, place.y_m))
        comes_s = at.along_m / LINE.length_m * LAP_SCANS * 0.1
        moved_s = motion.moved_s(0.0, comes_s)
        off_m = math.hypot(
            began.x_m + motion.x_mps * moved_s - place.x_m, began.y_m + motion.y_mps * moved_s - place.y_m
        )
        turn_rad = math.remainder(math.atan2(motion.y_mps, motion.x_mps) - place.yaw_rad, math.tau)
        ways.add(round(math.degrees(turn_rad)))
        assert off_m <= (2.5 if seed % 2 else 0.4)
        assert (began == place) == bool(seed % 2)
        assert motion.until_s > comes_s - 1.5
    assert ways <= {0, 90, -90}
    assert len(ways) > 1


def test_sudden_boxes_come_at_all_28_distances_and_speeds():
    case = case_of(cell(), load_world("loop"), LINE)
    boxes = [with_box(replace(case, seed=seed), SUDDEN, LINE, SAME).obstacles[0].appearance for seed in range(28)]
    assert {(box.ahead_m, box.min_speed_mps) for box in boxes} == set(product(DISTANCES_M, LEAST_MPS))


def test_a_contact_counts_by_what_a_full_brake_leaves():
    contact, brake = (FirstContact(1.0, speed_mps, Pose(0.0, 0.0, 0.0)) for speed_mps in (3.0, 2.8))
    hit, braked = run_of(1.0, contact=contact), run_of(1.0, contact=brake)
    assert box_figures(hit, braked)["excess_mps"] == pytest.approx(0.2)
    assert box_figures(hit, None)["excess_mps"] == 3.0
    assert box_figures(run_of(1.0), None)["excess_mps"] == 0.0
    assert not box_figures(run_of(1.0), None)["box_shown"]


def test_the_table_of_boxes_counts_what_was_touched():
    contact, rows = FirstContact(1.0, 3.0, Pose(0.0, 0.0, 0.0)), []
    for box_run in (run_of(1.0, contact=contact), run_of(1.0)):
        box_run.appeared[40:] = 1.0
        figures = {"reason": "", **figures_of(box_run, LINE, SAME), **box_figures(box_run, None)}
        rows.append(cell(box=SUDDEN).named(common(box_run) | figures))
    (table,) = tables(rows)
    assert table.rows == (("loop", "line+swept", "2", "2", "1.0", "1", "1", "3.00", "2"),)
    assert table.title.startswith("mu 0.8: a sudden box in the way")
    assert table.notes[0].startswith("all by line+swept: drives 2, box there 2")


def test_the_full_brake_judges_as_the_guard_does_until_the_box_shows():
    ever, brake = Verdict(1.0, 1.0, "as ever"), Verdict(0.0, NO_LIMIT_MPS, "full brake")

    class Guard:
        def look(self, scan, motor):
            return ever

        def learn(self):
            pass

    for guard, before in ((Guard(), ever), (None, FREE)):
        braking = BrakingGuard(guard, 2.0)
        assert [braking.look(scan_at(time_s), None) for time_s in (1.975, 2.0, 2.025)] == [before, brake, brake]
