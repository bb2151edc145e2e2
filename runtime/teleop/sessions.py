"""The clients' sessions: one record per client, at most MAX_SESSIONS, and the gate that every command must pass.

The gate checks two things only: whether the command is fresh, and whether it is newer than the last of its session. Its
content is evaluated elsewhere. The car numbers its heartbeats and remembers when it sent each; an operator echoes the
newest one received, so a command is at most as old as that heartbeat: the time covers the way to the operator, the way
back, and every queue in between, and no two clocks need to agree.
"""

from collections import deque
from dataclasses import dataclass

from wallride.drivers.api import Clock
from wallride.runtime.teleop.rejections import Refusal
from wallride.runtime.wire.teleop import Command

REMEMBERED_BEATS = 512
"""Number of heartbeats whose sending times are kept: ten seconds at 50 Hz. Older ones count as unknown: a command that
old is not obeyed anyway."""
_U32 = 0xFFFF_FFFF
_HALF = 0x8000_0000
MAX_SESSIONS = 64
"""Maximum number of sessions: more clients at once than any class has. Further sessions of a valid key are refused, not
obeyed."""


def newer(number: int, than: int) -> bool:
    """Compare 32-bit counters that wrap around: at most 2**31 ahead is newer (serial numbers, RFC 1982)."""
    return 0 < (number - than) & _U32 < _HALF


class Beats:
    """The car's numbered heartbeats and the sending time of each.

    number: the newest; 0 before the first.
    """

    def __init__(self, clock: Clock, number: int = 0) -> None:
        self._clock = clock
        self._sent_s: deque[float] = deque(maxlen=REMEMBERED_BEATS)
        self.number = number

    def count_sent(self) -> int:
        """Count one more heartbeat, which is sent now; return its number."""
        self.number = (self.number + 1) & _U32
        self._sent_s.append(self._clock())
        return self.number

    def sent_at_s(self, number: int) -> float | None:
        """Return the sending time of a heartbeat; None for one of the future, of another car or forgotten."""
        back = (self.number - number) & _U32
        return self._sent_s[-1 - back] if back < len(self._sent_s) else None


@dataclass(slots=True, eq=False)
class TeleopSession:
    """One start of one client.

    sequence: the newest command that passed. beat_s: when the car sent the heartbeat which that command echoed.
    fresh_until_s: when the newest of its commands expires. heard_s, arrived_s: when that was handled, and when it
        arrived.
    armed: a full release was seen since the last incident; only then a press counts.
    over: the session ended with a goodbye. It stays known for a while, or its last commands could be replayed.
    """

    number: int
    name: str
    sequence: int
    beat_s: float
    fresh_until_s: float
    heard_s: float
    arrived_s: float
    armed: bool = False
    over: bool = False

    @property
    def title(self) -> str:
        """Its name for logs and status."""
        return self.name or "an operator without a name"


class SessionGate:
    """Admits fresh and new commands, and keeps the sessions that sent them.

    A session that is forgotten was silent for `forget_after_s`, which is longer than `expiry_s`: a replay of its
    commands is stale, so forgetting it is safe.
    """

    def __init__(self, beats: Beats, car_session: int, *, expiry_s: float, forget_after_s: float) -> None:
        self._beats = beats
        self._car_session = car_session
        self._expiry_s = expiry_s
        self._forget_after_s = max(forget_after_s, 2 * expiry_s)
        self._sessions: dict[int, TeleopSession] = {}

    def admit(self, command: Command, now_s: float, arrival_s: float) -> TeleopSession | Refusal:
        """Judge a command; return the session that it renewed, or why it does not count."""
        if command.car_session != self._car_session:
            return Refusal.FOREIGN
        beat_s = self._beats.sent_at_s(command.beat)
        if beat_s is None:
            return Refusal.UNKNOWN_BEAT
        if now_s >= beat_s + self._expiry_s:
            return Refusal.STALE
        known = self._sessions.get(command.session)
        if known is None:
            return self._open(command, now_s, arrival_s, beat_s)
        if known.over:
            return Refusal.OVER
        if not newer(command.sequence, known.sequence):
            return Refusal.REPLAY
        if now_s >= known.fresh_until_s:
            known.armed = False  # a gap: whatever is held down now may have been pressed in it
        known.sequence, known.beat_s, known.heard_s, known.arrived_s = command.sequence, beat_s, now_s, arrival_s
        known.fresh_until_s = max(known.fresh_until_s, beat_s + self._expiry_s)
        return known

    def disarm(self) -> None:
        """Disarm every session: no press counts before a release."""
        for session in self._sessions.values():
            session.armed = False

    def heard_lately(self, now_s: float) -> int:
        """Return the number of clients with commands lately."""
        sessions = self._sessions.values()
        return len([one for one in sessions if not one.over and now_s - one.heard_s < self._forget_after_s])

    def _open(self, command: Command, now_s: float, arrival_s: float, beat_s: float) -> TeleopSession | Refusal:
        if len(self._sessions) >= MAX_SESSIONS:
            self._forget_silent(now_s)
        if len(self._sessions) >= MAX_SESSIONS:
            return Refusal.TOO_MANY
        session = TeleopSession(
            command.session, command.name, command.sequence, beat_s, beat_s + self._expiry_s, now_s, arrival_s
        )
        self._sessions[command.session] = session
        return session

    def _forget_silent(self, now_s: float) -> None:
        silent = [one.number for one in self._sessions.values() if now_s - one.heard_s >= self._forget_after_s]
        for number in silent:
            del self._sessions[number]
