"""A ROS 2 program that is not ours finds and decodes every topic of a running car."""

import asyncio
import json
import sys
from pathlib import Path

import pytest

from tests.system.operated import operated
from wallride.runtime.ros.graph import PUBLISHED, TF_STATIC

pytestmark = pytest.mark.timeout(90)
RECEIVER = Path(__file__).with_name("ros2_receiver.py")
DOMAIN = 7
AT_REST_G = (0.0, 0.0, 0.0, 0.0, 0.0, 1.0, *(0.0,) * 10)
"""What a sensor in the motor controller answers: rad, g, deg/s ..."""
OF_A_MAP = {"/pose", "/map", "/line"}
"""Topics of which nothing comes: this car has no map."""


async def receive(endpoint):
    process = await asyncio.create_subprocess_exec(
        sys.executable, str(RECEIVER), endpoint, str(DOMAIN), "20",
        stdout=asyncio.subprocess.PIPE, stderr=asyncio.subprocess.PIPE,
    )  # fmt: skip
    output, errors = await process.communicate()
    assert process.returncode == 0, errors.decode()
    return json.loads(output)


async def test_an_independent_receiver_finds_and_decodes_every_topic_of_the_driving_car(tmp_path):
    async with operated(tmp_path, "ros2.enabled=true", f"ros2.domain={DOMAIN}") as scene:
        scene.car.vesc.imu = AT_REST_G
        await scene.car.until_driving()
        await scene.drive_by_hand()
        found = await receive(scene.entrance)
    names = {f"/{topic.name}": topic for topic in (*PUBLISHED.values(), TF_STATIC)}
    assert set(found) == set(names)
    for name, each in found.items():
        assert each["schema"] == names[name].schema
        assert each["computed"] == each["announced"], "the SDK's hash of ROS's own definition"
        assert (each["qos"], each["node"]) == (names[name].qos, "wallride_sim")
        if name in OF_A_MAP:
            continue
        assert each["count"] >= 1, f"nothing came on {name}"
        if name != "/tf_static":  # the SDK asks for what is kept, and shows no attachment of it
            assert_attachments(each)
    assert_contents({name: each["messages"][0] for name, each in found.items() if name not in OF_A_MAP})


def assert_attachments(each):
    sizes, sequences, stamps_ns, gids = zip(*each["attachments"], strict=True)
    assert set(sizes) == {33}
    assert list(sequences) == sorted(set(sequences))
    assert len(set(gids)) == 1
    first = each["messages"][0]
    if stamp := first.get("header", {}).get("stamp"):
        sweep_s = first["time_increment"] * (first["ranges"]["size"] - 1) if "ranges" in first else 0.0
        assert sweep_s == pytest.approx(0.01875 if "ranges" in first else 0.0), "of 270 degrees at 40 Hz"
        header_ns = stamp["sec"] * 10**9 + stamp["nanosec"]
        assert stamps_ns[0] - header_ns == pytest.approx(1e9 * sweep_s, abs=5000)


def assert_contents(first):
    """The frames are those of REP-105, and the numbers are the car's."""
    scan = first["/scan"]
    assert (scan["header"]["frame_id"], scan["ranges"]["size"]) == ("laser", 1081)
    assert (first["/odom"]["header"]["frame_id"], first["/odom"]["child_frame_id"]) == ("odom", "base_link")
    assert frames(first["/tf"]) == [("odom", "base_link")]
    assert frames(first["/tf_static"]) == [("base_link", "laser")]
    assert first["/imu"]["header"]["frame_id"] == "base_link"
    assert first["/imu"]["linear_acceleration"]["z"] == pytest.approx(9.81, abs=0.02)
    assert first["/battery"]["voltage"] == pytest.approx(11.8, abs=0.05)
    assert first["/teleop"]["drive"]["speed"] == pytest.approx(2.0, abs=0.05)
    assert {status["name"] for status in first["/diagnostics"]["status"]} == {"lidar", "motor", "window", "mux"}
    assert first["/footprint"]["markers"][0]["header"]["frame_id"] == "base_link"


def frames(message):
    return [(one["header"]["frame_id"], one["child_frame_id"]) for one in message["transforms"]]
