"""Sink that publishes the topics for ROS 2 as rmw_zenoh would: the same bytes under other keys, with attachments."""

import functools

from wallride.runtime.realtime.wall_clock import WallClock
from wallride.runtime.ros import messages
from wallride.runtime.ros.graph import DRIVE, PUBLISHED, SCAN_BY_BEAM, TF_ODOM, TF_STATIC
from wallride.runtime.ros.messages import Frame
from wallride.runtime.settings.telemetry import RatesHz
from wallride.runtime.telemetry.sinks import TopicGate
from wallride.runtime.wire import topics
from wallride.runtime.wire.network import CDR, Network
from wallride.runtime.wire.rmw_zenoh import RosGraph, attachment, gid


class Ros2Sink:
    """Announces the car's node and its publishers, and sends the topics that have ROS 2 subscribers.

    laser: the fixed frame, on /tf_static. drives: the car subscribes to /drive.
    """

    def __init__(
        self,
        bus: Network,
        graph: RosGraph,
        rates: RatesHz,
        laser: Frame,
        *,
        wall_clock: WallClock,
        drives: bool = False,
    ) -> None:
        self._bus = bus
        self._graph = graph
        self._laser = laser
        self._drives = drives
        self._wall_clock = wall_clock
        self._keys = {topic: graph.data_key(known) for topic, known in PUBLISHED.items()}
        self._gids: dict[str, bytes] = {}
        self._sequences: dict[str, int] = {}
        self._gate = TopicGate(self._is_wanted)
        self.limit(rates)
        bus.when_open(self._join)

    def limit(self, rates: RatesHz) -> None:
        """Apply other rates from now on."""
        rates_hz: dict[str, float] = rates.model_dump()
        rates_hz |= {TF_ODOM: rates_hz[topics.TF], SCAN_BY_BEAM: rates_hz[topics.SCAN]}
        self._gate.limit({topic: rates_hz[topic] for topic in PUBLISHED})

    def claim(self, topic: str, at_s: float, *, urgent: bool = False) -> bool:
        """Tell whether the topic is due and has a subscriber."""
        return self._gate.claim(topic, at_s, urgent=urgent)

    def take(self, topic: str, schema: str, stamp_s: float, payload: bytes) -> None:  # noqa: ARG002 - it is in the key
        """Send it; a slow or vanished reader loses it."""
        publisher = self._gids.get(topic)
        if publisher is None:  # not announced: a receiver could not read its attachment
            return
        self._sequences[topic] = sequence = self._sequences.get(topic, 0) + 1
        note = attachment(sequence, self._wall_clock.unix_ns(stamp_s), publisher)
        put = self._bus.put_latched if topic in topics.LASTING else self._bus.put_attached
        put(self._keys[topic], payload, encoding=CDR, attachment=note)

    def _is_wanted(self, topic: str) -> bool:
        """Tell whether a topic has a subscriber; one whose message is kept for late ones is wanted once."""
        if topic in topics.LASTING:
            return topic in self._gids and topic not in self._sequences
        return self._bus.wanted(self._keys[topic], encoding=CDR)

    def _join(self) -> None:
        """Announce the node and its publishers, and publish the fixed frame."""
        graph, session = self._graph, self._bus.session_id
        self._bus.announce(graph.node_token(session))
        endpoint = functools.partial(graph.endpoint_token, session)
        for number, (topic, known) in enumerate(PUBLISHED.items(), start=1):
            token = endpoint(number, "MP", known)
            self._bus.announce(token)
            self._gids[topic] = gid(token)
        fixed = endpoint(len(PUBLISHED) + 1, "MP", TF_STATIC)
        self._bus.announce(fixed)
        if self._drives:
            self._bus.announce(endpoint(len(PUBLISHED) + 2, "MS", DRIVE))
        now_ns = self._wall_clock.now_unix_ns()
        message, note = messages.transforms(now_ns, (self._laser,)), attachment(1, now_ns, gid(fixed))
        self._bus.put_latched(graph.data_key(TF_STATIC), message, encoding=CDR, attachment=note)
