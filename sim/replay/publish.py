"""`wallride replay --publish`: a recording on zenoh under the car's own keys, as if the car were there.

A token says that it is a recording, so that no screen takes it for a car that drives.
It is a router of its own on this machine, so that a monitor finds it where a simulated car would be. Besides the
terminal's keys, the query `wallride/<car>/replay` controls it: {"pause": true}, {"speed": 2}, {"seek_s": 12}.
"""

import argparse
import asyncio
import contextlib
import json
import os
import sys
import time
from collections.abc import Callable

from wallride.runtime.ros.definitions import encoding
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.endpoints import split_endpoint
from wallride.runtime.wire.network import RefusedError
from wallride.sim.recordings import RecordingError
from wallride.sim.replay.drive_log import LoggedMessage
from wallride.sim.replay.foreign import open_any
from wallride.sim.replay.keys import names, press, single_keys
from wallride.sim.replay.player import PLAYED, Player

REPLAY = "replay"
STEP_S = 0.005
HELD_S = 0.4
"""Period of repetition of the picture during a pause: late subscribers receive it, and it does not count as stale."""
LINE_S = 0.2


def play(options: argparse.Namespace) -> int:
    """Play until the end, or until the user quits; RecordingError for an empty recording or an unavailable address."""
    opened = open_any(options.file, options.assignments, options.topic)
    car = options.car or opened.log.fact("car") or "replay"
    player = Player(opened.log, time.monotonic, speed=options.speed, loops=options.loop)
    if not player.duration_s:
        raise RecordingError(f"{options.file} holds nothing that a monitor could show.")
    if not 0.0 <= options.begin_s < player.duration_s:
        raise RecordingError(
            f"{options.file}: --from {options.begin_s:g} is not in it: give seconds from 0 to {player.duration_s:.1f}."
        )
    player.seek(options.begin_s)
    for note in opened.log.notes:
        print(f"note: {note}", file=sys.stderr)  # noqa: T201 - this is the command's voice
    try:
        return asyncio.run(Broadcast(player, car, options.listen).run())
    except (ValueError, OSError) as error:
        raise RecordingError(f"--listen {options.listen}: {error}") from None


class Broadcast:
    """Publishes a player over zenoh: bus, keys, and the line of its position. bus: its own router."""

    def __init__(self, player: Player, car: str, listen: str) -> None:
        if split_endpoint(listen)[0] != "tcp":
            raise ValueError("recordings are played on this machine only; write tcp/127.0.0.1:7447")
        self._player = player
        self._car = car
        self.bus = Bus(zenoh_config.car_config([listen], None, [], car))
        self._leave = asyncio.Event()
        self._keys = {topic: (topics.key(car, topic), encoding(topic)) for topic in PLAYED}

    async def run(self) -> int:
        """Publish until the end."""
        bus, car = self.bus, self._car
        bus.announce(topics.key(car, topics.PLAYED))
        bus.announce(topics.key(car, topics.ALIVE))
        bus.answer(topics.key(car, REPLAY), self.answer)
        await bus.open()
        restore = self._listen_to_keys()
        print(f"playing {car} on {bus.endpoint}, {self._player.duration_s:.1f} s", flush=True)  # noqa: T201
        if restore is not None:
            print("space pause · + - speed · ← → 5 s · page keys 30 s · home · q", flush=True)  # noqa: T201
        try:
            await self._play(is_watched=restore is not None)
        finally:
            if restore is not None:
                restore()
                print()  # noqa: T201
            await bus.close()
        return 0

    def answer(self, payload: bytes) -> bytes:
        """Process a query and return the position; RefusedError with the remedy."""
        try:
            self._player.handle_request(json.loads(payload or b"{}"))
        except ValueError as error:
            raise RefusedError(str(error)) from None
        return topics.encode(self._player.status())

    async def _play(self, *, is_watched: bool) -> None:
        player = self._player
        held_s = line_s = 0.0
        while not self._leave.is_set():
            now_s = time.monotonic()
            due = player.due()
            if due:
                held_s = now_s
            elif now_s - held_s > HELD_S:
                due, held_s = player.picture(), now_s
            for message in due:
                self._put(message)
            if player.ended:
                if not is_watched:
                    return
                player.paused = True  # the user may want to go back
            if is_watched and now_s - line_s > LINE_S:
                line_s = now_s
                print(f"\r{line(player)}\x1b[K", end="", flush=True)  # noqa: T201
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(STEP_S):
                    await self._leave.wait()

    def _put(self, message: LoggedMessage) -> None:
        key, kind = self._keys[message.topic]
        self.bus.put(key, message.payload, encoding=kind)

    def _listen_to_keys(self) -> Callable[[], None] | None:
        restore = single_keys()
        if restore is not None:
            asyncio.get_running_loop().add_reader(sys.stdin.fileno(), self._on_typed)
        return restore

    def _on_typed(self) -> None:
        typed = os.read(sys.stdin.fileno(), 64)
        if not typed or not all(press(self._player, name) for name in names(typed)):
            self._leave.set()


def line(player: Player) -> str:
    """Return the position as a line of text."""
    state = "paused " if player.paused else "playing"
    return f"{state} {player.position_s:7.1f} of {player.duration_s:.1f} s, {player.speed:g} times as fast"
