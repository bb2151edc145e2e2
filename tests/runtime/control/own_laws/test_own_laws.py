"""Laws of the user in the live stack: what they are given, and that no mistake of theirs moves the car."""

import ctypes
import math
import re
import signal

import numpy as np
import pytest

from tests.own_laws import EASY, HEAD, INIT, STRAIGHT, follow, limit
from tests.runtime.control.scans import scan_of
from tests.runtime.in_earnest import judged
from wallride.drivers.api import MotorState
from wallride.runtime.arbitration.command import Source, arbitrate, consent
from wallride.runtime.control.own_laws import runner
from wallride.runtime.host.stop_signals import STOP_SIGNALS, StopSignals
from wallride.runtime.live_stack import REQUIRED, LiveStack
from wallride.runtime.parameters.catalogue import catalogue, values
from wallride.runtime.parameters.update import UnacceptableError, plan
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.settings.tree import Settings, load_settings, to_toml
from wallride.sim.virtual.devices import BEAMS, ranges_between_walls

NO_PATH = "returned path_m and path_mps that are not the numbers of (2, n) places and (n,) speeds (FILE:5)"
ROLLING = MotorState(100.0, 1.0, 0.0, 0.1)


class Car:
    """A stack whose clock advances by `costs_s` at every reading."""

    def __init__(self, *wanted):
        self.now_s, self.costs_s, self.scans = 100.0, 0.0, 0
        self.stack = LiveStack(load_settings(None, wanted, laws=True), DecisionLog(self.clock, 64))
        self.stack.queue.put(consent(Source.PERMIT, "test"))

    def clock(self):
        self.now_s += self.costs_s
        return self.now_s

    def scan(self, ahead_m=math.nan):
        """Answer one scan and return what would be sent."""
        self.scans += 1
        self.now_s += 0.025
        scan = scan_of(ranges_between_walls(1.0, 1.0, ahead_m), self.now_s, self.scans)
        costs_s = self.costs_s
        self.stack.look(scan, ROLLING)
        self.stack.follow(scan, ROLLING)
        self.costs_s = 0.0
        decision, memories = arbitrate(self.stack.queue.live(), REQUIRED, self.stack.queue.order)
        for assessment, memory in memories:
            assessment.commit(memory)
        self.costs_s = costs_s
        return decision

    @property
    def fault(self):
        return self.stack.laws.own_law_fault


def follower(name, *more):
    return Car(f"wall_follow.method={name}", *more)


def test_an_own_law_drives(law_file):
    car = follower(law_file(STRAIGHT))
    decision = car.scan()
    assert (decision.speed_mps, decision.steering_rad, decision.driver) == (1.0, 0.0, Source.NAVIGATION)
    assert car.fault == ""


def test_it_is_given_arrays_in_si_units_and_what_is_wanted(law_file):
    body = INIT + (
        "def follow(self, scan, state):\n"
        "    import builtins; builtins.seen_by_law = (scan, state, scan.points_m())\n"
        "    return Guidance(0.5, 0.0)\n"
    )
    car = follower(
        law_file(body), "wall_follow.side=right", "wall_follow.speed_mps=2", "wall_follow.desired_distance_m=0.7"
    )
    car.scan(ahead_m=3.0)
    import builtins

    scan, state, points_m = builtins.seen_by_law  # type: ignore[attr-defined]
    assert scan.ranges_m.shape == scan.angles_rad.shape == (BEAMS,)
    left = int(np.argmin(np.abs(scan.angles_rad - math.pi / 2)))
    assert scan.ranges_m[left] == pytest.approx(1.0, abs=0.01)
    assert points_m[:, left] == pytest.approx([0.27, 1.0], abs=0.02)
    assert (state.side, state.desired_speed_mps, state.desired_distance_m) == ("right", 2.0, 0.7)
    assert (state.speed_mps, state.steering_rad) == (1.0, 0.1)


def odd(base, method):
    """Return the expression of a class whose method raises."""
    return f"type('Odd', ({base},), {{'{method}': lambda *_: {{}}['odd']}})"


def raising(error):
    return f"{INIT}def follow(self, scan, state): import asyncio; raise {error}\n"


RAISES = f"{INIT}def follow(self, scan, state):\n    return Guidance(1.0, 1 / 0)\n"


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        (RAISES, "raised ZeroDivisionError: division by zero (FILE:6)"),
        (INIT + "def follow(self, scan, state): sys.exit(3)\n", "raised SystemExit: 3 (FILE:5)"),
        (raising("asyncio.CancelledError"), "raised CancelledError (FILE:5)"),
        (raising("GeneratorExit"), "raised GeneratorExit (FILE:5)"),
        (raising("BaseException('lost')"), "raised BaseException: lost (FILE:5)"),
        (raising(odd("Exception", "__str__")), "raised an exception that cannot be shown (FILE:5)"),
        (raising("ValueError(chr(0xdc80) + chr(27))"), "raised ValueError: ?? (FILE:5)"),
        (raising("SyntaxError('odd', (3, {}, None, 4))"), "raised SyntaxError: odd (FILE:5)"),
        (follow(f"Guidance(1.0, {odd('object', '__float__')}())"), "raised KeyError: 'odd' (FILE:5)"),
        (follow("Guidance(10 ** 5000, 0.0)"), "returned speed_mps = int, which is no finite number (FILE:5)"),
        (follow("Guidance(chr(0xdc80), 0.0)"), "returned speed_mps = '\\udc80', which is no finite number (FILE:5)"),
        (follow(f"{odd('Guidance', '__getattribute__')}(1.0, 0.0)"), "raised KeyError: 'odd' (FILE:5)"),
        (follow("Guidance(1.0, math.nan)"), "returned steering_rad = nan, which is no finite number (FILE:5)"),
        (follow("Guidance(math.inf, 0.0)"), "returned speed_mps = inf, which is no finite number (FILE:5)"),
        (follow("Guidance('fast', 0.0)"), "returned speed_mps = 'fast', which is no finite number (FILE:5)"),
        (follow("Guidance(True, 0.0)"), "returned speed_mps = True, which is no finite number (FILE:5)"),
        (follow("Guidance(1.0, 0.0, None)"), "returned distance_m = NoneType, which is no number (FILE:5)"),
        (follow("Guidance(1.0, 0.0, path_m=[[0.0, 1.0]], path_mps=[1.0, 1.0])"), NO_PATH),
        (follow("Guidance(1.0, 0.0, path_m=[[0.0, 1.0], [0.0, 0.0]], path_mps=[1.0])"), NO_PATH),
        (follow("Guidance(1.0, 0.0, path_m='on')"), NO_PATH),
        (follow("Guidance(1.0, 0.0, reason=3)"), "returned reason = 3, which is no text (FILE:5)"),
        (follow("(1.0, 0.0)"), "returned a tuple where a Guidance is needed (FILE:5)"),
        (follow("None"), "returned nothing where a Guidance is needed (FILE:5)"),
    ],
)
def test_each_mistake_stops_the_car_with_name_and_line(law_file, body, sentence):
    name = law_file(body)
    car = follower(name)
    decision = car.scan()
    assert decision.speed_mps == 0.0
    assert car.fault == decision.reason == f"{name} {sentence.replace('FILE', name.replace(':Law', '.py'))}"
    assert car.fault in car.stack.laws.words


@pytest.mark.parametrize(
    ("reason", "shown"),
    [
        ("chr(0xd800) + 'gap' + chr(27)", "?gap?"),
        (odd("str", "__str__") + "('gap')", "gap"),
        (odd("str", "__getitem__") + "('gap')", "gap"),
        ("'gap' * 10 ** 6", "gap" * 20),
    ],
)
def test_an_odd_reason_becomes_a_short_printable_text(law_file, reason, shown):
    car = follower(
        law_file(follow(f"Guidance(np.float32(0.5), 0, reason={reason})"), head=f"import numpy as np\n{HEAD}")
    )
    decision = car.scan()
    assert (decision.speed_mps, decision.reason) == (0.5, shown)
    assert type(decision.reason) is str
    assert type(decision.speed_mps) is float


def test_a_ctrl_c_is_no_fault_of_a_law_where_python_raises_it(law_file):
    with pytest.raises(KeyboardInterrupt):
        follower(law_file(raising("KeyboardInterrupt"))).scan()


def test_a_law_that_changes_what_a_signal_does_has_a_fault_and_the_signal_is_held(law_file, monkeypatch):
    signals, stops = StopSignals(), []
    monkeypatch.setattr(runner, "STOP_SIGNALS_HELD", signals)
    before = [signal.getsignal(number) for number in STOP_SIGNALS]
    try:
        signals.hold(lambda: [signal.signal(number, lambda *_: stops.append(1)) for number in STOP_SIGNALS])
        name = law_file(follow("signal.signal(signal.SIGTERM, signal.SIG_IGN)"), head=HEAD.replace("math", "signal"))
        car = follower(name)
        assert car.scan().speed_mps == 0.0
        assert car.fault == f"{name} changed what SIGTERM does, which ends the process ({name[:-4]}.py:5)"
        signal.raise_signal(signal.SIGTERM)
        signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGHUP])
        ctypes.CDLL(None).signal(ctypes.c_int(signal.SIGUSR1), ctypes.c_void_p(1))  # SIG_IGN, which Python does not see
        signals.put_back()
        signal.raise_signal(signal.SIGHUP)
        signal.raise_signal(signal.SIGUSR1)
        assert stops == [1, 1, 1]
    finally:
        for number, handler in zip(STOP_SIGNALS, before, strict=True):
            signal.signal(number, handler)


def test_a_fault_lasts_until_it_is_tried_again(law_file):
    body = INIT + (
        "def follow(self, scan, state):\n"
        "    self.scans += 1\n"
        "    if self.scans > 1: raise ValueError(f'at {self.scans}')\n"
        "    return Guidance(1.0, 0.0)\n"
    )
    car = follower(law_file(body))
    assert [car.scan().speed_mps for _ in range(4)] == [1.0, 0.0, 0.0, 0.0]
    assert "at 2" in car.fault, "it was called again"
    car.stack.apply(car.stack.settings)
    assert car.scan().speed_mps == 1.0
    assert car.fault == ""
    assert [runner.faults for runner in car.stack.laws.runners] == [1]


def test_only_a_change_of_its_own_settings_tries_a_law_with_a_fault_again(law_file):
    car = follower(law_file(SETTINGS + follow("1 / (self.settings.gain - 1.5)")))
    car.scan()
    for speed_mps in (1.1, 1.2):  # a slider
        car.stack.apply(plan(car.stack.settings, {"wall_follow.speed_mps": speed_mps, "mux.tick_hz": 40.0}).settings)
        assert "division by zero" in car.fault
        assert car.scan().speed_mps == 0.0
    car.stack.apply(plan(car.stack.settings, {"wall_follow.own.gain": 2.0}).settings)
    assert car.fault == ""
    assert car.stack.laws.runners[0].last_fault, "the text is kept"


def test_three_slow_answers_in_a_row_are_a_fault_and_two_are_not(law_file):
    name = law_file(STRAIGHT)
    car = follower(name, "safety.method=report", "wall_follow.budget_s=0.005")
    for costs_s in (0.006, 0.006, 0.004, 0.006, 0.006):
        car.costs_s = costs_s
        assert car.scan().speed_mps == 1.0
    assert car.scan().speed_mps == 0.0
    assert re.search(r"is too slow 3 times in a row: 6\.0 ms where 5 ms are allowed \(own_law_\d+\.py:5\)$", car.fault)


def test_one_answer_far_over_the_budget_is_a_fault(law_file):
    car = follower(law_file(STRAIGHT), "safety.method=report")
    car.costs_s = 0.099
    car.scan()
    assert car.fault == ""
    car.costs_s = 0.101
    assert car.scan().speed_mps == 0.0
    assert "is too slow: 101.0 ms where 5 ms are allowed" in car.fault


def test_a_law_whose_constructor_raises_never_drives(law_file):
    car = follower(law_file(STRAIGHT.replace("self.settings, self.scans = settings, 0", "open('nothing')")))
    assert car.scan().speed_mps == 0.0
    assert "raised FileNotFoundError" in car.fault
    assert car.fault.endswith(".py:4)")


SETTINGS = "class Settings(LawSettings):\n    gain: float = 1.5\n    '''Gain [rad/m].'''\n"


def test_its_settings_are_settings_of_the_car(law_file):
    name = law_file(SETTINGS + follow("Guidance(self.settings.gain, 0.0)"))
    car = follower(name, "wall_follow.own.gain=0.5")
    assert car.scan().speed_mps == 0.5
    known = catalogue(car.stack.settings)["wall_follow.own.gain"]
    assert (known.default, known.unit, known.words) == (1.5, "rad/m", "Gain [rad/m].")
    car.stack.apply(plan(car.stack.settings, {"wall_follow.own.gain": 0.75}).settings)
    assert car.scan().speed_mps == 0.75
    assert values(car.stack.settings)["wall_follow.own.gain"] == 0.75
    text = to_toml(car.stack.settings)
    assert "[wall_follow.own]\ngain = 0.75\n" in text
    with pytest.raises(UnacceptableError, match=r"wall_follow\.own\.gain = 'x': must be a number rad/m"):
        plan(car.stack.settings, {"wall_follow.own.gain": "x"})
    with pytest.raises(UnacceptableError, match=r"wall_follow\.own\.gian is not a setting; did you mean"):
        plan(car.stack.settings, {"wall_follow.own.gian": 1.0})


def test_the_settings_survive_a_file_and_a_recording(law_file, tmp_path):
    settings = load_settings(
        None, [f"wall_follow.method={law_file(SETTINGS + follow('None'))}", "wall_follow.own.gain=3"], laws=True
    )
    file = tmp_path / "car.toml"
    file.write_text(to_toml(settings))
    assert load_settings(file) == settings
    assert Settings.model_validate(settings.model_dump(mode="json")) == settings


def test_a_driving_car_may_switch_to_a_law_that_it_has_loaded_and_to_no_other(law_file):
    name, other = law_file(STRAIGHT), law_file(STRAIGHT)
    settings = load_settings(None, [f"wall_follow.method={name}"], laws=True)
    ball = plan(settings, {"wall_follow.method": "ball"}).settings
    assert plan(ball, {"wall_follow.method": name}).settings == settings
    with pytest.raises(UnacceptableError, match="is loaded at the start only: name it in the file, restart"):
        plan(ball, {"wall_follow.method": other})
    with pytest.raises(UnacceptableError, match="is loaded at the start only"):
        plan(ball, {"wall_follow.method": "os:PathLike"})


def test_a_safety_law_that_is_chosen_while_driving_keeps_the_settings_of_swept(law_file):
    name = law_file(EASY)
    load_settings(None, [f"safety.method={name}"], laws=True)  # the process knows it
    before = load_settings(None, ["safety.grip_mu=0.5", "safety.backs_out=false"])
    after = plan(before, {"safety.method": name}).settings
    assert (after.safety.grip_mu, after.safety.backs_out) == (0.5, False)
    assert plan(after, {"safety.method": "swept"}).settings == before


def test_a_law_may_promise_its_path(law_file):
    path = "path_m=[[0.0, 0.4, 0.8], [0.0, 0.0, 0.1]], path_mps=[1.0, 1.0, 0.5]"
    car = Car(f"wall_follow.method={law_file(follow(f'Guidance(1.0, 0.0, {path})'))}")
    car.scan()
    (promise,) = [word.promise for word in car.stack.queue.live() if word.source is Source.NAVIGATION]
    assert promise.path_m.tolist() == [[0.0, 0.4, 0.8], [0.0, 0.0, 0.1]]
    assert promise.speed_mps.tolist() == [1.0, 1.0, 0.5]
    assert promise.stamp_s == car.now_s


def guard(name, *more):
    return Car(f"safety.method={name}", "wall_follow.method=report", *more)


def test_an_own_safety_law_lowers_the_limit(law_file):
    car = guard(law_file(limit("Limit(0.4, 0.0, 'slow zone')")))
    decision = car.scan()
    assert (decision.speed_mps, decision.winner, decision.reason) == (0.4, Source.SAFETY, "slow zone")
    assert judged(car.stack.queue.live()[0].assessment, -1.0, 0.0).reverse_mps == 0.0


@pytest.mark.parametrize("body", [EASY, limit("Limit(math.inf, 0.0)"), limit("Limit(5.0, math.inf)")])
def test_an_own_safety_law_cannot_switch_off_the_cars_own(law_file, body):
    car = guard(law_file(body))
    free = car.scan()
    assert free.speed_mps == 1.0
    blocked = [car.scan(ahead_m=0.3) for _ in range(3)][-1]
    assert (blocked.speed_mps, blocked.winner) == (0.0, Source.SAFETY)


@pytest.mark.parametrize(
    ("answer", "sentence"),
    [
        ("Limit(math.nan)", "returned forward_mps = nan, which is no speed from 0 to infinity"),
        ("Limit(1.0, -1.0)", "returned reverse_mps = -1.0, which is no speed from 0 to infinity"),
        ("Limit(-math.inf)", "returned forward_mps = -inf, which is no speed from 0 to infinity"),
        ("1.0", "returned a float where a Limit is needed"),
        ("1 / 0", "raised ZeroDivisionError: division by zero"),
    ],
)
def test_a_mistake_of_an_own_safety_law_stops_the_car(law_file, answer, sentence):
    name = law_file(limit(answer))
    car = guard(name)
    decision = car.scan()
    assert (decision.speed_mps, decision.winner) == (0.0, Source.SAFETY)
    assert decision.reason == f"{name} {sentence} ({name[:-4]}.py:5)"


def test_a_stop_of_an_own_law_is_no_dead_end_to_back_out_of(law_file):
    car = follower(law_file(follow("None")))
    assert {car.scan().speed_mps for _ in range(200)} == {0.0}
