"""Deadman and commands of the client: its half of "release means stop". Pure: time is an argument.

Every cycle sends the whole state, so that a release is a message like any other and a lost message loses nothing.
The gate: a deadman counts only after everything was seen released with the sticks centred, on a live device, over a
live link, and only if the sticks were still centred when it was pressed. Any trouble closes the gate, and only a
human hand opens it again. An e-stop needs no gate, and is repeated until the car reports that it latched.

A command states the truth: "nothing pressed" is sent only after an observed release. A pad that is gone, or a
deadman that is still held after an incident, is not a release (see DISTRUST).

The car has the same rules and the last word (runtime/teleop/desk.py); the rules here spare the operator surprises.
"""

import math
from collections import OrderedDict
from dataclasses import dataclass, replace
from enum import StrEnum

from wallride.clients.teleop.inputs import Control, Inputs
from wallride.clients.teleop.shaping import InputShape, Shaper
from wallride.runtime.wire.teleop import UNKNOWN_AGE_MS, Beat, CarCondition, Command, Input, Press, is_stop

HOLD_S = 1.0
INSIST_S = 1.0
"""Duration of repeating an accepted press to the car; then it must be released, lest it undo what comes later."""
LINK_LOST_S = 0.2
"""Timeout of the link, ten beats. The screen is drawn every 0.05 s, so that a lost link is seen within 0.3 s."""
PAUSE_S = 0.2
"""Minimum delay of a cycle that shows that this program itself was stopped."""
PAD_SILENT_S = 1.0
"""Timeout of a silent pad that commands a speed: a held stick jitters, so such a pad is gone without notice."""
PERMIT_SILENT_S = 5.0
"""Timeout of a silent pad under autonomy: a held button does not jitter; a moved stick shows that the pad is there."""
MINDED_S = 0.5
"""Timeout of the acknowledgement of a car that obeys this client."""
STOP_INSIST_S = 0.3
"""Minimum duration of sending an e-stop, also to a car that is already latched for another reason."""
REMEMBERED_COMMANDS = 500
DISTRUST = Press.UNSURE
"""Sent while we do not know the hands, or know that they still hold what no longer counts; 0 would be an explicit
release, after which autonomy may go on."""


class Hold:
    """Watches one button. Begins only after the button was seen released, because a stuck button is not a request."""

    def __init__(self) -> None:
        self._since_s: float | None = None
        self._spent = True

    def update(self, now_s: float, *, held: bool, alone: bool) -> bool:
        """Return whether to send the request now.

        held: the button is down. alone: nothing else is, and the device and the link are well.
        """
        if not held:
            self._since_s, self._spent = None, False
        elif self._spent or not alone:
            self._since_s, self._spent = None, True
        elif self._since_s is None:
            self._since_s = now_s
        elif now_s - self._since_s > HOLD_S + INSIST_S:
            self._since_s, self._spent = None, True
        return self._since_s is not None and now_s - self._since_s >= HOLD_S

    def done(self) -> None:
        """Record that the car did it: nothing more is sent until the button was released."""
        self._since_s, self._spent = None, True

    def progress(self, now_s: float) -> float:
        """Return the progress of the hold, 0 to 1; 0 when it does not count."""
        return 0.0 if self._since_s is None else min(1.0, (now_s - self._since_s) / HOLD_S)


class DeadmanFault(StrEnum):
    """Reasons why the deadman does not count, most significant first."""

    NONE = ""
    WAITING = "no heartbeat from the car yet"
    LINK = "the link is lost"
    DEVICE = "no input device"
    FROZEN = "the pad is silent"
    PAUSED = "this program stood still"
    RESTARTED = "the car's program restarted"
    LATCHED = "e-stop"
    OTHER = "another operator drives the car"
    LOST = "the car lost us"
    REARM = "the car wants a release"
    OFF_CENTRE = "a stick was not centred when the deadman was pressed"
    HELD = "not everything is released"


@dataclass(frozen=True, slots=True)
class PilotState:
    """State of the pilot, for screens and tests.

    block: present obstacle; closed_by: cause of closing the gate. flags, wanted_*: what was sent last.
    beat_age_s: since the last heartbeat, inf before the first. round_trip_s: NaN when not known.
    mine: the car obeys this session. unminded_s: how long the car has ignored our deadman.
    holding, progress: the deliberate press under way, and how far it is (0 to 1).
    link_s: round trip of the newest question to the car; patience_s: age of a command that it refuses; NaN: unknown.
    drives_alone: the car needs no permit, so it drives on when we let go.
    """

    block: DeadmanFault
    closed_by: DeadmanFault
    armed: bool
    inputs: Inputs
    flags: Press
    wanted_mps: float
    wanted_rad: float
    beat: Beat | None
    beat_age_s: float
    round_trip_s: float
    mine: bool
    unminded_s: float
    stop_pending: bool
    input_age_s: float
    holding: Control | None
    progress: float
    drives_alone: bool
    link_s: float = math.nan
    patience_s: float = math.nan

    @property
    def too_slow(self) -> bool:
        """Return whether the car would refuse a command as too old: the link takes longer than it waits."""
        round_trip_s = self.round_trip_s if self.mine and self.linked else self.link_s
        patience_s = self.patience_s if math.isfinite(self.patience_s) else LINK_LOST_S
        return round_trip_s > patience_s  # false for NaN

    @property
    def linked(self) -> bool:
        """Return whether heartbeats arrive."""
        return self.beat_age_s <= LINK_LOST_S

    @property
    def operator_name(self) -> str:
        """Return the name of the car's operator, "" without one."""
        if self.beat is None or self.beat.operator_session == 0:
            return ""
        return self.beat.operator_name or f"session {self.beat.operator_session:x}"


OF_ANOTHER = DeadmanFault.OTHER, DeadmanFault.LATCHED
"""Reasons against a deadman with which another operator may have the car: an e-stop stands before that."""


class Pilot:
    """Turns inputs and heartbeats into commands.

    session: random and not 0, one per start. name: shown by the car and to the others.
    """

    def __init__(self, session: int, name: str, feel: InputShape) -> None:
        self.session = session
        self._name = name
        self._shaper = Shaper(feel)
        self._holds = {Control.RESET: Hold(), Control.TAKE_OVER: Hold()}
        self._armed = False
        self._held = frozenset[Control]()
        self._closed_by = DeadmanFault.WAITING
        self._beat: Beat | None = None
        self._beat_s = -math.inf
        self._restarted = False
        self._round_trip_s = math.nan
        self._stop_since_s: float | None = None
        self._owes_release = False
        self._unminded_since_s: float | None = None
        self._sequence = 0
        self._sent_s: OrderedDict[int, float] = OrderedDict()
        self._last_s: float | None = None
        self._link_s = self._patience_s = math.nan
        self.situation: PilotState | None = None

    def is_addressed(self, command: Command) -> bool:
        """Tell whether a car can obey a command: it answers a heartbeat, or is a stop. Others only fill its log."""
        return self._beat is not None or is_stop(command.flags)

    def know_link(self, link_s: float, patience_s: float) -> None:
        """Take the measured round trip of the link, and the age at which the car refuses a command; NaN: unknown."""
        self._link_s, self._patience_s = link_s, patience_s

    def hear(self, beat: Beat, arrival_s: float) -> None:
        """Process a heartbeat; one that is not newer than the last is ignored."""
        last = self._beat
        if last is not None and last.car_session == beat.car_session:
            if (beat.beat - last.beat) & 0xFFFF_FFFF not in range(1, 0x8000_0000):
                return
        elif last is not None:
            self._restarted = True
        self._beat, self._beat_s = beat, arrival_s
        if beat.operator_session == self.session and beat.acknowledged_age_ms != UNKNOWN_AGE_MS:
            sent_s = self._sent_s.get(beat.acknowledged)
            if sent_s is not None:
                self._round_trip_s = max(0.0, arrival_s - sent_s - beat.acknowledged_age_ms / 1000)

    def step(self, inputs: Inputs, now_s: float) -> Command:
        """Return the command to send now; call it at a steady rate, whatever happened."""
        elapsed_s = 0.0 if self._last_s is None else now_s - self._last_s
        block = self._block(inputs, now_s, elapsed_s)
        self._gate(block, inputs)
        flags = self._honest(self._flags(block, inputs, now_s), inputs)
        if flags == Press.MANUAL:
            wanted_mps, wanted_rad = self._shaper.step(inputs.speed, inputs.steering, min(elapsed_s, PAUSE_S))
        else:
            self._shaper.reset()
            wanted_mps = wanted_rad = 0.0
        self._held = inputs.pressed if inputs.live else frozenset()
        self._last_s = now_s
        command = replace(
            self._command(flags, inputs.kind),
            input_age_ms=_age_ms(now_s - inputs.event_s),
            speed_mps=wanted_mps,
            steering_rad=wanted_rad,
        )
        self._remember_sent(command, now_s)
        self.situation = self._describe(block, inputs, command, now_s)
        return command

    def goodbye(self, inputs_kind: Input) -> Command:
        """Return the last word of this session: everything released. Send it thrice; each call is a new number."""
        return self._command(Press.GOODBYE, inputs_kind)

    @property
    def _is_others(self) -> bool:
        return self._beat is not None and self._beat.operator_session not in {0, self.session}

    @property
    def _is_mine(self) -> bool:
        return self._beat is not None and self._beat.operator_session == self.session

    def _block(self, inputs: Inputs, now_s: float, elapsed_s: float) -> DeadmanFault:
        """Return the present reason against any deadman."""
        beat, restarted = self._beat, self._restarted
        self._restarted = False
        if beat is None:
            return DeadmanFault.WAITING
        conditions = beat.flags
        blocks = {
            DeadmanFault.LINK: now_s - self._beat_s > LINK_LOST_S,
            DeadmanFault.DEVICE: not inputs.live,
            DeadmanFault.FROZEN: self._is_silent(inputs, now_s),
            DeadmanFault.PAUSED: elapsed_s > PAUSE_S,
            DeadmanFault.RESTARTED: restarted,
            DeadmanFault.LATCHED: inputs.wants_stop
            or self._stop_since_s is not None
            or CarCondition.ESTOP_LATCHED in conditions,
            DeadmanFault.OTHER: self._is_others,
            DeadmanFault.LOST: CarCondition.OPERATOR_LOST in conditions and beat.operator_session == self.session,
            DeadmanFault.REARM: CarCondition.REARM in conditions and self._is_meant(beat, now_s),
        }
        return next((block for block, holds in blocks.items() if holds), DeadmanFault.NONE)

    def _is_meant(self, beat: Beat, now_s: float) -> bool:
        """Return whether "release first" is for us: without an operator it may be for another client's stuck button."""
        if beat.operator_session == self.session:
            return True
        return self._unminded_since_s is not None and now_s - self._unminded_since_s > MINDED_S

    def _is_silent(self, inputs: Inputs, now_s: float) -> bool:
        if inputs.kind is not Input.PAD:
            return False
        silent_s = now_s - inputs.event_s
        moving = inputs.manual and self._shaper.wants_speed(inputs.speed)
        return (moving and silent_s > PAD_SILENT_S) or (inputs.autonomy and silent_s > PERMIT_SILENT_S)

    def _gate(self, block: DeadmanFault, inputs: Inputs) -> None:
        """Open the gate on a release without an obstacle; close it on any trouble."""
        if block is not DeadmanFault.NONE:
            self._armed, self._closed_by = False, block
        elif not self._armed:
            self._armed = inputs.released
        elif not inputs.sound or (Control.MANUAL in inputs.pressed - self._held and not inputs.centred):
            self._armed, self._closed_by = False, DeadmanFault.OFF_CENTRE

    def _flags(self, block: DeadmanFault, inputs: Inputs, now_s: float) -> Press:
        if self._is_stopping(inputs, now_s):
            return Press.ESTOP
        deliberate = self._deliberate(block, inputs, now_s)
        if deliberate:
            return deliberate
        if not self._armed:
            return Press(0)
        if inputs.manual:
            return Press.MANUAL
        return Press.AUTONOMY if inputs.autonomy else Press(0)

    def _honest(self, flags: Press, inputs: Inputs) -> Press:
        """Report "nothing pressed" only when it is true, to a car that obeyed us."""
        if flags in {Press.MANUAL, Press.AUTONOMY}:
            self._owes_release = True
        elif self._armed or (inputs.live and inputs.released):
            self._owes_release = False
        elif not flags and (self._owes_release or (self._is_mine and not inputs.live)):
            return DISTRUST
        return flags

    def _is_stopping(self, inputs: Inputs, now_s: float) -> bool:
        """Remember an e-stop until a heartbeat from after the press reports that it latched."""
        if inputs.wants_stop:
            self._stop_since_s = now_s
        since_s = self._stop_since_s
        if since_s is None or self._beat is None:
            return since_s is not None
        confirmed = CarCondition.ESTOP_LATCHED in self._beat.flags and self._beat_s > since_s
        if confirmed and now_s - since_s > STOP_INSIST_S:
            self._stop_since_s = None
        return self._stop_since_s is not None

    def _deliberate(self, block: DeadmanFault, inputs: Inputs, now_s: float) -> Press:
        """Return RESET or TAKE_OVER once it was held for long enough, until the car has done it."""
        sent = Press(0)
        beat = self._beat
        sound = beat is not None and block not in {
            DeadmanFault.LINK,
            DeadmanFault.DEVICE,
            DeadmanFault.PAUSED,
            DeadmanFault.RESTARTED,
        }
        for control, press, needed in (
            (Control.RESET, Press.RESET, beat is not None and _needs_reset(beat) and not self._is_others),
            (Control.TAKE_OVER, Press.TAKE_OVER, self._is_others and block in OF_ANOTHER),
        ):
            hold = self._holds[control]
            if not inputs.live or not needed:
                hold.done()
                held = control in inputs.pressed
                if inputs.live and not held:
                    hold.update(now_s, held=False, alone=False)
            elif hold.update(now_s, held=control in inputs.pressed, alone=sound and inputs.only(control)):
                sent = press
        if sent:
            self._armed, self._closed_by = False, DeadmanFault.HELD
        return sent

    def _remember_sent(self, command: Command, now_s: float) -> None:
        self._sent_s[command.sequence] = now_s
        if len(self._sent_s) > REMEMBERED_COMMANDS:
            self._sent_s.popitem(last=False)

    def _command(self, flags: Press, kind: Input) -> Command:
        """Return the next command of this session, as an answer to the latest heartbeat."""
        self._sequence += 1
        beat = self._beat
        return Command(
            session=self.session,
            sequence=self._sequence,
            car_session=beat.car_session if beat else 0,
            beat=beat.beat if beat else 0,
            flags=flags,
            input=kind,
            name=self._name,
        )

    def _describe(self, block: DeadmanFault, inputs: Inputs, command: Command, now_s: float) -> PilotState:
        mine = self._is_mine
        if mine or command.flags not in {Press.MANUAL, Press.AUTONOMY}:
            self._unminded_since_s = None
        elif self._unminded_since_s is None:
            self._unminded_since_s = now_s
        holding = next((control for control, hold in self._holds.items() if hold.progress(now_s) > 0), None)
        return PilotState(
            block=block,
            closed_by=self._closed_by,
            armed=self._armed,
            inputs=inputs,
            flags=command.flags,
            wanted_mps=command.speed_mps,
            wanted_rad=command.steering_rad,
            beat=self._beat,
            beat_age_s=now_s - self._beat_s,
            round_trip_s=self._round_trip_s,
            mine=mine,
            unminded_s=0.0 if self._unminded_since_s is None else now_s - self._unminded_since_s,
            stop_pending=self._stop_since_s is not None,
            input_age_s=now_s - inputs.event_s,
            holding=holding,
            progress=self._holds[holding].progress(now_s) if holding is not None else 0.0,
            drives_alone=self._beat is not None and CarCondition.ALONE in self._beat.flags,
            link_s=self._link_s,
            patience_s=self._patience_s,
        )


def _needs_reset(beat: Beat) -> bool:
    return bool(beat.flags & (CarCondition.ESTOP_LATCHED | CarCondition.FAULT))


def _age_ms(age_s: float) -> int:
    return UNKNOWN_AGE_MS if not math.isfinite(age_s) else max(0, min(int(age_s * 1000), UNKNOWN_AGE_MS))
