"""`wallride foxglove`: a car's topics live for Foxglove, Lichtblick and PlotJuggler, the very bytes from zenoh.

A program of its own, a client like any other; it displays topics, and accepts settings and the e-stop, but no drive
command. A topic is subscribed to on the car when the first viewer selects it, because a car writes only topics that
have a subscriber.
"""

import argparse
import asyncio
from collections.abc import Mapping
from typing import Any

import foxglove
from foxglove.websocket import Capability, WebSocketServer

from clients.connection import ConnectionProblemError, connected
from clients.foxglove_control import SubscriptionListener
from runtime.recording.channels import STRING, schema_text, text
from runtime.ros.definitions import SCHEMA_ENCODING, TYPES
from runtime.wire import topics
from runtime.wire.bus import Bus

TEXTS = (topics.STATUS, topics.DECISION)
"""Topics with JSON on zenoh; std_msgs/String here, as in a recording, so that one layout fits both."""
LOOPBACK = ("127.0.0.1", "localhost", "::1")


class FoxgloveView:
    """Channels of one car. Every topic is advertised at once; data flow for those that a viewer shows."""

    def __init__(self, bus: Bus, car: str) -> None:
        self.context = foxglove.Context()
        self.shown: set[str] = set()
        self._bus = bus
        self._car = car
        types = {**TYPES, **dict.fromkeys(TEXTS, STRING)}
        self._channels: Mapping[str, Any] = {topic: self._channel(topic, schema) for topic, schema in types.items()}

    def show(self, topic: str) -> None:
        """Subscribe to a topic; idempotent, and without effect for topics that the car does not have."""
        channel = self._channels.get(topic)
        if channel is None or topic in self.shown:
            return
        self.shown.add(topic)
        wrap = text if topic in TEXTS else bytes
        self._bus.subscribe(topics.key(self._car, topic), lambda _key, payload, _arrival_s: channel.log(wrap(payload)))

    def _channel(self, topic: str, schema: str) -> foxglove.Channel:
        described = foxglove.Schema(name=schema, encoding=SCHEMA_ENCODING, data=schema_text(schema).encode())
        return foxglove.Channel(f"/{topic}", message_encoding="cdr", schema=described, context=self.context)


async def run(options: argparse.Namespace) -> int:
    """Serve until interrupted; options as of `wallride.foxglove_options`."""
    async with connected(options) as (bus, car):
        show = FoxgloveView(bus, car)
        server = _serve(show, bus, car, options)
        options.print_line(f"{car}: open ws://{options.host}:{server.port} in Foxglove, Lichtblick or PlotJuggler")
        if options.host not in LOOPBACK:
            options.print_line("anyone who reaches this address can watch and press the e-stop: it knows no passwords")
        try:
            await asyncio.get_running_loop().create_future()
        finally:
            server.stop()
    return 0


def _serve(show: FoxgloveView, bus: Bus, car: str, options: argparse.Namespace) -> WebSocketServer:
    gate = SubscriptionListener(bus, car, show.show, may_change=options.host in LOOPBACK)
    try:
        return foxglove.start_server(
            name=car,
            host=options.host,
            port=options.port,
            context=show.context,
            server_listener=gate,
            capabilities=[Capability.Parameters, Capability.ClientPublish],
            supported_encodings=["json", "cdr"],
        )
    except (OSError, RuntimeError, ValueError) as error:
        raise ConnectionProblemError(f"cannot serve on {options.host}:{options.port}: {error} (--port)") from None
