"""Each list of topics that is kept by hand holds every topic; the failure names the list and the topic."""

import pytest

from tests.runtime.ros.samples import SAMPLES
from wallride import reference
from wallride.clients.plot import FIELDS
from wallride.runtime.recording.recorder import PERIODS_S
from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.ros.graph import PUBLISHED as ROS2_PUBLISHED
from wallride.runtime.ros.graph import SCAN_BY_BEAM, TF_ODOM
from wallride.runtime.settings.telemetry import RatesHz
from wallride.runtime.tasks import telemetry
from wallride.runtime.wire import topics

PUBLISHED = {*TYPES, *topics.JSON_TOPICS}
APPENDED = {topics.OUTPUT, topics.DISTANCE_ERROR, topics.IMU, topics.POSE}
"""Every message of these is sent: `Telemetry` appends them to `_each`."""
SENT = {
    *telemetry.BY_SCAN, *telemetry.BY_GUIDANCE, *telemetry.BY_MOTOR, *telemetry.BY_OUTPUT, *telemetry.BY_POSE,
    *APPENDED,
} - {TF_ODOM, SCAN_BY_BEAM}  # fmt: skip
WITHOUT_NUMBER = {
    topics.SCAN,
    topics.TF,
    topics.WALL,
    topics.FOOTPRINT,
    topics.DIAGNOSTICS,
    topics.JOY,
    *topics.LASTING,
}
"""Topics that have no one number to plot."""
LISTS = {
    "RatesHz in runtime/settings/telemetry.py": (set(RatesHz.model_fields), PUBLISHED),
    "BY_SCAN, BY_GUIDANCE, BY_MOTOR, BY_OUTPUT or BY_POSE in runtime/tasks/telemetry.py (or APPENDED of this test)": (
        SENT, PUBLISHED,
    ),
    "PERIODS_S in runtime/recording/recorder.py": (set(PERIODS_S) | {topics.SCAN}, PUBLISHED),
    "MEANINGS in wallride/reference": (set(reference.MEANINGS), PUBLISHED | {topics.BEAT}),
    "FIELDS in clients/plot.py (or WITHOUT_NUMBER of this test)": (
        set(FIELDS) | WITHOUT_NUMBER, PUBLISHED | {topics.BEAT},
    ),
    "PUBLISHED in runtime/ros/graph.py": (
        set(ROS2_PUBLISHED), {*TYPES, TF_ODOM, SCAN_BY_BEAM} - {topics.TF, topics.SCAN},
    ),
    "SAMPLES in tests/runtime/ros/samples.py": (set(SAMPLES), set(TYPES)),
}  # fmt: skip


@pytest.mark.parametrize("name", LISTS)
def test_every_topic_is_in_every_list(name):
    listed, wanted = LISTS[name]
    assert listed == wanted, f"{name}: add {sorted(wanted - listed)}, remove {sorted(listed - wanted)}"
