"""Somebody with a zenoh session of his own and no manners; what he tries, and what he brings home."""

import asyncio
import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import zenoh

HERE = "wallride/car1"
COMMAND = f"{HERE}/operator/command"
STATUS = f"{HERE}/status"
SECRET = b"drive, says alice"
EVIL = b"evil"
WILD = (
    f"{HERE}/operator/*",
    f"{HERE}/**",
    "wallride/*/operator/command",
    "wallride/**",
    "**",
    f"{HERE}/operator/comm$*",
)
OTHERS = (
    STATUS,
    f"{HERE}/beat",
    f"{HERE}/scan",
    f"{HERE}/param/set",
    f"{HERE}/param/get",
    f"{HERE}/alive",
    f"{HERE}/record",
)
FALSE_OPERATORS = {f"{HERE}/operator/alive/e0e0", f"{HERE}/operator/alive/a11ce2"}
FALSE_TOKENS = {"wallride/car2/alive", "wallride/evil/alive", *FALSE_OPERATORS}
ASKED = (
    "param/list",
    "param/get",
    "param/history",
    "param/set",
    "param/save",
    "param/restart",
    "param/configure",
    "record",
)


@dataclass
class Loot:
    """What an attack brought home: overheard samples, operators seen, questions of others answered, own answers."""

    overheard: list[tuple[str, bytes]] = field(default_factory=list)
    operators: list[str] = field(default_factory=list)
    captured: list[str] = field(default_factory=list)
    answers: list[bytes] = field(default_factory=list)


class Attacker:
    """Tries everything on a session of its own, with zenoh itself and without our manners."""

    def __init__(self, config: Mapping[str, Any], *, may_command: bool = False, may_ask: tuple[str, ...] = ()) -> None:
        self.loot = Loot()
        self._config = config
        self._keys = [*WILD, *OTHERS] if may_command else [COMMAND, *WILD, *OTHERS]
        self._may_ask = may_ask
        self._session: Any = None

    async def open(self) -> bool:
        """Return whether a session opened; peers and routers open one even where nobody lets them in."""
        try:
            self._session = await asyncio.to_thread(zenoh.open, zenoh.Config.from_json5(json.dumps(self._config)))
        except zenoh.ZError:
            return False
        return True

    async def close(self) -> None:
        if self._session is not None:
            await asyncio.to_thread(self._session.close)

    def lay_traps(self) -> None:
        session, loot = self._session, self.loot

        def overhear(sample: zenoh.Sample) -> None:
            payload = sample.payload.to_bytes()
            if payload not in {EVIL, b""}:
                loot.overheard.append((str(sample.key_expr), payload))

        def capture(query: zenoh.Query) -> None:
            with query:
                if query.payload is None or query.payload.to_bytes() != EVIL:
                    loot.captured.append(str(query.key_expr))
                    query.reply(f"{HERE}/param/get", EVIL)

        def spy(sample: zenoh.Sample) -> None:
            if str(sample.key_expr) not in FALSE_TOKENS:
                loot.operators.append(str(sample.key_expr))

        for key in (COMMAND, f"{HERE}/operator/**", f"{HERE}/param/**", "wallride/**", "**"):
            session.declare_subscriber(key, overhear)
        for key in (f"{HERE}/param/get", f"{HERE}/param/**", f"{HERE}/**", "**"):
            session.declare_queryable(key, capture, complete=True)  # "ask nobody but me"
        liveliness = session.liveliness()
        self._tokens = [liveliness.declare_token(key) for key in FALSE_TOKENS]
        self._spy = liveliness.declare_subscriber(f"{HERE}/operator/**", spy, history=True)

    async def strike(self) -> None:
        for _ in range(3):
            for key in self._keys:
                self._session.put(key, EVIL, priority=zenoh.Priority.REAL_TIME, express=True)
                self._session.delete(key)
            self._session.delete(COMMAND)  # an operator may put there, and nobody may delete
            await asyncio.sleep(0.02)
        for name in set(ASKED) - set(self._may_ask):
            await self._ask(f"{HERE}/{name}")
        for wild in (f"{HERE}/param/*", f"{HERE}/**", "**"):
            await self._ask(wild)

    async def _ask(self, selector: str) -> None:
        replies = self._session.get(selector, payload=EVIL, timeout=0.3)
        for reply in await asyncio.to_thread(list, replies):
            if reply.ok is not None:
                self.loot.answers.append(reply.ok.payload.to_bytes())
