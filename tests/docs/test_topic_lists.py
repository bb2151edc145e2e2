"""Each list of topics that is kept by hand holds every topic; the failure names the list and the topic."""

import re
from pathlib import Path
from unittest.mock import Mock

import pytest

from tests.runtime.ros.samples import SAMPLES
from wallride.runtime.control.vehicle import CarSettings
from wallride.runtime.ros.definitions import TYPES, definition
from wallride.runtime.ros.graph import PUBLISHED as ROS2_PUBLISHED
from wallride.runtime.ros.graph import SCAN_BY_BEAM, TF_ODOM
from wallride.runtime.telemetry.topic_writers import Newest, TopicWriters
from wallride.runtime.wire import topics
from wallride.runtime.wire.rmw_zenoh import TYPE_HASHES
from wallride.runtime.wire.topics import NewBy

ROOT = Path(__file__).resolve().parents[2]
PUBLISHED = set(topics.TELEMETRY)
EACH = set(topics.new_by(NewBy.EACH))
FOR_ROS_2 = {TF_ODOM, SCAN_BY_BEAM}
WRITERS = TopicWriters(Mock(), CarSettings(), Newest(), Mock(), wall_clock=Mock(), side=Mock(), ball_m=Mock())
APPENDED = re.findall(r"_each\.append\(\(topics\.(\w+)", (ROOT / "runtime/tasks/telemetry.py").read_text())
LISTS = {
    "_writers in runtime/telemetry/topic_writers.py": (set(WRITERS._writers), PUBLISHED - EACH | FOR_ROS_2),
    "what runtime/tasks/telemetry.py appends to _each": ({getattr(topics, name) for name in APPENDED}, EACH),
    "PUBLISHED in runtime/ros/graph.py": (set(ROS2_PUBLISHED), {*TYPES} - {topics.TF, topics.SCAN} | FOR_ROS_2),
    "SAMPLES in tests/runtime/ros/samples.py": (set(SAMPLES), set(TYPES)),
    "TYPE_HASHES in runtime/wire/rmw_zenoh.py": (set(TYPE_HASHES), set(TYPES.values())),
}


@pytest.mark.parametrize("name", LISTS, ids=[name.split()[-1] for name in LISTS])
def test_every_topic_is_in_every_list(name):
    listed, wanted = LISTS[name]
    assert not wanted - listed, f"add {sorted(wanted - listed)} to {name}"
    assert not listed - wanted, f"take {sorted(listed - wanted)} out of {name}, or add it to TELEMETRY (wire/topics.py)"


@pytest.mark.parametrize("schema", sorted(set(TYPES.values())))
def test_every_type_has_its_fields(schema):
    try:
        definition(schema)
    except KeyError as error:
        pytest.fail(f"add {error} to runtime/ros/types.msg")
