"""Way out for a car whose nose stands against an obstacle: back and forth on its arcs until it is clear.

Creeping forward at any angle frees no car that touches with its margins; backing out blindly hits what is behind. So:
be patient first (people walk on), and meanwhile search all that is seen and remembered (`floor_map`) for the way that
leads off (`pose_search`), a slice with each scan. Drive it leg by leg; safety judges every moment of it like any drive.
Where a leg is blocked, look again from there. What was tried is remembered: from the same place the car next looks for
a way that leads elsewhere and farther, and after a few tries it asks for help.
"""

import cmath
import math
from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from wallride.drivers.api import Drive, MotorState
from wallride.runtime.control.perception.obstacles.moving_obstacles import STOOD_S
from wallride.runtime.control.recovery.floor_map import blocked_floor
from wallride.runtime.control.recovery.pose_search import Goal, Leg, Move, PoseSearch, WayOut
from wallride.runtime.control.recovery.traffic import Traffic
from wallride.runtime.control.safety.swept import STANDING_MPS, SweptAssessment
from wallride.runtime.control.safety.swept_settings import RecoverySettings

SETTLING_S = 0.3
"""Time for the servo to reach the angle of a leg: it needs 0.2 s from end to end; the plan assumes it to be there."""
GIVE_UP_LEG_S = 0.5
STOPPING_M = 0.1
"""Tolerance of a leg's length: safety stops a backing car short of its limit by the braking distance."""
BEGUN_M = 0.03
ROLLED_M, STALLS_AFTER_S = 0.01, 0.8
"""Way by which wheels that were told to turn have to turn again and again within a time: what drives by wheels that
report none does not know how far it came."""
SLICES_AT_ONCE = 2
"""Number of slices of a search, a few milliseconds, between two scans."""
WORTH_IT_M = 0.5
"""Minimum free distance ahead that ends a stand by itself."""
LOOKS_AFTER_S = 0.3
"""Minimum duration of a stand before a search begins."""
LOOKS_AGAIN_AFTER_S = 2.0
"""Delay before a new search where no way was found: an obstacle may have moved by then."""
AWAY_M = (1.3, 1.7, 2.1)
"""Lengths of a way out: longer each time that the car stands at the same place again."""
FREE_FOR_S = 0.25
"""Minimum duration of a free path; a shorter one is the lidar's noise at the edge of the margins, and waiting
continues."""
ASKS_AFTER_S = 10.0
"""Time that a car without permitted tries waits for a free path before it asks for help."""
HELP = "boxed in: needs help"
TURNS = "turning to where the way goes on"
TRAFFIC = "boxed in: something moves near, and may be behind"
DISBELIEF = "boxed in: will not back out without a believed odometry"


@dataclass(frozen=True, slots=True)
class RecoveryAdvice:
    """Replacement of the driver's command: drive is None when there is nothing to replace. words: text for the user."""

    drive: Drive | None
    words: str


NO_ADVICE = RecoveryAdvice(None, "")


class WayOutSearch:
    """A search for a goal that is under way: one slice with each scan. way: its answer, None while not finished.

    back_m: how far it may back, 0: not at all, not even where the car came from. backs: whether it may.
    """

    def __init__(self, assessment: SweptAssessment, goal: Goal, refused: frozenset[Move], back_m: float) -> None:
        guard, self._behind = assessment.guard, assessment.strip.behind
        self._here = self._behind.seen_now(assessment.view)
        self._body, self.goal, self._refused = guard.body, goal, refused
        self.backs = back_m > 0.0
        self._most_backed_m = min(back_m, guard.settings.reverse_unseen_m - STOPPING_M)
        self._slices = self._think()
        self.way: WayOut | None = None

    def step(self) -> None:
        """Run some more slices of the search."""
        for _ in range(SLICES_AT_ONCE):
            next(self._slices, None)

    def end_in_odom_m(self, way: WayOut) -> complex:
        """Return the end of the way in the odometry frame."""
        return self._here.place_m + way.end_m * cmath.rect(1.0, self._here.yaw_rad)

    def _think(self) -> Iterator[None]:
        behind, body, here = self._behind, self._body, self._here
        blocked, laid = yield from blocked_floor([*behind.kept, here], body.bare)
        behind.lay_anew(laid[:-1])
        turned = cmath.rect(1.0, -here.yaw_rad)
        track_m, headings = behind.track()
        search = PoseSearch(
            (body.around, body.bare),
            (body.car.narrower_end_rad, body.car.wheelbase_m),
            (behind.backed_m if self.backs else math.inf, self._most_backed_m),
            ((track_m - here.place_m) * turned, headings * turned),
            self.goal,
            self._refused,
        )
        self.way = yield from search.look(blocked)


class Recovery:
    """Tracks since when the car is boxed in, the running search, the leg being driven, and the earlier tries.

    driven: whether the last decision of the mux moves the car by the follower's word: a leg without a permit, or under
    an operator's hand, is no stall, and is given back after a while.
    """

    def __init__(self, settings: RecoverySettings) -> None:
        self._settings = settings
        self.driven = True
        self._driven_s = -math.inf
        self._since_s: float | None = None
        self._boxed_s = -math.inf
        self._thought: WayOutSearch | None = None
        self._thought_s = -math.inf
        self._found_none = False
        self._due = False
        self._tries = 0
        self._tried_at_m = 0.0
        self._ends_m: list[complex] = []
        self._refused: frozenset[Move] = frozenset()
        self._legs: list[Leg] = []
        self._begun_s = 0.0
        self._begun_m = 0.0
        self._moving_s = 0.0
        self._rolled_s = self._rolled_m = 0.0
        self._turned_in_vain_m = -math.inf
        self._traffic = Traffic()

    def think(self) -> None:
        """Run the deferrable work after the answer is sent; at the latest it runs with the next scan."""
        if self._due:
            self._due = False
            if self._thought is not None:
                self._thought.step()

    def tune(self, settings: RecoverySettings) -> None:
        """Change the settings; an active manoeuvre is driven to its end."""
        self._settings = settings

    def step(
        self, assessment: SweptAssessment, wish: Drive | None, motor: MotorState | None, *, believed: bool = True,
        toward_rad: float = math.nan,
    ) -> RecoveryAdvice:  # fmt: skip
        """Return the advice for one scan.

        wish: the driver's, before the safety. believed: the odometry is trusted. toward_rad: bearing to turn to first.
        """
        if self._due:
            self.think()
        scan_s = assessment.view.scan.stamp_s
        stood = self._since_s is not None and not self._legs and scan_s - self._since_s > STOOD_S
        moving = assessment.percept.movers.moving(stood=stood)
        self._traffic.update(moving, scan_s, speed_mps=assessment.speed_mps, stood=stood)
        if motor is None or wish is None or wish.speed_mps <= 0:
            self._forget()
            return NO_ADVICE
        if self._legs and believed:
            return self._drive_leg(assessment, motor)
        if believed and not math.isnan(toward_rad) and (turns := self._turn(assessment, wish, motor, toward_rad)):
            return turns
        now_s = assessment.view.scan.stamp_s
        if not self._is_boxed_in(assessment, wish):
            if now_s - self._boxed_s > FREE_FOR_S or abs(assessment.speed_mps) > STANDING_MPS:
                self._forget()
            if abs(motor.distance_m - self._tried_at_m) > self._settings.forgotten_after_m:
                self._tries, self._ends_m, self._refused = 0, [], frozenset()
            return NO_ADVICE
        if not believed:
            self._forget()
            return RecoveryAdvice(None, DISBELIEF)
        self._boxed_s = now_s
        if self._since_s is None:
            self._since_s = now_s
        return self._stand(assessment, wish, motor)

    def _forget(self) -> None:
        self._since_s, self._thought, self._legs, self._found_none = None, None, [], False

    def _turn(
        self, assessment: SweptAssessment, wish: Drive, motor: MotorState, toward_rad: float
    ) -> RecoveryAdvice | None:
        """Stand, look for a way that turns the car, and begin it; None where there is none: some metres on it may be.

        The driver would go on in the wrong direction: nothing is waited for. While something may be behind, the way
        leads forward alone; where there is none, it is looked for again.
        """
        if abs(motor.distance_m - self._turned_in_vain_m) < self._settings.forgotten_after_m:
            return None
        if self._tries >= self._settings.tries:
            self._turned_in_vain_m, self._thought, self._tries, self._refused = motor.distance_m, None, 0, frozenset()
            return None
        stop = RecoveryAdvice(Drive(0.0, wish.steering_rad), TURNS)
        now_s, backs = assessment.view.scan.stamp_s, not self._traffic.is_about
        rests = not backs and now_s - self._thought_s < LOOKS_AGAIN_AFTER_S
        if rests or abs(assessment.speed_mps) > STANDING_MPS:
            self._thought = None
            return stop
        thought = self._thought
        if thought is None or math.isnan(thought.goal.toward_rad) or (thought.backs and not backs):
            goal = replace(self._goal(assessment), toward_rad=toward_rad)
            thought = WayOutSearch(assessment, goal, self._refused, self._settings.back_m if backs else 0.0)
        self._thought, self._due = thought, True
        if (way := thought.way) is None:
            return stop
        if not way.legs and not thought.backs:
            self._thought, self._thought_s = None, now_s
            return stop
        if not way.legs:
            self._tries = self._settings.tries
            return self._turn(assessment, wish, motor, toward_rad)
        self._ends_m.append(thought.end_in_odom_m(way))
        self._thought = None
        return self._begin(way, assessment, motor)

    def _stand(self, assessment: SweptAssessment, wish: Drive, motor: MotorState) -> RecoveryAdvice:
        """Wait, and search meanwhile."""
        stood_s = self._boxed_s - (self._since_s if self._since_s is not None else self._boxed_s)
        if self._tries >= self._settings.tries:
            patient = stood_s < (self._settings.boxed_for_s if self._settings.tries else ASKS_AFTER_S)
            return RecoveryAdvice(None, "waiting for the way to clear" if patient else HELP)
        if self._traffic.is_about:
            self._thought = None  # what it knows of the floor will be old
            patient = stood_s < self._settings.boxed_for_s
            return RecoveryAdvice(None, "waiting for the way to clear" if patient else TRAFFIC)
        if stood_s >= LOOKS_AFTER_S and self._thought is None and self._boxed_s - self._thought_s > LOOKS_AGAIN_AFTER_S:
            self._thought = WayOutSearch(assessment, self._goal(assessment), self._refused, self._settings.back_m)
        self._due = self._thought is not None
        if stood_s < self._settings.boxed_for_s or self._is_free(assessment, wish):
            return RecoveryAdvice(None, "waiting for the way to clear")
        thought = self._thought
        if thought is None or thought.way is None:
            return RecoveryAdvice(None, HELP if self._found_none else "looking for a way out")
        self._found_none = not thought.way.legs
        self._thought, self._thought_s = None, self._boxed_s if self._found_none else -math.inf
        if self._found_none:
            self._refused = frozenset()  # it may have been the noise of those scans
            return RecoveryAdvice(None, HELP)
        self._ends_m.append(thought.end_in_odom_m(thought.way))
        return self._begin(thought.way, assessment, motor)

    def _goal(self, assessment: SweptAssessment) -> Goal:
        """Return the goal: farther with each try, and not at the end of an earlier one."""
        here = assessment.strip.behind.seen_now(assessment.view)
        ends_m = (np.array(self._ends_m, np.complex128) - here.place_m) * cmath.rect(1.0, -here.yaw_rad)
        return Goal(AWAY_M[min(self._tries, len(AWAY_M) - 1)], ends_m)

    def _is_boxed_in(self, assessment: SweptAssessment, wish: Drive) -> bool:
        """Return whether the car stands and may not go ahead; what forbids both ways, a blind lidar, is no box."""
        if abs(assessment.speed_mps) > STANDING_MPS:
            return False  # and the safety judges nothing for a follower that may not be the active driver
        verdict = assessment.ask(wish.speed_mps, wish.steering_rad)
        return verdict.forward_mps <= 0 < verdict.reverse_mps

    def _is_free(self, assessment: SweptAssessment, wish: Drive) -> bool:
        """Return whether the path is free by now, and only a stop is still held."""
        return assessment.strip.contact(wish.steering_rad, WORTH_IT_M).travel_m >= WORTH_IT_M

    def _begin(self, way: WayOut, assessment: SweptAssessment, motor: MotorState) -> RecoveryAdvice:
        self._tries += 1
        self._tried_at_m = motor.distance_m
        *legs, last = way.legs
        self._legs = [*legs, Leg(last.steering_rad, min(last.travel_m, self._settings.forward_m))]
        self._enter_leg(assessment.view.scan.stamp_s, motor)
        return self._drive_leg(assessment, motor)

    def _enter_leg(self, now_s: float, motor: MotorState) -> None:
        self._begun_s = self._moving_s = now_s
        self._begun_m = motor.distance_m
        self._rolled_s, self._rolled_m = now_s + SETTLING_S, motor.distance_m
        self._driven_s = self._rolled_s

    def _give_up(self, leg: Leg, motor: MotorState) -> None:
        """Drop the way; a leg that could not even be begun is not begun again from here."""
        if abs(motor.distance_m - self._begun_m) > BEGUN_M:
            self._refused = frozenset()
        else:
            steering = round(math.copysign(1, leg.steering_rad)) if leg.steering_rad else 0
            self._refused |= {(1 if leg.travel_m > 0 else -1, steering)}
        self._forget()

    def _note_motion(self, now_s: float, motor: MotorState, *, blocked: bool) -> None:
        if not blocked:
            self._moving_s = now_s
        if blocked or self.driven:
            self._driven_s = now_s
        if blocked or not self.driven or abs(motor.distance_m - self._rolled_m) > ROLLED_M:
            self._rolled_s, self._rolled_m = now_s, motor.distance_m

    def _give_back(self, leg: Leg, words: str) -> RecoveryAdvice:
        """Stand, and drop the way as if it had not been tried."""
        self._tries -= 1
        self._ends_m.pop()
        self._forget()
        return RecoveryAdvice(Drive(0.0, leg.steering_rad), words)

    def _drive_leg(self, assessment: SweptAssessment, motor: MotorState) -> RecoveryAdvice:
        now_s, leg = assessment.view.scan.stamp_s, self._legs[0]
        words = f"{'backing' if leg.travel_m < 0 else 'turning'} out, try {self._tries} of {self._settings.tries}"
        if leg.travel_m < 0 and self._traffic.is_about:
            return self._give_back(leg, TRAFFIC)
        if now_s - self._begun_s < SETTLING_S:
            return RecoveryAdvice(Drive(0.0, leg.steering_rad), words)
        speed_mps = math.copysign(self._settings.speed_mps, leg.travel_m)
        verdict = assessment.ask(speed_mps, leg.steering_rad)
        blocked = (verdict.forward_mps if speed_mps > 0 else verdict.reverse_mps) <= 0
        self._note_motion(now_s, motor, blocked=blocked)
        if now_s - self._driven_s > STALLS_AFTER_S:
            return self._give_back(leg, "waiting for the way to clear")
        if now_s - self._rolled_s > STALLS_AFTER_S:
            self._tries = self._settings.tries
            self._forget()
            return RecoveryAdvice(Drive(0.0, leg.steering_rad), HELP)
        left_m = abs(leg.travel_m) - abs(motor.distance_m - self._begun_m)
        if now_s - self._moving_s > GIVE_UP_LEG_S and left_m > STOPPING_M:
            self._give_up(leg, motor)
            self._since_s = now_s - self._settings.boxed_for_s  # look again from here, patience has been had
            return RecoveryAdvice(Drive(0.0, leg.steering_rad), words)
        if abs(motor.distance_m - self._begun_m) > BEGUN_M:
            self._refused = frozenset()
        if left_m <= 0.0 or now_s - self._moving_s > GIVE_UP_LEG_S:
            self._legs.pop(0)
            self._since_s = None
            if self._legs:
                self._enter_leg(now_s, motor)
            return RecoveryAdvice(Drive(0.0, leg.steering_rad), words)
        return RecoveryAdvice(Drive(speed_mps, leg.steering_rad), words)
