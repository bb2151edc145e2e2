"""Safety `swept`: judgement of every drive command, from any source, before it is executed.

The outline is swept along the arc that will be driven (`footprint`); the distance to the first contact is compared with
the stopping distance (`stopping`). Two limits: a graded one, which brakes gently and early, and a hard stop, which is
held for a moment. Formulas: docs/laws.md; figures: benchmarks/laws.md.
"""

import math
from dataclasses import dataclass, replace

from wallride.drivers.api import Clock, MotorState, Scan
from wallride.runtime.arbitration.command import NO_LIMIT_MPS, Verdict
from wallride.runtime.arbitration.promise import Promise
from wallride.runtime.control.perception.geometry import Places
from wallride.runtime.control.perception.lidar_health_settings import LidarHealthSettings
from wallride.runtime.control.perception.perception import Assumed, Percept, Perception
from wallride.runtime.control.perception.view import View
from wallride.runtime.control.perception.visibility.unknown_regions import CRAWL_MPS
from wallride.runtime.control.safety.body import LOOK_SPARE_M, Body
from wallride.runtime.control.safety.emergency import Emergency
from wallride.runtime.control.safety.footprint import NOTHING, Contact
from wallride.runtime.control.safety.lidar_reach import LidarReach
from wallride.runtime.control.safety.manoeuvre_rollout import FRONT_SHARE
from wallride.runtime.control.safety.promise_judgement import CLEAR, JudgedWay, believed, least_limit_mps
from wallride.runtime.control.safety.promise_record import NO_PROMISES
from wallride.runtime.control.safety.stopping import speed_to_stop_within_mps, stopping_distance_m
from wallride.runtime.control.safety.swept_memory import SweptMemory
from wallride.runtime.control.safety.swept_path import GAINS_MPS, Strip
from wallride.runtime.control.safety.swept_settings import SweptSettings
from wallride.runtime.control.vehicle import GRAVITY_MPS2, CarSettings

STANDING_MPS = 0.05
STOP_SPARE_M = 0.05
WARY_S = 0.25
UNTOLD_S = 0.25
"""Time after locked wheels for which a braking car waits: while they are locked, no motion of an obstacle is told, and
to tell one takes this long."""
NEEDY_SHARE = 0.7
"""Share of a slippery floor's grip above which a bend leaves too little for the deceleration by the motor."""
EDGE_M = 0.05
"""Maximum depth by which an object beside the car, not ahead of it, reaches into the strip."""
UNSEEN = "the lidar sees nothing ahead"
ON_LIDAR = Verdict(0.0, 0.0, "something on the lidar: uncover it")


class SweptGuard:
    """Judges what perception understands of each scan; its SweptAssessment judges drives until the next scan.

    perception: shared with the follower; one of its own where none is given. clock: where given, the scan's age is
    measured at every judgement, else taken as it was when the scan arrived. reach: the speed that the lidar allows by
    its range, step and rate. memory: what the judgements of commands that were sent have left. assessment: the last
    one, None before the first scan.
    """

    def __init__(
        self, settings: SweptSettings, car: CarSettings, perception: Perception | None = None, *,
        clock: Clock | None = None,
    ) -> None:  # fmt: skip
        self.settings = settings
        self.car = car
        self.body = Body(settings, car)
        self.perception = perception or Perception(car, assumed(settings))
        self.clock = clock
        self.reach = LidarReach(self.body)
        self.memory = SweptMemory()
        self.assessment: SweptAssessment | None = None
        self._window = Verdict(math.inf, math.inf, "")

    def tune(self, settings: SweptSettings) -> None:
        """Change the settings; an active hard stop is kept."""
        self.settings = settings
        self.body = Body(settings, self.car)
        self.reach.tune(self.body)

    def look(self, scan: Scan, motor: MotorState | None) -> "SweptAssessment":
        """Take in one scan; called once for each, in order."""
        seen = self.perception.look(scan, motor)
        speed_mps = seen.speed_mps
        latency_s = max(0.0, self.now_s(scan) - scan.stamp_s) + self.settings.actuation_s
        strip = Strip(
            self.body, seen.view, speed_mps, seen.wheel_rad, latency_s, seen.unseen_m, seen.behind, seen.past_rad
        )
        wary = speed_mps > self.settings.doubtful_mps and scan.stamp_s < self.memory.wary_until_s
        self.assessment = SweptAssessment(self, seen, strip, self._limit_of_lidar(seen), wary)
        return self.assessment

    def _limit_of_lidar(self, seen: Percept) -> Verdict:
        """Return the limit for every drive: by the window, by the lidar's range and rate, by what is on the lidar."""
        if seen.visibility.on_lidar:
            return ON_LIDAR
        ceiling_mps, window = seen.ceiling_mps, self._window
        if window.forward_mps != ceiling_mps or window.reason != seen.ceiling_reason:
            window = self._window = Verdict(ceiling_mps, ceiling_mps, seen.ceiling_reason)
        reach = self.reach.update(seen.scan, self.perception.views.rate)
        return reach if reach.forward_mps < window.forward_mps else window

    @property
    def words(self) -> tuple[str, ...]:
        """Faults of the lidar's window, limits of the lidar, a promise not believed, in sentences for the user."""
        return (*self.perception.health.words, *self.reach.words, *self.memory.promises.words)

    def learn(self) -> None:
        """Run the deferred work of the last scan, once its answer is sent."""
        self.perception.learn()

    def now_s(self, scan: Scan) -> float:
        """Return the time, or that of the scan's arrival where there is no clock."""
        return self.clock() if self.clock is not None else scan.received_s


def assumed(settings: SweptSettings, window: LidarHealthSettings | None = None) -> Assumed:
    """Return what perception assumes by these settings."""
    slippery_mps2 = min(settings.slippery_mu, settings.grip_mu) * GRAVITY_MPS2
    rear = settings.cornering_per_rad
    window = window or LidarHealthSettings()
    return Assumed(window, settings.doubtful_mps, slippery_mps2, settings.grip_mu, FRONT_SHARE * rear, rear)


@dataclass(slots=True, eq=False)
class SweptAssessment:
    """Judges every drive by one scan. Repeated calls are cheap: the strip caches its sweeps."""

    guard: SweptGuard
    percept: Percept
    strip: Strip
    window: Verdict
    wary: bool

    @property
    def view(self) -> View:
        """Return the view of the judged scan."""
        return self.percept.view

    @property
    def speed_mps(self) -> float:
        """Return the signed speed over the ground."""
        return self.percept.speed_mps

    @property
    def age_s(self) -> float:
        """Age of the scan now, as accurately as the clock allows."""
        return max(0.0, self.guard.now_s(self.view.scan) - self.view.scan.stamp_s)

    @property
    def memory(self) -> SweptMemory:
        """The memory of the guard, which the commands that were sent have left."""
        return self.guard.memory

    def commit(self, memory: SweptMemory) -> None:
        """Take over the memory after a command that was sent."""
        self.guard.memory = memory

    def ask(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Return what `judge` would, with caches of its own: some sweeps depend on when they ran."""
        return replace(self, strip=self.strip.copied()).judge(speed_mps, steering_rad, self.guard.memory)[0]

    def judge(
        self, speed_mps: float, steering_rad: float, memory: SweptMemory, promise: Promise | None = None
    ) -> tuple[Verdict, SweptMemory]:
        """Return the verdict on a drive, and the memory after it; changes no memory.

        NaN, infinity and a speed of 0 receive the ceiling alone. promise: where it is believed, it is judged in place
        of the arc.
        """
        age_s = self.age_s
        ceiling = self._ceiling(age_s)
        if ceiling.forward_mps <= 0 or not speed_mps or not math.isfinite(speed_mps + steering_rad):
            return ceiling, memory
        steering_rad = self._possible_rad(steering_rad)
        reaction_s = age_s + self.guard.settings.actuation_s
        if speed_mps > 0:
            now_s, jump_rad = self.view.scan.stamp_s, self.guard.car.steering_rate_radps * reaction_s
            reversal = memory.reversal.after(steering_rad, now_s, jump_rad)
            memory = memory._replace(reversal=reversal)
            way, memory = self._promised(speed_mps, steering_rad, memory, promise)
            verdict, memory = self._forward(speed_mps, steering_rad, reaction_s, memory, way)
            if reversal.wavers:
                verdict = _slower_of(verdict, self._wavering(speed_mps, reversal.given_up_rad, reaction_s))
            if self.percept.visibility.suspicious:
                verdict = _slower_of(verdict, self._unseen(speed_mps, steering_rad, reaction_s, way))
            return _slower_of(verdict, ceiling), memory
        verdict = self._backward(steering_rad, reaction_s)
        return verdict if verdict.reverse_mps <= ceiling.reverse_mps else ceiling, memory

    def limit_of_sensing(self, speed_mps: float, steering_rad: float) -> Verdict:
        """Judge a drive by what the lidar can be trusted to show, whatever is in the way: the limit above every law.

        The scan's age, the window, something on the lidar, and what it does not see ahead.
        """
        age_s = self.age_s
        ceiling = self._ceiling(age_s)
        known = not self.percept.visibility.suspicious or not math.isfinite(speed_mps + steering_rad)
        if ceiling.forward_mps <= 0 or speed_mps <= 0 or known:
            return ceiling
        reaction_s = age_s + self.guard.settings.actuation_s
        return _slower_of(ceiling, self._unseen(speed_mps, self._possible_rad(steering_rad), reaction_s))

    def _possible_rad(self, steering_rad: float) -> float:
        return self.guard.car.steered_rad(steering_rad)

    def _ceiling(self, age_s: float) -> Verdict:
        """Return the limit that holds for every drive: by the scan's age and the window."""
        settings = self.guard.settings
        waits_s = self.view.waits_s
        if age_s > settings.stale_s + waits_s:
            return Verdict(0.0, 0.0, "the scan is too old", age_s)
        if age_s <= settings.late_s + waits_s or self.window.forward_mps < settings.doubtful_mps:
            return self.window
        return Verdict(settings.doubtful_mps, settings.doubtful_mps, "the scan is late", age_s)

    def _promised(
        self, wanted_mps: float, steering_rad: float, memory: SweptMemory, promise: Promise | None
    ) -> tuple[JudgedWay | None, SweptMemory]:
        """Return the way that is judged in place of the arc, None without a believed promise, and the memory after."""
        if promise is None:
            return None, memory if memory.promises is NO_PROMISES else memory._replace(promises=NO_PROMISES)
        command, look_m = (wanted_mps, steering_rad), self._look_m(wanted_mps)
        way, record = believed(self.percept, self.strip, command, promise, memory.promises, look_m)
        return way, memory if record is memory.promises else memory._replace(promises=record)

    def _forward(
        self, wanted_mps: float, steering_rad: float, reaction_s: float, memory: SweptMemory, way: JudgedWay | None
    ) -> tuple[Verdict, SweptMemory]:
        body, settings = self.guard.body, self.guard.settings
        speed_mps, look_m = max(self.speed_mps, 0.0), self._look_m(wanted_mps)
        found = self._found(steering_rad, look_m, memory, way)
        now_s = self.view.scan.stamp_s
        if not memory.braking and way is None:
            memory = self._begun(steering_rad, memory)
        if found is NOTHING and not memory.braking:
            return self._no_contact(steering_rad, look_m, wanted_mps, reaction_s, way), memory
        if found is not NOTHING and speed_mps > settings.doubtful_mps:
            memory = memory._replace(wary_until_s=now_s + WARY_S)
        hard_mps2 = settings.hard_share * body.grip_for_mps2(found)
        hard_m = STOP_SPARE_M + stopping_distance_m(speed_mps, reaction_s, hard_mps2)
        stops = found if way is None or memory.braking else way.stops
        memory = self._braked(stops.travel_m, hard_m, steering_rad, memory)
        if memory.braking:
            if speed_mps <= STANDING_MPS:
                return self._standing(found), memory
            memory = memory._replace(emergency=memory.emergency.decided(self.strip, steering_rad, now_s))
            return _emergency(found, memory.emergency), memory
        if memory.emergency.chosen is not None:
            memory = memory._replace(emergency=memory.emergency.ended())
        if found is NOTHING:
            return self._no_contact(steering_rad, look_m, wanted_mps, reaction_s, way), memory
        graded_mps = max(body.graded_mps(found, reaction_s), least_limit_mps(way))
        hastes = wanted_mps >= speed_mps > graded_mps and found.aside_m * steering_rad < 0.0
        if way is None and hastes and self._is_needy(steering_rad):
            slowed = memory.emergency.slowed_in_bend(self.strip, steering_rad, now_s)
            if slowed is not None:
                return _emergency(found, slowed), memory._replace(braking=True, emergency=slowed)
        gaining = self._gaining(steering_rad, look_m, wanted_mps, reaction_s, way)
        return _slower_of(self._slower(found, stops, graded_mps, reaction_s), gaining), memory

    def _found(self, steering_rad: float, look_m: float, memory: SweptMemory, way: JudgedWay | None) -> Contact:
        """Return the first contact of the way, or of the arc; of both while the car brakes."""
        if way is not None and not memory.braking:
            return way.found
        found = self.strip.contact(steering_rad, look_m, wary=self.wary)
        return found if way is None or found.travel_m <= way.found.travel_m else way.found

    def _begun(self, steering_rad: float, memory: SweptMemory) -> SweptMemory:
        """Return the memory after an emergency may have begun by a turn in vain."""
        now_s = self.view.scan.stamp_s
        in_vain, emergency = memory.emergency.turns_in_vain(self.strip, steering_rad, now_s)
        if in_vain:
            return memory._replace(braking=True, held_until_s=now_s + self.guard.settings.hold_s, emergency=emergency)
        return memory if emergency is memory.emergency else memory._replace(emergency=emergency)

    def _look_m(self, wanted_mps: float) -> float:
        """Return the look-ahead: never beyond the lidar's range, whatever speed is reported."""
        look_m = self.guard.body.look_m(max(self.speed_mps, wanted_mps), self.view.waits_s)
        return min(look_m, self.view.scan.range_max_m)

    def _is_needy(self, steering_rad: float) -> bool:
        """Return whether a bend leaves too little of a slippery floor's grip for the motor's full deceleration."""
        return self.strip.needs_grip(steering_rad, self.speed_mps, NEEDY_SHARE * self.guard.body.slippery_mps2)

    def _wavering(self, wanted_mps: float, given_up_rad: float, reaction_s: float) -> Verdict:
        """Limit the speed so that a stop is possible on the path the driver has just given up, should it turn back."""
        guard = self.guard
        found = self.strip.contact(given_up_rad, self._look_m(wanted_mps))
        slow_mps = max(guard.body.graded_mps(found, reaction_s), guard.settings.creep_mps)
        return Verdict(slow_mps, NO_LIMIT_MPS, "slower: the driver wavers", found.travel_m)

    def _unseen(
        self, wanted_mps: float, steering_rad: float, reaction_s: float, way: JudgedWay | None = None
    ) -> Verdict:
        """Limit the speed so that a stop is possible within the known part of the path, whatever the rest hides."""
        body, unknown, look_m = self.guard.body, self.percept.visibility.unknown(), self._look_m(wanted_mps)

        def reaches(points_m: Places) -> Contact:
            if way is None:
                return self.strip.reaches(points_m, steering_rad, look_m)
            return self.strip.reaches_along(points_m, way.way.path, look_m, way.margin_m)

        found = reaches(unknown.hard)
        hard_mps = body.graded_mps(found, reaction_s)
        brake_mps2 = self.guard.settings.hard_share * body.grip_mps2
        hard_m = STOP_SPARE_M + stopping_distance_m(max(self.speed_mps, 0.0), reaction_s, brake_mps2)
        if hard_mps < self.guard.settings.slowest_mps or found.travel_m < hard_m:
            return Verdict(
                0.0, 0.0, "the lidar is blind ahead: uncover it" if unknown.blind else UNSEEN, found.travel_m
            )
        soft_mps = max(CRAWL_MPS, body.graded_mps(reaches(unknown.soft), reaction_s))
        if reaches(unknown.doubted) is not NOTHING:
            soft_mps = CRAWL_MPS
        reason = f"{UNSEEN}: crawling" if soft_mps <= CRAWL_MPS else f"slower: {UNSEEN}"
        return Verdict(min(hard_mps, soft_mps), NO_LIMIT_MPS, reason, found.travel_m)

    def _slower(self, found: Contact, stops: Contact, graded_mps: float, reaction_s: float) -> Verdict:
        """Return the verdict without a hard stop: the graded limit, or the slowest speed as long as `stops` is away."""
        body, settings = self.guard.body, self.guard.settings
        where = "beside" if abs(found.aside_m) > body.ahead.half_width_m - EDGE_M else "ahead"
        if graded_mps >= settings.slowest_mps:
            return Verdict(graded_mps, NO_LIMIT_MPS, f"slower: wall {where}", found.travel_m)
        hard_mps2 = settings.hard_share * body.grip_mps2
        creep_m = STOP_SPARE_M + stopping_distance_m(settings.creep_mps, reaction_s, hard_mps2)
        if stops.travel_m > creep_m and self.strip.free_somewhere():
            return Verdict(settings.creep_mps, NO_LIMIT_MPS, f"creeping: wall {where}", found.travel_m)
        return self._standing(found)

    def _braked(self, way_m: float, hard_m: float, steering_rad: float, memory: SweptMemory) -> SweptMemory:
        """Return the memory with an emergency begun, which is at once, held, or ended, with clearance or at standstill.

        A car that turns past an obstacle is released as soon as its driver's bend is free, on a slippery floor too, and
        leaves grip for the motor; one whose wheels were locked, not before a person who walks into its way would be
        seen to move.
        """
        settings, emergency, now_s = self.guard.settings, memory.emergency, self.view.scan.stamp_s
        if way_m < hard_m:
            return memory._replace(braking=True, held_until_s=now_s + settings.hold_s)
        if not memory.braking:
            return memory
        if emergency.turns:
            braking = self._is_needy(steering_rad) or not emergency.may_release(self.strip, steering_rad, now_s)
        elif now_s >= max(memory.held_until_s, self.percept.slid_s + UNTOLD_S):
            braking = self.speed_mps > STANDING_MPS and way_m < hard_m + settings.release_m
        else:
            return memory
        return memory if braking else memory._replace(braking=False)

    def _standing(self, found: Contact) -> Verdict:
        reason = "wall ahead" if self.strip.free_somewhere() else "boxed in"
        return Verdict(0.0, NO_LIMIT_MPS, reason, found.travel_m, stands=True)

    def _no_contact(
        self, steering_rad: float, look_m: float, wanted_mps: float, reaction_s: float, way: JudgedWay | None
    ) -> Verdict:
        """Allow the drive, unless the path enters an enclosed region without echoes, or accelerating would widen it."""
        strip = self.strip
        if strip.leads_into_the_dark(steering_rad, look_m) if way is None else strip.is_dark(way.toward_rad, look_m):
            return Verdict(self.guard.settings.doubtful_mps, NO_LIMIT_MPS, "no information ahead", look_m)
        return self._gaining(steering_rad, look_m, wanted_mps, reaction_s, way)

    def _gaining(
        self, steering_rad: float, look_m: float, wanted_mps: float, reaction_s: float, way: JudgedWay | None
    ) -> Verdict:
        """Allow the drive, unless accelerating takes all grip from the bend, or so much that the wider bend touches.

        On a promised way, unless it is too fast for a full brake from each of its points, or for what it hides.
        """
        if way is not None:
            return way.limit(self.guard.body, reaction_s)
        body, speed_mps = self.guard.body, max(self.speed_mps, 0.0)
        needy_mps2 = NEEDY_SHARE * body.slippery_mps2
        if wanted_mps <= speed_mps + GAINS_MPS or not self.strip.needs_grip(steering_rad, wanted_mps, needy_mps2):
            return CLEAR
        found = self.strip.contact(steering_rad, look_m, faster_mps=wanted_mps)
        bend_mps = self.strip.bend_mps(steering_rad)
        if found is NOTHING and wanted_mps <= bend_mps:
            return CLEAR
        held_mps = max(speed_mps, min(body.graded_mps(found, reaction_s), bend_mps), self.guard.settings.creep_mps)
        return Verdict(held_mps, NO_LIMIT_MPS, "no faster in this bend", found.travel_m)

    def _backward(self, steering_rad: float, reaction_s: float) -> Verdict:
        settings = self.guard.settings
        left_m = settings.reverse_unseen_m - self.percept.behind.backed_m
        brake_mps2 = settings.graded_share * self.guard.body.grip_mps2
        look_m = stopping_distance_m(settings.reverse_mps, reaction_s, brake_mps2) + LOOK_SPARE_M
        found = self.strip.contact(steering_rad, round(look_m, 2), -1.0)
        # The last centimetres may be used: the nose does not swing there, and the way out may be short.
        way_m = min(found.travel_m, left_m)
        allowed_mps = speed_to_stop_within_mps(way_m, reaction_s, brake_mps2)
        if allowed_mps < settings.slowest_mps:
            reason = "wall behind" if found.travel_m <= left_m else "backed far enough without seeing"
            return Verdict(NO_LIMIT_MPS, 0.0, reason, max(0.0, way_m))
        return Verdict(NO_LIMIT_MPS, min(allowed_mps, settings.reverse_mps), "backing slowly", found.travel_m)


def _emergency(found: Contact, emergency: Emergency) -> Verdict:
    """Return the verdict of an emergency with a manoeuvre; `_braked` decides on its end."""
    brake_mps2 = emergency.chosen.manoeuvre.brake_mps2 if emergency.chosen is not None else math.inf
    return Verdict(0.0, NO_LIMIT_MPS, emergency.reason, found.travel_m, brake_mps2, emergency.steering_rad)


def _slower_of(first: Verdict, other: Verdict) -> Verdict:
    """Return the verdict that lets the car drive forward less fast; of equal ones the first."""
    return other if other.forward_mps < first.forward_mps else first
