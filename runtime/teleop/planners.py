"""The planners' desk: programs outside the car that drive in the follower's place, under safety and permit.

The rules, each with a test that fails when it is broken (docs/decisions/0038-planners.md has the reasons):

* A planner speaks on the key of its name alone, and one session at a time for each name.
* Only a fresh and new command counts: it echoes the car's heartbeat and holds for `planners.expiry_s` from it. ROS 2's
  commands echo nothing and are compared with the fastest of their series.
* Each planner has its own slot; the most urgent one with a command in force drives.
* While a planner has the car the follower does not drive, also not in the moment between expiry and notice.
* A planner that falls silent without a goodbye is lost, and so is one that leaves unsure, at once: the permit ends as
  with a lost device.

A plain state machine: the clock is injected, nothing here waits, and it knows no bus.
"""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Final

from wallride.drivers.api import Clock, Drive
from wallride.runtime.arbitration.command import DriveCommand, Source, refusal
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.permit import Permit
from wallride.runtime.host.rate_limited_log import RateLimitedLog
from wallride.runtime.realtime.wall_clock import NS
from wallride.runtime.ros.commands import read_ackermann
from wallride.runtime.teleop.rejections import Refusal, Refusals
from wallride.runtime.teleop.ros_drive import DriveSeries, Stamps
from wallride.runtime.teleop.sessions import Beats, SessionGate
from wallride.runtime.wire.rmw_zenoh import ROS2_PLANNER, read_attachment
from wallride.runtime.wire.teleop import Command, Malformed, Press, read_command

log = logging.getLogger("wallride.planners")

FORGET_AFTER_S: Final = 3.0
HEARD_S: Final = 1.0


@dataclass(slots=True)
class _Slot:
    """One planner's newest command. drive: None asks for nothing. session: may speak while a command of it is fresh."""

    gate: SessionGate
    refusals: Refusals
    drive: Drive | None = None
    until_s: float = -math.inf
    heard_s: float = -math.inf
    session: int = 0
    accepted: int = 0


class PlannerDesk:
    """Takes commands (`receive`, `receive_ros`), notices silence (`tick`), and puts the most urgent command.

    names: most urgent first. beats: the car's heartbeats. rearm: disarms operators and ends what they hold.
    """

    def __init__(
        self,
        names: Sequence[str],
        expiry_s: float,
        queue: CommandQueue,
        permit: Permit,
        beats: Beats,
        rearm: Callable[[str], None],
        clock: Clock,
        car_session: int,
    ) -> None:
        self._expiry_s = expiry_s
        self._queue = queue
        self._permit = permit
        self._rearm = rearm
        self._clock = clock
        self._log = RateLimitedLog(log, clock)
        self._series = DriveSeries(expiry_s)
        self._slots = {
            name: _Slot(
                SessionGate(beats, car_session, expiry_s=expiry_s, forget_after_s=FORGET_AFTER_S), Refusals(self._log)
            )
            for name in names
        }
        self._holder = ""
        self._lost = ""

    def receive(self, key: str, payload: bytes, arrival_s: float) -> None:
        """Take in one command from the key `planner/NAME/command`; never raises, whatever the payload is."""
        name = key.split("/")[-2]
        slot, now_s = self._slots[name], self._clock()
        self.tick()  # first, or a late command would pass for an unbroken series
        try:
            command = read_command(payload)
        except Malformed as error:
            slot.refusals.count(Refusal.MALFORMED, f"planner {name}: {error}")
            return
        if (refused := self._judge(slot, command, now_s, arrival_s)) is not None:
            if not (refused is Refusal.OVER and command.flags & Press.GOODBYE):  # which is sent several times
                slot.refusals.count(refused, f"planner {name}")
        elif command.flags & Press.UNSURE:
            slot.until_s, slot.session = -math.inf, 0
            self.tick()
        elif command.flags & Press.GOODBYE:
            self._leave(name)
        else:
            self._take(name, Drive(command.speed_mps, command.steering_rad) if command.flags else None, slot.until_s)

    def receive_ros(self, payload: bytes, attachment: bytes | None, arrival_s: float) -> None:
        """Take in one command of ROS 2's /drive; never raises, whatever the payload is."""
        slot = self._slots[ROS2_PLANNER]
        self.tick()
        try:
            sequence, stamp_ns, publisher = read_attachment(attachment or b"")
            speed_mps, steering_rad, header_s = read_ackermann(payload)
        except ValueError as error:
            slot.refusals.count(Refusal.MALFORMED, f"planner {ROS2_PLANNER}: {error}")
            return
        stamps = Stamps(stamp_ns / NS, header_s)
        if (refused := self._series.judge(sequence, stamps, publisher, arrival_s)) is not None:
            slot.refusals.count(refused, f"planner {ROS2_PLANNER}")
            return
        self._take(ROS2_PLANNER, Drive(speed_mps, steering_rad), self._series.until_s)

    def refuse_other_type(self, own_key: str, key: str, _payload: bytes, _arrival_s: float) -> None:
        """Count what comes on /drive under another type or type hash than own_key's: ROS 2 itself would hide it."""
        if key != own_key:
            self._slots[ROS2_PLANNER].refusals.count(Refusal.OTHER_TYPE, f"planner {ROS2_PLANNER}")

    def tick(self) -> None:
        """Notice a silent planner; call at the rate of the heartbeats."""
        now_s = self._clock()
        if self._holder and now_s >= self._slots[self._holder].until_s:
            name, self._holder = self._holder, ""
            self._lost = name
            reason = f"planner {name} was lost"
            self._log.log("lost", f"{reason}: no fresh command and no goodbye")
            self._queue.withdraw(Source.PLANNER)
            self._queue.put(refusal(Source.PLANNER_HOLD, reason))
            if not self._permit.always and now_s < self._permit.until_s:
                self._rearm(reason)
        elif self._lost and not self._permit.always and now_s < self._permit.until_s:
            self._lost = ""  # the permit ended with the planner: this one is a new act
            if following := self._first():
                self._give_to(following)
            else:
                self._queue.withdraw(Source.PLANNER_HOLD)

    @property
    def is_attended(self) -> bool:
        """Whether a planner has sent commands lately."""
        now_s = self._clock()
        return any(now_s - slot.heard_s < HEARD_S for slot in self._slots.values())

    def status(self) -> Mapping[str, Any]:
        """Return the planners as plain values."""
        now_s = self._clock()
        return {
            "driving": self._holder,
            "lost": self._lost,
            "planners": {
                name: {
                    "live": now_s < slot.until_s,
                    "age_s": now_s - slot.heard_s if math.isfinite(slot.heard_s) else None,
                    "accepted": slot.accepted,
                    "refused": dict(slot.refusals.counts),
                }
                for name, slot in self._slots.items()
            },
        }

    def _judge(self, slot: _Slot, command: Command, now_s: float, arrival_s: float) -> Refusal | None:
        if command.flags not in {Press(0), Press.MANUAL, Press.GOODBYE, Press.GOODBYE | Press.UNSURE}:
            return Refusal.CONTRADICTION
        if command.session != slot.session and now_s < slot.until_s:
            return Refusal.TOO_MANY
        session = slot.gate.admit(command, now_s, arrival_s)
        if isinstance(session, Refusal):
            return session
        slot.session, slot.until_s = command.session, session.beat_s + self._expiry_s
        session.over = bool(command.flags & Press.GOODBYE)
        return None

    def _take(self, name: str, drive: Drive | None, until_s: float) -> None:
        """Keep a command in the planner's slot, and put it unless a more urgent planner has one in force."""
        slot = self._slots[name]
        slot.drive, slot.until_s, slot.heard_s = drive, until_s, self._clock()
        slot.accepted += 1
        if self._first() == name:
            self._give_to(name)

    def _first(self) -> str:
        """Return the most urgent planner with a command in force, "" without one."""
        now_s = self._clock()
        return next((name for name, slot in self._slots.items() if slot.until_s > now_s), "")

    def _give_to(self, name: str) -> None:
        """Let the command in a planner's slot drive."""
        slot = self._slots[name]
        if self._holder != name or self._lost:
            self._holder, self._lost = name, ""
            self._log.log("driving", f"planner {name} has the car", logging.INFO)
            self._queue.put(refusal(Source.PLANNER_HOLD, f"planner {name} has the car and asks for nothing"))
        if slot.drive is None:
            self._queue.withdraw(Source.PLANNER)
        else:
            word = DriveCommand(Source.PLANNER, slot.drive, None, f"planner {name} drives")
            self._queue.put(word, expires_at_s=slot.until_s)

    def _leave(self, name: str) -> None:
        """Give the car to the next planner with a command in force, else to the follower, under the same permit."""
        slot = self._slots[name]
        slot.until_s, slot.session = -math.inf, 0
        if name not in {self._holder, self._lost}:
            return
        self._log.log("left", f"planner {name} said goodbye", logging.INFO)
        if following := self._first():
            self._give_to(following)
        else:
            self._holder = self._lost = ""
            self._queue.withdraw(Source.PLANNER)
            self._queue.withdraw(Source.PLANNER_HOLD)
