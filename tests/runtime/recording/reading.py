"""Reads recordings as others would: with the package `mcap`, and with ours for the decision log."""

import warnings
from collections import Counter
from io import BytesIO
from typing import Any

from mcap import records
from mcap.stream_reader import StreamReader
from rosbags.typesys import Stores, get_typestore

from wallride.runtime.recording.channels import TAPE, text_of
from wallride.runtime.recording.decision_codec import decode
from wallride.runtime.wire import topics

STORE: Any = get_typestore(Stores.ROS2_HUMBLE)


def streamed(content):
    """Return (topic, message) of all that the stream reader finds before it meets the torn end."""
    channels, found = {}, []
    try:
        for record in StreamReader(BytesIO(content)).records:
            if isinstance(record, records.Channel):
                channels[record.id] = record.topic
            elif isinstance(record, records.Message):
                found.append((channels[record.channel_id], record))
    except Exception:  # noqa: BLE001 - whatever a torn end leads it to
        return found
    return found


def scans_in(content):
    """Return the numbers of the recorded scans."""
    return [message.sequence for topic, message in streamed(content) if topic == f"/{topics.SCAN}"]


def metadata(content):
    """Return what the file says about itself."""
    for record in StreamReader(BytesIO(content)).records:
        if isinstance(record, records.Metadata):
            return record.metadata
    raise AssertionError("no metadata")


def events(content):
    """Return the whole decision log."""
    return [
        event for topic, message in streamed(content) if topic == f"/{TAPE}" for event in decode(text_of(message.data))
    ]


def ranges_by_sequence(content):
    """Return the ranges of every recorded scan."""
    return {
        message.sequence: STORE.deserialize_cdr(message.data, "sensor_msgs/msg/LaserScan").ranges
        for topic, message in streamed(content)
        if topic == f"/{topics.SCAN}"
    }


def decoded_by_ros2_support(path):
    """Return how many messages of each topic mcap-ros2-support decodes."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DeprecationWarning)  # its module says that about itself
        from mcap_ros2.reader import read_ros2_messages
    return Counter(message.channel.topic for message in read_ros2_messages(str(path)))
