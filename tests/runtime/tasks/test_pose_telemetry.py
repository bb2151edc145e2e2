"""What telemetry publishes of the pose on a map, and of the map and the line themselves."""

import cmath
import math
from types import SimpleNamespace

import numpy as np
import pytest

from tests.runtime.control.localization.rooms import report, ring
from tests.runtime.observed import output_of
from tests.runtime.tasks.test_telemetry import Keeper, Rig, decoded
from tests.runtime.telemetry.test_course_messages import circle, shown
from wallride.runtime.control.localization.localizer import PoseEstimate, Whereabouts
from wallride.runtime.control.localization.wall_points import MapGrid
from wallride.runtime.wire import topics


def placed(rig, x_m, y_m, yaw_rad, age_s):
    """Return an estimate that is newer than the motor's report by age_s."""
    return PoseEstimate(
        rig.observed.motor.state.stamp_s + age_s, Whereabouts.LOCATED, x_m, y_m, yaw_rad, 0.02, 0.01, 0.97
    )


async def test_a_pose_is_published_with_what_it_is_known_to():
    rig = Rig(Keeper(topics.POSE))
    rig.drive_once()
    rig.telemetry.on_pose(placed(rig, 3.0, -1.0, 0.5, 0.0))
    rig.telemetry.on_pose(PoseEstimate(rig.clock.now_s, Whereabouts.LOST))
    rig.drive_once()
    told = await rig.told(topics.POSE)
    assert told.header.frame_id == "map"
    assert (told.pose.pose.position.x, told.pose.pose.position.y) == (3.0, -1.0)
    assert 2 * math.atan2(told.pose.pose.orientation.z, told.pose.pose.orientation.w) == pytest.approx(0.5)
    assert [told.pose.covariance[place] for place in (0, 7, 35)] == [0.02**2, 0.02**2, 0.01**2]


async def test_odom_lies_on_the_map_so_that_the_car_is_where_it_was_found():
    """The scan is 20 ms newer than the report: what the car has moved since then is no error of the odometry."""
    rig = Rig(Keeper(topics.TF))
    for _ in range(2):
        rig.drive_once()
    pose, age_s = rig.telemetry.journey.pose, 0.02
    rig.telemetry.on_pose(placed(rig, 3.0, -1.0, 0.5, age_s))
    rig.drive_once()
    frames = {
        one.header.frame_id: one for one in decoded((await rig.written()).of(topics.TF)[-1], topics.TF).transforms
    }
    assert frames["map"].child_frame_id == "odom"
    shift, turn = frames["map"].transform.translation, frames["map"].transform.rotation
    yaw_rad = 2 * math.atan2(turn.z, turn.w)
    odom = complex(pose.x_m, pose.y_m) + pose.speed_mps * age_s * cmath.exp(
        1j * (pose.yaw_rad + pose.yaw_rate_radps * age_s / 2)
    )
    there = complex(shift.x, shift.y) + odom * cmath.exp(1j * yaw_rad)
    assert there == pytest.approx(3.0 - 1.0j)
    assert yaw_rad + pose.yaw_rad + pose.yaw_rate_radps * age_s == pytest.approx(0.5)


async def test_without_a_pose_there_is_no_map_frame():
    rig = Rig(Keeper(topics.TF))
    rig.drive_once()
    rig.telemetry.on_pose(placed(rig, 3.0, -1.0, 0.5, 0.0))
    rig.telemetry.on_pose(PoseEstimate(rig.clock.now_s, Whereabouts.LOST))
    rig.drive_once()
    transforms = decoded((await rig.written()).of(topics.TF)[-1], topics.TF).transforms
    assert [one.header.frame_id for one in transforms] == ["odom", "base_link"]


class OnDemand(Keeper):
    """A sink that takes one message of each topic whenever it is asked to."""

    def __init__(self):
        super().__init__()
        self.wishes = set()

    def claim(self, topic, at_s, *, urgent=False):
        return topic in self.wishes

    def take(self, topic, schema, stamp_s, payload):
        super().take(topic, schema, stamp_s, payload)
        self.wishes.discard(topic)


async def test_map_and_line_are_there_whenever_a_reader_comes_and_are_always_the_same_bytes():
    rig = Rig(OnDemand())
    grid = MapGrid(np.array([[0, 100]], dtype=np.int8), 0.05, 0j)
    rig.telemetry.on_course(shown(circle(50), grid))
    sink = rig.sinks[0]
    for _ in range(3):
        rig.clock.now_s += 10.0
        sink.wishes |= topics.LASTING
        rig.telemetry.on_pose(PoseEstimate(rig.clock.now_s, Whereabouts.SEARCHING))
        rig.drive_once()
        await rig.written()
    for topic in topics.LASTING:
        assert len(sink.of(topic)) == 3
        assert len(set(sink.of(topic))) == 1
    assert list(decoded(sink.of(topics.MAP)[0], topics.MAP).data) == [0, 100]
    assert len(decoded(sink.of(topics.LINE)[0], topics.LINE).poses) == 51


async def test_a_map_without_a_line_has_no_topic_line():
    rig = Rig()
    rig.telemetry.on_course(shown(grid=MapGrid(np.zeros((1, 1), dtype=np.int8), 0.05, 0j)))
    rig.telemetry.on_pose(PoseEstimate(rig.clock.now_s, Whereabouts.SEARCHING))
    rig.drive_once()
    kept = await rig.written()
    assert (len(kept.of(topics.MAP)), kept.of(topics.LINE)) == (1, [])


def off_m(*, learns):
    """Return the error of the pose after 6 m straight on, by wheels that report 3 % too much; it has stood for 2 s."""
    motor, room, x_m = SimpleNamespace(state=None), ring(), 0.0
    rig = Rig(motor=motor)
    for number in range(200):
        now_s, speed_mps = 0.025 * number, 2.0 if number > 80 else 0.0
        x_m += 0.025 * speed_mps
        rig.telemetry.on_imu(now_s, (0.0, 0.0, 0.01), (0.0, 0.0, 9.81))
        motor.state = report(now_s, 1.03 * x_m, 1.03 * speed_mps)
        rig.telemetry.on_output(output_of(rig.observed))
        if learns:
            rig.telemetry.learn(room.scan((x_m, 0.0, 0.0), stamp_s=now_s, noise_m=0.01, seed=number))
    return abs(rig.telemetry.journey.pose.x_m - x_m)


def test_the_odometry_learns_from_the_scans_that_were_answered():
    assert off_m(learns=False) > 0.15
    assert off_m(learns=True) < 0.08
