"""The car's topics on the ROS 2 side: names, types and quality of service."""

from collections.abc import Mapping
from types import MappingProxyType

from wallride.runtime.ros.definitions import TYPES
from wallride.runtime.wire import topics
from wallride.runtime.wire.rmw_zenoh import BEST_EFFORT, LATCHED, RosAccess, RosGraph, RosTopic

TF_ODOM = "tf_odom"
"""Telemetry's name for odom to base_link alone, ROS 2's /tf: beside it /tf_static has base_link to laser."""
SCAN_BY_BEAM = "scan_by_beam"
"""Telemetry's name for ROS 2's /scan: with the time of each beam, and what came back from those without a distance."""
TF_STATIC = RosTopic("tf_static", TYPES[topics.TF], LATCHED)
"""laser in base_link: published once, and kept for late subscribers."""

PUBLISHED: Mapping[str, RosTopic] = MappingProxyType(
    {
        SCAN_BY_BEAM: RosTopic(topics.SCAN, TYPES[topics.SCAN]),
        **{
            topic: RosTopic(topic, schema, LATCHED if topic in topics.LASTING else BEST_EFFORT)
            for topic, schema in TYPES.items()
            if topic not in {topics.TF, topics.SCAN}
        },
        TF_ODOM: RosTopic("tf", TYPES[topics.TF]),
    }
)
"""ROS 2's topic for each of telemetry's; the names are the same, except that base_link to laser is on /tf_static."""


DRIVE = RosTopic("drive", TYPES[topics.OUTPUT])
"""The car's subscription, with `ros2.drive`."""


def scan_source(name: str) -> RosTopic:
    """Return the topic of the lidar's scans, with `lidar.driver = "topic"`."""
    return RosTopic(name, TYPES[topics.SCAN])


def access(graph: RosGraph, *, drives: bool = False, scans: bool = False) -> RosAccess:
    """Return the keys that the access control has to let through.

    drives: commands are taken on /drive. scans: the lidar's scans come by the bus.
    """
    published = (*PUBLISHED.values(), TF_STATIC)
    keys = tuple(graph.data_key(topic) for topic in published)
    latched = tuple(graph.data_key(topic) for topic in published if topic.qos == LATCHED)
    return RosAccess(graph.domain, keys, latched, graph.data_key(DRIVE) if drives else "", scans)
