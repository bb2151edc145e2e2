"""The simulator's conditions: named one by one, refused in words, changed while it drives."""

import json
import re

import numpy as np
import pytest

from wallride.runtime.wire.network import RefusedError
from wallride.sim.car.vehicle import SpeedDemand, Vehicle
from wallride.sim.live.live_conditions import ACTIONS, KEYS, LiveConditions
from wallride.sim.live.live_keys import LEGEND, handle_keys, legend
from wallride.sim.live.scenes import WorldScene
from wallride.sim.live.stop_request import StopRequest
from wallride.sim.scenario.conditions import (
    Conditions,
    ConditionsError,
    RequestedConditions,
    checked_conditions,
    conditions_of,
    own_parts_kinds,
)
from wallride.sim.scenario.obstacle_text import read_obstacle
from wallride.sim.world.beams import NO_RETURN_MM
from wallride.sim.world.obstacles import Box, ConstantMotion, Obstacle, Round, StandingObstacle, SuddenObstacle
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world


def corridor(conditions=None):
    """Return a scene in a corridor, the car in it, and what changes both."""
    at_start = conditions or Conditions()
    world = load_world("corridor", side="left")
    scene = WorldScene(world, "left", at_start.lidar, None, 1, at_start.things())
    vehicle = Vehicle(at_start.vehicle, world.start)
    return scene, vehicle, LiveConditions(vehicle, scene, at_start)


def looked(scene, vehicle, time_s=0.0):
    scene.step(time_s, vehicle)
    found = scene.scan(time_s, vehicle)
    assert found is not None
    return found[0]


@pytest.mark.parametrize(
    ("text", "obstacle"),
    [
        ("box at=3,1", Obstacle(Box(0.3, 0.5), StandingObstacle(Pose(3, 1, 0)))),
        ("box at=3,1,0.7 size=0.2x0.8", Obstacle(Box(0.2, 0.8), StandingObstacle(Pose(3, 1, 0.7)))),
        ("box ahead=1.5 after=4", Obstacle(Box(0.3, 0.5), SuddenObstacle(1.5, 0.0, 0.0, 4.0))),
        ("box ahead=1 left=0.2 speed=2", Obstacle(Box(0.3, 0.5), SuddenObstacle(1.0, 0.2, 2.0))),
        ("pole at=3,1 radius=0.03", Obstacle(Round(0.03), StandingObstacle(Pose(3, 1, 0)))),
        (
            "person at=3,-1 walks=0,0.8 after=2 until=5",
            Obstacle(Round(0.2), StandingObstacle(Pose(3, -1, 0), 2.0), ConstantMotion(0.0, 0.8, 2.0, 5.0)),
        ),
    ],
)
def test_an_obstacle_is_one_line(text, obstacle):
    assert read_obstacle(text) == obstacle


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "begins with box, pole, person"),
        ("cat at=1,2", "begins with box, pole, person"),
        ("box", "with at=X,Y or with ahead=M"),
        ("box at=1,2 ahead=1", "with at=X,Y or with ahead=M"),
        ("box at=1", "at=1 is not 2 or 3 numbers"),
        ("box ahead=nan", "ahead=nan is not 1 number"),
        ("box at=1,2 wheels=4", "wheels is unknown; there are at, ahead"),
        ("box at=1,2 size=0x1", "has no area"),
        ("pole at=1,2 radius=0", "must be above 0"),
    ],
)
def test_what_is_no_obstacle_is_told_what_one_looks_like(text, words):
    with pytest.raises(ValueError, match="obstacle") as caught:
        read_obstacle(text)
    assert words in str(caught.value)


def test_options_file_and_assignments_meet_and_the_later_one_wins(tmp_path):
    file = tmp_path / "rain.toml"
    file.write_text('obstacles = ["pole at=1,2"]\n[vehicle]\ngrip_mu = 0.4\nmass_kg = 4\n[lidar]\nnoise_std_m = 0.02\n')
    found = conditions_of(
        RequestedConditions(
            file, ["lidar.outlier_share=0.01"], friction=0.5, trim_rad=0.02, delay_s=0.05, dirt=["-10,5", "20,25,0.1"],
            obstacles=["box ahead=1"],
        )
    )  # fmt: skip
    assert found.changed() == {
        "vehicle": {"grip_mu": 0.5, "mass_kg": 4.0, "trim_rad": 0.02, "steering_delay_s": 0.05, "drive_delay_s": 0.05},
        "lidar": {
            "noise_std_m": 0.02, "outlier_share": 0.01, "dirty_sectors": [[-10.0, 5.0, 0.05], [20.0, 25.0, 0.1]],
        },
        "obstacles": ["pole at=1,2", "box ahead=1"],
    }  # fmt: skip
    assert conditions_of(RequestedConditions()).changed() == {}


@pytest.mark.parametrize(
    ("wishes", "words"),
    [
        (RequestedConditions(friction=-1.0), "vehicle.grip_mu = -1.0: input should be greater than 0"),
        (RequestedConditions(dropouts=2.0), "lidar.dropout_share = 2.0"),
        (RequestedConditions(assignments=["vehicle.wings=2"]), "vehicle.wings = 2"),
        (RequestedConditions(assignments=["grip=2"]), "write vehicle.KEY=VALUE"),
        (RequestedConditions(dirt=["5,-5"]), "write FROM,TO or FROM,TO,RANGE"),
        (RequestedConditions(own_parts="wings"), "--own-parts wings: write one of none"),
        (RequestedConditions(obstacles=["cat"]), "begins with box, pole, person"),
    ],
)
def test_what_cannot_be_is_refused_in_words(wishes, words):
    with pytest.raises(ConditionsError) as caught:
        conditions_of(wishes)
    assert words in str(caught.value)


def test_a_box_put_there_now_is_seen_one_metre_ahead_and_goes_when_it_is_cleared():
    scene, vehicle, live = corridor()
    ahead = slice(530, 551)
    assert looked(scene, vehicle)[ahead].min() > 3000
    live.do("box")
    assert looked(scene, vehicle, 0.05)[ahead] == pytest.approx(np.full(21, 1000), abs=60)
    assert len(scene.outline_m()) == len(scene.world.outline_m) + 4
    assert scene.sample(0.05, vehicle).clearance_m < 1.0
    live.do("clear")
    assert looked(scene, vehicle, 0.1)[ahead].min() > 3000


def test_a_box_that_is_driven_into_is_a_contact():
    scene, vehicle, _ = corridor()
    scene.step(0.0, vehicle)
    assert not scene.collided
    scene.put(read_obstacle("box ahead=0.05"))
    scene.step(0.01, vehicle)
    vehicle.place(vehicle.pose.ahead(0.3))
    assert scene.step(0.02, vehicle)
    assert scene.collided


def test_a_person_crosses_the_way_from_the_right():
    scene, vehicle, live = corridor()
    live.do("person")
    ahead = slice(452, 629)  # 22 degrees to both sides, where the corridor's walls are farther than the person
    scans = [looked(scene, vehicle, time_s)[ahead] for time_s in np.arange(0.0, 3.1, 0.1)]
    bearings = [int(np.argmin(seen)) for seen in scans if seen.min() < 2300][::4]
    assert len(bearings) > 3
    assert bearings == sorted(bearings), "from the right to the left"
    assert bearings[-1] - bearings[0] > 100


def test_grip_and_trim_change_the_car_that_drives():
    _, vehicle, live = corridor()
    for _ in range(400):
        vehicle.step(0.005, SpeedDemand(2.0), 0.0)
    straight_rad = vehicle.yaw_rad
    live.do("trim_up")
    assert vehicle.settings.trim_rad == pytest.approx(0.02)
    for _ in range(100):
        vehicle.step(0.005, SpeedDemand(2.0), 0.0)
    assert vehicle.yaw_rad - straight_rad > 0.02, "it turns to the left now"
    assert vehicle.speed_mps == pytest.approx(2.0, abs=0.1), "it goes on as fast as before"
    for _ in range(10):
        live.do("grip_down")
    assert vehicle.settings.grip_mu == 0.3


def test_dropouts_dirt_noise_and_own_parts_change_the_next_scan():
    scene, vehicle, live = corridor()
    before = (looked(scene, vehicle) == NO_RETURN_MM).mean()
    for name in ("dropouts_up", "dropouts_up"):
        live.do(name)
    assert (looked(scene, vehicle, 0.05) == NO_RETURN_MM).mean() - before == pytest.approx(0.1, abs=0.04)
    live.do("dirt")
    assert looked(scene, vehicle, 0.1)[500:560].min() < 100
    live.do("dirt")
    assert live.fields()["dirt"] == "off"
    seen = []
    for _ in own_parts_kinds():
        live.do("parts")
        seen.append(live.fields()["own parts"])
    assert set(seen) == set(own_parts_kinds())


def test_every_action_has_a_key_and_every_key_stands_in_the_legend():
    _, _, live = corridor()
    for action in ACTIONS:
        live.do(action.name)
    assert live.done == len(ACTIONS) == len(KEYS)
    shown = "".join(keys for keys, _ in LEGEND).replace(" ", "")
    assert set(shown) == {*KEYS, "q"}
    assert ("f F", "grip 0.8") in legend(corridor()[2].fields())


def test_keys_change_the_drive_and_q_ends_it():
    _, vehicle, live = corridor()
    stop = StopRequest()
    wishes = []
    for typed in ("f?x", "q", "bq"):
        handle_keys(typed, live if typed != "bq" else None, stop)
        wishes.append(stop.asked)
    assert vehicle.settings.grip_mu == 0.65
    assert wishes == [False, True, True]
    assert not stop.killed


def test_a_page_asks_what_there_is_and_has_it_done():
    _, _, live = corridor()
    told = json.loads(live.answer(b""))
    assert told["actions"][0]["name"] == "box"
    assert told["conditions"]["grip"] == "0.8"
    told = json.loads(live.answer(b'{"do": "grip_down"}'))
    assert told["conditions"]["grip"] == "0.65"
    assert told["done"] == 1
    for payload, words in ((b'{"do": "fly"}', "there is no fly; there are box"), (b"[1]", "ask {}"), (b"{", "ask {}")):
        with pytest.raises(RefusedError) as caught:
            live.answer(payload)
        assert words in str(caught.value)


def test_the_same_conditions_and_seed_give_the_same_scans():
    at_start = conditions_of(RequestedConditions(dropouts=0.1, noise_m=0.02, own_parts="right-rear"))
    one, other = (looked(*corridor(at_start)[:2]) for _ in range(2))
    assert (one == other).all()


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ("vehicle.mas=1", "vehicle.mas = 1: there is no such condition; did you mean vehicle.mass_kg? known here: "),
        ("lidar.noise=1", "did you mean lidar.noise_std_m?"),
        ("vehicel.mass_kg=4", "there is no such condition; did you mean vehicle? known here: vehicle, lidar, wiring"),
        ("lidar.zzz=1", "lidar.zzz = 1: there is no such condition; known here: "),
    ],
)
def test_an_unknown_condition_is_answered_with_the_nearest(wrong, said):
    with pytest.raises(ConditionsError, match=re.escape(said)):
        conditions_of(RequestedConditions(assignments=[wrong]))


@pytest.mark.parametrize(
    "tree",
    [
        {"vehicle": {"mass_kg": True}},
        {"lidar": {"outlier_share": "0.1"}},
        {"lidar": {"dirty_sectors": [[0.0, True, 0.5]]}},
    ],
)
def test_a_condition_of_another_kind_is_refused(tree):
    with pytest.raises(ConditionsError, match="input should be a valid number, without quotes"):
        checked_conditions(tree)
