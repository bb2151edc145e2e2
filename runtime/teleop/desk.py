"""The operator's desk on the car: turns commands into entries of the command queue, and silence into a stop.

The rules, each with a test that fails when it is broken (docs/decisions/0008-teleop-protocol.md has the reasons):

* Only a fresh and new command is obeyed; stopping is obeyed from any command, however old or broken.
* A press counts only after a release was seen: at the start of a session, and again after every incident.
* One operator at a time. A takeover is visible, and stops the car.
* Manual driving: the drive command lasts as long as the operator's command behind it. Autonomy: the permit is a lease
  of the same length.
* An operator who falls silent without a goodbye is lost: autonomy does not take over, whatever the permit's mode.
* After an incident autonomy waits for an act of the operator: a press, or a goodbye. A release is no such act.

A plain state machine: the clock is injected, nothing here waits, and it knows no bus.
"""

import logging
import math
from collections.abc import Callable

from wallride.drivers.api import Clock, Drive
from wallride.runtime.arbitration.command import DriveCommand, Source
from wallride.runtime.arbitration.command_queue import CommandQueue
from wallride.runtime.arbitration.emergency_stop import Cause, EmergencyStop
from wallride.runtime.arbitration.permit import NOT_GRANTED, NOT_REQUIRED, Permit
from wallride.runtime.host.rate_limited_log import RateLimitedLog
from wallride.runtime.settings.operator import OperatorSettings
from wallride.runtime.teleop.rejections import Refusal, Refusals
from wallride.runtime.teleop.sessions import Beats, SessionGate, TeleopSession
from wallride.runtime.teleop.status import DeskFacts, OperatorState, OperatorView
from wallride.runtime.wire.teleop import UNKNOWN_AGE_MS, Beat, Command, Input, Malformed, Press, is_stop, read_command

log = logging.getLogger("wallride.operator")

RELEASE_FIRST = "release everything first, then press"


class TeleopStatements:
    """Puts the operator's command and permit, which change only together, into the command queue.

    While a human drives, the permit refuses in either mode, so that the silence of teleop never releases autonomy.
    While an operator is present at all, the permit's consent is a lease, so that it ends even if no task were left to
    notice.

    holding: what the last obeyed command held: MANUAL, AUTONOMY, or RELEASED.
    incident: why autonomy waits for an act of an operator, in the mode that needs no permit; "" when it does not.
    """

    def __init__(self, queue: CommandQueue, permit: Permit) -> None:
        self._queue = queue
        self._permit = permit
        self.holding = OperatorState.RELEASED
        self.incident = ""

    def drive(self, name: str, drive: Drive, *, until_s: float) -> None:
        """Put a manual drive command."""
        self.holding, self.incident = OperatorState.MANUAL, ""
        self._permit.refuse(f"{name} drives by hand")
        self._queue.put(DriveCommand(Source.TELEOP, drive, None, f"{name} drives"), expires_at_s=until_s)

    def permit(self, *, until_s: float) -> None:
        """Permit autonomy to move."""
        self._withdraw()
        self.holding, self.incident = OperatorState.AUTONOMY, ""
        self._permit.grant(until_s=until_s)

    def release(self, *, until_s: float) -> None:
        """Handle an explicit release: a stop, unless autonomy needs no permit and no act is awaited."""
        self._withdraw()
        if not self._permit.always:
            self.incident = ""  # here autonomy needs a press in any case
            self._permit.refuse(NOT_GRANTED)
        elif not self.incident:
            self._permit.grant(until_s=until_s, reason=NOT_REQUIRED)

    def halt(self, reason: str) -> None:
        """Stop; autonomy waits for an act of an operator, whatever the permit's mode."""
        self._withdraw()
        self.incident = reason
        self._permit.refuse(reason)

    def interrupt(self, reason: str) -> None:
        """End what the last command held: a stop; where it held nothing, only a granted permit is revoked."""
        if self.holding is OperatorState.RELEASED:
            self._permit.revoke(reason)
        else:
            self.halt(reason)

    def leave(self) -> None:
        """Return to the defaults without any operator."""
        self._withdraw()
        self.incident = ""
        self._permit.rest()

    def _withdraw(self) -> None:
        if self.holding is OperatorState.MANUAL:
            self._queue.withdraw(Source.TELEOP)
        self.holding = OperatorState.RELEASED


class OperatorDesk:
    """Takes commands (`receive`), detects silence (`tick`), and answers with heartbeats (`beat`).

    clear_fault: requests the motor to clear its fault; called on a deliberate reset of the e-stop.
    car_session: random per start of this process, never 0: commands meant for an earlier start do not count.
    beats: the numbered heartbeats. heard_elsewhere: whether another kind of client echoes them.
    waits: tells whether a press, by hand or not, must wait for a lost device. Else it would move the car from the
        device's return until that is noticed.
    """

    def __init__(
        self,
        settings: OperatorSettings,
        queue: CommandQueue,
        permit: Permit,
        emergency_stop: EmergencyStop,
        clear_fault: Callable[[], None],
        clock: Clock,
        car_session: int,
    ) -> None:
        self._settings = settings
        self._permit = permit
        self._emergency_stop = emergency_stop
        self._clear_fault = clear_fault
        self._clock = clock
        self._car_session = car_session
        self.waits: Callable[[bool], bool] = lambda _by_hand: False
        self.heard_elsewhere: Callable[[], bool] = lambda: False
        self.beats = self._beats = Beats(clock)
        self._gate = SessionGate(
            self._beats, car_session, expiry_s=settings.expiry_s, forget_after_s=settings.slot_free_after_s
        )
        self._log = RateLimitedLog(log, clock)
        self._refusals = Refusals(self._log)
        self._words = TeleopStatements(queue, permit)
        self._operator: TeleopSession | None = None
        self._lost: TeleopSession | None = None  # fell silent; until a client acts or it says goodbye
        self._reason = ""  # reason why everything has to be released
        self._futile_until_s = -math.inf  # until then a client presses without a release before
        self._accepted = 0
        self._round_trip_s: float | None = None
        self._command: Command | None = None  # the operator's newest

    def receive(self, _key: str, payload: bytes, arrival_s: float) -> None:
        """Take in one command; never raises, whatever the payload is.

        arrival_s: its arrival on the monotonic clock; only for the round trip that the operator's client shows.
        """
        now_s = self._clock()
        try:
            command = read_command(payload)
        except Malformed as error:
            self._refusals.count(Refusal.MALFORMED, str(error))
            if error.stop:
                self._press_e_stop("an unreadable command")
            return
        if is_stop(command.flags):
            self._press_e_stop(command.name or "an operator without a name")
        self._notice_silence(now_s)  # first, or a late command would pass for an unbroken series
        session = self._gate.admit(command, now_s, arrival_s)
        if session is Refusal.OVER and command.flags & Press.GOODBYE:
            self._accepted += 1  # a goodbye is sent several times, because one may be lost
            return
        if isinstance(session, Refusal) and is_stop(command.flags):
            self._accepted += 1  # it is obeyed all the same: STOP ALL is sent to cars that were not heard before
            return
        if isinstance(session, Refusal):
            self._refusals.count(session, _advice(session))
            return
        self._accepted += 1
        self._obey(session, command, now_s)

    def tick(self) -> None:
        """Detect missing commands; call at the rate of the heartbeats."""
        self._notice_silence(self._clock())

    @property
    def command(self) -> Command | None:
        """The operator's newest command; None without an operator, or once it has expired."""
        operator = self._operator
        is_fresh = operator is not None and self._lost is None and self._clock() < operator.fresh_until_s
        return self._command if is_fresh else None

    @property
    def is_attended(self) -> bool:
        """Whether a client has sent commands lately, to drive or only to be present."""
        return bool(self._gate.heard_lately(self._clock())) or self.heard_elsewhere()

    def rearm(self, reason: str) -> None:
        """Disarm all sessions and end what is held: a device was lost or came back; the reason is shown."""
        self._gate.disarm()
        self._reason = reason
        self._words.interrupt(reason)

    def beat(self, speed_mps: float) -> Beat:
        """Return the next heartbeat, to be sent at once. speed_mps: measured, NaN when unknown."""
        number, condition, operator = self._beats.count_sent(), self._facts().condition(), self._operator
        if operator is None:
            return Beat(self._car_session, number, condition, speed_mps=speed_mps)
        age_ms = round(min(max(0.0, (self._clock() - operator.arrived_s) * 1000), UNKNOWN_AGE_MS))
        return Beat(
            self._car_session, number, condition, operator.number, operator.sequence, age_ms, speed_mps, operator.name
        )

    def view(self) -> OperatorView:
        """Return the present state as plain values."""
        now_s, facts, operator = self._clock(), self._facts(), self._operator
        return OperatorView(
            standing=facts.standing(),
            operator=operator.title if operator else "",
            session=f"{operator.number:016x}" if operator else "",
            sessions=self._gate.heard_lately(now_s),
            accepted=self._accepted,
            age_s=now_s - operator.heard_s if operator else None,
            round_trip_s=self._round_trip_s if operator else None,
            reason=(self._reason if operator else RELEASE_FIRST) if facts.must_release else facts.incident,
            permit=self._permit.reason,
            permitted=facts.permitted,
            e_stop={str(cause): reason for cause, reason in facts.e_stop.items()},
            refused=self._refusals.counts,
        )

    def _obey(self, session: TeleopSession, command: Command, now_s: float) -> None:
        if session is self._operator:
            self._lost = None
            self._round_trip_s = now_s - session.beat_s
        flags = command.flags
        if flags & Press.GOODBYE:
            self._leave(session, unsure=bool(flags & Press.UNSURE))
        elif is_stop(flags):
            pass  # done already, before its age was looked at
        elif flags & Press.UNSURE:
            self._distrust(session, Refusal.UNSURE, "release everything, then press again")
        elif flags & Press.TAKE_OVER:
            self._take_over(session)
        elif not flags:
            self._release(session)
        elif self._operator not in {None, session}:
            session.armed = False  # or it would move the car by itself when the other operator leaves
            self._refusals.count(Refusal.NOT_OPERATOR, "another operator drives; take over, or wait")
        elif not session.armed or self._must_wait(flags):
            session.armed = False
            self._futile_until_s = now_s + self._settings.expiry_s
            self._refusals.count(Refusal.REARM, RELEASE_FIRST)
            self._end_what_is_held(session)
        else:
            self._press(session, command)
        if session is self._operator:
            self._command = command

    def _end_what_is_held(self, session: TeleopSession) -> None:
        """Stop what the operator held until now: a press in its place ends it, also one that does not count."""
        if session is self._operator and self._words.holding is not OperatorState.RELEASED:
            self._halt(RELEASE_FIRST)

    def _must_wait(self, flags: Press) -> bool:
        return flags in {Press.MANUAL, Press.AUTONOMY} and self.waits(flags == Press.MANUAL)

    def _press(self, session: TeleopSession, command: Command) -> None:
        flags, until_s = command.flags, session.beat_s + self._settings.expiry_s
        if flags == Press.RESET:
            self._reset(session)
        elif self._emergency_stop.latched:
            self._distrust(session, Refusal.HELD, "release everything, then reset the e-stop")
        elif flags == Press.MANUAL and self._is_frozen(command):
            self._distrust(session, Refusal.FROZEN, "no event from it although it drives; switch it off and on")
        elif flags == Press.MANUAL:
            self._appoint(session)
            self._words.drive(session.title, Drive(command.speed_mps, command.steering_rad), until_s=until_s)
        elif flags == Press.AUTONOMY:
            self._appoint(session)
            self._words.permit(until_s=until_s)
        else:
            self._distrust(session, Refusal.CONTRADICTION, "press one thing at a time")

    def _release(self, session: TeleopSession) -> None:
        session.armed = True
        if session is self._operator:
            self._words.release(until_s=session.beat_s + self._settings.expiry_s)

    def _leave(self, session: TeleopSession, *, unsure: bool) -> None:
        """Give the place back. unsure: without a release, as a script that failed: autonomy waits for an operator.

        A script may fail before its first press: with no operator at the desk its goodbye stops the car all the same.
        """
        session.over = True
        if session not in {self._operator, self._lost} and not (unsure and self._operator is None):
            return
        self._operator = self._lost = None
        if unsure:
            self._log.log("left", f"{session.title} left without a release")
            self._halt(f"{session.title} left without a release")
        else:
            self._log.log("left", f"{session.title} said goodbye", logging.INFO)
            self._words.leave()

    def _take_over(self, session: TeleopSession) -> None:
        self._gate.disarm()
        self._appoint(session)
        self._halt(f"{session.title} took over")

    def _reset(self, session: TeleopSession) -> None:
        if not self._emergency_stop.latched:
            session.armed = False
            self._reason = "a reset, and nothing to reset"
            self._words.interrupt(self._reason)
        else:
            self._gate.disarm()
            self._appoint(session)
            self._log.log("reset", f"{session.title} reset the e-stop")
            self._emergency_stop.clear(Cause.OPERATOR)
            self._clear_fault()
            self._halt("the e-stop was reset")

    def _appoint(self, session: TeleopSession) -> None:
        self._lost = None
        if self._operator is not session:
            self._operator = session
            self._log.log("operator", f"{session.title} operates", logging.INFO)

    def _press_e_stop(self, name: str) -> None:
        self._gate.disarm()  # each time: a reset must come after the last press of any client
        if Cause.OPERATOR not in self._emergency_stop.causes:
            reason = f"e-stop by {name}"
            self._log.log("e-stop", reason)
            self._emergency_stop.latch(Cause.OPERATOR, reason)
            self._halt(reason)

    def _distrust(self, session: TeleopSession, kind: Refusal, advice: str) -> None:
        self._refusals.count(kind, advice)
        session.armed = False
        if session is self._operator:
            self._halt(f"{kind}: {advice}")

    def _notice_silence(self, now_s: float) -> None:
        operator = self._operator
        if operator is None or now_s < operator.fresh_until_s:
            return
        if self._lost is not operator:
            self._lost = operator
            operator.armed = False
            self._halt(f"{operator.title} was lost")
            self._log.log("lost", f"{operator.title} was lost: no fresh command and no goodbye")
        if now_s - operator.heard_s >= self._settings.slot_free_after_s:
            self._operator = None

    def _halt(self, reason: str) -> None:
        self._reason = reason
        self._words.halt(reason)

    def _is_frozen(self, command: Command) -> bool:
        still_s = command.input_age_ms / 1000
        return command.input is Input.PAD and command.speed_mps != 0 and still_s > self._settings.frozen_after_s

    def _facts(self) -> DeskFacts:
        now_s = self._clock()
        operator = self._operator
        return DeskFacts(
            e_stop=self._emergency_stop.causes,
            present=operator is not None and self._lost is None,
            lost=self._lost is not None,
            must_release=not operator.armed if operator is not None else now_s < self._futile_until_s,
            holding=self._words.holding,
            incident=self._words.incident,
            permitted=now_s < self._permit.until_s and not self._emergency_stop.latched,
            alone=self._permit.always,
        )


def _advice(kind: Refusal) -> str:
    """Return the meaning of a command that did not pass the gate, for the log."""
    return {
        Refusal.FOREIGN: "sent before this car was heard, or for an earlier start of it",
        Refusal.UNKNOWN_BEAT: "echoes a beat that was not sent lately",
        Refusal.STALE: "the link is slow, or was away for a while",
        Refusal.REPLAY: "not newer than the last of its session",
        Refusal.OVER: "said goodbye; start the client again",
        Refusal.TOO_MANY: "close some of the clients",
    }.get(kind, "")
