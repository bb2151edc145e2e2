"""Thousands of histories of operators, links and accidents, judged by what was sent and not by how the desk works.

Every command asks for a speed of its own, so the speed at the mux names the very command that moves the car. The
judge keeps a plain diary of deliveries and checks for that command: was it fresh, new, the newest of its sender, and
was there a release since the last accident, without a gap in between?
"""

from dataclasses import dataclass

from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import Bundle, RuleBasedStateMachine, initialize, invariant, precondition, rule

from tests.runtime.operator_rig import CAR_SESSION, Rig
from wallride.runtime.arbitration.command import Source
from wallride.runtime.arbitration.emergency_stop import Cause
from wallride.runtime.teleop.sessions import MAX_SESSIONS
from wallride.runtime.wire.teleop import Input, Press, is_stop

EXPIRY_S = 0.2
FREE_S = 3.0
CLIENTS = st.integers(0, 2)
FLAGS = st.sampled_from(
    [Press(0)] * 4 + [Press.MANUAL] * 4 + [Press.AUTONOMY] * 3
    + [Press.RESET, Press.RESET, Press.TAKE_OVER, Press.ESTOP, Press.GOODBYE]
    + [Press.MANUAL | Press.AUTONOMY, Press.MANUAL | Press.RESET, Press.MANUAL | Press.TAKE_OVER]
)  # fmt: skip

SELDOM = st.sampled_from([False] * 9 + [True])


@dataclass
class Sent:
    """One command on its way."""

    session: int
    sequence: int
    beat_s: float
    flags: Press
    speed_mps: float
    foreign: bool
    frozen: bool
    payload: bytes


@dataclass
class Diary:
    """What reached the car from one session and was fresh and new when it did."""

    sequence: int = 0
    fresh_until_s: float = 0.0
    released_at: int = -1  # step of the last release in an unbroken series
    last: Sent | None = None
    over: bool = False
    heard_s: float = 0.0


class OperatorMachine(RuleBasedStateMachine):
    """Clients press, links delay, repeat and lose, devices fail, the car stalls."""

    waiting = Bundle("waiting")

    @initialize(mode=st.sampled_from(["required", "always"]))
    def start(self, mode):
        self.rig = Rig(mode)
        self.always = mode == "always"
        self.people = [self.rig.client(name) for name in ("Ann", "Bob", "Eve")]
        self.beats = {self.rig.heard.beat: self.rig.now_s}
        self.diaries = {}
        self.sent = {}
        self.step = 0
        self.accident_at = -1  # step of the last reason to want a release from everybody
        self.held = False  # after an accident: autonomy must wait for an act
        self.reset_ok = False  # whether this step may open the e-stop
        self.latched = False
        self.before = ""
        self.handover_ok = False
        self.must_stand = False

    # --- what happens ---

    @rule(ticks=st.integers(1, 30))
    def time_passes(self, ticks):
        self.next_step()
        for _ in range(ticks):
            self.rig.now_s += 0.02
            self.notice()
            self.rig.beat()
            self.beats[self.rig.heard.beat] = self.rig.now_s

    @rule(seconds=st.sampled_from([0.01, 0.1, 0.19, 0.2, 0.3, 3.0, 4.0]))
    def the_car_stalls(self, seconds):
        self.next_step()
        self.rig.stall(seconds)
        self.notice()

    @rule(who=CLIENTS)
    def the_way_to_a_client_is_cut_or_mended(self, who):
        self.next_step()
        self.people[who].deaf = not self.people[who].deaf

    @rule(who=CLIENTS)
    def a_client_starts_anew(self, who):
        self.next_step()
        again = self.rig.client(self.people[who].name)
        self.rig.clients.remove(self.people[who])
        self.people[who] = again
        again.session = 1000 + self.step

    @rule(who=CLIENTS, flags=FLAGS, foreign=SELDOM, frozen=SELDOM)
    def a_command_arrives_at_once(self, who, flags, foreign, frozen):
        self.deliver(self.make(who, flags, foreign, frozen))

    @rule(who=CLIENTS, flags=st.sampled_from([Press.MANUAL, Press.AUTONOMY]))
    def somebody_does_it_right(self, who, flags):
        self.next_step()
        self.rig.beat()
        self.beats[self.rig.heard.beat] = self.rig.now_s
        self.deliver(self.make(who, Press(0), False, False))
        self.deliver(self.make(who, flags, False, False))

    @rule(target=waiting, who=CLIENTS, flags=FLAGS)
    def a_command_waits_in_the_link(self, who, flags):
        self.next_step()
        return self.make(who, flags, False, False)

    @rule(sent=waiting)
    def a_waiting_command_arrives_again_and_again(self, sent):
        self.deliver(sent)

    @precondition(lambda self: self.sent)
    @rule(data=st.data())
    def any_old_command_is_played_again(self, data):
        self.deliver(self.sent[data.draw(st.sampled_from(sorted(self.sent)))])

    @rule(stop=st.booleans())
    def a_broken_command_arrives(self, stop):
        self.next_step()
        payload = bytearray(self.people[0].make(Press.ESTOP if stop else Press.MANUAL, beat=0))
        payload[28:32] = b"\x00\x00\xc0\x7f"
        self.rig.desk.receive("", bytes(payload), self.rig.now_s)
        if stop:
            self.stop_was_pressed()

    @rule()
    def a_device_is_lost(self):
        self.next_step()
        self.rig.desk.rearm("the lidar was lost; permit again")
        self.accident_at = self.step

    @rule()
    def the_motor_has_a_fault_or_none_any_more(self):
        self.next_step()
        if Cause.MOTOR in self.rig.e_stop.causes:
            self.rig.desk.rearm("the motor had a fault; permit again")
            self.rig.e_stop.clear(Cause.MOTOR)
        else:
            self.rig.e_stop.latch(Cause.MOTOR, "motor fault: DRV")
            self.rig.desk.rearm("the motor had a fault; permit again")
        self.accident_at = self.step

    # --- the diary ---

    def next_step(self):
        self.step += 1
        self.reset_ok = self.handover_ok = self.must_stand = False
        self.before = self.rig.desk.view().session
        self.latched = Cause.OPERATOR in self.rig.e_stop.causes

    def make(self, who, flags, foreign, frozen):
        client = self.people[who]
        speed_mps = (len(self.sent) + 1) / 1024
        changes = {"speed_mps": speed_mps, "input": Input.PAD, "input_age_ms": 1500 if frozen else 0}
        if foreign:
            changes["car_session"] = CAR_SESSION + 1
        payload = client.make(flags, **changes)
        sent = Sent(
            client.session, client.sequence, self.beats[client.echo], flags, speed_mps, foreign, frozen, payload
        )
        self.sent[speed_mps] = sent
        return sent

    def deliver(self, sent):
        self.next_step()
        self.notice()
        now_s = self.rig.now_s
        if is_stop(sent.flags):
            self.stop_was_pressed()
        diary = self.diaries.setdefault(sent.session, Diary())
        counts = not sent.foreign and now_s < sent.beat_s + EXPIRY_S and sent.sequence > diary.sequence
        if counts and not diary.over:
            self.write_down(diary, sent)
        self.rig.desk.receive("", sent.payload, now_s)
        mine = self.rig.desk.view().session == f"{sent.session:016x}"
        if counts and mine and sent.flags in (Press.MANUAL, Press.AUTONOMY) and self.may_move(sent):
            self.held = False

    def write_down(self, diary, sent):
        if self.rig.now_s >= diary.fresh_until_s:
            diary.released_at = -1
        diary.sequence, diary.last = sent.sequence, sent
        diary.fresh_until_s = max(diary.fresh_until_s, sent.beat_s + EXPIRY_S)
        diary.heard_s = self.rig.now_s
        number = f"{sent.session:016x}"
        if sent.flags == 0:
            diary.released_at = self.step
        alone = self.before in {"", number}
        if sent.flags == Press.RESET and diary.released_at > self.accident_at and alone:
            self.reset_ok = True
            if self.latched:
                self.accident_at = self.step
                self.held = True
        if sent.flags & Press.TAKE_OVER and not sent.flags & Press.GOODBYE and not is_stop(sent.flags):
            self.handover_ok = self.must_stand = self.held = True
            self.accident_at = self.step
        if sent.flags & Press.GOODBYE:
            diary.over = True
            if number == self.before or self.lost == number:
                self.handover_ok = True
                self.held = False

    def stop_was_pressed(self):
        self.accident_at = self.step
        self.held = True
        self.must_stand = True

    lost = ""

    def notice(self):
        """Write down that the operator is silent, as anybody with a watch could."""
        number = self.rig.desk.view().session
        if number:
            diary = self.diaries[int(number, 16)]
            if self.rig.now_s >= diary.fresh_until_s:
                self.held = True
                self.lost = number
                diary.released_at = -1
            if self.rig.now_s - diary.heard_s >= FREE_S:
                self.handover_ok = True

    def may_move(self, sent):
        diary = self.diaries[sent.session]
        return (
            not sent.foreign
            and self.rig.now_s < sent.beat_s + EXPIRY_S
            and diary.last is sent
            and diary.released_at > self.accident_at
        )

    # --- the judge ---

    @invariant()
    def nothing_moves_by_hand_without_a_fresh_command_since_the_last_release(self):
        decision = self.rig.decision
        if decision.driver is Source.TELEOP and decision.speed_mps:
            sent = self.sent[decision.speed_mps]
            assert sent.flags == Press.MANUAL
            assert not sent.frozen
            assert self.may_move(sent)
            assert self.rig.desk.view().session == f"{sent.session:016x}"

    @invariant()
    def autonomy_moves_only_by_leave(self):
        decision = self.rig.decision
        if decision.driver is not Source.NAVIGATION or not decision.speed_mps:
            return
        number = self.rig.desk.view().session
        last = self.diaries[int(number, 16)].last if number else None
        if self.always:
            assert not self.held
            assert last is None or last.flags & Press.MANUAL == 0
            assert last is None or self.rig.now_s < self.diaries[last.session].fresh_until_s
        else:
            assert last is not None
            assert last.flags == Press.AUTONOMY
            assert self.may_move(last)

    @invariant()
    def an_e_stop_opens_only_by_a_reset(self):
        latched = Cause.OPERATOR in self.rig.e_stop.causes
        assert not self.latched or latched or self.reset_ok
        if latched or self.must_stand:
            assert self.rig.speed_mps == 0

    @invariant()
    def the_operator_changes_only_by_the_rules(self):
        now = self.rig.desk.view().session
        if self.before and now != self.before:
            assert self.handover_ok

    @invariant()
    def memory_is_bounded(self):
        assert self.rig.desk.view().sessions <= MAX_SESSIONS


TestOperator = OperatorMachine.TestCase
TestOperator.settings = settings(max_examples=150, stateful_step_count=40, deadline=None)
