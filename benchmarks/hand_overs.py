"""Whether asking changes a verdict: a human hands over to the autonomy, with and without a status at every scan.

Run: python -m benchmarks.hand_overs --drives 450

Random drives in virtual time, half of them in a corridor, half towards a box that appears in it, at 2 to 4 m/s, on
floors of random friction, with the car's own laws, queue, mux rule and limiter. A human whom safety does not bind
drives, lets go, and the autonomy drives on. Each drive happens twice: without any status, and with one after every
decision. Exit code 1 where a decision differs by a bit.
"""

import argparse
import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from wallride.drivers.api import Drive, Scan
from wallride.runtime.arbitration.command import Decision, DriveCommand, Output, Source, arbitrate, consent
from wallride.runtime.live_stack import REQUIRED, LiveStack
from wallride.runtime.recording.decision_log import DecisionLog
from wallride.runtime.settings.tree import load_settings
from wallride.runtime.telemetry.status import Journey, ObservedState, status
from wallride.sim.car.vehicle import VehicleSettings
from wallride.sim.virtual.devices import BEAMS, STEP_RAD, MemoryLidar
from wallride.sim.virtual.twin_world import TwinWorld, WorldMotor
from wallride.sim.world.obstacles import sudden_box
from wallride.sim.world.pose import Pose
from wallride.sim.world.worlds import load_world

SCAN_S = 0.025
TICK_S = 0.0125
"""A second decision between two scans: by then the laws have learnt from the first."""
AUTONOMY_S = 1.0
TURNS_EVERY_S = 0.3
THUMB_RAD = 0.0003
"""Noise of the human's stick: it never rests, and hardly moves."""
FAN = -STEP_RAD * (BEAMS // 2), STEP_RAD, 0.02, 30.0


@dataclass(frozen=True, slots=True)
class HandOver:
    """One random drive. human_rad: the human's steering, one for each TURNS_EVERY_S."""

    seed: int
    speed_mps: float
    grip_mu: float
    start: Pose
    by_hand_s: float
    human_rad: tuple[float, ...]
    box_m: float | None

    @staticmethod
    def random(seed: int) -> "HandOver":
        """Return the drive of a seed."""
        rng = np.random.default_rng(seed)
        by_hand_s = float(rng.uniform(0.8, 2.2))
        turns = math.ceil(by_hand_s / TURNS_EVERY_S) + 1
        return HandOver(
            seed,
            speed_mps=float(rng.uniform(2.0, 4.0)),
            grip_mu=float(rng.uniform(0.4, 1.0)),
            start=Pose(0.0, float(rng.uniform(-0.4, 0.4)), float(rng.uniform(-0.2, 0.2))),
            by_hand_s=by_hand_s,
            human_rad=tuple(float(turn_rad) for turn_rad in rng.uniform(-0.15, 0.15, turns)),
            box_m=float(rng.uniform(0.8, 3.0)) if seed % 2 else None,
        )


def decisions(drive: HandOver, *, asked: bool) -> list[Decision]:
    """Return every decision of a drive, until a contact. asked: with a status after each."""
    return _Course(drive, asked=asked).run()


def differing(drive: HandOver) -> list[tuple[Decision, Decision]]:
    """Return the pairs of decisions, without and with the questions, that differ by a bit."""
    without, with_ = decisions(drive, asked=False), decisions(drive, asked=True)
    pairs = [(one, other) for one, other in zip(without, with_, strict=False) if repr(one) != repr(other)]
    return pairs if len(without) == len(with_) else [*pairs, (without[-1], with_[-1])]


class _Course:
    def __init__(self, drive: HandOver, *, asked: bool) -> None:
        self._drive, self._asked, self._now_s = drive, asked, 0.0
        box = sudden_box(drive.box_m, from_s=drive.by_hand_s - 0.3) if drive.box_m is not None else None
        self._twin = TwinWorld(
            load_world("corridor"), self._clock, start=drive.start, vehicle=VehicleSettings(grip_mu=drive.grip_mu),
            obstacles=(box,) if box is not None else (), seed=drive.seed,
        )  # fmt: skip
        self._motor = WorldMotor(self._twin, self._clock)
        self._rng = np.random.default_rng(drive.seed)
        settings = load_settings(None, [f"wall_follow.speed_mps={drive.speed_mps}", "car.max_speed_mps=4.0"])
        self._stack = LiveStack(settings, DecisionLog(self._clock, 0))
        self._stack.queue.put(consent(Source.PERMIT, "always"))
        self._observed = ObservedState(
            "car", "", MemoryLidar(lambda _: None, self._clock), self._motor, self._stack.queue, self._clock, {}
        )
        self._journey = Journey(0.0)
        self._decided: list[Decision] = []

    def _clock(self) -> float:
        return self._now_s

    def run(self) -> list[Decision]:
        for sequence in range(math.ceil((self._drive.by_hand_s + AUTONOMY_S) / SCAN_S)):
            self._now_s += TICK_S
            self._decide()
            self._now_s += TICK_S
            ranges_m = self._twin.ranges_at(self._now_s)
            if self._twin.contact_mps is not None:
                break
            scan, motor = Scan(self._now_s, self._now_s, *FAN, ranges_m, sequence), self._motor.state
            self._stack.look(scan, motor)
            self._stack.follow(scan, motor)
            self._decide()
            self._stack.laws.learn()
        return self._decided

    def _decide(self) -> None:
        """Decide once, as the mux does; by hand until the human lets go."""
        stack, drive = self._stack, self._drive
        if self._now_s < drive.by_hand_s:
            thumb_rad = self._rng.normal(drive.human_rad[int(self._now_s / TURNS_EVERY_S)], THUMB_RAD)
            wish = Drive(drive.speed_mps, float(thumb_rad))
            stack.queue.put(DriveCommand(Source.TELEOP, wish, None, "by hand"), expires_at_s=drive.by_hand_s)
        decision, memories = arbitrate(stack.queue.live(), REQUIRED, stack.queue.order)
        for assessment, memory in memories:
            assessment.commit(memory)
        sent = stack.limiter.limit(decision.speed_mps, decision.steering_rad, TICK_S, decision.brake_mps2)
        self._motor.send(sent)
        self._decided.append(decision)
        if self._asked:
            status(self._observed, Output(self._now_s, sent, decision, delivered=True), self._journey)


def main(arguments: Sequence[str] | None = None) -> int:
    """Compare the drives, and print each that differs."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--drives", type=int, default=450)
    parser.add_argument("--seed", type=int, default=0, help="of the first drive")
    options = parser.parse_args(arguments)
    differ = 0
    for seed in range(options.seed, options.seed + options.drives):
        if pairs := differing(HandOver.random(seed)):
            differ += 1
            without, with_ = pairs[0]
            print(f"{seed}: {len(pairs)} decisions differ; the first without a status: {without}\n   with one: {with_}")
    print(f"{differ} of {options.drives} drives differ")
    return 1 if differ else 0


if __name__ == "__main__":
    raise SystemExit(main())
