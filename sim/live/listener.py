"""Telemetry subscriber: the runtime's messages over zenoh, newest value per topic."""

import asyncio
import contextlib
import re
import struct
from collections.abc import Awaitable, Mapping
from functools import partial
from typing import Any

from wallride.runtime.parameters.history import SettingChange
from wallride.runtime.wire import topics, zenoh_config
from wallride.runtime.wire.bus import Bus
from wallride.runtime.wire.network import RefusedError, Reply
from wallride.sim.live.user_code import NO_USER_CODE, UserCode

CONNECT_TIMEOUT_S = 15.0
RETRY_S = 0.1
ANSWER_WITHIN_S = 2.0
MAX_CHANGES = 1000
MAX_POSES = 20_000
MAX_REASONS = 100
LONGEST_S = 2.0
"""Largest time between two messages of the status for which the reason of the first one holds."""
TOPICS = (topics.STATUS, topics.DISTANCE_ERROR)
"""Displayed topics only: the runtime has to write every subscribed one."""
_FLOAT32 = struct.Struct("<4xf")
_AMOUNT = re.compile(r"\d+(\.\d+)?(?= (s|m|deg)\b)")
"""A number with a unit, which may differ each time that the same fault is told."""


class Listener:
    """Subscribes to one start of one car at a known endpoint; messages of another start are rejected.

    user_code: the user's laws and drivers. own_faults: how often each of their faults began.
    recorded: files of the car's recordings, in order. poses: stamp, x and y of the car on its map, as the status tells
    them. reasons_s: for how long it decided for which reason.
    latest: the newest message of each topic; `distance_error` as {"error_m": metres}.
    problem: why nothing is received, "" while messages arrive. malformed: messages that could not be read.
    """

    def __init__(self, endpoint: str, car: str, session: str, user_code: UserCode = NO_USER_CODE) -> None:
        self._endpoint = endpoint
        self._prefix = topics.key(car, "")
        self._session = session
        self._replies: dict[str, Reply] = {}
        self._user_code = user_code
        self._faulty: frozenset[str] = frozenset()
        self._told: dict[str, str] = {}
        self.own_faults: dict[str, int] = {}
        self.latest: dict[str, Mapping[str, Any]] = {}
        self.recorded: list[str] = []
        self.poses: list[tuple[float, float, float]] = []
        self.reasons_s: dict[str, float] = {}
        self.problem = "nothing was heard from it"
        self.malformed = 0
        self._heard = asyncio.Event()
        self._bus: Bus | None = None

    def answer(self, topic: str, reply: Reply) -> None:
        """Answer queries for the car in this process, as long as they address this car; to be called before `run`."""
        self._replies[topic] = reply

    async def wait_until_heard(self, timeout_s: float) -> None:
        """Wait for the first status, up to a timeout."""
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(timeout_s):
                await self._heard.wait()

    async def changes_since(self, begin_s: float) -> list[SettingChange]:
        """Return the settings that the car changed since a time on the monotonic clock; [] when it does not answer."""
        if self._bus is None or self.problem:
            return []
        try:
            answers = await self._bus.ask(
                f"{self._prefix}{topics.PARAM}/history", topics.encode({"most": MAX_CHANGES}), timeout_s=ANSWER_WITHIN_S
            )
            found = [SettingChange(**fields) for fields in topics.decode(answers[0])["changes"]] if answers else []
        except (OSError, RefusedError, ValueError, TypeError, KeyError):
            return []
        return [change for change in found if change.stamp_s >= begin_s]

    async def run(self) -> None:
        """Connect as soon as the runtime listens, then listen until cancelled."""
        bus = self._bus = Bus(zenoh_config.client_config(self._endpoint, None))
        for topic in TOPICS:
            bus.subscribe(self._prefix + topic, self._on_sample)
        for topic, reply in self._replies.items():
            bus.answer(self._prefix + topic, partial(self._guarded, reply))
        try:
            if await self._opened(bus):
                await asyncio.get_running_loop().create_future()
        finally:
            await bus.close()

    async def _opened(self, bus: Bus) -> bool:
        loop = asyncio.get_running_loop()
        give_up_s = loop.time() + CONNECT_TIMEOUT_S
        while loop.time() < give_up_s:
            try:
                await bus.open()
            except OSError as error:
                self.problem = str(error)
                await asyncio.sleep(RETRY_S)
            else:
                return True
        return False

    def _guarded(self, reply: Reply, payload: bytes) -> bytes | Awaitable[bytes]:
        if self.problem:
            raise RefusedError(self.problem)
        return reply(payload)

    def _on_sample(self, key: str, payload: bytes, _arrival_s: float) -> None:
        try:
            self._take(key.removeprefix(self._prefix), payload)
        except (ArithmeticError, AttributeError, LookupError, TypeError, ValueError, struct.error):
            self.malformed += 1  # any program may write on the topic

    def _take(self, topic: str, payload: bytes) -> None:
        if topic == topics.STATUS:
            status = topics.decode(payload)
            if status.get("session") == self._session:
                faults, pose = self._user_code.faults_in(status), dict(status.get("pose") or {})
                before, self.latest[topic] = self.latest.get(topic, {}), status
                self.problem = ""
                self._count_faults(faults)
                self._heard.set()
                self._count_reason(before, status)
                self._note_recording(status)
                if pose.get("whereabouts") == "located" and len(self.poses) < MAX_POSES:
                    self.poses.append((pose["stamp_s"], pose["x_m"], pose["y_m"]))
            else:
                self.problem = f"another car answers at {self._endpoint} (session {status.get('session')})"
        elif not self.problem:
            (error_m,) = _FLOAT32.unpack(payload)
            self.latest[topic] = {"error_m": error_m}

    def _note_recording(self, status: Mapping[str, Any]) -> None:
        file = (status.get("recording") or {}).get("file")
        if file and file not in self.recorded[-1:]:
            self.recorded.append(file)

    def _count_reason(self, before: Mapping[str, Any], status: Mapping[str, Any]) -> None:
        reason = (before.get("output") or {}).get("reason")
        if reason and (reason in self.reasons_s or len(self.reasons_s) < MAX_REASONS):
            since_s = (status.get("stamp_s") or 0.0) - (before.get("stamp_s") or 0.0)
            self.reasons_s[reason] = self.reasons_s.get(reason, 0.0) + min(max(since_s, 0.0), LONGEST_S)

    def _count_faults(self, faults: frozenset[str]) -> None:
        """Count those that begin; one that goes on with another number, as of its seconds, has not begun again."""
        kinds = {_AMOUNT.sub("", fault): fault for fault in faults}
        for kind in sorted(kinds.keys() - self._faulty):
            told = self._told.setdefault(kind, kinds[kind])
            self.own_faults[told] = self.own_faults.get(told, 0) + 1
        self._faulty = frozenset(kinds)
